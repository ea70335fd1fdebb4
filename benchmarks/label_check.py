"""How many mistakes the label check finds, and how often it accuses good labels.

Run ``python benchmarks/label_check.py``. Random features of ears drawn from the published atlas are labelled
with 0.1 mm noise on every coordinate; then the whole side is called by the other side's name, or two names
are exchanged. ``--json FILE`` keeps each trial, and ``--against FILE`` compares with such a file, trial by
trial: the same seed draws the same ears. ``--old`` asks the two checkers that there were before, of the shell
and of the window, in a checkout of commit 8da40c9:

    git worktree add /tmp/before 8da40c9
    PYTHONPATH=/tmp/before python benchmarks/label_check.py --old --correct 0 --trials 600 --json old.json
    python benchmarks/label_check.py --trials 600 --correct 1000 --against old.json
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from gp_core import Atlas, LandmarkSet, Side

try:
    from gp_core.atlas.sampling import draw_animal
except ModuleNotFoundError:  # at commit 8da40c9, see above
    from gp_core.atlas.draw import draw_animal  # type: ignore[import-not-found, no-redef]

N_LABELS = (4, 5, 6, 8, 12, 19)
NOISE_MM = 0.1
COLUMNS = ("side found", "exchange found", "exchange named")

Check = Callable[[LandmarkSet], tuple[bool, set[frozenset[str]], set[str]]]
"""Whether the side is called the other one, the pairs called exchanged, and the labels that are outliers."""


def new_check(atlas: Atlas) -> Check:
    """Return the checker of this checkout."""
    from gp_core.atlas.label_check import check_side

    def check(landmarks: LandmarkSet) -> tuple[bool, set[frozenset[str]], set[str]]:
        found = check_side(landmarks, atlas)
        pairs = {frozenset(f.landmarks) for f in found.findings if f.kind == "exchanged"}
        outliers = {
            code for f in found.findings if f.is_problem and f.kind != "other side" for code in f.landmarks
        }
        return found.is_other_side, pairs, outliers

    return check


def old_shell(atlas: Atlas) -> Check:
    """Return what ``gp-core check`` was."""
    from gp_core.atlas.quality import check_landmarks  # type: ignore[import-not-found]

    def check(landmarks: LandmarkSet) -> tuple[bool, set[frozenset[str]], set[str]]:
        found = [
            f for f in check_landmarks(landmarks, atlas) if f.kind not in ("missing", "unseen", "unchecked")
        ]
        pairs = {frozenset(f.landmarks) for f in found if f.kind == "swapped"}
        is_other = any(f.kind == "other side" for f in found)
        return is_other, pairs, {code for f in found if f.kind != "other side" for code in f.landmarks}

    return check


def old_window(atlas: Atlas) -> Check:
    """Return what the labelling window asked."""
    from functools import partial

    from gp_core.atlas.shape import predict  # type: ignore[import-not-found]
    from gp_labeler.session.ghosts import Expectations, Judging  # type: ignore[import-not-found]

    def check(landmarks: LandmarkSet) -> tuple[bool, set[frozenset[str]], set[str]]:
        expectations = Expectations(partial(predict, atlas))
        Judging(expectations, landmarks).run(lambda _: None)
        return expectations.known_other_side(landmarks), set(), set(expectations.doubts(landmarks))

    return check


def ears(atlas: Atlas, n: int, n_trials: int, seed: int) -> Iterator[tuple[LandmarkSet, tuple[str, str]]]:
    """Draw ears with n labels, left and right in turn, and two of the features of each."""
    for trial in range(n_trials):
        rng = np.random.default_rng([seed, n, trial])
        side = (Side.LEFT, Side.RIGHT)[trial % 2]
        ear = draw_animal(atlas, rng=rng, tilt_deg=20.0).side(side)
        codes = [str(code) for code in rng.choice(atlas.codes, n, replace=False)]
        points = {code: ear[code] + rng.normal(0, NOISE_MM, 3) for code in codes}
        a, b = (codes[i] for i in rng.choice(n, 2, replace=False))
        yield LandmarkSet.from_mapping(points, side), (a, b)


def trials(check: Check, atlas: Atlas, n: int, n_trials: int, seed: int) -> dict[str, list[bool]]:
    """Try both mistakes on each ear; return for every column whether it was found."""
    found: dict[str, list[bool]] = {column: [] for column in COLUMNS}
    for landmarks, (a, b) in ears(atlas, n, n_trials, seed):
        found["side found"].append(check(LandmarkSet(landmarks.points, landmarks.side.other))[0])
        exchanged = landmarks.with_point(a, landmarks[b]).with_point(b, landmarks[a])
        _, pairs, outliers = check(exchanged)
        is_named = pairs == {frozenset((a, b))}
        found["exchange named"].append(is_named)
        found["exchange found"].append(is_named or {a, b} <= outliers)
    return found


def false_alarms(check: Check, atlas: Atlas, n: int, n_trials: int, seed: int) -> tuple[int, float]:
    """Return how many of n_trials ears in order are accused of anything, and ms a check."""
    alarms, begin = 0, time.perf_counter()
    spent = 0.0
    for landmarks, _ in ears(atlas, n, n_trials, seed + 1):
        begin = time.perf_counter()
        is_other, pairs, outliers = check(landmarks)
        spent += time.perf_counter() - begin
        alarms += bool(is_other or pairs or outliers)
    return alarms, 1000 * spent / n_trials


def main() -> None:
    """Measure, print, and compare."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--trials", type=int, default=60, help="ears of each number of labels")
    parser.add_argument("--correct", type=int, default=200, help="ears in order of each number of labels")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--old", action="store_true", help="the two checkers that there were before")
    parser.add_argument("--json", type=Path, help="write every trial")
    parser.add_argument("--against", type=Path, help="compare with such a file")
    args = parser.parse_args()
    atlas = Atlas.published()
    checkers = {"shell": old_shell, "window": old_window} if args.old else {"now": new_check}
    results = {name: measure(make(atlas), atlas, args, name) for name, make in checkers.items()}
    if args.json:
        args.json.write_text(json.dumps(results))
    if args.against:
        compare(results["now"], json.loads(args.against.read_text()))


