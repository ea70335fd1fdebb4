from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gp_core import LandmarkSet, Specimen
from gp_core.errors import FeatureError, GeometryError
from gp_core.frames import RigidTransform, mirror_x
from gp_core.landmarks.anatomy import (
    cochlea_frame,
    cochlea_origin,
    modiolar_axis,
    round_window_frame,
    with_cochlea_origin,
)

_POINTS = {"CA": (5, 1, 0), "CB": (1, 1, 0.5), "RWA": (2, 4, 1), "RWP": (1, 4, 0), "LLI": (2, 5, 1.5)}


def _landmarks(side: str = "L") -> LandmarkSet:
    return LandmarkSet.from_mapping(_POINTS, side)


def _mirrored(landmarks: LandmarkSet) -> LandmarkSet:
    return LandmarkSet(mirror_x(landmarks.points), landmarks.side.other, landmarks.frame)


def test_origin_lies_on_the_axis_nearest_to_the_round_window() -> None:
    ca, cb, rwa, rwp = (np.array(_POINTS[c], dtype=float) for c in ("CA", "CB", "RWA", "RWP"))
    origin = cochlea_origin(ca, cb, rwa, rwp)
    axis = modiolar_axis(ca, cb)
    assert (origin - (rwa + rwp) / 2) @ axis == pytest.approx(0, abs=1e-12)
    np.testing.assert_allclose(np.cross(origin - cb, axis), 0, atol=1e-12)


def test_real_origins_are_met(real_specimens: list[Specimen]) -> None:
    for specimen in real_specimens:
        for landmarks in specimen.sides.values():
            np.testing.assert_allclose(with_cochlea_origin(landmarks)["CO"], landmarks["CO"], atol=1e-12)
            T = cochlea_frame(landmarks)
            np.testing.assert_allclose(T.matrix, np.eye(4), atol=1e-9)


def test_frames_move_with_the_head() -> None:
    rotation = Rotation.random(random_state=4).as_matrix()
    T_tracker_scan = RigidTransform.from_parts(rotation, (3, -2, 1), dst="tracker", src="scan")
    for frame in (cochlea_frame, round_window_frame):
        still, moved = frame(_landmarks()), frame(_landmarks().moved(T_tracker_scan))
        np.testing.assert_allclose((T_tracker_scan @ still).matrix, moved.matrix, atol=1e-12)


@pytest.mark.parametrize("frame", [cochlea_frame, round_window_frame])
def test_the_two_sides_are_mirror_images_in_x(frame: object) -> None:
    left, right = _landmarks("L"), _mirrored(_landmarks("L"))
    in_left = frame(left).inverse().apply(left.points)  # type: ignore[operator]
    in_right = frame(right).inverse().apply(right.points)  # type: ignore[operator]
    np.testing.assert_allclose(mirror_x(in_right), in_left, atol=1e-12)


def test_the_round_window_frame_moves_away_from_the_incus() -> None:
    T_scan_window = round_window_frame(_landmarks())
    incus = T_scan_window.inverse().apply([_POINTS["LLI"]])[0]
    window = T_scan_window.inverse().apply([_POINTS["RWA"], _POINTS["RWP"]])
    assert incus[0] == pytest.approx(0, abs=1e-12)
    assert incus[1] == pytest.approx(2 * window[0, 1])
    np.testing.assert_allclose(window[:, 2], 0, atol=1e-12)


def test_without_its_four_points_there_is_no_origin() -> None:
    landmarks = with_cochlea_origin(_landmarks())
    assert "CO" in landmarks
    assert "CO" not in with_cochlea_origin(landmarks.with_point("RWA", None))
    with pytest.raises(FeatureError, match="has no RWA"):
        cochlea_frame(landmarks.with_point("RWA", None))


def test_degenerate_points_are_refused() -> None:
    with pytest.raises(GeometryError, match="CA and CB are at the same place"):
        cochlea_frame(_landmarks().with_point("CA", _POINTS["CB"]))
    with pytest.raises(GeometryError, match="RWA and RWP are at the same place"):
        round_window_frame(_landmarks().with_point("RWA", _POINTS["RWP"]))
    with pytest.raises(GeometryError, match="lie on one line"):
        round_window_frame(_landmarks().with_point("LLI", (3, 4, 2)))
