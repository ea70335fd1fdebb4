"""Planes along an ear contain what they are named after, and show it as a person would look at it."""

from __future__ import annotations

import numpy as np
import pytest
from document_cases import head_frame
from panel_cases import in_scan, place, workspace_with_scan

from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_labeler.document.head_edits import SetHeadFrame
from gp_labeler.models.anatomical_planes import ANATOMICAL_PLANES

EAR = ("CA", "CB", "RWA", "RWP", "RWL", "RWM", "FPA", "FPP")


@pytest.fixture(params=[Side.LEFT, Side.RIGHT])
def ear(request):
    workspace = workspace_with_scan()
    place(workspace, *EAR, side=request.param)
    workspace.labels.go_to(request.param, "CA")
    yield workspace
    workspace.close(discard=True)


def shown(workspace, title: str):
    names = [n for n in workspace.view.planes if workspace.view.title(n) == title]
    assert len(names) == 1, title
    return workspace.view.planes[names[0]]


def off(workspace, plane, *codes: str) -> np.ndarray:
    side = workspace.labels.active.side
    points = np.array([in_scan(code, side) for code in codes])
    return plane.depth(points) - plane.position_of(workspace.view.crosshair)


@pytest.mark.parametrize("kind", ["along", "across"])
def test_the_axis_lies_in_the_planes_along_it_and_pierces_the_one_across(ear, kind) -> None:
    ear.planes.show(kind)
    along, across = shown(ear, "Along the axis"), shown(ear, "Across the axis")
    middle = (in_scan("RWA", ear.labels.active.side) + in_scan("RWP", ear.labels.active.side)) / 2
    assert off(ear, along, "CA", "CB") == pytest.approx(0, abs=1e-9)
    assert along.position_of(middle) == pytest.approx(along.position_of(ear.view.crosshair), abs=1e-9)
    assert off(ear, shown(ear, "Along the axis, beside it"), "CA", "CB") == pytest.approx(0, abs=1e-9)
    side = ear.labels.active.side
    axis = in_scan("CA", side) - in_scan("CB", side)
    assert abs(across.normal @ axis) == pytest.approx(np.linalg.norm(axis))
    assert along.down @ axis == pytest.approx(-np.linalg.norm(axis))  # the apex is up
    np.testing.assert_allclose(ear.view.crosshair, ear.document.landmarks(side)["CO"], atol=1e-9)


def test_round_window_and_footplate_lie_in_their_planes(ear) -> None:
    ear.planes.show("round window")
    assert off(ear, shown(ear, "Round window"), "RWA", "RWP") == pytest.approx(0, abs=1e-9)
    assert np.abs(off(ear, shown(ear, "Round window"), "RWL", "RWM")).max() < 0.3
    ear.planes.show("footplate")
    assert off(ear, shown(ear, "Through the footplate"), "FPA", "FPP") == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("kind", ANATOMICAL_PLANES)
@pytest.mark.parametrize("layout", ["four-up", "sagittal"])
def test_the_three_planes_are_at_right_angles_and_never_mirrored(ear, kind, layout) -> None:
    ear.document.do(SetHeadFrame(head_frame()))
    ear.view.update(layout=layout)
    ear.planes.show(kind)
    normals = np.stack([plane.normal for plane in ear.view.planes.values()])
    assert np.abs(normals @ normals.T - np.eye(3)).max() < 1e-9
    for name, plane in ear.view.planes.items():
        straight = ear.view.frame.plane(name)
        assert plane.towards_viewer @ straight.towards_viewer >= -1e-9  # seen from the same side
        assert plane.position_of(ear.view.crosshair) == pytest.approx(0.0)
    if layout == "sagittal":
        wanted = {"along": "Along the axis", "across": "Across the axis", "round window": "Round window"}
        assert ear.view.title("sagittal") == wanted.get(kind, "Through the footplate")
    with pytest.raises(GpError, match="planes of an ear"):
        ear.head.take_planes()
    ear.planes.straighten()
    assert not ear.view.planes_are_turned
    assert ear.view.frame.name == "head"
    ear.head.take_planes()


def test_what_is_only_expected_will_do_and_too_little_is_said() -> None:
    workspace = workspace_with_scan()
    with pytest.raises(GpError, match=r"modiolar axis of the left side.*CA and CB, or three"):
        workspace.planes.show("along")
    assert not workspace.planes.can_show("footplate")
    place(workspace, "OS", "LLI", "MN")
    expected = workspace.labels.ghosts(Side.LEFT)
    assert workspace.planes.can_show("footplate")
    workspace.planes.show("along")
    along = shown(workspace, "Along the axis")
    for code in ("CA", "CB"):
        away = along.position_of(expected[code].position) - along.position_of(workspace.view.crosshair)
        assert away == pytest.approx(0, abs=1e-9)
    workspace.close(discard=True)


def test_each_feature_offers_the_plane_that_defines_it(ear) -> None:
    assert ear.planes.show_for("CA") is not None
    assert shown(ear, "Along the axis")
    assert ear.planes.show_for("RWL") is not None
    assert shown(ear, "Round window")
    assert ear.planes.show_for("ZL") is None
    assert not ear.view.planes_are_turned
