"""What a person does in the window becomes a script that leaves the same files, to the byte, times aside."""

from __future__ import annotations

import re
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from animal_cases import drawn_animals, write_animals
from qtpy.QtCore import QCoreApplication, QEvent, QPoint, Qt
from qtpy.QtTest import QTest
from script_cases import write_ball
from window_cases import BALL_MM, MIDDLE, wait_until_idle

from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_core.landmarks.suggestion import Suggestion
from gp_labeler.commands.actions import ACTIONS
from gp_labeler.document import touching
from gp_labeler.document.edits import SuggestPoints, SwapPoints
from gp_labeler.document.landmark_export import export_landmarks
from gp_labeler.document.landmark_import import import_landmarks
from gp_labeler.document.specimen_edits import RenameSpecimen, SetNotes
from gp_labeler.document.state import How
from gp_labeler.document.touches import TouchHow
from gp_labeler.jobs.library_check import CheckLibrary, LibraryChecked
from gp_labeler.models.workflow import Active
from gp_labeler.scene.planes import Plane
from gp_labeler.scripting import events
from gp_labeler.scripting.runner import run_script
from gp_labeler.scripting.script import make_script, read_script
from gp_labeler.scripting.steps import STEPS
from gp_labeler.scripting.steps.edits import EDIT_STEPS
from gp_labeler.views.panels.label.suggestion_page_dialog import SuggestionPageDialog
from gp_labeler.views.recorder import Recorder, script_text

SAVED = "ball.gpspecimen.json"
FILES = (SAVED, "ball_L.mrk.json", "ball_R.mrk.json")
INSIDE = MIDDLE + np.array([2.1, -1.7, 0.125])
ON_BONE = MIDDLE + np.array([0.0, -BALL_MM, 0.0])

DIALOG = "a dialog: what it does is written once it is done"
CHOOSES = "chooses only: an edit is written with its point"
KEEPS_VIEWS = ("view.canvas", "view.next_view", "view.step_")
"""Commands of the menu View, or beginnings of their names, that change nothing of what the views show."""

ACTION_STEPS = {
    **dict.fromkeys(("file.open", "file.open_folder", "file.demo", "file.find_scan", "file.new"), "open"),
    **dict.fromkeys(("file.save", "file.save_as"), "save"),
    "file.import": "import",
    **dict.fromkeys(("file.show_references", "file.clear_references"), "reference"),
    "file.add_mesh": "add_mesh",
    "file.remove_meshes": "remove_mesh",
    "file.export": "export",
    "file.save_mesh": "mesh",
    "file.screenshot": "screenshot",
    "edit.undo": "undo",
    "edit.redo": "action",
    "edit.swap": "swap_points",
    "edit.swap_sides": "swap_sides",
    **{id: "view" for id in ACTIONS if id.startswith("view.") and not id.startswith(KEEPS_VIEWS)},
    **{id: "action" for id in ACTIONS if id.startswith(("view.from_", "view.cut_", "tool."))},
    **dict.fromkeys(("view.cut_open",), "action"),
    **dict.fromkeys(("view.reset", "view.zoom_to_point", "view.projection", "view.slices_visible"), "action"),
    **{id: "action" for id in ACTIONS if id.startswith(("view.plane_", "view.frame", "view.straight"))},
    **dict.fromkeys(
        ("head.straighten", "head.like", "head.by_landmarks", "head.take_planes"), "set_head_frame"
    ),
    **dict.fromkeys(("head.midline", "head.left", "head.right", "head.take_mid_plane"), "set_head_frame"),
    "head.by_hand": "action",
    "head.confirm_left": "confirm_left",
    "head.forget": "clear_head_frame",
    "head.left_is_right": "open",
    "point.place": "place_point",
    **dict.fromkeys(("point.accept_ghost", "point.accept_all", "point.suggest_like"), "suggest_points"),
    "point.confirm": "confirm_point",
    "point.check_page": "confirm_page",
    "point.unseen": "mark_unseen",
    "point.clear": "clear_point",
    "point.check": "check_point",
    **dict.fromkeys(("point.lock", "point.lock_all"), "lock_points"),
    **dict.fromkeys(("point.sure", "point.fair", "point.guess"), "annotate_point"),
    "labelling.again": "begin_labelling",
    "file.next_specimen": "open",
    "atlas.save_reliability": "reliability",
    "pose.open_touches": "take_touches",
    "pose.clear": "remove_touches",
    "pose.open_skull": "set_skull",
    **dict.fromkeys(("pose.touch", "pose.along_axis", "pose.through_window"), "action"),
    "pose.overlay": "overlay",
    "pose.record": "record_touch",
    "pose.export": "estimate",
    "pose.report": "report",
    **dict.fromkeys(("pose.path", "pose.save_path"), "path"),
    "atlas.save": "action",
    **dict.fromkeys(("atlas.published", "atlas.open", "atlas.fit_files", "atlas.fit_folder"), "atlas"),
    **dict.fromkeys(("pose.accept", "pose.reject"), "verdict"),
    "measure.remove": "remove_measurements",
    "measure.import": "add_measurements",
    "measure.export": "export_measurements",
    "measure.clear_pair": "show_distance",
}
"""What a command is written as."""

