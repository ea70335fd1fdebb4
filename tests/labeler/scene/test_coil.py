"""The coil has a guinea pig's turns, is mirrored on the right, and is cut where its curve crosses a slice."""

from __future__ import annotations

import numpy as np
import pytest
from pose_cases import pose

from gp_core import Atlas, Side
from gp_labeler.imaging.mean_cochlea import BASE_MM, COIL, cochlea_tubes, duct_curve
from gp_labeler.imaging.slice_plane import SlicePlane
from gp_labeler.scene.coil import section


def test_it_winds_three_and_a_half_times_about_the_axis_and_narrows() -> None:
    line, radii = duct_curve(Side.LEFT)
    wound = line[1:-1]
    angle = np.unwrap(np.arctan2(-wound[:, 2], wound[:, 1]))
    assert 3.4 < (angle[-1] - angle[0]) / (2 * np.pi) < 3.7
    assert (np.diff(angle) > 0).all()  # on the left from the round window downwards, about +x
    assert (np.diff(radii) <= 0).all()
    rho = np.linalg.norm(wound[:, 1:], axis=1)
    assert rho[0] > 3 * rho[-1]


def test_proportions_are_those_of_the_published_atlas() -> None:
    atlas = Atlas.published()
    np.testing.assert_allclose(COIL.length, np.linalg.norm(atlas["CA"] - atlas["CB"]), atol=0.02)
    np.testing.assert_allclose(BASE_MM, atlas["CB"][0], atol=0.02)
    for code, (height, radius) in (("CC", COIL.cc), ("CL", COIL.cl)):
        np.testing.assert_allclose(height + BASE_MM, atlas[code][0], atol=0.02)
        np.testing.assert_allclose(radius, np.linalg.norm(atlas[code][1:]), atol=0.02)


def test_a_right_ear_is_the_mirror_image() -> None:
    for left, right in zip(duct_curve(Side.LEFT), duct_curve(Side.RIGHT), strict=True):
        mirrored = left * [1, 1, -1] if left.ndim == 2 else left
        np.testing.assert_allclose(right, mirrored)


@pytest.mark.parametrize("side", list(Side))
def test_tubes_are_closed_and_face_outward(side) -> None:
    for tube in cochlea_tubes(side):
        triangles = tube.regular_faces
        corners = tube.points[triangles].astype(float)
        volume = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
        assert volume > 1.0
        edges = np.sort(np.concatenate([triangles[:, k] for k in ([0, 1], [1, 2], [2, 0])]), axis=1)
        assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()


@pytest.mark.parametrize("side", list(Side))
@pytest.mark.parametrize("axis", range(3))
def test_a_slice_cuts_the_duct_where_its_curve_crosses(side, axis) -> None:
    drawn = pose(side=side)
    line, radii = duct_curve(side)
    scan = drawn.at(line)
    position = float(scan[:, axis].mean()) + 0.013
    loops = section(cochlea_tubes(side)[0], drawn, _across(axis), position)
    before, after = scan[:-1, axis] - position, scan[1:, axis] - position
    crossings = np.flatnonzero(before * after < 0)
    assert len(loops) > 1
    assert len(crossings)
    for n in crossings:
        share = before[n] / (before[n] - after[n])
        there = (1 - share) * scan[n] + share * scan[n + 1]
        assert any(_is_inside(np.delete(there, axis), np.delete(loop, axis, axis=1)) for loop in loops)
    for loop in loops:
        np.testing.assert_allclose(loop[:, axis], position, atol=1e-9)
        away = np.linalg.norm(loop[:, None] - scan, axis=2)
        nearest = away.argmin(axis=1)
        on_wall = np.abs(away.min(axis=1) - radii[nearest])[(nearest > 4) & (nearest < len(line) - 5)]
        assert (on_wall < 0.06).all()


def test_a_slice_beside_it_cuts_nothing() -> None:
    assert section(cochlea_tubes(Side.LEFT)[0], pose(), _across(1), 100.0) == []


def _across(axis: int) -> SlicePlane:
    right, down = (n for n in range(3) if n != axis)
    return SlicePlane(*np.eye(3)[[right, down, axis]])


def _is_inside(point: np.ndarray, loop: np.ndarray) -> bool:
    turn = np.arctan2(*(loop - point).T)
    winding = np.angle(np.exp(1j * np.diff(np.append(turn, turn[0]))))
    return bool(abs(winding.sum()) > np.pi)
