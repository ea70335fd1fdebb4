"""Features that are touched more than once: their mean is used, their spread is kept, an outlier is named."""

from __future__ import annotations

import numpy as np
import pytest

from gp_core import PROBE, Atlas, GpError, estimate_pose
from gp_core.landmarks.repeats import combine_repeats

ATLAS = Atlas.published()
ANIMAL = {code: ATLAS[code] for code in PROBE}


def _touched(n: int, noise: float, rng: np.random.Generator) -> dict[str, np.ndarray]:
    return {code: point + noise * rng.normal(size=(n, 3)) for code, point in ANIMAL.items()}


def test_repeats_are_estimated_by_their_means() -> None:
    touches = _touched(3, 0.2, np.random.default_rng(0))
    pose = estimate_pose(touches, "L", ATLAS)
    means = {code: points.mean(axis=0) for code, points in touches.items()}
    np.testing.assert_allclose(pose.transform, estimate_pose(means, "L", ATLAS).transform, atol=1e-12)
    assert set(pose.repeats) == set(PROBE)
    one = pose.repeats["CL"]
    np.testing.assert_array_equal(one.points, touches["CL"])
    assert one.spread_mm == pytest.approx(np.sqrt(((one.points - one.mean) ** 2).sum(axis=1).mean()))
    assert pose.as_dict()["repeated_touches"]["CL"]["spread_mm"] == one.spread_mm


def test_touching_three_and_five_times_sharpens_the_pose() -> None:
    rng = np.random.default_rng(1)
    off = [
        [np.linalg.norm(estimate_pose(_touched(n, 0.4, rng), "L", ATLAS).origin) for _ in range(60)]
        for n in (1, 3, 5)
    ]
    once, thrice, five = np.mean(off, axis=1)
    assert thrice < 0.75 * once
    assert five < 0.65 * once


def test_an_outlier_among_repeats_is_named_and_left_out() -> None:
    touches = _touched(3, 0.1, np.random.default_rng(2))
    wrong = {**touches, "MN": touches["MN"] + np.array([[0, 0, 0], [2.5, 0, 0], [0, 0, 0]])}
    pose = estimate_pose(wrong, "L", ATLAS)
    assert pose.repeats["MN"].outliers == (2,)
    assert any(w.startswith("touch 2 of 3 of MN lies 2.") for w in pose.warnings)
    assert all(not pose.repeats[code].outliers for code in PROBE if code != "MN")
    assert not any("of the others" in w for w in estimate_pose(touches, "L", ATLAS).warnings)


def test_ordinary_repeats_hardly_ever_hold_an_outlier() -> None:
    rng = np.random.default_rng(3)
    found = [
        one.outliers
        for noise in (0.05, 0.2, 0.4)
        for n in (2, 3, 5)
        for _ in range(100)
        for one in combine_repeats(_touched(n, noise, rng)).values()
    ]
    assert sum(map(bool, found)) < 0.01 * len(found)


def test_of_two_touches_that_differ_both_are_used() -> None:
    (one,) = combine_repeats({"CL": [[0, 0, 0], [4, 0, 0]], "MN": [1, 2, 3]}).values()
    assert one.outliers == ()
    assert one.mean.tolist() == [2, 0, 0]
    assert one.spread_mm == 2


@pytest.mark.parametrize("points", [np.empty((0, 3)), [[1, 2]], [[1, 2, np.nan]], [[1, 2, 3], [1, 2]]])
def test_repeats_that_are_no_positions_are_refused(points: object) -> None:
    with pytest.raises(GpError, match=r"^CL: |CL"):
        estimate_pose({**ANIMAL, "CL": points}, "L", ATLAS)  # type: ignore[dict-item]