NOT_WRITTEN = {
    "file.close": "the script ends there",
    "help.shortcuts": "a dialog that changes nothing",
    "help.about": "a dialog that changes nothing",
    "help.record": "the recorder itself",
    "view.canvas": "a setting of this computer, in force at the next start",
    "view.next_view": "moves the keyboard only",
    **dict.fromkeys([f"view.step_{step}" for step in ("scan", "label", "atlas", "pose")], "shows a panel"),
    **dict.fromkeys(("point.skip", "point.next", "point.previous", "point.other_side"), CHOOSES),
    **dict.fromkeys(("pose.skip", "pose.other_side"), CHOOSES),
    **dict.fromkeys(("pose.tracker", "pose.guide"), "shows settings, or asks for touches, which are written"),
    "head.forget_points": "what is straightened by them is written",
    "point.replace": "arms a click: the move is written",
    "measure.show": "tells only: what is done in it is written",
    "pose.physical": "tells only: its result is no part of the specimen",
    "file.specimens": DIALOG,
    "labelling.show": DIALOG,
    **dict.fromkeys(
        ("atlas.reliability_files", "atlas.reliability_folder"), "written once it is saved, or its error used"
    ),
    **dict.fromkeys(("atlas.show", "atlas.try"), "tells only: nothing of it is kept"),
    **dict.fromkeys(
        ("pose.robust", "pose.jrmpc", "pose.both", "pose.touched_window"), "written with a verdict"
    ),
}
"""Why a command leaves no step."""


def test_every_command_is_written_or_need_not_be() -> None:
    for id in ACTIONS:  # those of panels that come later may be said here already
        assert (id in ACTION_STEPS) != (id in NOT_WRITTEN), f"say how {id} is recorded, or why it is not"
    assert set(ACTION_STEPS.values()) <= STEPS.keys() | EDIT_STEPS.keys()


class Recording:
    """A window on the ball, what is done in it written down, and done again by the script."""

    def __init__(self, qtbot, window, folder) -> None:
        self.qtbot, self.window, self.folder = qtbot, window, folder
        self.workspace, self.script = window.workspace, folder / "script.json"
        (folder / "first").mkdir(exist_ok=True)

    @property
    def document(self):
        return self.workspace.document

    @property
    def labels(self):
        return self.workspace.labels

    @property
    def view(self):
        return self.workspace.view

    @property
    def recorder(self) -> Recorder:
        return self.window.findChild(Recorder)

    def begin(self) -> None:
        self.window.commands.run("help.record")

    def run(self, id: str, *answers: str) -> list[str]:
        """Run a command; return what kinds of steps it left."""
        n = len(self.recorder.tables)
        self.window.prompts.answers = list(answers)
        self.window.commands.run(id)
        wait_until_idle(self.qtbot, self.window)
        return [table["do"] for table in self.recorder.tables[n:]]

    def check(self, *files: str) -> list[str]:
        """Save, end the recording, run the script, compare what both leave; return its steps."""
        self.document.save(self.folder / "first" / SAVED, overwrite=True)
        export_landmarks(self.document.measured_state, self.folder / "first", overwrite=True)
        self.window.prompts.files = [self.script]
        self.window.commands.run("help.record")
        assert self.recorder is None
        script = read_script(self.script)
        whole = make_script([*script.tables, {"do": "export"}], folder=self.folder)
        report = run_script(whole, self.folder / "again")
        assert report.ok, report.error
        for name in files or FILES:
            assert untimed(self.folder / "again" / name) == untimed(self.folder / "first" / name)
        return [step.do for step in script.steps]


