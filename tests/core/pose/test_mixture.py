"""The region around one pose that covers several hypotheses on the touches."""

from __future__ import annotations

import numpy as np
import pytest

from gp_core.pose.covariance import radius_95
from gp_core.pose.mixture import MixturePart, axis_part, mixture_radius_95, origin_part

RNG = np.random.default_rng(0)


def _covariance(scale: float) -> np.ndarray:
    root = scale * RNG.normal(size=(3, 3)) * [[1.0], [0.6], [0.3]]
    return root @ root.T


def test_of_one_hypothesis_it_is_the_plain_radius() -> None:
    covariance = np.zeros((6, 6))
    covariance[:3, :3] = _covariance(0.2)
    part = origin_part(1.0, np.ones(3), np.ones(3), covariance)
    assert mixture_radius_95([part]) == pytest.approx(radius_95(covariance))


@pytest.mark.parametrize("share", [0.004, 0.02, 0.3, 0.7, 0.999])
def test_it_covers_95_percent_of_the_mixture_and_of_every_hypothesis_not_ruled_out(share: float) -> None:
    parts = [
        MixturePart(1 - share, np.zeros(3), _covariance(0.2)),
        MixturePart(share, np.array([2.0, 1, 0]), _covariance(0.3)),
    ]
    radius = mixture_radius_95(parts)
    held = []
    for part in parts:
        drawn = RNG.multivariate_normal(part.offset, part.covariance, 40_000)
        held.append(np.mean(np.linalg.norm(drawn, axis=1) <= radius))
    mixed = (1 - share) * held[0] + share * held[1]
    assert mixed > 0.94
    if share >= 0.005:
        assert min(held) > 0.94
    else:
        assert mixed < 0.96
        assert held[1] < 0.1


def test_a_hypothesis_of_no_weight_changes_nothing() -> None:
    parts = [
        MixturePart(1.0, np.zeros(3), _covariance(0.2)),
        MixturePart(0.0, np.full(3, 9.0), _covariance(0.2)),
    ]
    assert mixture_radius_95(parts) == pytest.approx(mixture_radius_95(parts[:1]))


def test_an_axis_is_as_far_as_its_angle_even_the_opposite_one() -> None:
    x, covariance = np.array([1.0, 0, 0]), np.eye(6) * 1e-8
    for degrees in (0, 20, 90, 180):
        angle = np.radians(degrees)
        part = axis_part(1.0, np.array([np.cos(angle), np.sin(angle), 0]), x, covariance)
        assert np.linalg.norm(part.offset) == pytest.approx(angle, abs=1e-6)
        assert mixture_radius_95([part]) == pytest.approx(angle, abs=1e-3)


def test_no_spread_at_all_is_no_distance() -> None:
    assert mixture_radius_95([MixturePart(1.0, np.zeros(3), np.zeros((3, 3)))]) == 0.0
