"""Features that are touched more than once: their mean is used, their spread is kept, an outlier is named."""

from __future__ import annotations

import numpy as np
import pytest

from gp_core import PROBE, Atlas, GpError, LandmarkSet, RigidTransform, estimate_pose, read_as
from gp_core.landmarks.repeats import combine_repeats

ATLAS = Atlas.published()
ANIMAL = {code: ATLAS[code] for code in PROBE}


def _touched(n: int, noise: float, rng: np.random.Generator) -> dict[str, np.ndarray]:
    return {code: point + noise * rng.normal(size=(n, 3)) for code, point in ANIMAL.items()}


def test_the_mean_of_n_touches_has_the_error_of_one_over_root_n() -> None:
    touches = _touched(4, 0.2, np.random.default_rng(0))
    pose = estimate_pose(touches, "L", ATLAS, probe_noise=0.2)
    means = {code: points.mean(axis=0) for code, points in touches.items()}
    alone = estimate_pose(means, "L", ATLAS, probe_noise=0.1)
    np.testing.assert_allclose(pose.transform, alone.transform, atol=1e-12)
    np.testing.assert_allclose(pose.residuals["MN"], alone.residuals["MN"], atol=1e-12)


def test_all_touches_are_kept_with_their_spread() -> None:
    touches = _touched(3, 0.2, np.random.default_rng(0))
    pose = estimate_pose(touches, "L", ATLAS)
    assert set(pose.repeats) == set(PROBE)
    one = pose.repeats["CL"]
    np.testing.assert_array_equal(one.points, touches["CL"])
    assert one.spread_mm == pytest.approx(np.sqrt(((one.points - one.mean) ** 2).sum(axis=1).mean()))
    assert pose.as_dict()["repeated_touches"]["CL"]["spread_mm"] == one.spread_mm


def test_a_feature_touched_more_often_weighs_more() -> None:
    rng = np.random.default_rng(4)
    weighted, plain = [], []
    for _ in range(60):
        touches: dict[str, np.ndarray] = {code: _touched(1, 0.4, rng)[code][0] for code in PROBE}
        touches |= {code: ANIMAL[code] + 0.4 * rng.normal(size=(8, 3)) for code in ("CL", "OS", "RWP")}
        means = {code: np.atleast_2d(points).mean(axis=0) for code, points in touches.items()}
        weighted.append(np.linalg.norm(estimate_pose(touches, "L", ATLAS).origin))
        plain.append(np.linalg.norm(estimate_pose(means, "L", ATLAS).origin))
    assert np.mean(weighted) < 0.97 * np.mean(plain)


def test_the_shared_error_does_not_shrink_with_repeats() -> None:
    rng = np.random.default_rng(5)
    pose = estimate_pose(_touched(50, 0.2, rng), "L", ATLAS, shared_error=1.0)
    alone = np.sqrt(7.814727903251179 / 3)  # chi-squared, 3 degrees of freedom, 95 %
    assert alone < pose.radius_95 < 1.3 * alone


def test_the_spread_of_repeats_bounds_the_noise_from_below() -> None:
    rng = np.random.default_rng(6)
    offsets = 0.8 * rng.normal(size=(6, 5, 3))
    offsets -= offsets.mean(axis=1, keepdims=True)  # the means fit exactly: only the repeats show the noise
    rough = {code: ANIMAL[code] + off for code, off in zip(PROBE, offsets, strict=True)}
    exact = {code: ANIMAL[code] + 0.01 * off for code, off in zip(PROBE, offsets, strict=True)}
    wide, narrow = (estimate_pose(touches, "L", ATLAS).plain_radius_95 for touches in (rough, exact))
    assert wide > 1.2 * narrow


def test_repeats_keep_their_weight_under_another_name() -> None:
    touches = _touched(3, 0.05, np.random.default_rng(7))
    exchanged = {**touches, "CL": touches["OS"], "OS": touches["CL"][:1]}
    landmarks = LandmarkSet.from_touches(exchanged, "L")
    pose = estimate_pose(landmarks, "L", ATLAS)
    assert pose.likelier_hypothesis is not None
    renamed = read_as(landmarks, pose.likelier_hypothesis)
    assert len(renamed.repeats["OS"].points) == 3
    assert "CL" not in renamed.repeats
    moved = landmarks.moved(RigidTransform(np.diag([-1.0, -1, 1, 1]), "scan", "tracker"))
    assert moved.repeats.keys() == landmarks.repeats.keys()
    assert not landmarks.with_point("CL", (1, 2, 3)).repeats.keys() & {"CL"}


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
    assert pose.repeats["MN"].spread_mm < 0.5, "of those that are used"
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