def untimed(path) -> str:
    text = re.sub(r'"time": "[^"]*"| \[time: [^]]*\]|; time: [^]]*', "", path.read_text())
    return re.sub(r"\d{4}-\d\d-\d\dT[\d:.]+|\b\d{10}\.\d+", "", text)


def write_path(folder) -> Path:
    """Write an insertion path of a left ear, in m, with the authors' axes and a row that is none."""
    turn = np.linspace(0, 12, 30)
    rows = np.column_stack([-1.9 * np.sin(turn), -1.9 * np.cos(turn), 0.1 * turn + 0.5]) / 1000
    rows = np.vstack([rows, np.zeros(3)])
    np.savetxt(folder / "curve.csv", rows, delimiter=",")
    return folder / "curve.csv"


@pytest.fixture
def recording(qtbot, make_window, tmp_path):
    window = make_window(atlas=True)
    window.workspace.scan.open(write_ball(tmp_path / "ball.nrrd"))
    wait_until_idle(qtbot, window)
    return Recording(qtbot, window, tmp_path)


def click(view, position) -> None:
    x, y = view.pixel_at(position)
    QTest.mouseClick(view, Qt.MouseButton.LeftButton, pos=QPoint(int(x), int(y)))


def place_three(recording) -> None:
    """Place two of the left and one of the right by clicks, and nudge one."""
    scene, document = recording.window.grid.scene_view, recording.document
    axial = recording.window.grid.slice_views[Plane.AXIAL]
    recording.window.set_step("label")  # elsewhere a click looks
    scene.view_from("A")
    recording.view.set_crosshair(INSIDE)
    axial.setFocus()
    click(axial, INSIDE)  # CA
    for _ in range(3):
        QTest.keyClick(axial, Qt.Key.Key_Left)
    click(scene, ON_BONE)  # RWP
    recording.workspace.labels.go_to(Side.RIGHT, "OS")
    click(scene, ON_BONE + np.array([1.0, 0.1, 1.0]))
    assert document.state.landmarks.keys() == {(Side.LEFT, "CA"), (Side.LEFT, "RWP"), (Side.RIGHT, "OS")}


def test_clicks_nudges_marks_and_undo_are_done_again(recording) -> None:
    recording.begin()
    place_three(recording)
    workspace, run = recording.workspace, recording.run
    workspace.labels.go_to(Side.LEFT, "CB")
    assert run("point.unseen") == ["mark_unseen"]
    workspace.labels.go_to(Side.LEFT, "CA")
    assert run("point.check") == ["check_point"]
    assert run("point.lock") == ["lock_points"]
    workspace.labels.go_to(Side.RIGHT, "OS")
    assert run("point.place") == []  # it is placed already
    assert run("point.replace") == []
    assert run("point.place") == ["place_point"]  # where the crosshair is
    assert run("edit.undo") == ["undo"]
    assert run("edit.redo") == ["action"]
    assert run("edit.swap", "CB") == ["swap_points"]
    workspace.labels.go_to(Side.LEFT, "CA")
    assert run("point.lock") == ["lock_points"]
    assert run("edit.swap_sides") == ["swap_sides"]
    assert run("point.lock_all") == ["lock_points"]
    assert run("edit.undo") == ["undo"]
    workspace.labels.go_to(Side.RIGHT, "RWP")
    assert run("point.clear") == ["clear_point"]
    workspace.scan.set_threshold(1003.25)
    wait_until_idle(recording.qtbot, recording.window)
    recording.document.do(SetNotes("one"), merge=False)
    recording.document.do(SetNotes('one "two"\nthrée'), merge=True)
    steps = recording.check()
    assert [do for do in steps if do in ("place_point", "set_threshold", "set_notes", "save")] == [
        *("place_point",) * 5,
        *("set_threshold", "set_notes", "save"),
    ]  # the three nudges are one step


