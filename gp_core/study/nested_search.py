"""Unbiased search: features are selected without the animal that they are scored on."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass
from os import PathLike
from typing import Any

import numpy as np

from gp_core.argument_types import checks_arguments
from gp_core.errors import GpError
from gp_core.landmarks.features import CODES
from gp_core.landmarks.sets import Specimen
from gp_core.registration.jrmpc import DEFAULTS, JrmpcSettings
from gp_core.study.backward_elimination import (
    Codes,
    Elimination,
    SearchProgress,
    Ticker,
    TrainingStep,
    run_all,
)
from gp_core.study.checkpoint import Checkpoint, fingerprint
from gp_core.study.leave_one_out import LeaveOneOutReport, Row, leave_one_out, summarise
from gp_core.study.scoring import PoseErrors
from gp_core.study.subset_search import check_start, problem_of

__all__ = ["NestedFold", "NestedReport", "nested_search"]

_FEWEST_ANIMALS = 4


@dataclass(frozen=True)
class NestedFold:
    """What was chosen without one animal.

    Attributes
    ----------
    held_out : str
    features, probe : tuple of str
        The training and probe features that are best for the other animals.
    e_t : float
        E_T of the others with these.
    """

    held_out: str
    features: Codes
    probe: Codes
    e_t: float


@dataclass(frozen=True)
class NestedReport:
    """Errors of the whole procedure, choosing included, beside the optimistic ones.

    Attributes
    ----------
    method : str
    settings : JrmpcSettings or None
        Of ``jrmpc``.
    rows : tuple of Row
        Each side with the features chosen without its animal; left sides, then right sides.
    folds : tuple of NestedFold
    optimistic : LeaveOneOutReport
        Every side with the features chosen on all animals, itself among them, as in the paper.
    fits : int
    seconds : float
    """

    method: str
    settings: JrmpcSettings | None
    rows: tuple[Row, ...]
    folds: tuple[NestedFold, ...]
    optimistic: LeaveOneOutReport
    fits: int
    seconds: float

    @property
    def errors(self) -> PoseErrors:
        """The errors of all rows."""
        return PoseErrors(
            np.array([row.e_co_mm for row in self.rows]), np.array([row.e_ma_deg for row in self.rows])
        )

    def as_dict(self) -> dict[str, Any]:
        """Return the report as the JSON file holds it.

        Returns
        -------
        dict
            Plain values for JSON; lengths in mm, angles in degrees.
        """
        numbers = {} if self.settings is None else asdict(self.settings)
        return {
            "rows": [asdict(row) for row in self.rows],
            "summary": summarise(self.errors),
            "folds": [asdict(fold) for fold in self.folds],
            "optimistic": self.optimistic.as_dict(),
            "fits": self.fits,
            "seconds": self.seconds,
            "settings": {"method": self.method, **numbers},
        }


@checks_arguments
def nested_search(
    specimens: Sequence[Specimen],
    *,
    method: str = "jrmpc",
    training: Iterable[str] = CODES,
    fewest_training: int | None = None,
    settings: JrmpcSettings = DEFAULTS,
    executor: Executor | None = None,
    checkpoint: str | PathLike[str] | None = None,
    progress: Callable[[SearchProgress], None] | None = None,
) -> NestedReport:
    """Search inside each fold: hold an animal out, select features on the others, then estimate it.

    A search over so many subsets finds some that suit its animals by chance; for an animal that had no part
    in the selection, that advantage is gone. So these are the errors to expect for a new animal.

    Parameters
    ----------
    specimens, method, training, fewest_training, settings, executor, checkpoint, progress
        As for `gp_core.study.subset_search.search_features`; at least four animals. The search takes about as
        many times longer as there are animals.

    Returns
    -------
    NestedReport
        Errors of each side, the selections of each fold, and the optimistic errors.

    Raises
    ------
    GpError
        Too few animals or features, or a checkpoint of another study.

    References
    ----------
    Varma and Simon, "Bias in error estimation when using cross-validation for model selection", BMC
    Bioinformatics 7:91, 2006. https://doi.org/10.1186/1471-2105-7-91
    """
    start, fewest = check_start(specimens, method, training, fewest_training)
    if len(specimens) < _FEWEST_ANIMALS:
        raise GpError(
            f"a nested search needs at least {_FEWEST_ANIMALS} animals, got {len(specimens)}",
            remedy="Give more of them, or search without holding animals out.",
        )
    used = settings if method == "jrmpc" else None
    memory = Checkpoint(checkpoint, fingerprint(specimens, used, ("nested", method)))
    ticker = Ticker(progress)
    cohorts = {f"without {s.name}": [other for other in specimens if other is not s] for s in specimens}
    searches = [
        Elimination(problem_of(cohort, method, settings), executor, memory, ticker, name)
        for name, cohort in {**cohorts, "all animals": list(specimens)}.items()
    ]
    *inner, whole = [_best(steps) for steps in run_all(searches, start, fewest)]
    folds = tuple(
        NestedFold(specimen.name, best.features, best.probe, best.e_t)
        for specimen, best in zip(specimens, inner, strict=True)
    )
    rows = [row for fold in folds for row in _outer(specimens, fold, method, settings)]
    optimistic = leave_one_out(
        specimens, method=method, training=whole.features, probe=whole.probe, settings=settings
    )
    return NestedReport(
        method=method,
        settings=used,
        rows=tuple(sorted(rows, key=lambda row: row.side)),
        folds=folds,
        optimistic=optimistic,
        fits=ticker.fits,
        seconds=ticker.seconds,
    )


def _best(steps: Sequence[TrainingStep]) -> TrainingStep:
    return min(steps, key=lambda step: step.e_t)


def _outer(
    specimens: Sequence[Specimen], fold: NestedFold, method: str, settings: JrmpcSettings
) -> tuple[Row, ...]:
    return leave_one_out(
        specimens,
        method=method,
        training=fold.features,
        probe=fold.probe,
        settings=settings,
        held_out=[fold.held_out],
    ).rows
