"""What repeated touches gain: the errors of simulated ears whose features are touched once, or several times.

Run from the top of a checkout: ``python benchmarks/repeats.py``. Animals are drawn from perturbed published
atlases (`gp_core.atlas.sampling`), touched with Gaussian noise on every coordinate, and estimated with the
published atlas. It prints mean and median errors, and the change of the mean error of CO against touching
once, with a 95 % bootstrap interval over animals. It takes two minutes; ``-n`` and ``--seed`` change the
animals.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).resolve().parents[1])]

from gp_core import PROBE, Atlas, LandmarkSet, estimate_pose  # noqa: E402
from gp_core.atlas.sampling import draw_animal, perturbed_atlas  # noqa: E402
from gp_core.frames import angle_between_deg  # noqa: E402
from gp_core.landmarks.anatomy import with_cochlea_origin  # noqa: E402
from gp_core.validation import FloatArray  # noqa: E402

DESIGNS: Mapping[str, Mapping[str, int]] = {
    "all once": {},
    "all three times": dict.fromkeys(PROBE, 3),
    "all five times": dict.fromkeys(PROBE, 5),
    "MN five times": {"MN": 5},
    "RWA, RWP, LLI three times": dict.fromkeys(("RWA", "RWP", "LLI"), 3),
}
RESAMPLES = 2000


def estimated(side: LandmarkSet, times: Mapping[str, int], noise: float, seed: int) -> tuple[float, ...]:
    """Return errors (mm, degrees) of one ear, and whether radius and cone contain the truth."""
    rng = np.random.default_rng(seed)  # the same first touches in every design
    first = {code: side[code] + noise * rng.standard_normal(3) for code in PROBE}
    touches = {
        code: np.vstack([point, side[code] + noise * rng.standard_normal((times.get(code, 1) - 1, 3))])
        for code, point in first.items()
    }
    pose = estimate_pose(touches, side.side)
    mm = float(np.linalg.norm(pose.origin - side["CO"]))
    degrees = float(angle_between_deg(pose.axis, side["CA"] - side["CO"]))
    return mm, degrees, mm < pose.radius_95, degrees < np.degrees(pose.cone_95)


def main() -> None:
    """Print a line for each noise and design."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-n", type=int, default=200, help="animals; one ear of each (default: 200)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--noise", type=float, nargs="+", default=[0.2, 0.4], metavar="MM")
    args = parser.parse_args()
    rng = np.random.default_rng(args.seed)
    heads = [draw_animal(perturbed_atlas(Atlas.published(), rng=rng), rng=rng) for _ in range(args.n)]
    ears = [with_cochlea_origin(head.side("LR"[i % 2])) for i, head in enumerate(heads)]
    for noise in args.noise:
        print(f"{noise:g} mm per coordinate, {args.n} animals")
        once: FloatArray | None = None
        for words, times in DESIGNS.items():
            rows = np.array([estimated(ear, times, noise, args.seed + i) for i, ear in enumerate(ears)])
            once = rows if once is None else once
            print(f"  {words:<26} {_line(rows, once)}")


def _line(rows: FloatArray, once: FloatArray) -> str:
    mm, degrees, radius, cone = rows.T
    drawn = np.random.default_rng(0).integers(len(rows), size=(RESAMPLES, len(rows)))
    change = 100 * (mm.mean() / once[:, 0].mean() - 1)
    low, high = np.percentile(100 * (mm[drawn].mean(1) / once[:, 0][drawn].mean(1) - 1), (2.5, 97.5))
    return (
        f"CO mean {mm.mean():.2f} median {np.median(mm):.2f} mm "
        f"({change:+.0f} %, {low:+.0f} to {high:+.0f}); "
        f"axis mean {degrees.mean():.1f} median {np.median(degrees):.1f} deg; "
        f"within radius {radius.mean():.0%}, cone {cone.mean():.0%}"
    )


if __name__ == "__main__":
    main()