def test_slab_and_noise_are_written_with_their_values(recording) -> None:
    recording.begin()
    assert recording.run("view.slab_maximum") == ["view"]
    assert recording.recorder.tables[-1]["slab"] == {"maximum": 0.5}
    recording.run("view.denoise_gaussian")
    assert recording.recorder.tables[-1]["denoise"] == "gaussian"
    recording.run("view.slab_maximum")
    assert recording.recorder.tables[-1]["slab"] == "off"


def test_rulers_and_angles_are_done_again(recording) -> None:
    recording.begin()
    axial, scene = recording.window.grid.slice_views[Plane.AXIAL], recording.window.grid.scene_view
    recording.view.set_crosshair(INSIDE)
    scene.view_from("A")
    assert recording.run("tool.ruler") == ["action"]
    click(axial, INSIDE)
    click(scene, ON_BONE)
    recording.run("tool.angle")
    for offset in ((1, 0, 0), (0, 0, 0), (0, 1, 0)):
        click(axial, INSIDE + offset)
    recording.workspace.measure.rename("Ruler 1", "to the surface")
    assert recording.run("measure.remove") == ["remove_measurements"]  # the angle, which is selected
    recording.document.undo()
    recording.window.prompts.files = [recording.folder / "first"]
    assert recording.run("measure.export") == ["export_measurements"]
    lines = [f"ball_{name}.mrk.json" for name in ("to the surface", "Angle 1")]
    place_three(recording)
    recording.check(SAVED, *lines)


def test_imports_of_every_kind_are_done_again(recording) -> None:
    recording.begin()
    place_three(recording)
    lines = [
        "label,x,y,z",
        *(f"{c},{INSIDE[0] + n / 7},{INSIDE[1]},1e3" for n, c in enumerate(["CA", "CB", "IN"])),
    ]
    (recording.folder / "far.csv").write_text("\n".join(lines))
    files, how = [recording.folder / "far.csv"], {"side": "L", "accept_off_bone": True}
    import_landmarks(recording.document, files, replace_placed=False, **how)
    assert recording.document.undo()
    import_landmarks(recording.document, files, **how)
    recording.labels.nudge([0.1, 0, 0], side="L", code="CB")
    assert recording.check().count("import") == 2


def test_suggestions_and_confirmations_are_done_again(recording) -> None:
    recording.begin()
    for code, at in (("CA", (2, 0, 0)), ("RWP", (-2, 1, 0)), ("OS", (0, -2, 1))):
        recording.labels.place(MIDDLE + at, How.SLICE, side="L", code=code)
    recording.workspace.labels.go_to(Side.LEFT, "CB")
    assert recording.run("point.accept_ghost") == ["suggest_points"]
    assert recording.recorder.tables[-1]["suggestions"]["CB"]["source"] == "atlas"
    assert recording.run("point.accept_all") == ["suggest_points"]
    assert recording.run("edit.undo") == ["undo"]
    assert recording.run("edit.redo") == ["action"]
    for code in ("CB", "RWA"):
        recording.workspace.labels.go_to(Side.LEFT, code)
        assert recording.run("point.confirm") == []  # not drawn yet: it is shown first
        assert recording.run("point.confirm") == ["confirm_point"]
    assert [table["code"] for table in recording.recorder.tables if table["do"] == "confirm_point"] == [
        "CB",
        "RWA",
    ]
    assert recording.labels.progress(Side.LEFT).text == "6 placed, 14 suggested"  # CO is computed
    recording.check(*FILES[:2])


