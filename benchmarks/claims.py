"""Measure what README.md and docs/method.md claim and no command of gp-core prints.

Run from the top of a checkout: ``python benchmarks/claims.py labelled/``, labelled animals as for gp-core.
Each is estimated with an atlas that has seen nothing of it, by the paper's six touched features. It takes
half a minute; ``--seed N`` draws other touches. ``--probe FILE...`` prints, alone, what files of real touches
give by themselves, their sides from their names: as the program estimates them, without a shared error
(``--shared-error 0`` of gp-core), and with the variance of no touch raised, as an earlier version had it.
``--conditions N`` prints the table of all conditions, each side touched N times: that of ``gp-core
conditions labelled/ --repeats N``, in some minutes.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
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
    read_touches,
)
from gp_core.atlas.sampling import draw_animal  # noqa: E402
from gp_core.cli.conditions import condition_lines  # noqa: E402
from gp_core.frames import angle_between_deg  # noqa: E402
from gp_core.io.file_names import named_side  # noqa: E402
from gp_core.landmarks.anatomy import mirror_right, with_cochlea_origin  # noqa: E402
from gp_core.pose.robust import defining_points, pose_covariance, touch_model  # noqa: E402
from gp_core.pose.systematic_error import DEFAULT_SHARED_ERROR_MM, SystematicError  # noqa: E402
from gp_core.registration.named_points import fit_named_points  # noqa: E402
from gp_core.study.trials import make_trial  # noqa: E402
from gp_core.validation import FloatArray  # noqa: E402

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
    parser.add_argument("--probe", nargs="+", default=(), metavar="FILE")
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
    if args.probe:
        for line in probe_files(args.probe):
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
            own = pose.radius_95, float(np.degrees(pose.cone_95))
            rows.append((*held.off(joint), mm, degrees, mm < own[0], degrees < own[1], *own))
        names = [held.animal.name for held in sides * (_REPEATS if noise else 1)]
        co_joint, ma_joint, co, ma, radius, cone, mm_95, deg_95 = np.array(rows, dtype=float).T
        yield words
        for method, distances, angles in (("jrmpc", co_joint, ma_joint), ("robust", co, ma)):
            yield f"  {method:<7} CO {_summary(distances, names)} mm; axis {_summary(angles, names)} deg"
        yield (
            f"  regions median {np.median(mm_95):.2f} mm, {np.median(deg_95):.1f} deg;"
            f" within radius {radius.mean():.1%}, cone {cone.mean():.1%} of {len(rows)}"
        )


def _summary(values: FloatArray, animals: Sequence[str]) -> str:
    """Return mean, its 95 % bootstrap interval over animals, and median."""
    of = np.array(animals)
    means = np.array([values[of == name].mean() for name in np.unique(of)])
    drawn = np.random.default_rng(0).choice(means, (4000, len(means))).mean(axis=1)
    low, high = np.percentile(drawn, (2.5, 97.5))
    return f"mean {values.mean():.2f} ({low:.2f} to {high:.2f}) median {np.median(values):.2f}"


def probe_files(paths: Sequence[str]) -> Iterator[str]:
    """Files of real touches, the published atlas: the noise that they show, and their own regions."""
    for shared_error, words in ((DEFAULT_SHARED_ERROR_MM, "shared error 0.2 mm"), (0.0, "no shared error")):
        rows = []
        for path in paths:
            side = named_side(path)
            if side is None:
                raise SystemExit(f"{path}: its name must tell the side, as SkullA_Left.dat does")
            touches = read_touches(path, side)
            pose = estimate_pose(touches, side, shared_error=shared_error)
            assert pose.probe_noise is not None
            plain = pose.plain_radius_95, float(np.degrees(pose.plain_cone_95))
            row = pose.probe_noise, pose.radius_95, float(np.degrees(pose.cone_95)), *plain
            rows.append((*row, *_unraised(touches)))
            yield f"{words}, {Path(path).name}: {_region(row)}, {pose.state}"
        medians = np.median(rows, axis=0)
        yield f"{words}, median of {len(rows)}: {_region(medians[:5])}"
    yield f"and no variance raised, median: 95 % within {medians[5]:.2f} mm, {medians[6]:.0f} deg (as named)"


class _UnraisedVariances(SystematicError):  # noqa: N818 - an error of touches, no exception
    """No shared error, and no touch gets the variance that its deviation shows."""

    outlier_squared = np.inf


def _unraised(touches: LandmarkSet) -> tuple[float, float]:
    """Return radius, mm, and cone, degrees, as an earlier version gave them."""
    atlas = Atlas.published()
    model = touch_model(touches, atlas, None)
    fit = fit_named_points(model, mirror_right(touches.array(model.codes), touches.side))
    defining = defining_points(atlas, model, fit)
    covariance = pose_covariance(atlas, model, fit, defining, touches.side, _UnraisedVariances(0.0))
    pose = replace(estimate_pose(touches, touches.side), covariance=covariance)
    return pose.plain_radius_95, float(np.degrees(pose.plain_cone_95))


def _region(row: Sequence[float] | FloatArray) -> str:
    noise, mm, degrees, plain_mm, plain_deg = row
    return (
        f"noise {noise:.2f} mm, 95 % within {mm:.2f} mm, {degrees:.0f} deg"
        f" (as named {plain_mm:.2f} mm, {plain_deg:.0f} deg)"
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
    mm, degrees = np.transpose([held.off(pose) for held, pose in zip(sides, poses, strict=True)])
    names = [held.animal.name for held in sides]
    yield f"{len(sides)} sides: CO {_summary(mm, names)} mm; axis {_summary(degrees, names)} deg"


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
