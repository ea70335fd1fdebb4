"""JRMPC compared with the robust method under increasing touch errors: the project's main claim."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from os import PathLike
from typing import Any

import numpy as np

from gp_core.argument_types import checks_arguments
from gp_core.atlas.atlas import Atlas
from gp_core.atlas.sampling import draw_animal
from gp_core.constants import METHODS
from gp_core.disk import write_text
from gp_core.errors import GpError
from gp_core.landmarks.features import EXTERNAL, PROBE, TRAINING
from gp_core.landmarks.sets import LandmarkSet, Specimen
from gp_core.pose.jrmpc_estimator import training_sides
from gp_core.registration.jrmpc import ESTIMATION, JrmpcSettings
from gp_core.study.leave_one_out import held_out_sides
from gp_core.study.parallel import run_map
from gp_core.study.scoring import PoseErrors, jrmpc_errors, robust_errors
from gp_core.study.subsets import check_labels, sides_of
from gp_core.study.trials import Trial, make_trial, window_arrays
from gp_core.validation import FloatArray, check_option

__all__ = ["CONDITIONS", "PROBES", "ComparisonReport", "ComparisonRow", "Condition", "compare"]

TEN = tuple(code for code in EXTERNAL if code in TRAINING)
"""The external features among the paper's 16 training features."""

PROBES = ("six", "ten", "five at random")
_RANDOM = 5


@dataclass(frozen=True)
class Condition:
    """Touch errors.

    Attributes
    ----------
    noise_mm : float
        Standard deviation of the Gaussian noise, mm per coordinate.
    mistouch_mm : float
        Error of one touch, mm.
    """

    noise_mm: float
    mistouch_mm: float = 0.0

    @property
    def label(self) -> str:
        """A few words."""
        return f"one touch {self.mistouch_mm:g} off" if self.mistouch_mm else f"noise {self.noise_mm:g}"


CONDITIONS = (
    *(Condition(noise) for noise in (0.0, 0.1, 0.2, 0.4)),
    *(Condition(0.1, mistouch) for mistouch in (1.5, 3.0)),
)
"""Noise of a careful hand, in trials with a mistouch."""


@dataclass(frozen=True)
class ComparisonRow:
    """Errors of one method under one condition.

    Attributes
    ----------
    probe : str
        ``six`` (the paper's), ``ten`` (all external ones in training) or ``five at random`` (of the ten).
    condition : Condition
    method : str
    errors : PoseErrors
        Of all sides and repeats; the same touches for both methods.
    """

    probe: str
    condition: Condition
    method: str
    errors: PoseErrors

    def as_dict(self) -> dict[str, Any]:
        """Return the row as the JSON file holds it.

        Returns
        -------
        dict
            Plain values for JSON; lengths in mm, angles in degrees.
        """
        return {
            "probe": self.probe,
            "noise_mm": self.condition.noise_mm,
            "mistouch_mm": self.condition.mistouch_mm,
            "method": self.method,
            "n": len(self.errors.e_co_mm),
            "e_co_mm": _summary(self.errors.e_co_mm),
            "e_ma_deg": _summary(self.errors.e_ma_deg),
        }