def test_pages_of_suggestions_are_done_again(recording) -> None:
    """One is corrected in another slice, and moved once more; the others are confirmed by Enter."""
    recording.begin()
    found = {code: Suggestion(tuple(INSIDE + n / 9), 0.3, "x") for n, code in enumerate(("CA", "MH", "FPA"))}
    recording.document.do(SuggestPoints(Side.LEFT, found, recording.document.provenance(How.GHOST)))
    recording.run("point.check_page")
    (dialog,) = recording.window.findChildren(SuggestionPageDialog)
    tile = dialog.shown_tiles[0]
    for place in ((0.3, 0.6), (0.55, 0.45)):
        events.turn_wheel(tile, *tile.pixel_of_place(0, *place), 2)
        wait_until_idle(recording.qtbot, recording.window)
        events.click(tile, *tile.pixel_of_place(0, *place), ctrl=True)
        wait_until_idle(recording.qtbot, recording.window)
    for each in dialog.shown_tiles:
        dialog.area.ensureWidgetVisible(each)
        wait_until_idle(recording.qtbot, recording.window)
    recording.qtbot.waitUntil(lambda: _confirms(recording, dialog))
    steps = [step for step in recording.check(*FILES[:2]) if step.endswith(("_point", "_page"))]
    assert steps == ["place_point", "place_point", "confirm_page"]


def _confirms(recording, dialog) -> bool:
    """Whether Enter has confirmed all: a page that is not painted yet stays."""
    QTest.keyClick(dialog.tiles[0], Qt.Key.Key_Return)
    return not recording.workspace.pages.is_open


def test_touches_and_verdicts_are_done_again(recording) -> None:
    pose, atlas, document = recording.workspace.pose, recording.workspace.atlas.current, recording.document
    assert atlas is not None
    recording.begin()
    place_three(recording)
    touching.record_touch(document, "R", "IN", [1.0, 2.0, 3.0], TouchHow.TRACKED)
    touching.move_touches(document, "R")
    touching.clear_touches(document, "L", "IN")
    for n, code in enumerate(("MN", "OS", "RWA", "LLI")):
        where = atlas[code] + [0.1 * n, 200, 0]
        details = {"source": "probe", "n_samples": 9, "spread_mm": 0.07} if n % 2 else {}
        touching.record_touch(document, "L", code, where, TouchHow.TRACKED, **details)
    touching.leave_out(document, "L", "OS")
    touching.leave_out(document, "L", "OS", False)
    touching.swap_touches(document, "L", "MN", "OS")
    touching.record_touch(document, "L", "ZL", [0, 0, 0], TouchHow.TRACKED)
    touching.clear_touches(document, "L", "ZL")
    touching.mark_skull(document, "S1", [1, 2, 3])
    touching.record_touch(document, "R", "MN", [0.5, 0, 0])
    touching.clear_touches(document, "R")
    lines = [",".join([code, *map(repr, atlas[code].tolist())]) for code in ("CL", "MN", "OI")]
    file = recording.folder / "touches.csv"
    file.write_text("\n".join(["label,x,y,z", *lines]))
    touching.load_touches(document, file, "R")
    document.undo()
    document.redo()
    pose.choose(probe_noise=0.3)
    pose.record_verdict("reject", by="AB", note="tilted")
    steps = recording.check()
    assert steps[-3:-1] == ["estimate", "verdict"]


def test_a_dry_run_on_the_scan_is_done_again(recording) -> None:
    workspace, run = recording.workspace, recording.run
    recording.begin()
    place_three(recording)
    assert run("pose.touch") == ["action"]
    for n, code in enumerate(("MN", "OS", "RWA", "LLI")):
        touching.record_touch(
            workspace.document, "L", code, workspace.atlas.current[code] + MIDDLE + n / 9, TouchHow.SCAN
        )
    assert run("pose.overlay") == ["overlay"]
    assert run("pose.overlay") == ["overlay"]
    assert run("pose.along_axis") == ["action"]
    assert run("tool.place") == ["action"]
    workspace.pose.record_verdict("accept", by="AB")
    assert recording.recorder.tables[-1]["do"] == "verdict"
    recording.window.prompts.files = [recording.folder / "first" / "pose.json"]
    assert run("pose.export")[-1] == "estimate"
    recording.window.prompts.files = [recording.folder / "first" / "page.html"]
    assert run("pose.report")[-1] == "report"
    assert run("pose.clear") == ["remove_touches"]
    assert run("edit.undo") == ["undo"]
    recording.check(*FILES, "pose.json")
    assert (recording.folder / "again" / "page.html").exists()


