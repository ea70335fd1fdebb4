"""Backward elimination of features, over anything that can score a choice of them."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

from gp_core.landmarks.features import EXTERNAL
from gp_core.study.checkpoint import Checkpoint
from gp_core.study.parallel import run_map

__all__ = [
    "FEWEST",
    "Codes",
    "Elimination",
    "ProbeStep",
    "Problem",
    "Progress",
    "Ticker",
    "TrainingStep",
    "external",
    "probe_curve",
    "run_all",
]

Codes = tuple[str, ...]

FEWEST = 3
"""The smallest number of training and of probe features: fewer points have no pose."""


class Problem(Protocol):
    """What is to be chosen for: leave-one-out of some animals by some method."""

    @property
    def n_sides(self) -> int:
        """How many sides are estimated for one score."""

    def scorer(self, training: Codes) -> Callable[[Codes], float]:
        """Return what gives E_T of probe features, with these training features."""


@dataclass(frozen=True)
class ProbeStep:
    """The best probe features of one number, and their E_T."""

    n: int
    features: Codes
    e_t: float


@dataclass(frozen=True)
class TrainingStep:
    """The best training features of one number.

    Attributes
    ----------
    n : int
    features : tuple of str
    dropped : str or None
        The feature that the step before still had; None for the first.
    e_t : float
        Least E_T of the probe curve.
    probe : tuple of str
        The probe features that reach it.
    probe_curve : tuple of ProbeStep
        From all external features among `features` downward.
    """

    n: int
    features: Codes
    dropped: str | None
    e_t: float
    probe: Codes
    probe_curve: tuple[ProbeStep, ...]


@dataclass(frozen=True)
class Progress:
    """How far a search is.

    Attributes
    ----------
    fits : int
        Sides estimated so far, those of a resumed run included.
    fraction : float
        Share of the work that is done, from 0 to 1; an estimate, since it depends on what will be dropped.
    seconds, left : float
        Time since the start of this run, and an estimate of what is still to come; NaN before the first.
    text : str
        What is being done.
    """

    fits: int
    fraction: float
    seconds: float
    left: float
    text: str


class Ticker:
    """Counts what is done and says how long the rest will take.

    Parameters
    ----------
    tell : callable or None
        Told about each candidate; what it raises stops the search.
    """

    def __init__(self, tell: Callable[[Progress], None] | None = None) -> None:
        self.fits = 0
        self.later = 0.0  # work of searches still to follow the present one
        self._tell = tell
        self._start = time.monotonic()
        self._done = self._fresh = 0.0
        self._counted: set[str] = set()

    @property
    def seconds(self) -> float:
        """Time since the start of this run."""
        return time.monotonic() - self._start

    def count(self, task: str, fits: int, work: float, *, fresh: bool) -> None:
        """Add what a candidate took, once; `fresh` is False where it came from a checkpoint."""
        if task in self._counted:
            return
        self._counted.add(task)
        self.fits += fits
        self._done += work
        self._fresh += work if fresh else 0.0

    def report(self, ahead: float, text: str) -> None:
        """Tell how far the search is, with this much work ahead in its present part."""
        if self._tell is not None:
            rest, seconds = ahead + self.later, self.seconds
            left = seconds * rest / self._fresh if self._fresh else math.nan
            self._tell(Progress(self.fits, self._done / (self._done + rest), seconds, left, text))


@dataclass(frozen=True)
class Elimination:
    """One backward elimination, over training features and within each candidate over probe features.

    Parameters
    ----------
    problem : Problem
        What scores a choice.
    executor : concurrent.futures.Executor or None
        What candidates run on.
    memory : Checkpoint
        Where probe curves are kept.
    ticker : Ticker
        Told as candidates come in.
    name : str
        Which search of a study this is: part of the checkpoint's tasks and of the progress text.
    """

    problem: Problem
    executor: Executor | None
    memory: Checkpoint
    ticker: Ticker
    name: str = "search"

    def run(self, start: Codes, fewest: int) -> tuple[TrainingStep, ...]:
        """Drop one training feature at a time, from `start` down to `fewest`."""
        (curve,) = self._curves([start], work_below(start, fewest))
        steps = [_training_step(start, None, curve)]
        while len(features := steps[-1].features) > fewest:
            candidates = [rest for rest in _each_left_out(features) if len(external(rest)) >= FEWEST]
            if not candidates:
                break
            later = work_below(candidates[0], fewest)
            curves = self._curves(candidates, later)
            scores = [min(step.e_t for step in found) for found in curves]
            best = scores.index(min(scores))
            (dropped,) = set(features) - set(candidates[best])
            steps.append(_training_step(candidates[best], dropped, curves[best]))
        return tuple(steps)

    def _curves(self, candidates: Sequence[Codes], later: float) -> list[tuple[ProbeStep, ...]]:
        """Return the probe curve of each candidate, from memory or anew; `later` is work of later steps."""
        known = {c: self.memory.get(self._task(c)) for c in candidates}
        curves = {c: _from_json(content) for c, content in known.items() if content is not None}
        missing = [c for c in candidates if c not in curves]
        ahead = later + sum(map(work_of, missing))
        for candidate in curves:
            self._count(candidate, fresh=False)

        def take(index: int, curve: tuple[ProbeStep, ...]) -> None:
            nonlocal ahead
            ahead -= work_of(missing[index])
            self.keep(missing[index], curve, ahead)

        found = run_map(partial(probe_curve, self.problem), missing, self.executor, done=take)
        curves.update(zip(missing, found, strict=True))
        return [curves[c] for c in candidates]

    def knows(self, candidate: Codes) -> bool:
        """Return whether the probe curve of a candidate is in memory."""
        return self.memory.get(self._task(candidate)) is not None

    def keep(self, candidate: Codes, curve: tuple[ProbeStep, ...], ahead: float) -> None:
        """Put a new probe curve into memory and tell, with this much work ahead."""
        self.memory.put(self._task(candidate), [[s.n, s.features, s.e_t] for s in curve])
        self._count(candidate, fresh=True)
        self.ticker.report(ahead, f"{self.name}: {len(candidate)} training features")

    def _count(self, candidate: Codes, *, fresh: bool) -> None:
        fits = _n_probe_subsets(len(external(candidate))) * self.problem.n_sides
        self.ticker.count(self._task(candidate), fits, work_of(candidate), fresh=fresh)

    def _task(self, candidate: Codes) -> str:
        return f"{self.name}: {' '.join(candidate)}"


def run_all(searches: Sequence[Elimination], start: Codes, fewest: int) -> list[tuple[TrainingStep, ...]]:
    """Run several searches on one ticker: the first step of all side by side, then one after the other."""
    ticker, executor = searches[0].ticker, searches[0].executor
    whole, first = work_of(start) + work_below(start, fewest), work_of(start)
    missing = [search for search in searches if not search.knows(start)]
    ahead = whole * len(searches)

    def take(index: int, curve: tuple[ProbeStep, ...]) -> None:
        nonlocal ahead
        ahead -= first
        missing[index].keep(start, curve, ahead)

    run_map(_curve_of, [(search.problem, start) for search in missing], executor, done=take)
    found: list[tuple[TrainingStep, ...]] = []
    for following in range(len(searches) - 1, -1, -1):
        ticker.later = following * (whole - first)
        found.append(searches[len(found)].run(start, fewest))
    return found


def _curve_of(task: tuple[Problem, Codes]) -> tuple[ProbeStep, ...]:
    return probe_curve(*task)


def external(training: Codes) -> Codes:
    """Return the features among these that can be touched, in the table's order."""
    return tuple(code for code in EXTERNAL if code in training)


