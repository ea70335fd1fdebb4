"""What two ears of one head tell of each other: agreement, knocked references, and one axis of both.

Run from the top of a checkout: ``python benchmarks/both_ears.py``. Heads are drawn from perturbed published
atlases and touched with Gaussian noise on every coordinate, six features on each side; each ear is estimated
with the published atlas. It takes some minutes; ``-n`` and ``--seed`` change the heads.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).resolve().parents[1])]

from gp_core import PROBE, Atlas, GpError, LandmarkSet, check_ears, estimate_pose, fuse_ears, mirror_plane  # noqa: E402
from gp_core.atlas.sampling import draw_animal, perturbed_atlas  # noqa: E402
from gp_core.frames import angle_between_deg  # noqa: E402
from gp_core.landmarks.anatomy import with_cochlea_origin  # noqa: E402

KNOCKED_MM = (4.0, 8.0)


def _agree(left: LandmarkSet, right: LandmarkSet) -> bool:
    try:
        poses = estimate_pose(left, "L"), estimate_pose(right, "R")
        return check_ears(*poses, mirror_plane(left, right)).agrees
    except GpError:
        return False


def _line(n: int, noise: float, rng: np.random.Generator) -> str:
    own, both, within, agree = [], [], [], []
    knocked: dict[float, list[bool]] = {mm: [] for mm in KNOCKED_MM}
    for _ in range(n):
        head = draw_animal(perturbed_atlas(Atlas.published(), rng=rng), rng=rng)
        truth = {side: with_cochlea_origin(head.side(side)) for side in "LR"}
        touches = {
            side: {code: truth[side][code] + noise * rng.standard_normal(3) for code in PROBE}
            for side in "LR"
        }
        sets = {side: LandmarkSet.from_touches(touches[side], side) for side in "LR"}
        poses = {side: estimate_pose(sets[side], side) for side in "LR"}
        agree.append(_agree(sets["L"], sets["R"]))
        for mm, found in knocked.items():
            way = rng.standard_normal(3)
            off = mm * way / np.linalg.norm(way)
            moved = LandmarkSet.from_touches({c: p + off for c, p in touches["R"].items()}, "R")
            found.append(_agree(sets["L"], moved))
        if not agree[-1]:
            continue
        fused = fuse_ears(poses["L"], poses["R"], mirror_plane(sets["L"], sets["R"]))
        for pose in fused.values():
            side = pose.side.value
            axis = truth[side]["CA"] - truth[side]["CO"]
            own.append(angle_between_deg(poses[side].axis, axis))
            both.append(angle_between_deg(pose.axis, axis))
            within.append(both[-1] < np.degrees(pose.cone_95))
    change = 100 * (np.mean(both) / np.mean(own) - 1)
    told = ", ".join(f"knocked by {mm:g} mm {np.mean(found):.0%}" for mm, found in knocked.items())
    return (
        f"{noise:g} mm: ears agree {np.mean(agree):.0%}, {told}; axis own {np.mean(own):.1f}, "
        f"both {np.mean(both):.1f} deg ({change:+.0f} %), in the cone {np.mean(within):.0%}"
    )


def main() -> None:
    """Print a line for each noise."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-n", type=int, default=60, help="heads (default: 60)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--noise", type=float, nargs="+", default=[0.1, 0.2, 0.4], metavar="MM")
    args = parser.parse_args()
    for noise in args.noise:
        print(_line(args.n, noise, np.random.default_rng(args.seed)))


if __name__ == "__main__":
    main()