@pytest.mark.parametrize("when", ["before", "after"])
def test_an_own_atlas_and_an_insertion_path_are_taken_again(recording, when) -> None:
    workspace, first, prompts = recording.workspace, recording.folder / "first", recording.window.prompts
    animals = write_animals(recording.folder / "animals", drawn_animals(3))

    def take() -> None:
        prompts.files = [animals]
        recording.window.commands.run("atlas.fit_folder")
        wait_until_idle(recording.qtbot, recording.window)
        prompts.files = [write_path(recording.folder)]
        prompts.answers = ["m", "left", "z,-y,x", "The first 30"]
        recording.window.commands.run("pose.path")

    if when == "before":
        take()
    recording.begin()
    if when == "after":
        take()
    place_three(recording)
    for code in ("MN", "OS", "RWA", "LLI", "RWP"):
        touching.record_touch(
            recording.document, "R", code, workspace.atlas.current[code] * (-1, 1, 1) + [0, 0, 300]
        )
    workspace.pose.choose(side=Side.RIGHT, round_window="expected")
    prompts.files = [first / "own.json"]
    assert recording.run("atlas.save") == ["action"]
    prompts.files = [first / "carried.csv"]
    assert recording.run("pose.save_path") == ["estimate", "path"]
    *_, carried, saved = (table for table in recording.recorder.tables if table["do"] == "path")
    assert saved == {"do": "path", "save": "carried.csv"}
    about = {"units": "m", "side": "L", "axes": "z,-y,x", "rows": 30}
    assert carried == {"do": "path", "path": str(recording.folder / "curve.csv"), **about}
    recording.check(*FILES[:1], "own.json", "carried.csv")


def test_another_atlas_is_taken_again(recording) -> None:
    file = recording.folder / "own.json"
    recording.workspace.atlas.current.save(file)
    recording.begin()
    recording.workspace.atlas.open(file)
    wait_until_idle(recording.qtbot, recording.window)
    assert recording.recorder.tables[-1] == {"do": "atlas", "path": str(file)}
    recording.workspace.atlas.use_published()
    wait_until_idle(recording.qtbot, recording.window)
    assert recording.recorder.tables[-1]["path"] == "published"
    place_three(recording)
    recording.check()


def test_what_is_seen_is_written_with_its_value(recording) -> None:
    recording.view.update(outline_visible=False)  # as this person likes it
    recording.begin()
    assert recording.recorder.tables[1]["outline"] is False
    for id, do in ACTION_STEPS.items():
        if id.startswith("view.") or (id.startswith("tool.") and id != "tool.place"):
            layout = "axial" if id == "view.four-up" else "four-up"
            recording.view.update(level=100.0, width=50.0, mesh_opacity=0.5, layout=layout)
            if not ACTIONS[id].enabled(recording.workspace):
                continue
            recording.run(id)
            assert recording.recorder.tables[-1]["do"] == do, id
    recording.view.update(mesh_opacity=0.7)
    n = len(recording.recorder.tables)
    recording.view.update(mesh_opacity=0.8)  # a slider on its way
    assert len(recording.recorder.tables) == n
    assert recording.recorder.tables[-1] == {"do": "view", "opacity": 0.8}
    recording.labels.place(MIDDLE, How.SLICE, side="L", code="CA")
    recording.check(*FILES[:2])


