"""What two ears of one head tell of each other: agreement, knocked references, mistouches, one axis of both.

Run from the top of a checkout: ``python benchmarks/both_ears.py``. Heads are drawn from perturbed published
atlases and touched with Gaussian noise on every coordinate, six features on each side; each ear is estimated
with the published atlas. It takes some minutes; ``-n`` and ``--seed`` change the heads, ``--touches`` how
often each feature is touched. ``--known-plane`` fuses the axes by the true mid-plane, and ``--independent``
draws heads whose ears have nothing in common: what of the gain is lost to either.

``--labelled SPECIMENS...`` takes labelled animals instead, each held out of the atlas. Their sides have
frames of their own, so the right ear is placed in the head of the left one: its external features where they
are most nearly the mirror images of the left ear's.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).resolve().parents[1])]

from gp_core import (  # noqa: E402
    EXTERNAL,
    PROBE,
    Atlas,
    EarCheck,
    GpError,
    LandmarkSet,
    MirrorPlane,
    Side,
    compare_ears,
    estimate_pose,
    fit_atlas,
    fuse_ears,
    load_specimens,
)
from gp_core.atlas import sampling  # noqa: E402
from gp_core.atlas.sampling import draw_animal, perturbed_atlas  # noqa: E402
from gp_core.frames import angle_between_deg  # noqa: E402
from gp_core.landmarks.anatomy import with_cochlea_origin  # noqa: E402
from gp_core.pose import both_ears  # noqa: E402
from gp_core.registration.procrustes import fit_rigid  # noqa: E402
from gp_core.validation import FloatArray  # noqa: E402

KNOCKED_MM, MISTOUCH_MM = (4.0, 8.0), 2.5
KNOWN_PLANE = MirrorPlane(np.array([1.0, 0.0, 0.0]), 0.0, 0.0, ("x = 0",), 0.3, 0.05)
"""Of drawn heads, known as well as skull features of the midline may tell it."""

Touched = dict[Side, LandmarkSet]


@dataclass
class Counts:
    """What came of the heads of one noise."""

    agree: list[bool] = field(default_factory=list)
    alarms: list[bool] = field(default_factory=list)
    knocked: dict[float, list[bool]] = field(default_factory=lambda: {mm: [] for mm in KNOCKED_MM})
    named: list[bool] = field(default_factory=list)
    others: list[bool] = field(default_factory=list)
    axes: list[tuple[float, float, bool]] = field(default_factory=list)

    @property
    def lines(self) -> Iterator[str]:
        """The figures."""
        told = ", ".join(f"knocked by {mm:g} mm {np.mean(found):.0%}" for mm, found in self.knocked.items())
        yield f"ears agree {np.mean(self.agree):.0%}, {told}"
        yield (
            f"a mistouch of {MISTOUCH_MM:g} mm is named in {np.mean(self.named):.0%}, another feature in "
            f"{np.mean(self.others):.0%}; of correct heads a feature is named in {np.mean(self.alarms):.0%}"
        )
        own, both, within = np.mean(self.axes, axis=0)
        change = 100 * (both / own - 1)
        yield f"axis own {own:.1f}, both {both:.1f} deg ({change:+.0f} %), in the cone {within:.0%}"


def _check(touches: Touched) -> EarCheck | None:
    left, right = touches[Side.LEFT], touches[Side.RIGHT]
    try:
        return compare_ears(left, estimate_pose(left, "L"), right, estimate_pose(right, "R")).check
    except GpError:
        return None


def _off(mm: float, rng: np.random.Generator) -> FloatArray:
    way = rng.standard_normal(3)
    off: FloatArray = mm * way / np.linalg.norm(way)
    return off


def _take(counts: Counts, truth: Touched, touches: Touched, n: int, known: bool, seed: int) -> None:
    """Take down what a head tells."""
    rng = np.random.default_rng(seed)
    check = _check(touches)
    counts.agree.append(check is not None and check.agrees)
    counts.alarms.append(check is not None and bool(check.suspects))
    right = touches[Side.RIGHT]
    for mm, found in counts.knocked.items():
        off = _off(mm, rng)
        moved = LandmarkSet.from_touches({c: right[c] + off for c in PROBE}, "R")
        knocked = _check({**touches, Side.RIGHT: moved})
        found.append(knocked is not None and knocked.agrees)
    code, side = PROBE[n % len(PROBE)], tuple(Side)[n % 2]
    wrong = touches[side].with_point(code, touches[side][code] + _off(MISTOUCH_MM, rng))
    mistouched = _check({**touches, side: wrong})
    suspects = () if mistouched is None else mistouched.suspects[:1]
    counts.named.append(code in suspects)
    counts.others.append(bool(suspects) and code not in suspects)
    if check is None or not check.agrees:
        return
    poses = {side: estimate_pose(touches[side], side) for side in Side}
    plane = KNOWN_PLANE if known else check.plane
    try:
        fused = fuse_ears(poses[Side.LEFT], poses[Side.RIGHT], plane)
    except GpError:
        return
    for side, pose in fused.items():
        axis = truth[side]["CA"] - truth[side]["CO"]
        both = float(angle_between_deg(pose.axis, axis))
        own = float(angle_between_deg(poses[side].axis, axis))
        counts.axes.append((own, both, both < np.degrees(pose.cone_95)))


@dataclass(frozen=True)
class LabelledHead:
    """Both ears of an animal in one frame, and an atlas that has seen nothing of it."""

    truth: Touched
    atlas: Atlas
    asymmetry_deg: float


def labelled_heads(paths: list[str]) -> list[LabelledHead]:
    """Return the animals with both ears in the frame of the left one."""
    animals = load_specimens(paths)
    normal = np.array(sampling._MIDLINE_NORMAL) / np.linalg.norm(sampling._MIDLINE_NORMAL)
    heads = []
    for animal in animals:
        left, right = (with_cochlea_origin(animal.side(side)) for side in Side)
        plane = MirrorPlane(normal, float(normal @ left["IN"]), 0.0, ("IN",), 0.0, 0.0)
        codes = [code for code in EXTERNAL if code in left and code in right]
        mirrored = plane.mirror(left.array(codes))
        T = fit_rigid(right.array(codes), mirrored, dst=left.frame, src=right.frame).transform
        placed = right.moved(T)
        axis, other = (side["CA"] - side["CO"] for side in (left, placed))
        atlas = fit_atlas([one for one in animals if one is not animal])
        apart = float(angle_between_deg(axis, plane.mirror_direction(other)))
        heads.append(LabelledHead({Side.LEFT: left, Side.RIGHT: placed}, atlas, apart))
    return heads


def _labelled_line(heads: list[LabelledHead], noise: float, repeats: int, seed: int) -> str:
    """Return how often the ears of labelled animals agree, and what one axis of both gains."""
    agreed: list[bool] = []
    axes: list[FloatArray] = []
    for n, head in enumerate(heads):
        found = []
        for k in range(repeats):
            rng = np.random.default_rng([seed, n, k])
            left, right = (
                LandmarkSet.from_touches(
                    {c: head.truth[side][c] + noise * rng.standard_normal(3) for c in PROBE}, side
                )
                for side in Side
            )
            poses = estimate_pose(left, "L", head.atlas), estimate_pose(right, "R", head.atlas)
            ears = compare_ears(left, poses[0], right, poses[1])
            agreed.append(ears.check.agrees)
            if not ears.check.agrees:
                continue
            for side, pose in ears.poses.items():
                axis, both = head.truth[side]["CA"] - head.truth[side]["CO"], ears.fused(side)
                off = float(angle_between_deg(both.axis, axis))
                found.append((float(angle_between_deg(pose.axis, axis)), off, off < np.degrees(both.cone_95)))
        axes.append(np.mean(found, axis=0))
    own, both, within = np.mean(axes, axis=0)
    rng = np.random.default_rng(0)
    drawn = np.array(axes)[rng.integers(0, len(axes), (2000, len(axes)))].mean(axis=1)
    low, high = 100 * (np.percentile(drawn[:, 1] / drawn[:, 0], [2.5, 97.5]) - 1)
    return (
        f"{noise:g} mm: ears agree {np.mean(agreed):.0%}; axis own {own:.1f}, both {both:.1f} deg "
        f"({100 * (both / own - 1):+.0f} %, {low:+.0f} to {high:+.0f}), in the cone {within:.0%}"
    )


def main() -> None:
    """Print the figures of each noise."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-n", type=int, default=60, help="heads (default: 60)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--noise", type=float, nargs="+", default=[0.1, 0.2, 0.4], metavar="MM")
    parser.add_argument("--touches", type=int, default=1, help="of each feature (default: 1)")
    parser.add_argument("--known-plane", action="store_true")
    parser.add_argument("--independent", action="store_true")
    parser.add_argument("--labelled", nargs="+", metavar="SPECIMENS")
    args = parser.parse_args()
    if args.labelled:
        heads = labelled_heads(args.labelled)
        apart = np.array([head.asymmetry_deg for head in heads])
        rms = np.sqrt((apart**2).mean())
        print(f"{len(heads)} animals; an axis is {rms:.1f} deg (RMS) from the other's mirror image")
        for noise in args.noise:
            print(f"  {_labelled_line(heads, noise, 20, args.seed)}", flush=True)
        return
    if args.independent:
        sampling._SIDE_CORRELATION = both_ears._CORRELATION = 0.0
    for noise in args.noise:
        rng, counts = np.random.default_rng(args.seed), Counts()
        for n in range(args.n):
            head = draw_animal(perturbed_atlas(Atlas.published(), rng=rng), rng=rng)
            truth = {side: with_cochlea_origin(head.side(side)) for side in Side}
            touches = {
                side: LandmarkSet.from_touches(
                    {c: truth[side][c] + noise * rng.standard_normal((args.touches, 3)) for c in PROBE}, side
                )
                for side in Side
            }
            _take(counts, truth, touches, n, args.known_plane, args.seed + n)
        print(f"{noise:g} mm, {args.n} heads, each feature touched {args.touches} times")
        for line in counts.lines:
            print(f"  {line}", flush=True)


if __name__ == "__main__":
    main()
