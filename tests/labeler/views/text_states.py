"""Every state of the window that shows other words: each step, panel, dialog and message in turn."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import tifffile
from animal_cases import drawn_animals, write_animals
from panel_cases import ATLAS, grey_volume, in_scan, place
from qtpy.QtCore import QTimer
from qtpy.QtWidgets import QApplication, QWidget

from gp_core import PROBE, Side
from gp_core.atlas.sampling import draw_animal
from gp_core.landmarks.features import FEATURES
from gp_labeler.document import touching
from gp_labeler.document.landmark_export import export_landmarks
from gp_labeler.document.touches import TouchHow
from gp_labeler.imaging.readers import inspect_volume
from gp_labeler.models.workflow import Active
from gp_labeler.views.guide import GuideWindow
from gp_labeler.views.main_window import MainWindow
from gp_labeler.views.panels.label.export_dialog import ExportDialog
from gp_labeler.views.panels.label.labellings_dialog import LabellingsDialog
from gp_labeler.views.panels.label.landmark_import_dialog import LandmarkImportDialog
from gp_labeler.views.panels.label.suggestion_page_dialog import SuggestionPageDialog
from gp_labeler.views.panels.measure.dialog import MeasureDialog
from gp_labeler.views.panels.pose.physical_dialog import PhysicalDialog
from gp_labeler.views.panels.scan.import_dialog import ImportDialog
from gp_labeler.views.panels.scan.recover_dialog import RecoverDialog
from gp_labeler.views.panels.scan.specimen_list_dialog import SpecimenListDialog
from gp_labeler.views.panels.tracker.dialog import TrackerDialog
from gp_labeler.views.prompts import Prompts
from gp_labeler.views.shortcuts_sheet import ShortcutsSheet

__all__ = ["LONG_NAME", "OWN", "walk_states"]

LEFT, RIGHT = Side.LEFT, Side.RIGHT
THERE = np.array([1040.0, -1120.5, -1180.2])
"""Where a tracker may well have its points."""
LONG_NAME = "GP-2024-017_left_bulla_opened_after_perfusion_rescan_0.018mm"
OWN = ("GP-014", "GP01", LONG_NAME, "torn", "unnamed", "touches of", "animals", "probe_of_monday")
"""What a user named: may be shortened."""

_ABOUT = (
    "Labels guinea-pig heads in micro-CT, and estimates the pose of the cochlea from a few touched points."
    "\n\nCoordinates are LPS, mm. No usage data are collected."
)

Look = Callable[[str, QWidget], object]


def walk_states(window: MainWindow, folder: Path, look: Look) -> None:
    """Bring a window that is shown from state to state.

    Parameters
    ----------
    window : MainWindow
        One that nothing was opened in yet, without an atlas.
    folder : Path
        Where files may be written.
    look : callable
        Is given the name of each state, and the widget that shows it.
    """
    workspace = window.workspace
    _without_scan(window, look)
    workspace.atlas.use(ATLAS)
    workspace.scan.begin(grey_volume())
    _wait(window)
    _scan(window, look)
    _label(window, look)
    _messages(window, look)
    _pose(window, look)
    _atlas(window, folder, look)
    _dialogs(window, folder, look)


def _wait(window: MainWindow) -> None:
    end = time.monotonic() + 180
    while window.workspace.jobs.running and time.monotonic() < end:
        QApplication.processEvents()
        time.sleep(0.005)
    QApplication.processEvents()


def _without_scan(window: MainWindow, look: Look) -> None:
    look("first page", window)
    window.set_step("atlas")
    look("atlas, alone, loading…", window)
    window.workspace.atlas.use(ATLAS)
    look("atlas, alone", window)
    window.set_step("pose")
    look("pose, alone, nothing touched", window)
    animal = draw_animal(ATLAS, rng=np.random.default_rng(3)).side("L")
    for code in PROBE:
        _touch(window, code, animal[code] + THERE)
    _wait(window)
    look("pose, alone, estimated", window)
    touching.clear_touches(window.workspace.document, LEFT)
    window.set_step("scan")


def _scan(window: MainWindow, look: Look) -> None:
    window.set_step("scan")
    look("scan", window)
    window.commands.run("view.cut_axial")
    look("scan, cut", window)
    window.commands.run("view.cut_axial")
    for layout in ("axial", "four-up"):
        window.workspace.view.update(layout=layout)
        look(f"layout {layout}", window)
    window.grid.hovered.emit(np.array([-12.34, 23.45, -34.56]))
    look("pointer over a slice", window)


def _label(window: MainWindow, look: Look) -> None:
    workspace, document, labels = window.workspace, window.workspace.document, window.workspace.labels
    window.set_step("label")
    look("label, nothing placed", window)
    place(workspace, "CA", "CB", "RWP")
    _wait(window)
    for state, code, edit in (
        ("ghost", "RWA", lambda: None),
        ("placed", "CA", lambda: None),
        ("checked", "CB", lambda: window.commands.run("point.check")),
        ("locked", "RWP", lambda: window.commands.run("point.lock")),
        ("unseen", "RWM", lambda: labels.mark_unseen(side=LEFT, code="RWM")),
    ):
        labels.set_active(Active(LEFT, code))
        edit()
        _wait(window)
        look(f"label, {state}", window)
    labels.accept_all_ghosts(side=LEFT)
    labels.set_active(Active(LEFT, "MN"))
    _wait(window)
    look("label, suggested", window)
    workspace.interaction.arm_replacing()
    look("label, re-placing", window)
    workspace.interaction.arm_replacing(False)
    document.undo()
    place(workspace, "OS", "LLI", "RWA")
    labels.place(np.add(in_scan("OI"), [0, 0, 3.0]), side=LEFT, code="OI")
    _wait(window)
    labels.set_active(Active(LEFT, "OI"))
    look("label, doubtful", window)
    labels.suggest(in_scan("DTM"), radius_95=0.8, source="atlas", side=LEFT, code="DTM")
    labels.set_active(Active(LEFT, "DTM"))
    _wait(window)
    look("label, suggested", window)
    for code in ("RWA", "DTL", "IN", "ZL", "MN", "FPP"):
        labels.set_active(Active(RIGHT, code))
        look(f"label, {code} right", window.steps["label"])
    place(workspace, "CA", "CB", "RWA", "RWP", "OS", side=RIGHT)
    _wait(window)
    look("label, both sides", window)


def _messages(window: MainWindow, look: Look) -> None:
    workspace = window.workspace
    workspace.say("Exported 40 points to GP-014_L.mrk.json and GP-014_R.mrk.json")
    look("message", window)
    workspace.say(
        f"/home/anatomy/2024/scans/{LONG_NAME}.nrrd: the values end before the header says they do: got "
        "5123 kB, expected 9123 kB. Copy the file again from the scanner, or export it there once more.",
        "error",
    )
    look("long error", window)
    workspace.interaction.set_tool("grey")
    look("instruction, contrast", window)
    workspace.interaction.set_tool("place")


def _touch(window: MainWindow, name: str, position: np.ndarray) -> None:
    window.workspace.pose.record(position, TouchHow.TYPED, name=name)


def _pose(window: MainWindow, look: Look) -> None:
    workspace, document = window.workspace, window.workspace.document
    window.set_step("pose")
    look("pose, nothing touched", window)
    animal = {code: in_scan(code) for code in ("CA", "CB", *PROBE)}
    moved = {code: position + THERE for code, position in animal.items()}
    rng = np.random.default_rng(1)
    for code in PROBE:
        _touch(window, code, moved[code] + 0.05 * rng.normal(size=3))
    for n, corner in enumerate(np.eye(3) * 9, 1):
        touching.record_touch(document, LEFT, f"S{n}", corner)
    _wait(window)
    look("pose, estimated", window)
    window.judge_pose("accept")
    touching.leave_out(document, LEFT, "OS", True)
    _wait(window)
    look("pose, one left out, judged", window)
    touching.leave_out(document, LEFT, "OS", False)
    _touch(window, "MN", moved["MN"] + [3.0, 0, 0])
    _wait(window)
    look("pose, a mistouch", window)
    _touch(window, "MN", moved["OS"])
    _touch(window, "OS", moved["MN"])
    _wait(window)
    look("pose, names exchanged", window)
    workspace.pose.choose(side=RIGHT)
    for code in PROBE:
        _touch(window, code, moved[code])
    _wait(window)
    look("pose, wrong side", window)
    workspace.pose.choose(side=LEFT)
    for code in PROBE:
        _touch(window, code, moved[code])
    window.steps["pose"].touches.model.show_skull(True)
    window.steps["pose"].touches.refresh()
    workspace.pose.choose(registration="skull")
    _wait(window)
    look("pose, skull features", window)
    workspace.pose.choose(registration="auto", methods=("robust", "jrmpc"))
    _wait(window)
    look("pose, both methods, no animals", window)
    workspace.atlas.problem = f"The atlas of {LONG_NAME}.json is no longer available: it does not exist."
    workspace.atlas.details_changed.emit()
    look("pose, atlas gone", window)
    workspace.interaction.set_tool("touch")
    look("pose, touching on the scan", window)
    workspace.interaction.set_tool("look")


def _atlas(window: MainWindow, folder: Path, look: Look) -> None:
    workspace = window.workspace
    window.set_step("atlas")
    look("atlas, chosen one gone", window)
    workspace.atlas.use(ATLAS)
    look("atlas", window)
    animals = write_animals(folder / "animals", drawn_animals(3))
    (animals / "torn_L.mrk.json").write_text("{")
    workspace.atlas.fit([animals])
    look("atlas, being fitted", window)
    _wait(window)
    look("atlas, fitted", window)
    workspace.atlas.try_out()
    _wait(window)
    look("atlas, tried out", window)
    window.set_step("pose")
    _wait(window)
    look("pose, both methods", window)


def _dialogs(window: MainWindow, folder: Path, look: Look) -> None:
    for name, make in _dialog_makers(window, folder).items():
        dialog = make()
        dialog.show()
        _wait(window)
        look(name, dialog)
        dialog.close()
        QApplication.processEvents()
    _questions(window, look)


def _dialog_makers(window: MainWindow, folder: Path) -> dict[str, Callable[[], QWidget]]:
    workspace = window.workspace
    out = folder / "out"
    out.mkdir(exist_ok=True)
    export_landmarks(workspace.document.state, out)
    file = next(out.glob("*_L.mrk.json"))
    bad = folder / f"{LONG_NAME}.mrk.json"
    bad.write_text("{")
    theirs = folder / "theirs_L.csv"
    theirs.write_text(f"name,x,y,z\nApex,1,2,3\n{LONG_NAME},4,5,6\n")
    off_bone = lambda points: np.zeros(len(points), dtype=bool)  # noqa: E731
    saving = SimpleNamespace(save_file=lambda *_: None)

    def off() -> QWidget:
        dialog = LandmarkImportDialog(workspace, [file], off_bone, parent=window)
        dialog.take.click()
        return dialog

    return {
        "export": lambda: ExportDialog(workspace, folder, parent=window),
        "export, files there": lambda: ExportDialog(workspace, out, parent=window),
        "import landmarks": lambda: LandmarkImportDialog(workspace, [file], parent=window),
        "import landmarks, off the bone": off,
        "import landmarks, other names": lambda: LandmarkImportDialog(workspace, [theirs], parent=window),
        "import landmarks, torn": lambda: LandmarkImportDialog(workspace, [bad], parent=window),
        "open a stack": lambda: ImportDialog(workspace, inspect_volume(_stack(folder)), parent=window),
        "recover": lambda: RecoverDialog(_recoveries(), window),
        "tracker": lambda: TrackerDialog(workspace, window.memory, window),
        "keys": lambda: ShortcutsSheet(window),
        "guide": lambda: GuideWindow(workspace, window),
        "physical test": lambda: PhysicalDialog(workspace, saving, window),
        "measurements": lambda: MeasureDialog(workspace, window.commands.actions, window),
        "labellings": lambda: LabellingsDialog(workspace, window),
        "specimens": lambda: SpecimenListDialog(workspace, window.prompts, window),
        "suggestions in pages": lambda: _pages_of_suggestions(window),  # the last: it suggests all there is
    }


def _pages_of_suggestions(window: MainWindow) -> QWidget:
    """The first page of suggestions, one of them marked."""
    workspace = window.workspace
    middle = workspace.scan.volume.extent.mean(axis=0)
    for side in Side:
        for n, row in enumerate(row for row in FEATURES if not row.computed):
            if not workspace.document.state.landmark(side, row.code).decided:
                at = middle + 0.1 * n
                workspace.labels.suggest(at, radius_95=0.3 + 0.1 * n, source="x", side=side, code=row.code)
    workspace.pages.begin()
    dialog = SuggestionPageDialog(workspace, window)
    offered = [entry for entry in workspace.pages.entries if entry.is_offered]
    workspace.pages.mark(offered[0].side, offered[0].code)
    return dialog


def _stack(folder: Path) -> Path:
    stack = folder / f"{LONG_NAME}_rec"
    stack.mkdir(exist_ok=True)
    for k in range(12):
        plane = np.full((30, 50), 20, np.uint8)
        plane[10:20, 5:15] = 120 + 3 * k
        tifffile.imwrite(stack / f"{LONG_NAME}_{k:04d}.tif", plane)
    return stack


def _recoveries() -> list:
    words = "GP-014: 12 unsaved edits, the last at 2026-11-22 13:41: mark RWM left as checked"
    long = words.replace("GP-014", LONG_NAME)
    return [SimpleNamespace(text=text, specimen_file=None) for text in (words, long)]


def _questions(window: MainWindow, look: Look) -> None:
    prompts = Prompts(window)
    asks: dict[str, Callable[[], object]] = {
        "question": lambda: prompts.choose(
            "Not saved",
            "Save the changes to GP-014?",
            ["Save", "Do not save"],
            detail="Otherwise they are lost when this specimen is closed.",
        ),
        "question of the insertion path": lambda: prompts.item(
            "Insertion path", "Unit of the path", ["mm", "µm", "m"]
        ),
        "number": lambda: prompts.number("Voxel size", "Voxel size of the slices, mm", 0.05),
        "about": lambda: prompts.tell("About gp-labeler", f"gp-labeler 1.0\n\n{_ABOUT}"),
    }
    for name, ask in asks.items():

        def leave(name: str = name) -> None:
            dialog = QApplication.activeModalWidget()
            if dialog is not None:
                try:
                    look(name, dialog)
                finally:
                    dialog.close()  # else the test would wait for an answer for ever

        QTimer.singleShot(50, leave)
        ask()
