"""Choose the settings of the 95 % region on animals drawn from perturbed atlases, and print why.

Run from the top of a checkout: ``python benchmarks/region_settings.py``; it takes some minutes. No real
animal is read, so figures of real ones (``gp-core conditions labelled/``) are of animals that chose nothing.
Every candidate sees the same animals and touches. The rules:

*share*, a part of the shared error's variance that is taken as different from touch to touch on top of the
noise that the fit finds: the smallest with which radius and cone hold the truth at most 1 % less often than
with the largest, on average over all sessions in which touches share an error. That is 0, so the program has
no such setting.

*odd*, the squared deviation from which a touch counts as uncertain as it looks (chi-square of 3 degrees):
the largest with which the cone holds in 85 % or more where MN is 3 mm off, at 0.1 and at 0.25 mm noise.

*undecided*, the probability from which another reading is not ruled out: the smallest with which fewer than
1 of 1000 correct ears are undecided without noise and with 0.1 mm; it must hold the truth in 92 % or more
of the sessions of each wrong side and each exchanged pair.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from unittest import mock

import numpy as np

sys.path[:0] = [str(Path(__file__).resolve().parents[1])]

from gp_core import (  # noqa: E402
    PROBE,
    Atlas,
    CochleaPose,
    LandmarkSet,
    conditions,
    estimate_pose,
    touch_conditions,
)
from gp_core.atlas.sampling import draw_animal, perturbed_atlas  # noqa: E402
from gp_core.constants import CHI2_3_95  # noqa: E402
from gp_core.frames import angle_between_deg  # noqa: E402
from gp_core.pose import mixture  # noqa: E402
from gp_core.pose import systematic_error as systematic  # noqa: E402
from gp_core.pose.systematic_error import SystematicError  # noqa: E402
from gp_core.registration.named_points import NamedFit  # noqa: E402
from gp_core.study.conditions import ConditionRow, TouchCondition  # noqa: E402
from gp_core.study.leave_one_out import held_out_sides  # noqa: E402
from gp_core.study.sessions import touch_session  # noqa: E402
from gp_core.validation import FloatArray  # noqa: E402

_SHARES = (0.0, 0.04, 0.25)
_ODDS = (3.0, 5.0, CHI2_3_95)
_UNDECIDED = (0.002, 0.005, 0.01, 0.02, 0.03, 0.05)
_WORSE_SHARED, _HELD_MISTOUCH = 0.01, 0.85
_RARE, _HELD = 1e-3, 0.92
_CAREFUL_TIMES = 5
"""A rate of 1 in 1000 needs more sessions than a share of 92 %."""


def main() -> None:
    """Print every candidate, and what is chosen."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cohorts", type=int, default=30, metavar="N", help="of 11 animals each")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    for lines in (_share, _odd, _undecided):
        for line in lines(args.cohorts, args.seed):
            sys.stdout.write(f"{line}\n")
            sys.stdout.flush()


def _rows(cohorts: int, seed: int, labels: tuple[str, ...]) -> list[ConditionRow]:
    """Measure conditions of six touches."""
    cases = [case for case in touch_conditions() if case.label in labels and case.codes == PROBE]
    return list(conditions(repeats=cohorts, rng=np.random.default_rng(seed), cases=cases).rows)


def _with_share(share: float) -> Callable[..., FloatArray]:
    """Return `SystematicError.covariance` with a part of the shared error that varies by touch."""
    plain = SystematicError.covariance

    def covariance(
        self: SystematicError, atlas: Atlas, fit: NamedFit, of_touches: FloatArray, of_shape: FloatArray
    ) -> FloatArray:
        more = share * self.shared_error**2 / 3
        return plain(self, atlas, fit, of_touches, of_shape) + more * of_touches @ of_touches.T

    return covariance


def _held(rows: list[ConditionRow], *regions: str) -> float:
    return float(np.mean([row.held(region) for row in rows for region in regions]))


