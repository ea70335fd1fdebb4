"""Landmarks give way to an estimate: under it they stand without their names."""

from __future__ import annotations

from gp_labeler.document.edits import PlacePoint
from gp_labeler.document.state import How, Provenance
from gp_labeler.models.workflow import Active
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.drawn import drawn_marks


def test_under_an_estimate_only_the_active_landmark_is_named() -> None:
    workspace = Workspace()
    for n, code in enumerate(("MN", "CL", "OS")):
        workspace.document.do(PlacePoint("L", code, (n, 0, 0), Provenance(How.MESH)))
    workspace.labels.set_active(Active(workspace.labels.active.side, "CL"))
    assert [mark.label for mark in drawn_marks(workspace)] == [
        mark.key[2:] for mark in drawn_marks(workspace)
    ]
    workspace.pose.draw(visible=True)
    assert [mark.label for mark in drawn_marks(workspace) if mark.label] == ["CL"]
    assert len(drawn_marks(workspace)) == 3
    workspace.close(discard=True)
