"""The shared error: what it adds to a region, and that without it the region is that of before."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from atlas_cases import draw_side, errors, noisy, random_pose

from gp_core import EXTERNAL, PROBE, Atlas, GpError, estimate_pose, gains
from gp_core.landmarks.sets import LandmarkSet

ATLAS = Atlas.published()


def _touches(seed: int, noise: float = 0.1, codes: tuple[str, ...] = PROBE) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    animal = draw_side(ATLAS, rng).moved(random_pose(rng))
    return {code: noisy(p, noise, rng) for code, p in animal.as_mapping(codes).items()}


@pytest.mark.parametrize(
    ("codes", "noise", "radius", "cone"),
    [
        (PROBE, 0.0, 0.4311580495727929, 0.1608386461914804),
        (PROBE, 0.1, 0.5075228570400871, 0.18365106328878225),
        (PROBE, 0.4, 0.9546865803441917, 0.274379199424424),
        (EXTERNAL, 0.0, 0.3924552857580192, 0.11931847119704178),
        (EXTERNAL, 0.1, 0.4564031129551455, 0.12879140363419264),
        (EXTERNAL, 0.4, 0.6833920958487296, 0.13535230008505714),
        (("CL", "MN", "OS"), 0.0, 0.7020536295234644, 0.21118203519709347),
        (("CL", "MN", "OS"), 0.1, 0.7005104049081977, 0.20937258721556076),
        (("CL", "MN", "OS"), 0.4, 0.7271195389368962, 0.2077601994822958),
    ],
)
def test_without_one_the_region_is_that_of_before(
    codes: tuple[str, ...], noise: float, radius: float, cone: float
) -> None:
    """Numbers of the commit before there was a shared error."""
    pose = estimate_pose(_touches(7, noise, codes), "L", ATLAS, shared_error=0)
    assert (pose.plain_radius_95, pose.plain_cone_95) == pytest.approx((radius, cone), rel=1e-6)


def test_it_moves_nothing_and_widens_the_region() -> None:
    touches = _touches(0)
    poses = [estimate_pose(touches, "L", ATLAS, shared_error=mm) for mm in (0, 0.2, 0.5, 1.0)]
    for pose in poses:
        np.testing.assert_array_equal(pose.transform, poses[0].transform)
    assert [pose.shared_error for pose in poses] == [0, 0.2, 0.5, 1.0]
    assert estimate_pose(touches, "L", ATLAS).shared_error == 0.2
    radii = [pose.radius_95 for pose in poses]
    assert radii == sorted(radii)
    assert radii[1] < 1.3 * radii[0]
    for small, large in pairwise(poses):
        grown = large.covariance - small.covariance
        assert np.linalg.eigvalsh(grown).min() > -1e-12


def test_an_offset_common_to_all_touches_is_covered_where_it_is_given() -> None:
    held = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        animal = draw_side(ATLAS, rng).moved(random_pose(rng))
        step = rng.normal(size=3)
        offset = 0.5 * step / np.linalg.norm(step)
        touches = {code: noisy(p, 0.1, rng) + offset for code, p in animal.as_mapping(PROBE).items()}
        bare, told = (estimate_pose(touches, "L", ATLAS, shared_error=mm) for mm in (0.0, 0.5))
        distance = errors(told, animal)[0]
        held.append((distance <= bare.radius_95, distance <= told.radius_95))
    bare_share, told_share = np.mean(held, axis=0)
    assert bare_share < 0.6
    assert told_share >= 0.9


@pytest.mark.parametrize("factor", [0.85, 1.15])
@pytest.mark.parametrize("codes", [PROBE, EXTERNAL])
def test_animals_of_another_size_are_held(factor: float, codes: tuple[str, ...]) -> None:
    held = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        animal = draw_side(ATLAS, rng)
        animal = replace(animal, points=factor * animal.points).moved(random_pose(rng))
        touches = {code: noisy(p, 0.1, rng) for code, p in animal.as_mapping(codes).items()}
        pose = estimate_pose(touches, "L", ATLAS)
        distance, angle = errors(pose, animal)
        held.append((distance <= pose.radius_95, angle <= pose.cone_95))
    assert (np.mean(held, axis=0) >= 0.88).all()


def test_touches_that_wander_with_time_widen_the_region_where_they_carry_times() -> None:
    rng = np.random.default_rng(3)
    animal = draw_side(ATLAS, rng)
    codes = tuple(rng.permutation(EXTERNAL))
    times = {code: 10.0 * i for i, code in enumerate(codes)}
    wandering = {code: animal[code] + [0, 0, 0.2 * i] for i, code in enumerate(codes)}
    timed = estimate_pose(wandering, "L", ATLAS, shared_error=2.0, times=times)
    untimed = estimate_pose(wandering, "L", ATLAS, shared_error=2.0)
    assert timed.plain_cone_95 > untimed.plain_cone_95
    some = {code: t for code, t in times.items() if code != "OS"}
    assert estimate_pose(wandering, "L", ATLAS, shared_error=2.0, times=some).cone_95 == untimed.cone_95


@pytest.mark.parametrize("value", [-0.1, np.nan, np.inf, 25.0])
def test_a_shared_error_that_cannot_be_is_refused(value: float) -> None:
    with pytest.raises(GpError, match="shared error must be from 0 to 20 mm"):
        estimate_pose(_touches(0), "L", ATLAS, shared_error=value)


def test_times_must_be_numbers() -> None:
    with pytest.raises(GpError, match="times of touches must be numbers"):
        estimate_pose(_touches(0), "L", ATLAS, times=dict.fromkeys(PROBE, np.nan))


def test_the_next_touch_is_weighed_with_the_same_shared_error() -> None:
    touches = LandmarkSet.from_mapping(_touches(0), "L", frame="tracker")
    for mm in (0.0, 0.5):
        pose = estimate_pose(touches, "L", ATLAS, shared_error=mm)
        assert gains(touches, ATLAS, shared_error=mm)[0].radius_95_now == pytest.approx(pose.plain_radius_95)


def test_a_drift_is_estimated_where_touches_carry_times() -> None:
    rng = np.random.default_rng(3)
    animal = draw_side(ATLAS, rng)
    codes = tuple(rng.permutation(EXTERNAL))
    times = {code: 10.0 * i for i, code in enumerate(codes)}
    wandering = {code: animal[code] + [0, 0, 0.2 * i] for i, code in enumerate(codes)}
    (told,) = (w for w in estimate_pose(wandering, "L", ATLAS, times=times).warnings if "drift" in w)
    assert 1.0 < float(told.split("drift by ")[1].split()[0]) < 3.0
    assert not any("drift" in w for w in estimate_pose(wandering, "L", ATLAS).warnings)
    still = estimate_pose(animal.as_mapping(codes), "L", ATLAS, times=times)
    assert not any("drift" in w for w in still.warnings)
