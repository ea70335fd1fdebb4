"""How often the 95 % region of a ghost holds its feature, while simulated users accept, confirm and correct.

Each user places three features of a drawn animal, then takes the others in the order that is proposed,
seeing each with an error of 0.1 mm per coordinate. At every step all ghosts are accepted. The next is
confirmed where it lies within 0.3 mm of where the user sees the feature; else the feature is placed there.
So points are confirmed *because* they lie near their ghost, and each is as far off as its ghost was.

Run from the project's root: python benchmarks/suggestions.py [ANIMALS]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

_ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(_ROOT), *(str(_ROOT / "tests" / "labeler" / room) for room in ("", "models"))]

from suggestion_users import Coverage, measured, mirrored  # noqa: E402


def main(n_animals: int) -> None:
    """Print the coverage as a whole, by number of observations and by feature."""
    found = measured(n_animals)
    print(f"{n_animals} animals drawn from the published atlas, left side: what the atlas expects")
    print(f"{found.n_confirmed} ghosts were confirmed, {found.n_placed} features placed")
    _print(found)
    print("Right side, one or two features placed: what the left side, mirrored, expects")
    _print(mirrored(n_animals))


def _print(found: Coverage) -> None:
    print(f"the region held the feature in {found.whole:.1%} of all ghosts\n")
    for title, groups in (("observations", found.by_stage), ("feature", found.by_feature)):
        print(f"{title:>12}  ghosts  held")
        for name, held in sorted(groups.items()):
            print(f"{name:>12}  {len(held):>6}  {np.mean(held):.1%}")
        print()


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100)
