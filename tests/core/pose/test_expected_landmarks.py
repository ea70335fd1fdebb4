"""The atlas's features by an estimate: on the touches, on the cochlea, and alike on both sides."""

from __future__ import annotations

import numpy as np
import pytest
from atlas_cases import draw_specimens, random_pose

from gp_core import PROBE, Atlas, Side, estimate_pose
from gp_core.frames import mirror_x
from gp_core.landmarks.anatomy import cochlea_origin
from gp_core.pose.expected_landmarks import expected_features

DEFINING = ("CA", "CB", "RWA", "RWP")


@pytest.mark.parametrize("side", list(Side))
def test_a_touch_is_as_far_from_its_feature_as_its_residual_says(side):
    atlas, rng = Atlas.published(), np.random.default_rng(3)
    touches = draw_specimens(atlas, 1, rng)[0].side(side).as_mapping(PROBE)
    pose = estimate_pose(touches, side, atlas)
    expected = expected_features(pose, atlas)
    for code, residual in pose.residuals.items():
        assert np.linalg.norm(touches[code] - expected[code]) == pytest.approx(residual, abs=1e-9)


@pytest.mark.parametrize("side", list(Side))
def test_the_mean_animal_is_met_by_both_methods(side):
    atlas, rng = Atlas.published(), np.random.default_rng(3)
    points = atlas.mean if side is Side.LEFT else mirror_x(atlas.mean)
    true = dict(zip(atlas.codes, random_pose(rng).apply(points), strict=True))
    animals = draw_specimens(atlas, 4, rng)
    for method in ("robust", "jrmpc"):
        touches = {code: true[code] for code in PROBE}
        pose = estimate_pose(touches, side, atlas, method=method, specimens=animals)
        expected = expected_features(pose, atlas)
        co = cochlea_origin(*(expected[code] for code in DEFINING))
        np.testing.assert_allclose(co, pose.origin, atol=0.2 if method == "jrmpc" else 1e-6)
        if method == "robust":
            np.testing.assert_allclose(list(expected.values()), list(true.values()), atol=1e-6)
        else:
            np.testing.assert_allclose(co, pose.origin, atol=1e-9)
            axis = expected["CA"] - expected["CB"]
            np.testing.assert_allclose(axis / np.linalg.norm(axis), pose.axis, atol=1e-9)
            shape = [expected[a] - expected[b] for a in atlas.codes for b in atlas.codes]
            truth = [true[a] - true[b] for a in atlas.codes for b in atlas.codes]
            np.testing.assert_allclose(
                np.linalg.norm(shape, axis=1), np.linalg.norm(truth, axis=1), atol=1e-9
            )
            assert np.linalg.norm(expected["MN"] - true["MN"]) < 3.0, "not its mirror image"
