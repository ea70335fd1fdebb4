"""Alternative hypotheses are weighted, kept, and widen the region where they are not ruled out."""

from __future__ import annotations

import json
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from atlas_cases import draw_side, errors, noisy, random_pose

from gp_core import PROBE, Atlas, LandmarkSet, Side, estimate_pose, read_pose
from gp_core.frames import mirror_x
from gp_core.pose.hypotheses import fit_hypotheses, log_evidence
from gp_core.pose.robust import touch_model
from gp_core.registration.named_points import fit_named_points

ATLAS = Atlas.published()


def _touches(seed: int, noise: float, side: Side = Side.LEFT) -> tuple[LandmarkSet, dict[str, np.ndarray]]:
    rng = np.random.default_rng(seed)
    animal = draw_side(ATLAS, rng, side).moved(random_pose(rng))
    return animal, {code: noisy(p, noise, rng) for code, p in animal.as_mapping(PROBE).items()}


@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_careful_touches_of_the_right_ear_are_never_undecided(noise: float) -> None:
    for seed in range(40):
        _, touches = _touches(seed, noise)
        pose = estimate_pose(touches, "L", ATLAS)
        assert pose.state == "side clear, names clear"
        assert pose.radius_95 == pytest.approx(pose.plain_radius_95, rel=0.05)


@pytest.mark.parametrize("noise", [0.1, 0.25, 0.4])
def test_the_region_of_a_wrong_side_reaches_the_truth(noise: float) -> None:
    held = []
    for seed in range(40):
        animal, touches = _touches(seed, noise, side := Side.LEFT if seed % 2 else Side.RIGHT)
        pose = estimate_pose(touches, side.other, ATLAS)
        distance, angle = errors(pose, animal)
        held.append((distance <= pose.radius_95, angle <= pose.cone_95))
    assert (np.mean(held, axis=0) >= 0.875).all()


def test_the_region_of_every_exchange_reaches_the_truth() -> None:
    held = []
    for i, (a, b) in enumerate(list(combinations(PROBE, 2)) * 2):
        animal, touches = _touches(i, 0.25)
        touches[a], touches[b] = touches[b], touches[a]
        pose = estimate_pose(touches, "L", ATLAS)
        distance, angle = errors(pose, animal)
        held.append((distance <= pose.radius_95, angle <= pose.cone_95))
    assert (np.mean(held, axis=0) >= 0.9).all()


def test_the_likeliest_other_hypothesis_is_the_true_one() -> None:
    animal, touches = _touches(1, 0.1)
    exchanged = {**touches, "CL": touches["OS"], "OS": touches["CL"]}
    pose = estimate_pose(exchanged, "L", ATLAS)
    best = pose.hypotheses[0]
    assert (pose.names_state, set(best.exchanged or ())) == ("wrong", {"CL", "OS"})
    assert best.label in ("CL and OS exchanged", "OS and CL exchanged")
    assert np.linalg.norm(best.origin - animal["CO"]) < 0.8
    assert pose.is_multimodal
    assert pose.radius_95 > np.linalg.norm(best.origin - pose.origin)
    right = estimate_pose(touches, "R", ATLAS)
    assert (right.side_state, right.hypotheses[0].side) == ("wrong", Side.LEFT)
    assert right.hypotheses[0].label == "the left ear"


def test_probabilities_add_up_and_come_back_from_a_file(tmp_path: Path) -> None:
    _, touches = _touches(2, 0.4)
    pose = estimate_pose({**touches, "RWA": touches["RWP"], "RWP": touches["RWA"]}, "R", ATLAS)
    assert pose.hypotheses
    total = pose.probability + sum(h.probability for h in pose.hypotheses)
    assert total == pytest.approx(1, abs=0.02)  # those below a thousandth are dropped
    pose.save(tmp_path / "pose.json")
    again = read_pose(tmp_path / "pose.json")
    assert again.as_dict() == pose.as_dict()
    assert (again.radius_95, again.cone_95) == (pose.radius_95, pose.cone_95)
    content = json.loads((tmp_path / "pose.json").read_text())
    assert content["plain_radius_95_mm"] < content["radius_95_mm"]


def test_the_odds_are_the_same_in_every_frame_and_for_both_ears() -> None:
    _, touches = _touches(3, 0.4)
    T = random_pose(np.random.default_rng(9), dst="tracker", src="tracker")
    here = estimate_pose(touches, "L", ATLAS)
    there = estimate_pose({c: T.apply(p[None])[0] for c, p in touches.items()}, "L", ATLAS)
    mirrored = estimate_pose({c: mirror_x(p[None])[0] for c, p in touches.items()}, "R", ATLAS)
    for other in (there, mirrored):
        assert other.probability == pytest.approx(here.probability, rel=1e-3)
        assert other.radius_95 == pytest.approx(here.radius_95, rel=1e-3)


def test_the_evidence_is_the_integral_over_pose_and_scale() -> None:
    """Against sampling: the pose from a wide Gaussian about the fit, errors by their own Student law."""
    rng = np.random.default_rng(4)
    touches = LandmarkSet.from_mapping(_touches(5, 0.2)[1], "L", frame="tracker")
    model = touch_model(touches, ATLAS, 0.2)
    points = touches.array(model.codes)
    found = []
    for read in (points, mirror_x(points)):
        fit = fit_named_points(model, read)
        found.append(log_evidence(model, fit) - _sampled(model, fit, rng))
    assert found[0] == pytest.approx(found[1], abs=0.7)  # a constant of the touches apart


def _sampled(model, fit, rng: np.random.Generator) -> float:
    from scipy.spatial.transform import Rotation
    from scipy.stats import multivariate_normal

    information = (fit.precision[:, None] * fit.jacobian).T @ fit.jacobian
    law = multivariate_normal(np.zeros(6), 1.5 * np.linalg.inv(information))
    steps = law.rvs(1500, random_state=rng)
    weights = rng.gamma(2.0, 0.5, (200, len(model.codes)))
    variance = model.variances + model.noise**2 / weights
    logs = []
    for step in steps:
        moved = fit.points @ Rotation.from_rotvec(step[3:]).as_matrix().T + step[:3]
        squared = ((moved - model.mean) ** 2).sum(axis=1)
        each = np.exp(-1.5 * np.log(variance) - squared / (2 * variance)).mean(axis=0)
        logs.append(np.log(each).sum() - law.logpdf(step))
    logs = np.array(logs)
    return float(logs.max() + np.log(np.mean(np.exp(logs - logs.max()))))


def test_what_is_read_first_is_what_was_named() -> None:
    touches = LandmarkSet.from_mapping(_touches(6, 0.4)[1], "L", frame="tracker")
    model = touch_model(touches, ATLAS, None)
    fit = fit_named_points(model, touches.array(model.codes))
    named, *others = fit_hypotheses(model, touches.array(model.codes), fit)
    assert (named.mirrored, named.exchanged, named.fit) == (False, None, fit)
    assert [r.probability for r in others] == sorted((r.probability for r in others), reverse=True)
