"""Reference points: seen in every view, never picked, no part of the specimen, gone with the scan."""

from __future__ import annotations

import numpy as np
import pytest
from qtpy.QtCore import QPoint, Qt
from qtpy.QtTest import QTest
from window_cases import BALL_MM, MIDDLE, VOXEL_MM, shown_pixels, wait_until_idle

from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_labeler.document.state import How
from gp_labeler.models.workspace import Workspace
from gp_labeler.scene.planes import Plane
from gp_labeler.views.panels.label.landmark_import_dialog import LandmarkImportDialog

_LEFT = Qt.MouseButton.LeftButton
INSIDE = MIDDLE + np.array([2.125, -1.625, 0.125])
ON_BONE = MIDDLE + np.array([0.0, -BALL_MM, 0.0])


def write_list(folder, **points) -> object:
    file = folder / "theirs.csv"
    rows = [f"{name},{x},{y},{z}" for name, (x, y, z) in points.items()]
    file.write_text("\n".join(["name,x,y,z", *rows, ""]), encoding="utf-8")
    return file


@pytest.fixture
def window(qtbot, one_window, ball):
    one_window.workspace.interaction.set_tool("place")
    one_window.workspace.view.update(layout="four-up")
    one_window.workspace.scan.begin(ball)
    one_window.activateWindow()
    wait_until_idle(qtbot, one_window)
    yield one_window
    one_window.workspace.references.clear()


@pytest.fixture
def shown(qtbot, window, tmp_path):
    window.prompts.files = [write_list(tmp_path, Apex=ON_BONE, Umbo=INSIDE)]
    assert window.commands.run("file.show_references")
    wait_until_idle(qtbot, window)
    return window


def _pixel(view, position) -> QPoint:
    x, y = view.pixel_at(position)
    return QPoint(round(x), round(y))


@pytest.mark.parametrize("plane", list(Plane))
def test_they_are_drawn_on_slices_near_them_only(shown, plane) -> None:
    view, at = shown.grid.slice_views[plane], INSIDE
    away = np.zeros(3)
    away[np.abs(plane.in_scan.normal).argmax()] = 4.0
    for crosshair, is_seen in ((at, True), (at + away, False)):
        shown.workspace.view.set_crosshair(crosshair)
        before = shown_pixels(view)
        shown.workspace.references.clear()
        changed = (shown_pixels(view) != before).any(axis=-1)
        assert bool(changed.any()) == is_seen
        if is_seen:
            y, x = np.argwhere(changed).T
            pixel = _pixel(view, at)
            assert np.hypot(x - pixel.x(), y - pixel.y()).min() < 8
        assert shown.commands.run("file.show_references")


def test_they_are_drawn_on_bone_and_go_when_cleared(shown, qtbot) -> None:
    view = shown.grid.scene_view
    view.view_from("A")
    wait_until_idle(qtbot, shown)
    before = shown_pixels(view)
    assert shown.commands.actions["file.clear_references"].isEnabled()
    assert shown.commands.run("file.clear_references")
    assert not shown.commands.actions["file.clear_references"].isEnabled()
    wait_until_idle(qtbot, shown)
    y, x = np.argwhere((shown_pixels(view) != before).any(axis=-1)).T
    pixel = _pixel(view, ON_BONE)
    assert np.hypot(x - pixel.x(), y - pixel.y()).min() < 8


def test_a_click_on_one_places_the_landmark_that_is_to_do(shown) -> None:
    document, labels = shown.workspace.document, shown.workspace.labels
    assert not document.state.landmarks
    view = shown.grid.scene_view
    view.view_from("A")
    QTest.mouseClick(view, _LEFT, pos=_pixel(view, ON_BONE))
    assert np.linalg.norm(document.landmarks(Side.LEFT)["CA"] - ON_BONE) < 2 * VOXEL_MM
    code, axial = labels.active.code, shown.grid.slice_views[Plane.AXIAL]
    shown.workspace.view.set_crosshair(INSIDE)
    QTest.mouseClick(axial, _LEFT, pos=_pixel(axial, INSIDE))
    assert np.linalg.norm(document.landmarks(Side.LEFT)[code] - INSIDE) < 2 * VOXEL_MM


