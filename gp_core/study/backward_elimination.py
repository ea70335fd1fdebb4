"""Backward elimination of features, for any score of a feature subset."""

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
    "SearchProgress",
    "SelectionProblem",
    "Ticker",
    "TrainingStep",
    "external",
    "probe_curve",
    "run_all",
]

Codes = tuple[str, ...]

FEWEST = 3
"""The smallest number of training and of probe features: fewer points determine no pose."""


class SelectionProblem(Protocol):
    """What is to be chosen for: leave-one-out of some animals by some method."""

    @property
    def n_sides(self) -> int:
        """How many sides are estimated for one score."""

    def scorer(self, training: Codes) -> Callable[[Sequence[Codes]], Sequence[float]]:
        """Return the function that scores sets of probe features, given training features.

        Parameters
        ----------
        training : tuple of str
            Training features.

        Returns
        -------
        callable
            From several sets of equally many probe features to the E_T of each.
        """


@dataclass(frozen=True)
class ProbeStep:
    """The best probe features of one number, for given training features.

    Attributes
    ----------
    n : int
        Number of probe features.
    features : tuple of str
        The best ones.
    e_t : float
        Their E_T, summed over all sides.
    """

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
class SearchProgress:
    """Progress of a search.

    Attributes
    ----------
    fits : int
        Sides estimated so far, including those of a resumed run.
    fraction : float
        Fraction of the work that is done, from 0 to 1; an estimate, since it depends on what will be dropped.
    seconds, left : float
        Time since the start of this run, and an estimate of the remaining time, s; NaN before the first
        candidate.
    text : str
        What is being done.
    """

    fits: int
    fraction: float
    seconds: float
    left: float
    text: str


class Ticker:
    """Counts finished work and estimates the remaining time.

    Parameters
    ----------
    tell : callable or None
        Receives a `SearchProgress` for each candidate; if it raises, the search stops.
    """

    def __init__(self, tell: Callable[[SearchProgress], None] | None = None) -> None:
        self.fits = 0
        self.later = 0.0  # work of the searches after the present one
        self._tell = tell
        self._start = time.monotonic()
        self._done = self._fresh = 0.0
        self._counted: set[str] = set()

    @property
    def seconds(self) -> float:
        """Time since the start of this run."""
        return time.monotonic() - self._start

    def count(self, task: str, fits: int, work: float, *, fresh: bool) -> None:
        """Record the work of a candidate, once.

        Parameters
        ----------
        task : str
            Name of the candidate.
        fits : int
            Number of registrations or fits.
        work : float
            In the unit of `work_of`.
        fresh : bool
            False where it came from a checkpoint.
        """
        if task in self._counted:
            return
        self._counted.add(task)
        self.fits += fits
        self._done += work
        self._fresh += work if fresh else 0.0

    def report(self, ahead: float, text: str) -> None:
        """Report the progress of the search.

        Parameters
        ----------
        ahead : float
            Remaining work in the current part, in the unit of `work_of`.
        text : str
            What has just been found.
        """
        if self._tell is not None:
            rest, seconds = ahead + self.later, self.seconds
            left = seconds * rest / self._fresh if self._fresh else math.nan
            self._tell(SearchProgress(self.fits, self._done / (self._done + rest), seconds, left, text))


