"""The panel of the step Pose by real clicks, keys and drops: what it takes, what it says, what it keeps."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from panel_cases import PANEL_WIDTH, actions_of, cut_words, deliver, workspace_with_scan
from qtpy.QtCore import QEvent, QPoint, QSize, Qt
from qtpy.QtGui import QGuiApplication
from qtpy.QtWidgets import QApplication, QLabel, QLineEdit
from window_cases import drop_file

from gp_core import PROBE, Atlas, Side, estimate_pose, read_touches
from gp_core.atlas.sampling import draw_animal
from gp_core.errors import GpError
from gp_labeler.document import touching
from gp_labeler.document.touches import TouchHow
from gp_labeler.jobs.runner import QueueDispatcher
from gp_labeler.models.pose import ORDER
from gp_labeler.models.workspace import Workspace
from gp_labeler.tracker import TrackerAddress
from gp_labeler.views.panels.parts import Notice
from gp_labeler.views.panels.pose.panel import PosePanel, holds_touches
from gp_labeler.views.panels.pose.touch_table_model import CLEAR, NAME, USE, XYZ
from gp_labeler.views.panels.pose.wording import parse_position
from gp_labeler.views.theme import DARK, LIGHT, apply_theme

DATA = Path(__file__).resolve().parents[4] / "shared" / "data"
FILES = {
    "SkullD_Right.dat": Side.RIGHT,
    "SkullA_Left_new.dat": Side.LEFT,
    "SkullE_Right.dat": Side.RIGHT,
    "sample_data_file.dat": Side.RIGHT,
}
LEFT, CLICK = Side.LEFT, Qt.MouseButton.LeftButton
ATLAS = Atlas.published()
ANIMAL = draw_animal(ATLAS, rng=np.random.default_rng(3)).side("L")
THERE = np.array([40.0, -120.5, -1180.2])
"""Where a tracker may well have its points."""

NARROW, WIDE = QSize(PANEL_WIDTH, 698), QSize(1180, 740)


def find(name: str) -> Path:
    path = DATA / ("usevitch2021" if name.startswith("sample") else "probe") / name
    if not path.exists():
        pytest.skip(f"{path} is not here")
    return path


@pytest.fixture
def workspace() -> Iterator[Workspace]:
    workspace = Workspace(None, QueueDispatcher(), atlas=ATLAS, author="AB")
    yield workspace
    workspace.close(discard=True)


@pytest.fixture
def panel(workspace: Workspace, qtbot) -> PosePanel:
    return shown(workspace, qtbot)


def shown(workspace: Workspace, qtbot, size: QSize = NARROW, theme=DARK, asked=None) -> PosePanel:
    panel = PosePanel(workspace, actions_of(workspace, qtbot, asked))
    apply_theme(panel, theme)
    qtbot.addWidget(panel)
    panel.set_wide(size.width() > PANEL_WIDTH)
    panel.resize(size)
    panel.show()
    qtbot.waitExposed(panel)
    panel.activateWindow()
    return panel


def touch(workspace: Workspace, *codes: str, noise: float = 0.1, seed: int = 1) -> None:
    rng = np.random.default_rng(seed)
    for code in codes:
        workspace.pose.record(ANIMAL[code] + THERE + noise * rng.normal(size=3), TouchHow.TYPED, name=code)


def touches(workspace: Workspace, side: Side = LEFT) -> dict[str, tuple[float, float, float]]:
    return {name: t.position for (of, name), t in workspace.document.state.touches.items() if of is side}


def cell(panel: PosePanel, name: str, column: int) -> QPoint:
    table, model = panel.touches.table, panel.touches.model
    return table.visualRect(model.index(model.row_of(name), column)).center()


def click(qtbot, panel: PosePanel, name: str, column: int) -> None:
    qtbot.mouseClick(panel.touches.table.viewport(), CLICK, pos=cell(panel, name, column))


def drop(widget, path: Path) -> None:
    def hovering() -> None:
        if isinstance(widget, PosePanel):
            assert path.name in widget.touches.change.toolTip()

    drop_file(widget, path, 20, 200, entered=hovering)


def editor(panel: PosePanel) -> QLineEdit:
    fields = panel.touches.table.viewport().findChildren(QLineEdit)
    found = [field for field in fields if field.isVisible()]
    assert len(found) == 1
    return found[0]


def notices(panel: PosePanel) -> str:
    return " ".join(" ".join(notice) for notice in panel.result.notices.shown)


# Touches come in


@pytest.mark.parametrize("name", list(FILES))
def test_a_dropped_probe_file_gives_the_numbers_of_the_library(workspace, panel, qtbot, name):
    path, side = find(name), FILES[name]
    qtbot.mouseClick(panel.head.side.buttons[side.value], CLICK)
    drop(panel, path)
    alone = estimate_pose(read_touches(path, side), side, ATLAS)
    assert workspace.pose.estimate.pose.as_dict() == alone.as_dict()
    shown_origin = panel.result.one.origin.text().replace("\N{MINUS SIGN}", "-").removesuffix("mm").split()
    np.testing.assert_allclose([float(x) for x in shown_origin], alone.origin, atol=0.005)
    assert f"{alone.radius_95:.2f} mm" in panel.result.one.region.text()
    for code, residual in alone.residuals.items():
        row = panel.touches.model.rows[panel.touches.model.row_of(code)]
        assert row.residual == residual
        assert row.suspect is (code in alone.suspects)


def test_six_touches_are_typed_one_after_the_other(workspace, panel, qtbot):
    qtbot.mouseClick(panel.touches.ways["type"], CLICK)
    for code in ORDER[:6]:
        position = ANIMAL[code] + THERE
        assert workspace.pose.target == code
        qtbot.keyClicks(editor(panel), " ".join(f"{x:.4f}" for x in position))
        qtbot.keyClick(editor(panel), Qt.Key.Key_Return)
        QApplication.processEvents()
    np.testing.assert_allclose(touches(workspace)["RWP"], ANIMAL["RWP"] + THERE, atol=1e-4)
    assert set(touches(workspace)) == set(PROBE)
    assert "95 % within" in panel.result.one.region.text()
    assert panel.result.verdict.label.text() == "Good"
    assert "Touch IN next" in panel.result.next.text()
    qtbot.keyClick(editor(panel), Qt.Key.Key_Escape)
    assert set(touches(workspace)) == set(PROBE)


def test_before_the_third_touch_it_says_how_many_are_wanting(workspace, panel):
    assert panel.result.waiting.text() == "3 more touches for an estimate"
    touch(workspace, "CL", "MN")
    assert panel.result.waiting.text() == "1 more touch for an estimate"
    assert not panel.result.one.isVisible()
    touch(workspace, "OS")
    assert panel.result.one.isVisible()
    assert not panel.result.waiting.isVisible()


@pytest.mark.parametrize(
    "text", ["1.5 -2 3", "1.5, -2, 3", "1.5,-2,3", "1,5 -2 3", "1.5\t-2\t3", "(1.5; \N{MINUS SIGN}2; 3)"]
)
def test_positions_are_read_as_they_are_pasted(text):
    assert parse_position(text, "MN") == (1.5, -2.0, 3.0)


@pytest.mark.parametrize("text", ["", "1 2", "1 2 3 4", "1 2 x", "nan 1 2", "1e999 0 0"])
def test_what_is_no_position_is_said_so(text):
    with pytest.raises(GpError, match=r"MN.*three"):
        parse_position(text, "MN")


def test_a_slip_while_typing_keeps_what_was_typed(workspace, panel, qtbot):
    told = []
    workspace.messages.said.connect(lambda *what: told.append(what))
    panel.touches.table.edit_position("CL")
    qtbot.keyClicks(editor(panel), "1.5 2.5")
    qtbot.keyClick(editor(panel), Qt.Key.Key_Return)
    assert editor(panel).text() == "1.5 2.5"
    assert editor(panel).property("wrong") == "true"
    assert "CL" in told[-1][0]
    assert "Type x y z in mm" in " ".join(panel.touches.notices.shown[0])
    qtbot.keyClicks(editor(panel), " 3.5")
    qtbot.keyClick(editor(panel), Qt.Key.Key_Return)
    assert touches(workspace) == {"CL": (1.5, 2.5, 3.5)}
    assert not panel.touches.notices.isVisible()


def test_what_is_being_typed_outlives_a_touch_from_elsewhere(workspace, panel, qtbot):
    touch(workspace, "CL", "LLI", "MN", "OS")
    panel.touches.table.edit_position("OS")
    editor(panel).selectAll()
    qtbot.keyClicks(editor(panel), "1 2")
    touch(workspace, "RWA", "MN", seed=2)  # the residual of OS changes, and so does its row
    assert editor(panel).text() == "1 2"
    qtbot.keyClicks(editor(panel), " 3")
    qtbot.keyClick(editor(panel), Qt.Key.Key_Return)
    assert touches(workspace)["OS"] == (1, 2, 3)


def test_a_field_that_is_left_half_filled_in_says_so_and_changes_nothing(workspace, panel, qtbot):
    panel.touches.table.edit_position("CL")
    qtbot.keyClicks(editor(panel), "1 2")
    panel.verdict.note.setFocus()
    assert touches(workspace) == {}
    assert "CL" in panel.touches.notices.shown[0][1]


def test_random_clicks_and_keys_leave_it_whole(workspace, panel, qtbot):
    rng = np.random.default_rng(5)
    touch(workspace, *PROBE)
    keys = [Qt.Key.Key_Return, Qt.Key.Key_Delete, Qt.Key.Key_Space, Qt.Key.Key_Escape, Qt.Key.Key_Down]
    for _ in range(150):
        what = rng.integers(6)
        name = str(rng.choice(workspace.pose.names))
        if what < 3:
            click(qtbot, panel, name, int(rng.integers(5)))
        elif what == 3:
            qtbot.keyClick(QApplication.focusWidget() or panel.touches.table, keys[rng.integers(len(keys))])
        elif what == 4:
            workspace.document.undo() if rng.integers(2) else workspace.document.redo()
        else:
            touch(
                workspace,
                str(rng.choice(ORDER)),
                noise=float(rng.choice([0.1, 3.0])),
                seed=int(rng.integers(99)),
            )
    QApplication.processEvents()
    made = workspace.pose.estimate
    assert panel.result.one.isVisible() is (made is not None and made.pose is not None)
    assert {row.name for row in panel.touches.model.rows if row.touch is not None} == set(touches(workspace))


def test_a_touch_is_changed_by_a_double_click(workspace, panel, qtbot):
    touch(workspace, "CL", "MN", "OS", noise=0)
    where = cell(panel, "MN", XYZ)
    qtbot.mouseClick(panel.touches.table.viewport(), CLICK, pos=where)
    qtbot.mouseDClick(panel.touches.table.viewport(), CLICK, pos=where)
    assert editor(panel).text() == " ".join(f"{x:.6g}" for x in ANIMAL["MN"] + THERE)
    editor(panel).selectAll()
    qtbot.keyClicks(editor(panel), "1, 2, 3")
    qtbot.keyClick(editor(panel), Qt.Key.Key_Return)
    assert touches(workspace)["MN"] == (1, 2, 3)


def test_lines_with_names_are_pasted_at_once(workspace, panel, qtbot):
    lines = [f"{code}, " + ", ".join(f"{x:.3f}" for x in ANIMAL[code]) for code in PROBE]
    QGuiApplication.clipboard().setText("\n".join(["label, x, y, z", *lines, ""]))
    panel.touches.table.setFocus()
    qtbot.keyClick(panel.touches.table, Qt.Key.Key_V, Qt.KeyboardModifier.ControlModifier)
    assert set(touches(workspace)) == set(PROBE)
    QGuiApplication.clipboard().setText("7 8 9")
    click(qtbot, panel, "ZL", NAME)
    qtbot.keyClick(panel.touches.table, Qt.Key.Key_V, Qt.KeyboardModifier.ControlModifier)
    assert touches(workspace)["ZL"] == (7, 8, 9)


def test_a_bad_file_is_named_with_what_to_do_and_nothing_is_lost(workspace, panel, tmp_path):
    touch(workspace, *PROBE)
    before = workspace.document.state
    bad = tmp_path / "milk.dat"
    bad.write_text("milk, bread")
    told = []
    workspace.messages.said.connect(lambda *what: told.append(what))
    drop(panel, bad)
    assert workspace.document.state == before
    assert told[-1][1] == "error"
    assert "milk.dat" in told[-1][0]
    level, words, remedy = panel.touches.notices.shown[0]
    assert (level, "milk.dat" in words) == ("error", True)
    assert panel.touches.notices.isVisible()
    assert remedy or "." in words
    touch(workspace, "ZL")
    panel.touches.table.use_asked.emit("ZL")
    assert not panel.touches.notices.isVisible(), "what works takes the message away"


def test_only_files_of_touches_are_taken(tmp_path):
    assert all(holds_touches(Path(name)) for name in ("a.DAT", "b.csv", "c.mrk.json", "d.fcsv"))
    assert not any(holds_touches(Path(name)) for name in ("a.nrrd", "b.gpspecimen.json", "c"))


def test_undo_takes_a_file_back(workspace, panel, qtbot):
    touch(workspace, "CL", "MN", "OS")
    drop(panel, find("SkullA_Left_new.dat"))
    assert "S1" in touches(workspace)
    assert panel.touches.model.row_of("S1") == -1, "eight more rows are shown where they are wanted"
    assert panel.touches.more.accessibleName() == "Show 8 skull features"
    qtbot.mouseClick(panel.touches.more, CLICK)
    assert panel.touches.model.row_of("S1") == len(ORDER)
    workspace.document.undo()
    assert set(touches(workspace)) == {"CL", "MN", "OS"}
    assert panel.touches.model.row_of("S1") == -1


# What is made of them


def test_a_click_leaves_a_point_out_and_takes_it_in_again(workspace, panel, qtbot):
    touch(workspace, *PROBE)
    before = workspace.pose.estimate.pose
    click(qtbot, panel, "MN", USE)
    assert workspace.document.state.touches[LEFT, "MN"].left_out
    assert "MN" not in workspace.pose.estimate.pose.residuals
    assert "1 left out" in panel.touches.heading.text()
    row = panel.touches.model.rows[panel.touches.model.row_of("MN")]
    assert (row.state, row.residual) == ("unseen", None)
    click(qtbot, panel, "MN", USE)
    assert workspace.pose.estimate.pose.as_dict() == before.as_dict()


def test_it_says_beforehand_what_leaving_out_changes(workspace, panel, qtbot):
    touch(workspace, *PROBE)
    moved, turned = workspace.pose.without("MN")
    click(qtbot, panel, "MN", NAME)
    qtbot.waitUntil(lambda: bool(panel.touches.change.toolTip()))
    said = panel.touches.change.toolTip()
    assert said == f"Without MN, CO moves {moved:.2f} mm, the axis {turned:.1f}°"
    before = workspace.pose.estimate.pose
    click(qtbot, panel, "MN", USE)
    after = workspace.pose.estimate.pose
    assert np.linalg.norm(after.origin - before.origin) == pytest.approx(moved)
    qtbot.waitUntil(lambda: panel.touches.change.toolTip().startswith("With MN"))


def test_one_touch_or_all_are_cleared_and_come_back(workspace, panel, qtbot):
    touch(workspace, *PROBE)
    click(qtbot, panel, "OS", CLEAR)
    assert "OS" not in touches(workspace)
    assert workspace.pose.target == "OS"
    qtbot.mouseClick(panel.touches.clear, CLICK)
    assert touches(workspace) == {}
    assert panel.result.waiting.isVisible()
    workspace.document.undo()
    workspace.document.undo()
    assert set(touches(workspace)) == set(PROBE)
    panel.touches.table.setFocus()
    click(qtbot, panel, "MN", NAME)
    qtbot.keyClick(panel.touches.table, Qt.Key.Key_Delete)
    assert "MN" not in touches(workspace)


def test_a_mistouch_is_marked_by_shape_and_called_out(workspace, panel):
    touch(workspace, *PROBE)
    workspace.pose.record(ANIMAL["MN"] + THERE + [3.0, 0, 0], TouchHow.TYPED, name="MN")
    rows = {row.name: row for row in panel.touches.model.rows}
    assert (rows["MN"].state, rows["MN"].suspect, rows["OS"].state) == ("doubtful", True, "placed")
    assert "MN does not fit the other points" in notices(panel)
    assert panel.result.verdict.label.text() == "Check first"


def test_the_wrong_side_is_called_out_and_right_on_the_other(workspace, panel, qtbot):
    qtbot.mouseClick(panel.head.side.buttons["R"], CLICK)
    touch(workspace, *PROBE)
    assert "left side fits these points better than the right" in notices(panel)
    assert "check the side" in notices(panel).lower()
    assert panel.result.verdict.label.text() == "Check the side"
    wrong = touches(workspace, Side.RIGHT)
    qtbot.mouseClick(panel.result.other_side, CLICK)
    assert workspace.pose.side is LEFT
    assert panel.head.side.value == "L"
    assert touches(workspace) == wrong
    assert touches(workspace, Side.RIGHT) == {}
    assert panel.result.verdict.label.text() == "Good"
    assert not panel.result.other_side.isVisible()
    workspace.document.undo()
    assert touches(workspace, Side.RIGHT) == wrong, "one step"
    assert panel.head.side.value == "R", "the panel does not look cleared"
    assert panel.result.other_side.isVisible()


def test_swapped_names_are_called_out_and_exchanged_by_a_click(workspace, panel, qtbot):
    touch(workspace, *PROBE)
    at = touches(workspace)
    workspace.pose.record(at["MN"], TouchHow.TYPED, name="OS")
    workspace.pose.record(at["OS"], TouchHow.TYPED, name="MN")
    assert "look exchanged" in notices(panel)
    assert panel.result.verdict.label.text() == "Check the names"
    assert panel.result.swap.text() in ("Exchange MN and OS", "Exchange OS and MN")
    assert not panel.result.next.isVisible()
    wrong = touches(workspace)
    qtbot.mouseClick(panel.result.swap, CLICK)
    assert touches(workspace) == at
    assert panel.result.verdict.label.text() == "Good"
    assert not panel.result.swap.isVisible()
    with pytest.raises(GpError, match="no two touches"):
        workspace.pose.swap_names()
    workspace.document.undo()
    assert touches(workspace) == wrong, "one step"
    assert panel.result.swap.isVisible()


def test_a_side_that_is_undecided_is_offered_with_its_odds(workspace, panel, qtbot):
    touch(workspace, "OS", "MN", "RWA")
    assert panel.result.verdict.label.text() == "Side undecided"
    assert panel.result.other_side.isVisible()
    assert panel.result.other_side.text() == "Use the right side  (3 % likely)"
    pose = workspace.pose.estimate.pose
    assert f"{pose.radius_95:.2f} mm" in panel.result.one.region.text()
    beside = panel.result.one.allowance.text()
    assert f"As named: {pose.plain_radius_95:.2f} mm" in beside
    assert "several hypotheses" in beside
    assert f"as named, {pose.plain_radius_95:.2f} →" in panel.result.next.text()
    before = touches(workspace)
    qtbot.mouseClick(panel.result.other_side, CLICK)
    assert (workspace.pose.side, touches(workspace, Side.RIGHT)) == (Side.RIGHT, before)
    touch_in = ANIMAL["IN"] + THERE
    workspace.document.undo()
    workspace.pose.record(touch_in, TouchHow.TYPED, name="IN")
    touch(workspace, "CL", "LLI", "RWP")
    assert panel.result.verdict.label.text() == "Good"
    assert not panel.result.other_side.isVisible()
    assert "As named" not in panel.result.one.allowance.text()


def test_the_shared_error_is_the_users_and_stated_with_the_region(workspace, panel, qtbot):
    touch(workspace, *PROBE)
    assert panel.head.shared.text() == "0.2"
    assert panel.result.one.allowance.text() == "It includes a shared error of 0.2 mm."
    before, origin = workspace.pose.estimate.pose.radius_95, workspace.pose.estimate.pose.origin
    panel.head.shared.setFocus()
    panel.head.shared.selectAll()
    qtbot.keyClicks(panel.head.shared, "0.8")
    qtbot.keyClick(panel.head.shared, Qt.Key.Key_Return)
    pose = workspace.pose.estimate.pose
    assert (pose.shared_error, workspace.pose.settings.shared_error) == (0.8, 0.8)
    assert pose.radius_95 > 2 * before
    np.testing.assert_array_equal(pose.origin, origin)
    assert panel.result.one.allowance.text() == "It includes a shared error of 0.8 mm."
    assert workspace.pose.gains()[0].radius_95_now == pytest.approx(pose.plain_radius_95)
    with pytest.raises(GpError, match="shared error must be from 0 to 20 mm"):
        workspace.pose.choose(shared_error=-1)


def test_the_likelier_reading_is_taken_in_one_step(workspace, panel):
    touch(workspace, *PROBE)
    assert workspace.pose.take_likelier() is None
    at = touches(workspace)
    workspace.pose.record(at["CL"], TouchHow.TYPED, name="OS")
    workspace.pose.record(at["OS"], TouchHow.TYPED, name="CL")
    taken = workspace.pose.take_likelier()
    assert set(taken.exchanged) == {"CL", "OS"}
    assert touches(workspace) == at


def test_an_atlas_that_is_not_the_one_chosen_is_told_beside_the_estimate(workspace, panel):
    assert not panel.head.problem.isVisible()
    workspace.atlas.problem = "The atlas of own.json is no longer available: own.json: does not exist."
    workspace.atlas.details_changed.emit()
    assert panel.head.problem.isVisible()
    assert "The published atlas is used." in panel.head.problem.text()
    workspace.atlas.use(ATLAS)
    assert not panel.head.problem.isVisible()


def test_a_verdict_is_not_taken_for_one_on_another_estimate(workspace, panel, qtbot):
    touch(workspace, *PROBE)
    qtbot.mouseClick(panel.verdict.accept, CLICK)
    (said,) = panel.verdict.findChildren(Notice)
    assert said.level == "good"
    workspace.pose.record(ANIMAL["RWP"] + THERE + [0.8, 0, 0], TouchHow.TYPED, name="RWP")
    QApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
    (said,) = panel.verdict.findChildren(Notice)
    assert said.level == "warning"
    assert any("has moved since by" in label.text() for label in said.findChildren(QLabel))


def test_two_methods_stand_side_by_side(workspace, panel, qtbot):
    rng = np.random.default_rng(0)
    workspace.atlas.use(ATLAS, [draw_animal(ATLAS, rng=rng, name=f"S{n}") for n in range(4)])
    touch(workspace, *PROBE)
    qtbot.mouseClick(panel.head.method.buttons["both"], CLICK)
    assert "Preparing JRMPC" in notices(panel)
    deliver(workspace)
    poses = workspace.pose.estimate.poses
    first = [row[0].text() for row in panel.result.two.cells]
    assert first[1] == "CO x"
    assert panel.result.two.cells[1][1].text() == f"{poses['robust'].origin[0]:.2f}"
    assert panel.result.two.cells[1][2].text() == f"{poses['jrmpc'].origin[0]:.2f}"
    apart = np.linalg.norm(poses["robust"].origin - poses["jrmpc"].origin)
    assert f"{apart:.2f} mm" in panel.result.two.apart.text()


def test_a_method_without_what_it_needs_says_so(workspace, panel, qtbot):
    touch(workspace, *PROBE)
    workspace.pose.set_joint_ready()
    qtbot.mouseClick(panel.head.method.buttons["jrmpc"], CLICK)
    assert "JRMPC" in notices(panel)
    assert not panel.result.one.isVisible()


def test_probe_noise_is_given_and_found_again(workspace, panel, qtbot):
    touch(workspace, *PROBE)
    found = f"{workspace.pose.estimate.pose.probe_noise:.2f}"
    assert found in panel.head.found.text()
    qtbot.keyClicks(panel.head.noise, "0.5")
    qtbot.keyClick(panel.head.noise, Qt.Key.Key_Return)
    assert workspace.pose.settings.probe_noise == 0.5
    qtbot.keyClick(panel.head.noise, Qt.Key.Key_A, Qt.KeyboardModifier.ControlModifier)
    qtbot.keyClick(panel.head.noise, Qt.Key.Key_Delete)
    assert workspace.pose.settings.probe_noise is None
    assert found in panel.head.found.text()


def test_the_point_that_gains_most_is_aimed_at_with_a_click(workspace, panel, qtbot):
    touch(workspace, *PROBE)
    best = workspace.pose.gains()[0].code
    workspace.pose.set_target("OI")
    qtbot.mouseClick(panel.result.next, CLICK)
    assert workspace.pose.target == best


# In the scan, and the verdict


def test_errors_against_the_labels_and_the_registration_are_told(qtbot):
    workspace = workspace_with_scan()
    panel = shown(workspace, qtbot)
    shift = np.array([3.0, -12.0, 4.0])
    for code in ("CA", "CB", *PROBE):
        workspace.labels.place(ANIMAL[code] + shift, side=LEFT, code=code)
    touch(workspace, *PROBE, noise=0.05)
    estimate, facts = workspace.pose.estimate, panel.in_scan.facts
    mm, deg = estimate.errors()
    assert facts["From the labels"].text() == f"CO {mm:.2f} mm, axis {deg:.1f}°"
    assert facts["FRE"].text() == f"{estimate.registered.fre_mm:.2f} mm"
    assert facts["Registered"].text() == "by labelled features, 6 of 6"
    qtbot.mouseClick(panel.in_scan.way.buttons["skull"], CLICK)
    assert workspace.pose.estimate.registered is None
    assert "at least 3 points" in " ".join(panel.in_scan.notices.shown[0])
    for n, corner in enumerate(np.eye(3) * 9, 1):
        touching.record_touch(workspace.document, LEFT, f"S{n}", corner + THERE)
        workspace.view.set_crosshair(corner + shift)
        assert panel.in_scan.mark.text() == f"Mark skull point S{n} at the crosshair"
        qtbot.mouseClick(panel.in_scan.mark, CLICK)
    assert workspace.pose.estimate.registered.way == "skull"
    qtbot.mouseClick(panel.touches.more, CLICK)
    shown_at = []
    workspace.view.point_shown.connect(shown_at.append)
    click(qtbot, panel, "S2", NAME)
    np.testing.assert_allclose(shown_at[-1], np.add(shift, (0, 9, 0)), atol=1e-6)
    assert list(cut_words(panel)) == []
    workspace.close(discard=True)


def test_skull_features_come_from_a_file(workspace, panel, tmp_path):
    (tmp_path / "skull.csv").write_text("label,x,y,z\nS1,1,2,3\nS2,4,5,7\nS3,9,1,0\n")
    assert panel.in_scan.take_file(tmp_path / "skull.csv")
    assert workspace.document.state.skull["S2"] == (4, 5, 7)
    assert "3" in panel.in_scan.skull.text()
    (tmp_path / "none.csv").write_text("label,x,y,z\nCA,1,2,3\n")
    assert not panel.in_scan.take_file(tmp_path / "none.csv")
    assert len(workspace.document.state.skull) == 3


def test_a_verdict_is_kept_with_initials_and_note(workspace, panel, qtbot):
    assert not panel.verdict.accept.isEnabled()
    touch(workspace, *PROBE)
    panel.verdict.initials.clear()
    qtbot.keyClicks(panel.verdict.initials, "CD")
    qtbot.keyClicks(panel.verdict.note, "seen on the mesh")
    qtbot.mouseClick(panel.verdict.accept, CLICK)
    check = workspace.document.state.pose_checks[-1]
    assert (check.side, check.verdict, check.by, check.note) == (LEFT, "accept", "CD", "seen on the mesh")
    assert check.pose["radius_95_mm"] == workspace.pose.estimate.pose.radius_95
    said = panel.verdict.said.itemAt(0).widget()
    assert said.words.startswith("Accepted by CD")
    qtbot.mouseClick(panel.verdict.reject, CLICK)
    assert [c.verdict for c in workspace.document.state.pose_checks] == ["accept", "reject"]
    workspace.document.undo()
    assert [c.verdict for c in workspace.document.state.pose_checks] == ["accept"]


def test_what_is_drawn_is_chosen(workspace, panel, qtbot):
    workspace.begin_judging()
    panel.overlay.parts["vectors"].click()
    assert workspace.pose.overlay.vectors
    panel.overlay.opacity.setValue(40)
    assert workspace.pose.overlay.opacity == 0.4
    panel.overlay.visible.click()
    assert not workspace.pose.overlay.visible
    assert not panel.overlay.parts["region"].isEnabled()


def test_other_parts_of_the_program_are_asked_for(workspace, qtbot):
    asked = []
    panel = shown(workspace, qtbot, asked=asked)
    touch(workspace, *PROBE)
    for button in (panel.touches.ways["file"], panel.touches.ways["tracker"], panel.touches.guide):
        qtbot.mouseClick(button, CLICK)
    for button in (panel.head.to_atlas, panel.report, panel.export, panel.in_scan.file):
        button.click()
    assert asked == [
        "pose.open_touches",
        "pose.tracker",
        "pose.guide",
        "atlas.show",
        "pose.report",
        "pose.export",
        "pose.open_skull",
    ]


# Looks, and speed


@pytest.mark.parametrize("theme", [DARK, LIGHT], ids=lambda theme: theme.name)
@pytest.mark.parametrize("size", [NARROW, WIDE], ids=["narrow", "wide"])
@pytest.mark.parametrize("n", [0, 3, 11])
def test_no_word_is_cut(workspace, qtbot, theme, size, n):
    touch(workspace, *ORDER[:n])
    panel = shown(workspace, qtbot, size, theme)
    assert list(cut_words(panel)) == []
    panel.hide()


def test_a_hidden_panel_computes_nothing_and_is_right_when_shown(workspace, panel, monkeypatch):
    panel.hide()
    asked = []
    monkeypatch.setattr(type(workspace.pose), "gains", lambda self: asked.append(1) or ())
    touch(workspace, *PROBE)
    assert asked == []
    panel.show()
    assert panel.result.one.isVisible()


def test_a_touch_shows_at_once(workspace, panel):
    touch(workspace, *PROBE)
    took = []
    for n in range(8):
        start = time.process_time()  # not what else the machine does
        touch(workspace, ORDER[n], seed=n)
        QApplication.processEvents()
        took.append(time.process_time() - start)
    assert min(took) < 0.03


def test_the_way_by_the_tracker_says_how_it_stands_also_where_its_card_is_below_the_window(
    workspace, panel, qtbot
):
    by_tracker = panel.touches.ways["tracker"]
    offered = by_tracker.text()
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    workspace.tracker.connect(TrackerAddress(port=port))  # where nobody listens any more

    def is_lost() -> None:
        workspace.tracker.poll()
        assert by_tracker.text() == "No tracker"

    qtbot.waitUntil(is_lost)
    workspace.tracker.disconnect()
    assert by_tracker.text() == offered