def test_they_cannot_be_dragged_and_have_no_menu(shown) -> None:
    before = shown.workspace.document.state
    view = shown.grid.scene_view
    view.view_from("A")
    start = _pixel(view, ON_BONE)
    QTest.mousePress(view, _LEFT, pos=start)
    QTest.mouseMove(view, start + QPoint(30, 10))
    assert shown.workspace.interaction.drag is None
    QTest.mouseRelease(view, _LEFT, pos=start + QPoint(30, 10))
    assert shown.workspace.document.state is before
    assert shown.workspace.labels.progress(Side.LEFT).text.startswith("0 ")


def test_a_landmark_under_one_is_still_picked(shown) -> None:
    view, document, labels = shown.grid.scene_view, shown.workspace.document, shown.workspace.labels
    shown.workspace.interaction.set_tool("look")
    view.view_from("A")
    QTest.mouseClick(view, _LEFT, pos=_pixel(view, ON_BONE))
    assert labels.active.code == "CA"
    assert np.linalg.norm(shown.workspace.view.crosshair - ON_BONE) < 2 * VOXEL_MM
    labels.place(ON_BONE, How.MESH, side=Side.LEFT, code="OS")
    assert labels.active.code != "OS"
    QTest.mouseClick(view, _LEFT, pos=_pixel(view, ON_BONE))
    assert labels.active.code == "OS"
    assert set(document.landmarks(Side.LEFT).placed) == {"OS"}


def test_another_scan_clears_them(shown, ball) -> None:
    shown.workspace.scan.begin(ball)
    assert not shown.workspace.references.points


def test_those_outside_the_scan_are_said(window, tmp_path) -> None:
    told = []
    window.workspace.messages.said.connect(lambda text, level: told.append((text, level)))
    window.workspace.references.show(write_list(tmp_path, Apex=INSIDE, Far=MIDDLE + 100))
    assert told == [("1 of 2 reference points lie outside the scan and are not shown", "warning")]


def test_unknown_names_can_be_shown_instead_of_imported(window, tmp_path, qtbot) -> None:
    workspace, file = window.workspace, write_list(tmp_path, Apex=INSIDE)
    dialog = LandmarkImportDialog(workspace, [file], parent=window)
    dialog.show()
    assert dialog.show_only.isVisible()
    qtbot.mouseClick(dialog.show_only, _LEFT)
    assert [point.name for point in workspace.references.points] == ["Apex"]
    assert not workspace.document.state.landmarks
    known = LandmarkImportDialog(workspace, [write_list(tmp_path, CA=INSIDE)], parent=window)
    known.show()
    assert not known.show_only.isVisible()
    known.reject()


def test_what_cannot_be_shown_is_refused_and_the_rest_stays(tmp_path) -> None:
    workspace, told = Workspace(), []
    references = workspace.references
    references.changed.connect(lambda: told.append(1))
    references.show(write_list(tmp_path, CA_L=INSIDE, CA_R=ON_BONE))
    assert [point.name for point in references.points] == ["CA L", "CA R"]
    tracked = tmp_path / "touched.dat"
    tracked.write_text("1 2 3\n4 5 6\n7 8 9\n", encoding="utf-8")
    with pytest.raises(GpError, match=r"touched\.dat") as refused:
        references.show(tracked)
    assert "\n" not in str(refused.value)
    with pytest.raises(GpError, match="at most 500"):
        references.show(write_list(tmp_path, **{f"p{n}": INSIDE for n in range(501)}))
    assert len(references.points) == 2
    references.clear()
    references.clear()
    assert len(told) == 2
    workspace.close()