@dataclass(frozen=True)
class Elimination:
    """One backward elimination over training features, and within each candidate over probe features.

    Parameters
    ----------
    problem : SelectionProblem
        Scores a feature subset.
    executor : concurrent.futures.Executor or None
        Runs the candidates.
    memory : Checkpoint
        Stores probe curves.
    ticker : Ticker
        Reports progress as candidates are finished.
    name : str
        Which search of a study this is: part of the checkpoint's tasks and of the progress text.
    """

    problem: SelectionProblem
    executor: Executor | None
    memory: Checkpoint
    ticker: Ticker
    name: str = "search"

    def run(self, start: Codes, fewest: int) -> tuple[TrainingStep, ...]:
        """Drop one training feature at a time.

        Parameters
        ----------
        start : tuple of str
            Training features to start from.
        fewest : int
            Number of training features to end at.

        Returns
        -------
        tuple of TrainingStep
            One for each number of training features.
        """
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
        """Return the probe curve of each candidate, stored or computed; `later`: work of later steps."""
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
        """Return whether the probe curve of a candidate is stored.

        Parameters
        ----------
        candidate : tuple of str
            Training features.

        Returns
        -------
        bool
            Whether it need not be computed.
        """
        return self.memory.get(self._task(candidate)) is not None

    def keep(self, candidate: Codes, curve: tuple[ProbeStep, ...], ahead: float) -> None:
        """Store a new probe curve and report progress.

        Parameters
        ----------
        candidate : tuple of str
            Training features.
        curve : tuple of ProbeStep
            Its probe curve.
        ahead : float
            Remaining work in the current part, in the unit of `work_of`.
        """
        self.memory.put(self._task(candidate), [[s.n, s.features, s.e_t] for s in curve])
        self._count(candidate, fresh=True)
        self.ticker.report(ahead, f"{self.name}: {len(candidate)} training features")

    def _count(self, candidate: Codes, *, fresh: bool) -> None:
        fits = _n_probe_subsets(len(external(candidate))) * self.problem.n_sides
        self.ticker.count(self._task(candidate), fits, work_of(candidate), fresh=fresh)

    def _task(self, candidate: Codes) -> str:
        return f"{self.name}: {' '.join(candidate)}"


def run_all(searches: Sequence[Elimination], start: Codes, fewest: int) -> list[tuple[TrainingStep, ...]]:
    """Run several searches with one progress report: the first step of all together, then one by one.

    Parameters
    ----------
    searches : sequence of Elimination
        The searches.
    start : tuple of str
        Training features to start from.
    fewest : int
        Number of training features to end at.

    Returns
    -------
    list of tuple of TrainingStep
        In the order of the searches.
    """
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


def _curve_of(task: tuple[SelectionProblem, Codes]) -> tuple[ProbeStep, ...]:
    return probe_curve(*task)


def external(training: Codes) -> Codes:
    """Return those features that can be touched.

    Parameters
    ----------
    training : tuple of str
        Features.

    Returns
    -------
    tuple of str
        External ones, in the table's order.
    """
    return tuple(code for code in EXTERNAL if code in training)


def probe_curve(problem: SelectionProblem, training: Codes) -> tuple[ProbeStep, ...]:
    """Drop one probe feature at a time, from all external training features down to three.

    Parameters
    ----------
    problem : SelectionProblem
        Scores the features.
    training : tuple of str
        Training features.

    Returns
    -------
    tuple of ProbeStep
        One for each number of probe features.
    """
    score = problem.scorer(training)
    features = external(training)
    steps = [ProbeStep(len(features), features, score([features])[0])]
    while len(features) > FEWEST:
        candidates = _each_left_out(features)
        scores = list(score(candidates))
        best = scores.index(min(scores))
        features = candidates[best]
        steps.append(ProbeStep(len(features), features, scores[best]))
    return tuple(steps)


def work_of(training: Codes) -> float:
    """Return the work for one candidate: number of probe subsets times points of a set.

    Parameters
    ----------
    training : tuple of str
        Training features.

    Returns
    -------
    float
        Work, in an arbitrary unit.
    """
    return float(_n_probe_subsets(len(external(training))) * len(training))


def work_below(training: Codes, fewest: int) -> float:
    """Estimate the work of all further steps, assuming that external features are dropped in proportion.

    Parameters
    ----------
    training : tuple of str
        Training features.
    fewest : int
        Number of training features to end at.

    Returns
    -------
    float
        Work, in the unit of `work_of`.
    """
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
