"""What slices keep between two paints is what the session holds, whatever was done in between."""

from __future__ import annotations

import numpy as np
import pytest
from window_cases import MIDDLE, settle

from gp_core import Atlas, Side
from gp_labeler.document.edits import CheckPoint
from gp_labeler.document.state import How
from gp_labeler.models import labelling
from gp_labeler.models.session import Session
from gp_labeler.models.workflow import Active
from gp_labeler.scene.colours import DARK
from gp_labeler.views import slice_painter
from gp_labeler.views.drawn import drawn_ghosts, drawn_marks, drawn_segments

ATLAS = Atlas.published()


def _place(session: Session, code: str, side: Side = Side.LEFT, shift: float = 0.0) -> None:
    place = MIDDLE + ATLAS[code] + shift
    labelling.place(session, place, How.MESH, side=side, code=code)


def _told(marks, ghosts, lines):
    return (
        [(m.key, m.position.tolist(), m.label, m.state, m.active) for m in marks],
        [(g.key, g.mean.tolist(), g.label, g.active) for g in ghosts],
        [(line.start.tolist(), line.end.tolist()) for line in lines],
    )


ACTS = {
    "place": lambda desk: _place(desk.session, "LLI"),
    "move": lambda desk: _place(desk.session, "RWA", shift=0.5),
    "undo": lambda desk: desk.session.undo(),
    "not seen": lambda desk: labelling.mark_unseen(desk.session, side=Side.LEFT, code="RWA"),
    "other point": lambda desk: desk.session.set_active(Active(Side.LEFT, "RWP")),
    "other side": lambda desk: desk.session.set_active(Active(Side.RIGHT, "CA")),
    "ghost": lambda desk: desk.session.set_active(Active(Side.LEFT, "LLI")),
    "ghosts off": lambda desk: desk.session.view.update(ghosts_visible=False),
    "axis off": lambda desk: desk.session.view.update(axis_visible=False),
    "estimate": lambda desk: desk.pose.draw(visible=True),
    "drag": lambda desk: (desk.begin_drag(Side.LEFT, "RWA"), desk.drag_to(MIDDLE + 0.3, How.SLICE)),
    "another": lambda desk: desk.begin(),
}


@pytest.mark.parametrize("act", ACTS)
def test_what_is_painted_follows(window, act) -> None:
    desk, slices = window.workbench, window.grid.slice_views.values()
    desk.use_atlas(ATLAS)
    for code in ("CA", "CB", "RWA", "RWP"):
        _place(desk.session, code)
    desk.session.set_active(Active(Side.LEFT, "OS" if act == "ghosts off" else "RWA"))
    before = []
    for view in slices:
        view.grab()
        before.append(view._painter._points)
        assert len(before[-1].marks) == 5, "the four, and CO"
    ACTS[act](desk)
    wanted = _told(drawn_marks(desk), drawn_ghosts(desk), drawn_segments(desk, DARK))
    marks, _, ghosts, lines = before[0]
    assert wanted != _told(marks, ghosts, lines), "the act shows, else this says nothing"
    for view in slices:
        view.grab()
        kept = view._painter._points
        if kept is None:
            assert view.source is None
            continue
        assert _told(kept.marks, kept.ghosts, kept.lines) == wanted
        np.testing.assert_array_equal(kept.positions, [mark.position for mark in kept.marks])


def test_a_doubted_point_shows_where_it_should_be(window, qtbot, monkeypatch) -> None:
    desk, view = window.workbench, next(iter(window.grid.slice_views.values()))
    desk.use_atlas(ATLAS)
    for code in ("CA", "CB", "RWA", "RWP", "OS", "LLI"):
        _place(desk.session, code)
    _place(desk.session, "RWL", shift=2.0)
    desk.session.set_active(Active(Side.LEFT, "RWL"))
    settle(qtbot, window)  # doubts are known a moment before the views are told of them
    assert drawn_ghosts(desk) != []
    view.grab()
    (ghost,) = view._painter._points.ghosts
    assert (ghost.key, ghost.label) == ("L:RWL", "RWL?")
    assert np.linalg.norm(ghost.mean - (MIDDLE + ATLAS["RWL"])) < 0.5
    named: list[str] = []
    take = lambda _, names, *__: named.extend(name.text for name in names)  # noqa: E731
    monkeypatch.setattr(slice_painter, "_draw_names", take)
    desk.session.set_crosshair(MIDDLE + ATLAS["RWA"])
    view.zoom_to(MIDDLE + ATLAS["RWA"], 12.0)
    view.grab()
    assert {"RWL?", "RWA"} <= set(named), "names are placed together, so that none lies on another"
    assert desk.begin_drag(Side.LEFT, "RWL")
    assert drawn_ghosts(desk)[0].mean is ghost.mean, "one sees where to drag it"
    desk.end_drag(keep=False)
    desk.session.set_active(Active(Side.LEFT, "OS"))
    assert drawn_ghosts(desk) == [], "a point that is well placed has none"
    desk.session.set_active(Active(Side.LEFT, "RWL"))
    desk.session.do(CheckPoint(Side.LEFT, "RWL", True))
    assert drawn_ghosts(desk) == [], "nor one that a person found right"