@dataclass(frozen=True)
class ComparisonReport:
    """The comparison of both methods.

    Attributes
    ----------
    animals : str
        What they are, and how often touched.
    repeats : int
        How many times every side was touched; drawn animals are new each time.
    rows : tuple of ComparisonRow
    """

    animals: str
    repeats: int
    rows: tuple[ComparisonRow, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return the report as the JSON file holds it.

        Returns
        -------
        dict
            Plain values for JSON; lengths in mm, angles in degrees.
        """
        return {
            "animals": self.animals,
            "repeats": self.repeats,
            "rows": [row.as_dict() for row in self.rows],
        }

    @checks_arguments
    def save_csv(self, path: str | PathLike[str]) -> None:
        """Write one line per row, with full precision.

        Parameters
        ----------
        path : path-like
            Where to write.

        Raises
        ------
        GpError
            The file cannot be written.
        """
        statistics = [f"{e}_{s}" for e in ("e_co_mm", "e_ma_deg") for s in ("mean", "p95", "max")]
        lines = [",".join(["probe", "noise_mm", "mistouch_mm", "method", "n", *statistics])]
        for row in self.rows:
            values = row.as_dict()
            flat = [values[name] for name in ("probe", "noise_mm", "mistouch_mm", "method", "n")]
            flat += [*values["e_co_mm"].values(), *values["e_ma_deg"].values()]
            lines.append(",".join(str(value) for value in flat))
        write_text(path, "\n".join(lines) + "\n")


def _summary(values: FloatArray) -> dict[str, float]:
    return {
        "mean": float(values.mean()),
        "p95": float(np.percentile(values, 95)),
        "max": float(values.max()),
    }


@checks_arguments
def compare(
    specimens: Sequence[Specimen] | None = None,
    *,
    repeats: int = 20,
    n_animals: int = 11,
    rng: np.random.Generator,
    probes: Sequence[str] = PROBES,
    conditions: Sequence[Condition] = CONDITIONS,
    settings: JrmpcSettings = ESTIMATION,
    executor: Executor | None = None,
) -> ComparisonReport:
    """Compare JRMPC and the robust method in leave-one-out, under touch errors.

    JRMPC gets the RW frame built on the touches of RWA, RWP and LLI, even where these are not among the five
    random features, since it cannot start without it. The robust method gets only the five.

    Parameters
    ----------
    specimens : sequence of Specimen, optional
        At least three labelled animals. By default animals are drawn from the published atlas.
    repeats : int
        Number of times that each side is touched; where animals are drawn, number of cohorts.
    n_animals : int
        Number of animals drawn for a cohort.
    rng : numpy Generator
        Source of random numbers.
    probes : sequence of {"six", "ten", "five at random"}
        What is touched.
    conditions : sequence of Condition
        With which errors.
    settings : JrmpcSettings
        Of JRMPC.
    executor : concurrent.futures.Executor, optional
        Runs the repeats; the result does not depend on it.

    Returns
    -------
    ComparisonReport
        One row for each probe, condition and method.

    Raises
    ------
    GpError
        Too few animals, or a feature is missing.
    """
    for probe in probes:
        check_option(probe, "the touched features", PROBES)
    if repeats < 1:
        raise GpError(f"the number of repeats must be 1 or more, got {repeats}")
    if specimens is None and n_animals < 3:
        raise GpError(f"a cohort needs at least 3 animals, got {n_animals}")
    if specimens is not None:
        check_labels(specimens, TRAINING)
    cohort = None if specimens is None else _Cohort.of(specimens)
    cases = [(probe, condition) for probe in probes for condition in conditions]
    task = partial(_repeat, cohort, n_animals, settings, cases)
    parts = run_map(task, rng.spawn(repeats), executor)
    keys = [(*case, method) for case in cases for method in METHODS]
    rows = [ComparisonRow(*key, PoseErrors.joined([part[i] for part in parts])) for i, key in enumerate(keys)]
    animals = (
        f"{repeats} cohorts of {n_animals} animals drawn from the published atlas"
        if specimens is None
        else f"{len(specimens)} labelled animals, each touched {repeats} times"
    )
    return ComparisonReport(animals, repeats, tuple(rows))


@dataclass(frozen=True)
class _Cohort:
    """Every labelled side of a cohort, with what is known from the other animals.

    Attributes
    ----------
    groups : list of (atlases, training, truths)
        A side of the head each: atlas without the animal, the others' points (A, A - 1, 20, 3) in their CO
        frames, and the animal's own.
    """

    groups: tuple[tuple[list[Atlas], FloatArray, list[LandmarkSet]], ...]

    @classmethod
    def of(cls, specimens: Sequence[Specimen]) -> _Cohort:
        atlases, truths = held_out_sides(specimens, TRAINING)
        groups, first = [], 0
        for side, which in sides_of(specimens):
            labelled = np.array([t.landmarks.points for t in training_sides(specimens, side)])
            others = np.array([np.delete(labelled, i, axis=0) for i in range(len(which))])
            last = first + len(which)
            groups.append((atlases[first:last], others, truths[first:last]))
            first = last
        return cls(tuple(groups))


def _repeat(
    cohort: _Cohort | None,
    n_animals: int,
    settings: JrmpcSettings,
    cases: Sequence[tuple[str, Condition]],
    rng: np.random.Generator,
) -> list[PoseErrors]:
    """Touch every side once in every case; errors by case, then by method."""
    if cohort is None:
        published = Atlas.published()
        cohort = _Cohort.of([draw_animal(published, rng=rng, name=f"{i}") for i in range(n_animals)])
    found = []
    for probe, condition in cases:
        parts: dict[str, list[PoseErrors]] = {method: [] for method in METHODS}
        for atlases, others, truths in cohort.groups:
            trials = [_touch(truth, probe, condition, rng) for truth in truths]
            parts["robust"].append(robust_errors(atlases, [t.touches for t in trials], truths))
            parts["jrmpc"].append(jrmpc_errors(others, *window_arrays(trials), TRAINING, settings))
        found += [PoseErrors.joined(parts[method]) for method in METHODS]
    return found


def _touch(truth: LandmarkSet, probe: str, condition: Condition, rng: np.random.Generator) -> Trial:
    if probe == "five at random":
        codes = tuple(rng.choice(TEN, _RANDOM, replace=False).tolist())
    else:
        codes = PROBE if probe == "six" else TEN
    return make_trial(truth, codes, noise=condition.noise_mm, mistouch=condition.mistouch_mm, rng=rng)
