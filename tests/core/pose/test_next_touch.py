"""What one more touch is said to gain is what it then gains."""

from __future__ import annotations

import numpy as np
import pytest
from atlas_cases import draw_side, draw_specimens, noisy, random_pose

from gp_core import EXTERNAL, PROBE, Atlas, LandmarkSet, Side, estimate_pose, fit_atlas
from gp_core.atlas.sampling import draw_animal
from gp_core.errors import FeatureError, GeometryError
from gp_core.frames import mirror_x
from gp_core.pose.both_ears import compare_ears
from gp_core.pose.next_touch import gains


@pytest.fixture(scope="module")
def published() -> Atlas:
    return Atlas.published()


def _touches(atlas: Atlas, seed: int, n: int, noise: float = 0.1) -> tuple[LandmarkSet, LandmarkSet]:
    """Some touches of a drawn animal, and all of its features touched as well as that."""
    rng = np.random.default_rng(seed)
    animal = draw_side(atlas, rng)
    touched = {code: noisy(animal[code], noise, rng) for code in EXTERNAL}
    codes = rng.choice(EXTERNAL, n, replace=False)
    every = LandmarkSet.from_mapping(touched, "L", frame="tracker")
    return LandmarkSet.from_mapping({str(c): touched[c] for c in codes}, "L", frame="tracker"), every


def test_it_starts_from_the_pose_itself_and_names_every_other_feature(published: Atlas) -> None:
    touches, _ = _touches(published, 0, 6)
    pose = estimate_pose(touches, "L", published)
    found = gains(touches, published)
    assert {gain.code for gain in found} == set(EXTERNAL) - set(touches.placed)
    for gain in found:
        assert gain.radius_95_now == pytest.approx(pose.radius_95)
        assert gain.cone_95_now == pytest.approx(pose.cone_95)
    worth = [gain.worth for gain in found]
    assert worth == sorted(worth, reverse=True)


@pytest.mark.parametrize("side", Side)
def test_with_the_axis_of_both_ears_it_starts_from_the_combined_pose(published: Atlas, side: Side) -> None:
    head = draw_animal(published, rng=np.random.default_rng(8))
    ears = {ear: LandmarkSet.from_touches(head.side(ear).as_mapping(PROBE), ear) for ear in Side}
    own, other = ears[side], ears[side.other]
    alone = estimate_pose(own, side)
    both = compare_ears(own, alone, other, estimate_pose(other, side.other))
    joined, found = both.fused(side), gains(own, published, ears=both)
    assert joined.cone_95 < 0.99 * alone.cone_95
    for gain, single in zip(
        sorted(found, key=lambda gain: gain.code),
        sorted(gains(own, published), key=lambda gain: gain.code),
        strict=True,
    ):
        assert gain.radius_95_now == pytest.approx(joined.radius_95)
        assert gain.cone_95_now == pytest.approx(joined.cone_95)
        assert gain.cone_95 <= 1.001 * single.cone_95


@pytest.mark.parametrize("n", [3, 4, 6, 8, 10])
def test_more_touches_never_promise_a_larger_region(published: Atlas, n: int) -> None:
    for seed in range(12):
        touches = _touches(published, seed, n)[0]
        for gain in gains(touches, published, shared_error=0):
            assert gain.radius_95 <= gain.radius_95_now
            assert gain.cone_95 <= gain.cone_95_now
        for gain in gains(touches, published):  # one more may make it surer that the animal is a large one
            assert gain.radius_95 <= 1.05 * gain.radius_95_now
            assert gain.cone_95 <= 1.05 * gain.cone_95_now


def test_features_that_vary_together_may_do_a_little_harm_at_most(published: Atlas) -> None:
    atlas = fit_atlas(draw_specimens(published, 11, np.random.default_rng(3)))
    for seed in range(12):
        for gain in gains(_touches(atlas, seed, 4)[0], atlas):
            assert gain.radius_95 <= 1.1 * gain.radius_95_now


@pytest.mark.parametrize("n", [3, 5, 7])
def test_the_promise_is_what_the_touch_then_gives(published: Atlas, n: int) -> None:
    promised, given = [], []
    for seed in range(20):
        touches, every = _touches(published, seed, n)
        best = gains(touches, published)[0]
        after = estimate_pose(touches.with_point(best.code, every[best.code]), "L", published)
        promised.append((best.radius_95, best.cone_95))
        given.append((after.plain_radius_95, after.plain_cone_95))  # gains take the touches as named
    np.testing.assert_allclose(np.mean(given, axis=0), np.mean(promised, axis=0), rtol=0.2)
    np.testing.assert_allclose(np.median(np.divide(given, promised), axis=0), 1.0, atol=0.05)


def test_frame_and_side_do_not_matter(published: Atlas) -> None:
    touches, _ = _touches(published, 4, 5)
    moved = touches.moved(random_pose(np.random.default_rng(1), src="tracker"))
    right = LandmarkSet(mirror_x(touches.points), Side.RIGHT, "tracker")
    for other in (moved, right):
        for gain, same in zip(gains(touches, published), gains(other, published), strict=True):
            assert gain.code == same.code
            assert gain.radius_95 == pytest.approx(same.radius_95, rel=1e-4)
            assert gain.cone_95 == pytest.approx(same.cone_95, rel=1e-4)


def test_all_touched_leaves_nothing_to_gain(published: Atlas) -> None:
    assert gains(_touches(published, 0, 11)[0], published) == ()


def test_touches_without_a_pose_are_refused(published: Atlas) -> None:
    with pytest.raises(FeatureError, match="at least three touched features"):
        gains(_touches(published, 0, 2)[0], published)
    line = {"OS": (0, 0, 0), "CL": (7, 0, 0), "MN": (3, 0, 0)}
    with pytest.raises(GeometryError, match="one line"):
        gains(LandmarkSet.from_mapping(line, "L", frame="tracker"), published)
