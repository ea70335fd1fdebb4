"""Measure what README.md and docs/method.md claim and no command of gp-core prints.

Run from the top of a checkout: ``python benchmarks/claims.py labelled/``, labelled animals as for gp-core.
Each is estimated with an atlas that has seen nothing of it, by the paper's six touched features. It takes
half a minute; ``--seed N`` draws other touches. ``--conditions N`` prints the table of all conditions,
each side touched N times: that of ``gp-core conditions labelled/ --repeats N``, in some minutes.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).resolve().parents[1])]

from gp_core import (  # noqa: E402
    EXTERNAL,
    PROBE,
    Atlas,
    CochleaPose,
    GpError,
    LandmarkSet,
    Specimen,
    conditions,
    estimate_pose,
    fit_atlas,
    gains,
    load_specimens,
)
from gp_core.atlas.sampling import draw_animal  # noqa: E402
from gp_core.cli.conditions import condition_lines  # noqa: E402
from gp_core.frames import angle_between_deg  # noqa: E402
from gp_core.landmarks.anatomy import with_cochlea_origin  # noqa: E402
from gp_core.study.trials import make_trial  # noqa: E402

_REPEATS, _MANY = 20, 80
_CONDITIONS = ((0.0, 0.0, "no noise"), (0.4, 0.0, "0.4 mm noise"), (0.1, 3.0, "0.1 mm noise, one 3 mm off"))
_NOISES = (0.0, 0.1, 0.2, 0.4)
_MISTOUCH_MM = 3.0
_TOUCHED, _HEADS = (3, 5, 7), 100


@dataclass(frozen=True)
class HeldOut:
    """A labelled side, CO with it, and what is known without its animal."""

    animal: Specimen
    side: LandmarkSet
    others: Sequence[Specimen]
    atlas: Atlas

    def touched(self, noise: float, mistouch: float, rng: np.random.Generator) -> LandmarkSet:
        """Return six touches with these errors, mm."""
        return make_trial(self.side, PROBE, noise=noise, mistouch=mistouch, rng=rng).touches

    def off(self, pose: CochleaPose) -> tuple[float, float]:
        """Return how far the pose is off: mm, degrees."""
        axis = self.side["CA"] - self.side["CO"]
        return float(np.linalg.norm(pose.origin - self.side["CO"])), float(angle_between_deg(pose.axis, axis))


def main() -> None:
    """Print all tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("specimens", nargs="+", metavar="SPECIMENS")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--conditions", type=int, default=0, metavar="N")
    args = parser.parse_args()
    try:
        animals = load_specimens(args.specimens)
    except GpError as error:
        raise SystemExit(str(error)) from None
    if args.conditions:
        rng = np.random.default_rng(args.seed)
        for line in condition_lines(conditions(animals, repeats=args.conditions, rng=rng)):
            print(line)
        return
    sides = list(held_out(animals))
    for table in (regions, mistouched, turns, published, next_touches):
        print(table.__doc__.splitlines()[0])
        for line in table(sides, np.random.default_rng(args.seed)):
            print(f"  {line}")
        print()


def held_out(animals: Sequence[Specimen]) -> Iterator[HeldOut]:
    """Return every labelled side with what is known without its animal."""
    for animal in animals:
        others = [other for other in animals if other is not animal]
        atlas = fit_atlas(others)
        for side in animal.sides.values():
            yield HeldOut(animal, with_cochlea_origin(side), others, atlas)


def regions(sides: Sequence[HeldOut], rng: np.random.Generator) -> Iterator[str]:
    """Errors of both methods, and how often the truth is within the region of the robust one."""
    for noise, mistouch, words in _CONDITIONS:
        rows = []
        for held in sides * (_REPEATS if noise else 1):
            touches = held.touched(noise, mistouch, rng)
            joint = estimate_pose(touches, touches.side, method="jrmpc", specimens=held.others)
            pose = estimate_pose(touches, touches.side, held.atlas)
            mm, degrees = held.off(pose)
            rows.append(
                (*held.off(joint), mm, degrees, mm < pose.radius_95, degrees < np.degrees(pose.cone_95))
            )
        co_joint, ma_joint, co, ma, radius, cone = np.mean(rows, axis=0)
        yield (
            f"{words:<28} jrmpc {co_joint:.2f} mm {ma_joint:4.1f} deg, robust {co:.2f} mm {ma:4.1f} deg;"
            f" within radius {radius:.1%}, cone {cone:.1%} of {len(rows)}"
        )


