from __future__ import annotations

import numpy as np
import pytest

from gp_core.errors import FeatureError, FrameError, GpError
from gp_core.frames import RigidTransform
from gp_core.landmarks.features import Side
from gp_core.landmarks.sets import LandmarkSet, Specimen, Status


def test_points_are_addressed_by_name() -> None:
    landmarks = LandmarkSet.from_mapping({"RWA": (1, 2, 3), "CA": (4, 5, 6)}, "L")
    assert landmarks.placed == ("CA", "RWA")
    np.testing.assert_array_equal(landmarks.array(("RWA", "CA")), [(1, 2, 3), (4, 5, 6)])
    assert "RWA" in landmarks
    assert "RWP" not in landmarks


def test_a_set_is_gone_through_like_a_mapping() -> None:
    points = {"LLI": np.array([1.0, 2.0, 3.0]), "CA": np.array([4.0, 5.0, 6.0])}
    landmarks = LandmarkSet.from_mapping(points, "L")
    assert list(landmarks) == ["CA", "LLI"]
    again = dict(landmarks)
    assert again.keys() == points.keys()
    np.testing.assert_array_equal([again[code] for code in points], list(points.values()))


def test_a_missing_point_is_named() -> None:
    with pytest.raises(FeatureError, match="landmark RWP: the left side has no RWP"):
        LandmarkSet.empty("L").array(["RWP"])


def test_sets_never_change_in_place() -> None:
    before = LandmarkSet.empty("R")
    after = before.with_point("OS", (1, 2, 3))
    assert before.placed == ()
    assert after.placed == ("OS",)
    with pytest.raises(ValueError, match="read-only"):
        after.points[0] = 1.0


def test_status_follows_what_is_done() -> None:
    landmarks = LandmarkSet.empty("L").with_unseen("RWM")
    assert landmarks.status("RWM") is Status.UNSEEN
    assert landmarks.status("RWA") is Status.TO_DO
    assert landmarks.with_point("RWM", (0, 0, 0)).status("RWM") is Status.PLACED
    assert landmarks.with_point("RWM", (0, 0, 0)).with_point("RWM", None).status("RWM") is Status.TO_DO


@pytest.mark.parametrize("position", [(1, 2), (1, 2, np.nan), (1, 2, np.inf), "abc", None, (1, 2, "x")])
def test_a_position_must_be_three_finite_numbers(position: object) -> None:
    with pytest.raises(GpError, match="landmark OS: position must be three finite numbers"):
        LandmarkSet.from_mapping({"OS": position}, "L")  # type: ignore[dict-item]


def test_moving_needs_the_right_frame() -> None:
    T_scan_tracker = RigidTransform.from_parts(np.eye(3), (1, 0, 0), dst="scan", src="tracker")
    touched = LandmarkSet.from_mapping({"OS": (0, 0, 0)}, "L", frame="tracker")
    assert touched.moved(T_scan_tracker).frame == "scan"
    np.testing.assert_array_equal(touched.moved(T_scan_tracker)["OS"], (1, 0, 0))
    with pytest.raises(FrameError, match="cannot move points of frame 'scan'"):
        touched.moved(T_scan_tracker).moved(T_scan_tracker)


def test_a_specimen_keeps_its_sides_apart() -> None:
    left = LandmarkSet.empty("L")
    assert Specimen("GP01", {Side.LEFT: left}).side("left") is left
    with pytest.raises(FeatureError, match="specimen GP01: the right side is not labelled"):
        Specimen("GP01", {Side.LEFT: left}).side("R")
    with pytest.raises(GpError, match="holds left landmarks"):
        Specimen("GP01", {Side.RIGHT: left})