def _share(cohorts: int, seed: int) -> Iterator[str]:
    words = ("tip offset", "soft tissue", "knocked marker", "drift")
    labels = tuple(f"{word} {size}" for word in words for size in (0.2, 0.5))
    held = {}
    yield "share   held, %   radius grown without noise"
    for share in _SHARES:
        with mock.patch.object(SystematicError, "covariance", _with_share(share)):
            rows = _rows(cohorts, seed, (*labels, "noise 0"))
        plain = next(row for row in rows if row.condition.group == "noise")
        held[share] = _held([row for row in rows if row is not plain], "radius_mm", "cone_deg")
        yield f"{share:5.2f}   {100 * held[share]:7.2f}   {plain.as_dict()['radius_mm_growth']:.3f}"
    chosen = min(share for share in _SHARES if held[share] >= held[max(_SHARES)] - _WORSE_SHARED)
    yield f"chosen: {chosen}; in use: 0\n"


def _odd(cohorts: int, seed: int) -> Iterator[str]:
    held = {}
    yield "odd     cone holds with MN off at 0.1, 0.25 mm, %   radius grown without noise"
    for odd in _ODDS:
        labels = ("noise 0", "MN 3 mm off, noise 0.1", "MN 3 mm off, noise 0.25")
        with mock.patch.object(systematic, "OUTLIER_SQUARED_SHARED", odd):
            plain, *off = _rows(cohorts, seed, labels)
        each = [_held([row], "cone_deg") for row in off]
        held[odd] = min(each)
        cones = " ".join(f"{100 * share:7.2f}" for share in each)
        yield f"{odd:5.2f}   {cones}   {plain.as_dict()['radius_mm_growth']:.3f}"
    chosen = max((odd for odd in _ODDS if held[odd] >= _HELD_MISTOUCH), default=min(_ODDS))
    yield f"chosen: {chosen:.2f}; in use: {systematic.OUTLIER_SQUARED_SHARED:.2f}\n"


def _undecided(cohorts: int, seed: int) -> Iterator[str]:
    rng = np.random.default_rng(seed)
    cases = [c for c in touch_conditions(("side", "names", "noise")) if c.codes == PROBE]
    careful = [case for case in cases if case.label in ("noise 0", "noise 0.1")]
    mistaken = [case for case in cases if case.group != "noise"]
    odds: list[float] = []
    found: dict[str, list[tuple[CochleaPose, float, float]]] = {case.label: [] for case in mistaken}
    for cohort in range(cohorts):
        atlas = perturbed_atlas(Atlas.published(), rng=rng)
        animals = [draw_animal(atlas, rng=rng, name=f"{cohort} {i}") for i in range(11)]
        for held_out, truth in zip(*held_out_sides(animals, PROBE), strict=True):
            for case in _CAREFUL_TIMES * careful:
                odds.append(_other_side(_estimated(case, held_out, truth, rng)[0]))
            for case in mistaken:
                found[case.label].append(_estimated(case, held_out, truth, rng))
    yield "undecided, %   of correct ears at 0 and 0.1 mm, %   held at least, %"
    chosen = None
    for limit in _UNDECIDED:
        share = float(np.mean(np.array(odds) >= limit))
        worst, label = min((_holds(poses, limit), label) for label, poses in found.items())
        yield f"{100 * limit:12.1f}   {100 * share:20.2f}   {100 * worst:24.1f}   {label}"
        if chosen is None and share < _RARE and worst >= _HELD:
            chosen = limit
    yield f"chosen: {chosen}; in use: {mixture.UNDECIDED}"


def _estimated(
    case: TouchCondition, atlas: Atlas, truth: LandmarkSet, rng: np.random.Generator
) -> tuple[CochleaPose, float, float]:
    """Return a pose, and how far it is off: mm, degrees."""
    session, touches = touch_session(truth, case.codes, case.noise_mm, case.disturbances, rng)
    pose = estimate_pose(touches, session.side, atlas)
    axis = session.truth["CA"] - session.truth["CO"]
    off = float(np.linalg.norm(pose.origin - session.truth["CO"]))
    return pose, off, float(angle_between_deg(pose.axis, axis))


def _other_side(pose: CochleaPose) -> float:
    return sum(h.probability for h in pose.hypotheses if h.exchanged is None)


def _holds(poses: list[tuple[CochleaPose, float, float]], limit: float) -> float:
    """Return how often radius and cone hold the truth, the lesser of both."""
    with mock.patch.object(mixture, "UNDECIDED", limit):
        again = [(replace(pose), mm, degrees) for pose, mm, degrees in poses]
        radius = np.mean([mm <= pose.radius_95 for pose, mm, _ in again])
        cone = np.mean([degrees <= np.degrees(pose.cone_95) for pose, _, degrees in again])
    return float(min(radius, cone))


if __name__ == "__main__":
    main()
