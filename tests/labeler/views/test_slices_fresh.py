"""What slices keep between two paints is what the session holds, whatever was done in between."""

from __future__ import annotations

import numpy as np
import pytest
from window_cases import MIDDLE, wait_until_idle, write_ball

from gp_core import Atlas, Side
from gp_labeler.document.edits import CheckPoint
from gp_labeler.document.state import How
from gp_labeler.imaging import readers, voxels
from gp_labeler.imaging.readers import read_volume
from gp_labeler.models.workflow import Active
from gp_labeler.models.workspace import Workspace
from gp_labeler.scene.colours import DARK
from gp_labeler.scene.planes import Plane
from gp_labeler.views.drawn import drawn_ghosts, drawn_marks, drawn_segments
from gp_labeler.views.painting import slice_painter

pytestmark = pytest.mark.any_binding

ATLAS = Atlas.published()


def _place(workspace: Workspace, code: str, side: Side = Side.LEFT, shift: float = 0.0) -> None:
    place = MIDDLE + ATLAS[code] + shift
    workspace.labels.place(place, How.MESH, side=side, code=code)


def _wait_for_checks(workspace: Workspace) -> None:
    """Let the checker have its say now: it works in the background, and changes the states of points."""
    for side in Side:
        workspace.labels.point_states(side)


def _told(marks, ghosts, lines):
    return (
        [(m.key, m.position.tolist(), m.label, m.state, m.active) for m in marks],
        [(g.key, g.mean.tolist(), g.label, g.active) for g in ghosts],
        [(line.start.tolist(), line.end.tolist()) for line in lines],
    )


ACTS = {
    "place": lambda workspace: _place(workspace, "LLI"),
    "move": lambda workspace: _place(workspace, "RWA", shift=0.5),
    "undo": lambda workspace: workspace.document.undo(),
    "not seen": lambda workspace: workspace.labels.mark_unseen(side=Side.LEFT, code="RWA"),
    "other point": lambda workspace: workspace.labels.set_active(Active(Side.LEFT, "RWP")),
    "other side": lambda workspace: workspace.labels.set_active(Active(Side.RIGHT, "CA")),
    "ghost": lambda workspace: workspace.labels.set_active(Active(Side.LEFT, "LLI")),
    "ghosts off": lambda workspace: workspace.view.update(ghosts_visible=False),
    "axis off": lambda workspace: workspace.view.update(axis_visible=False),
    "estimate": lambda workspace: workspace.pose.draw(visible=True),
    "drag": lambda workspace: (
        workspace.interaction.begin_drag(Side.LEFT, "RWA"),
        workspace.interaction.drag_to(MIDDLE + 0.3, How.SLICE),
    ),
    "another": lambda workspace: workspace.document.begin(),
}


@pytest.mark.parametrize("act", ACTS)
def test_what_is_painted_follows(window, act) -> None:
    workspace, slices = window.workspace, window.grid.slice_views.values()
    workspace.atlas.use(ATLAS)
    for code in ("CA", "CB", "RWA", "RWP"):
        _place(workspace, code)
    workspace.labels.set_active(Active(Side.LEFT, "OS" if act == "ghosts off" else "RWA"))
    _wait_for_checks(workspace)
    before = []
    for view in slices:
        view.grab()
        before.append(view.slice_painter.points)
        assert len(before[-1].marks) == 5, "the four, and CO"
    ACTS[act](workspace)
    _wait_for_checks(workspace)
    wanted = _told(drawn_marks(workspace), drawn_ghosts(workspace), drawn_segments(workspace, DARK))
    marks, _, ghosts, lines = before[0]
    assert wanted != _told(marks, ghosts, lines), "the act shows, else this says nothing"
    for view in slices:
        view.grab()
        kept = view.slice_painter.points
        assert _told(kept.marks, kept.ghosts, kept.lines) == wanted
        places = np.reshape([mark.position for mark in kept.marks], (-1, 3))
        np.testing.assert_array_equal(kept.positions, places)


def test_a_doubtful_point_shows_where_it_should_be(window, qtbot, monkeypatch) -> None:
    workspace, view = window.workspace, next(iter(window.grid.slice_views.values()))
    workspace.atlas.use(ATLAS)
    for code in ("CA", "CB", "RWA", "RWP", "OS", "LLI"):
        _place(workspace, code)
    _place(workspace, "RWL", shift=2.0)
    workspace.labels.set_active(Active(Side.LEFT, "RWL"))
    wait_until_idle(qtbot, window)  # problems are known a moment before the views are told of them
    assert drawn_ghosts(workspace) != []
    view.grab()
    (ghost,) = view.slice_painter.points.ghosts
    assert (ghost.key, ghost.label) == ("L:RWL", "RWL?")
    assert np.linalg.norm(ghost.mean - (MIDDLE + ATLAS["RWL"])) < 0.5
    named: list[str] = []
    place = slice_painter.place_names
    take = lambda tags, *a, **k: (named.extend(tag.text for tag in tags), place(tags, *a, **k))[1]  # noqa: E731
    monkeypatch.setattr(slice_painter, "place_names", take)
    workspace.view.set_crosshair(MIDDLE + ATLAS["RWA"])
    view.zoom_to(MIDDLE + ATLAS["RWA"], 12.0)
    view.grab()
    assert {"RWL?", "RWA"} <= set(named), "names are placed together, so that none lies on another"
    assert workspace.interaction.begin_drag(Side.LEFT, "RWL")
    assert drawn_ghosts(workspace)[0].mean is ghost.mean, "one sees where to drag it"
    workspace.interaction.end_drag(keep=False)
    workspace.labels.set_active(Active(Side.LEFT, "OS"))
    assert drawn_ghosts(workspace) == [], "a point that is well placed has none"
    workspace.labels.set_active(Active(Side.LEFT, "RWL"))
    workspace.document.do(CheckPoint(Side.LEFT, "RWL", True))
    assert drawn_ghosts(workspace) == [], "nor one that a person found right"


def test_a_slice_that_takes_long_to_read_is_coarse_first_and_whole_as_soon_as_it_is_there(
    window, qtbot, tmp_path, monkeypatch
) -> None:
    view = window.grid.slice_views[Plane.SAGITTAL]
    window.workspace.view.update(outline_visible=False)
    wait_until_idle(qtbot, window)
    wanted = view.grab().toImage()
    monkeypatch.setattr(readers, "MAPPED_FROM", 1)
    monkeypatch.setattr(voxels, "_MOST_AT_ONCE", 1)
    monkeypatch.setattr(voxels, "_GLANCE", 64**3 * 4 / 400)
    volume = read_volume(write_ball(tmp_path / "ball.nrrd"))
    window.workspace.scan.begin(volume)
    window.workspace.view.update(slices_visible=True)
    view.reset()
    coarse = view.grab().toImage()
    assert "Reading a slice of ball" in [task.job.title for task in window.workspace.jobs.running]
    wait_until_idle(qtbot, window)
    assert coarse != wanted
    assert view.grab().toImage() == wanted
    assert all(image.unread is None for image in window.grid.scene_view.scene.slices.images)