def probe_curve(problem: Problem, training: Codes) -> tuple[ProbeStep, ...]:
    """Drop one probe feature at a time, from all external ones among `training` down to three."""
    score = problem.scorer(training)
    features = external(training)
    steps = [ProbeStep(len(features), features, score(features))]
    while len(features) > FEWEST:
        candidates = _each_left_out(features)
        scores = [score(candidate) for candidate in candidates]
        best = scores.index(min(scores))
        features = candidates[best]
        steps.append(ProbeStep(len(features), features, scores[best]))
    return tuple(steps)


def work_of(training: Codes) -> float:
    """Return how much work a candidate is, in some unit: choices of probe features times points of a set."""
    return float(_n_probe_subsets(len(external(training))) * len(training))


def work_below(training: Codes, fewest: int) -> float:
    """Estimate the work of all steps below these features, as if external ones went in proportion."""
    n, share = len(training), len(external(training)) / len(training)
    return sum(
        float((size + 1) * size * _n_probe_subsets(max(FEWEST, round(share * size))))
        for size in range(fewest, n)
    )


def _n_probe_subsets(n_external: int) -> int:
    return 1 + sum(range(FEWEST + 1, n_external + 1))


def _each_left_out(features: Codes) -> list[Codes]:
    return [features[:i] + features[i + 1 :] for i in range(len(features))]


def _training_step(features: Codes, dropped: str | None, curve: tuple[ProbeStep, ...]) -> TrainingStep:
    best = min(curve, key=lambda step: (step.e_t, step.n))
    return TrainingStep(len(features), features, dropped, best.e_t, best.features, curve)


def _from_json(content: Any) -> tuple[ProbeStep, ...]:
    return tuple(ProbeStep(int(n), tuple(features), float(e_t)) for n, features, e_t in content)