def test_files_written_are_written_again(recording) -> None:
    recording.begin()
    place_three(recording)
    folder, prompts = recording.folder / "first", recording.window.prompts
    for id, name, do in (
        ("file.save_as", "other.gpspecimen.json", "save"),
        ("file.export", "", "export"),
        ("file.save_mesh", "bone.ply", "mesh"),
        ("file.screenshot", "window.png", "screenshot"),
    ):
        prompts.files = [folder / name]
        assert recording.run(id) == [do]
    recording.check(*FILES, "other.gpspecimen.json")
    assert (recording.folder / "again" / "window.png").exists()
    assert (recording.folder / "again" / "bone.ply").read_bytes() == (folder / "bone.ply").read_bytes()


def test_contact_sheets_of_several_specimens_are_made_again(recording) -> None:
    recording.begin()
    place_three(recording)
    document, folder = recording.document, recording.folder
    files = [folder / f"GP{n}.gpspecimen.json" for n in range(2)]
    for file in files:
        document.save(file)
    n_before = len(recording.recorder.tables)
    recording.workspace.specimens.make_contact_sheets_of(files, folder / "all.pdf", all_labellings=True)
    wait_until_idle(recording.qtbot, recording.window)
    recording.workspace.specimens.make_contact_sheets_of(files[1:], folder / "one.pdf")
    wait_until_idle(recording.qtbot, recording.window)
    assert recording.recorder.tables[n_before:] == [
        {
            "do": "contact_sheet",
            "specimens": [str(file) for file in files],
            "path": "all.pdf",
            "all_labellings": True,
        },
        {"do": "contact_sheet", "path": "one.pdf"},  # of the open specimen
    ]


def test_a_check_of_labels_against_each_other_is_one_step(recording, monkeypatch) -> None:
    recording.begin()
    place_three(recording)
    folder, n_before = recording.folder, len(recording.recorder.tables)
    monkeypatch.setattr(CheckLibrary, "run", lambda job, progress: LibraryChecked((), (job.where,), 3))
    recording.workspace.specimens.check_library_of([folder / "labelled"], folder / "labels.pdf")
    wait_until_idle(recording.qtbot, recording.window)
    assert recording.recorder.tables[n_before:] == [
        {"do": "check_library", "labelled": [str(folder / "labelled")], "path": "labels.pdf"}
    ]


def test_work_that_was_begun_before_is_kept_beside_the_script(recording) -> None:
    place_three(recording)
    recording.begin()
    recording.labels.place(MIDDLE, How.SLICE, side="R", code="CA")
    assert recording.run("edit.undo") == ["undo"]
    assert recording.run("edit.undo") == ["open", "view"]  # of what was done before
    assert recording.run("edit.redo") == ["open", "view"]
    recording.labels.place(MIDDLE, How.SLICE, side="R", code="CB")
    recording.check()
    assert (recording.folder / "script_start1.gpspecimen.json").exists()


def test_another_scan_is_opened_without_what_was_not_saved(recording) -> None:
    recording.begin()
    place_three(recording)
    other = write_ball(recording.folder / "other.nrrd")
    recording.window.prompts.answers = ["Do not save"]
    recording.window.open_path(other)
    wait_until_idle(recording.qtbot, recording.window)
    recording.labels.place(MIDDLE, How.MESH, side="L", code="CA")
    recording.document.do(RenameSpecimen("ball"))
    recording.check(*FILES[:2])


def test_what_was_only_touched_needs_no_scan_until_it_gets_one(qtbot, make_window, tmp_path) -> None:
    window = make_window()
    recording = Recording(qtbot, window, tmp_path)
    touching.record_touch(recording.document, "L", "MN", [1, 2, 3])
    recording.begin()
    touching.record_touch(recording.document, "L", "OS", [4, 2, 3])
    assert recording.run("file.new", "Do not save") == ["open", "view"]
    touching.record_touch(recording.document, "R", "OS", [4, 5, 3])
    window.workspace.scan.open(write_ball(tmp_path / "ball.nrrd"))
    wait_until_idle(qtbot, window)
    assert recording.document.state.specimen == "ball"
    recording.labels.place(MIDDLE, side="L", code="CA")
    assert recording.check(FILES[0]).count("open") == 3
    assert len(recording.document.state.touches) == 1