def measure(
    check: Check, atlas: Atlas, args: argparse.Namespace, name: str
) -> dict[str, dict[str, list[bool]]]:
    """Print a table of one checker, and return its trials by number of labels."""
    results = {str(n): trials(check, atlas, n, args.trials, args.seed) for n in N_LABELS}
    print(f"{name}, of {args.trials}:" + "".join(f"{n:>6}" for n in N_LABELS))
    for column in COLUMNS:
        print(f"  {column:<15}" + "".join(f"{sum(results[str(n)][column]):6}" for n in N_LABELS))
    for n in range(4, 20) if args.correct else ():
        alarms, ms = false_alarms(check, atlas, n, args.correct, args.seed)
        print(f"  {n:2} labels: {alarms} false alarms in {args.correct} ears, {ms:.1f} ms a check")
    return results


def compare(
    now: dict[str, dict[str, list[bool]]], before: dict[str, dict[str, dict[str, list[bool]]]]
) -> None:
    """Print by how much each cell differs from the better checker before, with its paired 95 % interval."""
    for column in COLUMNS:
        for n, found in now.items():
            name, old = max(((k, v[n][column]) for k, v in before.items()), key=lambda each: sum(each[1]))
            difference = np.array(found[column], dtype=float) - np.array(old, dtype=float)
            half = 1.96 * difference.std(ddof=1) / len(difference) ** 0.5
            mark = "BELOW" if difference.mean() + half < 0 else ""
            print(f"  {column:<15} {n:>2}: {difference.mean():+.3f} +- {half:.3f} against the {name} {mark}")


if __name__ == "__main__":
    main()