def mistouched(sides: Sequence[HeldOut], rng: np.random.Generator) -> Iterator[str]:
    """MN touched 3 mm off, all with 0.1 mm noise: whether it is named, and the cone."""
    rows = []
    for held in sides * _MANY:
        touches = held.touched(0.1, 0.0, rng)
        away = rng.standard_normal(3)
        moved = touches["MN"] + _MISTOUCH_MM * away / np.linalg.norm(away)
        points = {**touches.as_mapping(PROBE), "MN": moved}
        pose = estimate_pose(points, touches.side, held.atlas)
        others = len(set(pose.suspects) - {"MN"})
        rows.append(("MN" in pose.suspects, held.off(pose)[1] < np.degrees(pose.cone_95), others > 0))
    named, cone, wrong = np.mean(rows, axis=0)
    yield f"MN named {named:.1%}, axis within the cone {cone:.1%}, another named {wrong:.1%} of {len(rows)}"


def turns(sides: Sequence[HeldOut], rng: np.random.Generator) -> Iterator[str]:
    """Turn of the frame about the axis, y to the touched and to the expected round window, degrees."""
    for noise in _NOISES:
        rows = []
        for held in sides * (_MANY if noise else 1):
            touches = held.touched(noise, 0.0, rng)
            touched = estimate_pose(touches, touches.side, held.atlas)
            expected = estimate_pose(touches, touches.side, held.atlas, round_window="expected")
            rows.append((_turn_deg(held.side, touched), _turn_deg(held.side, expected)))
        touched_deg, expected_deg = np.mean(rows, axis=0)
        yield f"noise {noise:.1f} mm: touched {touched_deg:.1f}, expected {expected_deg:.1f}"


def _turn_deg(truth: LandmarkSet, pose: CochleaPose) -> float:
    """Return how far y is turned out of the plane of the true axis and round window, about that axis."""
    to_window = truth.array(("RWA", "RWP")).mean(axis=0) - truth["CO"]
    y = to_window / np.linalg.norm(to_window)
    x = (truth["CA"] - truth["CO"]) / np.linalg.norm(truth["CA"] - truth["CO"])
    found = pose.transform_to_touches.rotation[:, 1]
    return float(np.degrees(abs(np.arctan2(np.cross(x, y) @ found, y @ found))))


def published(sides: Sequence[HeldOut], rng: np.random.Generator) -> Iterator[str]:
    """Errors with the published atlas alone, no noise."""
    atlas = Atlas.published()
    poses = [estimate_pose(held.touched(0.0, 0.0, rng), held.side.side, atlas) for held in sides]
    mm, degrees = np.mean([held.off(pose) for held, pose in zip(sides, poses, strict=True)], axis=0)
    yield f"{len(sides)} sides: {mm:.2f} mm, {degrees:.1f} deg on average"


def next_touches(sides: Sequence[HeldOut], rng: np.random.Generator) -> Iterator[str]:
    """Region after the touch that gains most, over the promised one; drawn animals, 0.1 mm noise."""
    animals = {held.animal.name: held.animal for held in sides}
    for words, atlas in (
        ("published", Atlas.published()),
        ("of all these animals", fit_atlas([*animals.values()])),
    ):
        ratios, larger = [], []
        for n in _TOUCHED * _HEADS:
            points = _drawn_touches(atlas, rng)
            codes = [str(code) for code in rng.choice(EXTERNAL, n, replace=False)]
            before = LandmarkSet.from_mapping(points.as_mapping(codes), "L", frame=points.frame)
            found = gains(before, atlas)
            best = found[0]
            after = estimate_pose(before.with_point(best.code, points[best.code]), "L", atlas)
            ratios.append((after.plain_radius_95 / best.radius_95, after.plain_cone_95 / best.cone_95))
            larger += [gain.radius_95 / gain.radius_95_now for gain in found]
        medians, means = np.median(ratios, axis=0), np.mean(ratios, axis=0)
        yield (
            f"{words}: radius {medians[0]:.2f} (mean {means[0]:.2f}), cone {medians[1]:.2f} ({means[1]:.2f});"
            f" {np.mean(np.array(larger) > 1):.1%} promise a larger radius, at most {max(larger):.2f} times"
        )


def _drawn_touches(atlas: Atlas, rng: np.random.Generator) -> LandmarkSet:
    """Touch whatever can be touched on the left of a drawn animal."""
    side = with_cochlea_origin(draw_animal(atlas, rng=rng).side("L"))
    return make_trial(side, EXTERNAL, noise=0.1, rng=rng).touches


if __name__ == "__main__":
    main()