@pytest.mark.slow
def test_a_phantom_with_labels_comes_back_with_them(qtbot, make_window, tmp_path) -> None:
    window = make_window()
    window.workspace.scan.open_demo(3, 0.4)
    wait_until_idle(qtbot, window, 60)
    recording = Recording(qtbot, window, tmp_path)
    recording.labels.place(window.workspace.scan.truth.side(Side.LEFT)["CA"], side="L", code="CA")
    recording.begin()
    recording.document.do(RenameSpecimen("ball"))
    recording.labels.place(window.workspace.scan.truth.side(Side.LEFT)["CB"], side="L", code="CB")
    recording.check(*FILES[:2])


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_anything_in_any_order_is_done_again(recording, seed) -> None:
    rng, document, labels = np.random.default_rng(seed), recording.document, recording.labels
    codes = ["CA", "CB", "IN", "RWP"]

    def one() -> None:
        side, (code, other) = Side(rng.choice(["L", "R"])), rng.choice(codes, 2, replace=False)
        labels.set_active(Active(side, code))
        what = rng.integers(12)
        if what < 3:
            how = (How.MESH, How.SLICE)[rng.integers(2)]
            labels.place(MIDDLE + rng.uniform(-3, 3, 3), how, side=side, code=code)
        elif what < 5:
            labels.nudge(rng.normal(size=3), side=side, code=code)
        elif what < 8:
            (document.undo, document.undo, document.redo)[what - 5]()
        elif what == 8:
            document.do(SetNotes(str(rng.integers(3))), merge=bool(rng.integers(2)))
        elif what == 9 and "IN" not in (code, other):
            document.do(SwapPoints(side, code, other))
        else:
            verbs = ("point.unseen", "point.lock", "point.check", "point.clear", "edit.swap_sides")
            recording.window.commands.run(str(rng.choice(verbs)))

    def some(n: int) -> None:
        for _ in range(n):
            with suppress(GpError):  # of what is locked, or not placed yet
                one()

    some(10)
    recording.begin()
    some(40)
    labels.lock_all(False)
    labels.place(MIDDLE, side="L", code="ZL")
    labels.place(MIDDLE, side="R", code="ZL")
    recording.check()


def test_the_text_is_toml() -> None:
    toml = pytest.importorskip("tomllib")
    tables = [
        {"do": "open", "path": 'C:\\scans\\"ä".nrrd', "region": [[0, 1], [2, 3], [4, 5]], "reverse": True},
        {"do": "specimen", "notes": "a\nb\t\x7f\U0001f600"},
        {"do": "estimate", "side": "L", "touches": {"CA": [1e-7, 2.0, 3.0], "a b": [0, 0, 0]}},
        {"do": "undo"},
    ]
    assert toml.loads(script_text(tables)) == {"step": tables}


def test_a_toml_script_runs(recording) -> None:
    pytest.importorskip("tomllib", reason="TOML needs Python 3.11")
    recording.script = recording.folder / "script.toml"
    recording.begin()
    place_three(recording)
    recording.check()


def test_a_recorder_lets_go_of_its_window(make_window) -> None:
    window = make_window()
    recorder, workspace = Recorder(window), window.workspace
    listening = len(workspace.document.saved)
    recorder.deleteLater()
    QCoreApplication.sendPostedEvents(recorder, QEvent.Type.DeferredDelete)
    assert len(workspace.document.saved) == listening - 1


def test_reference_points_are_written_and_cleared(recording) -> None:
    file = recording.folder / "theirs.csv"
    file.write_text("name,x,y,z\nApex,10,-20,30\n", encoding="utf-8")
    recording.begin()
    recording.window.prompts.files = [file]
    assert recording.run("file.show_references") == ["reference"]
    assert recording.recorder.tables[-1]["files"] == [str(file)]
    assert recording.run("file.clear_references") == ["reference"]
    assert not recording.workspace.references.points
    place_three(recording)
    recording.check()
