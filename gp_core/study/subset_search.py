"""Search for the best features: backward elimination over training and probe features (Figure 5)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass
from os import PathLike
from typing import Any

from gp_core.argument_types import checks_arguments
from gp_core.constants import METHODS
from gp_core.errors import FeatureError, GpError
from gp_core.landmarks.features import CODES, check_codes
from gp_core.landmarks.sets import Specimen
from gp_core.registration.jrmpc import DEFAULTS, JrmpcSettings
from gp_core.study.backward_elimination import (
    FEWEST,
    Codes,
    Elimination,
    SearchProgress,
    SelectionProblem,
    Ticker,
    TrainingStep,
    external,
)
from gp_core.study.checkpoint import Checkpoint, fingerprint
from gp_core.study.leave_one_out import Folds, folds_of, held_out_sides
from gp_core.study.scoring import PoseErrors, robust_errors, touched
from gp_core.study.subsets import check_labels
from gp_core.validation import check_option

__all__ = ["SearchReport", "check_start", "problem_of", "search_features"]


@dataclass(frozen=True)
class SearchReport:
    """The two curves of the search.

    Attributes
    ----------
    method : str
    settings : JrmpcSettings or None
        Of ``jrmpc``.
    training : tuple of TrainingStep
        From all training features downward.
    fits : int
        How many sides were estimated in all, those of a resumed run included.
    seconds : float
        Time this run took.
    """

    method: str
    settings: JrmpcSettings | None
    training: tuple[TrainingStep, ...]
    fits: int
    seconds: float

    @property
    def best(self) -> TrainingStep:
        """The step with the least E_T."""
        return min(self.training, key=lambda step: step.e_t)

    def as_dict(self) -> dict[str, Any]:
        """Return the report as the JSON file holds it.

        Returns
        -------
        dict
            Plain values for JSON; lengths in mm, angles in degrees.
        """
        best = self.best
        numbers = {} if self.settings is None else asdict(self.settings)
        return {
            "training": [asdict(step) for step in self.training],
            "best": {"n": best.n, "features": best.features, "probe": best.probe, "e_t": best.e_t},
            "fits": self.fits,
            "seconds": self.seconds,
            "settings": {"method": self.method, **numbers},
        }


@dataclass(frozen=True)
class JrmpcProblem:
    """Leave-one-out by JRMPC, as a problem for `Elimination`.

    Attributes
    ----------
    folds : tuple of Folds
        One for each labelled side of the head.
    settings : JrmpcSettings
        Of the registration.
    """

    folds: tuple[Folds, ...]
    settings: JrmpcSettings

    @property
    def n_sides(self) -> int:
        """How many sides are estimated for one score."""
        return sum(len(fold.cochlea) for fold in self.folds)

    def scorer(self, training: Codes) -> Callable[[Sequence[Codes]], list[float]]:
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

        def score(probes: Sequence[Codes]) -> list[float]:
            sides = [fold.errors_of_each(training, probes, self.settings) for fold in self.folds]
            return [PoseErrors.joined(errors).e_t for errors in zip(*sides, strict=True)]

        return score


@dataclass(frozen=True)
class RobustProblem:
    """Leave-one-out by the robust method, as a problem for `Elimination`.

    Attributes
    ----------
    specimens : tuple of Specimen
        Labelled animals.
    """

    specimens: tuple[Specimen, ...]

    @property
    def n_sides(self) -> int:
        """How many sides are estimated for one score."""
        return sum(len(specimen.sides) for specimen in self.specimens)

    def scorer(self, training: Codes) -> Callable[[Sequence[Codes]], list[float]]:
        """Fit the atlases, and return the function that scores sets of probe features.

        Parameters
        ----------
        training : tuple of str
            Features of the atlases.

        Returns
        -------
        callable
            From several sets of probe features to the E_T of each.
        """
        atlases, truths = held_out_sides(self.specimens, training)
        return lambda probes: [
            robust_errors(atlases, [touched(truth, probe) for truth in truths], truths).e_t
            for probe in probes
        ]


@checks_arguments
def search_features(
    specimens: Sequence[Specimen],
    *,
    method: str = "jrmpc",
    training: Iterable[str] = CODES,
    fewest_training: int | None = None,
    settings: JrmpcSettings = DEFAULTS,
    executor: Executor | None = None,
    checkpoint: str | PathLike[str] | None = None,
    progress: Callable[[SearchProgress], None] | None = None,
) -> SearchReport:
    """Find the features with the smallest leave-one-out error E_T, dropping one at a time.

    From the best training features of one number, each is left out in turn; each of these candidates is
    scored by the smallest E_T of a backward elimination over its own external features, and the best is the
    next step. Features are selected on the animals that they are scored on, so the errors are optimistic: see
    `gp_core.study.nested_search`.

    Parameters
    ----------
    specimens : sequence of Specimen
        At least three animals that have the features on every labelled side.
    method : {"jrmpc", "robust"}
        The estimator.
    training : iterable of str
        Where the elimination starts, by default at all 20 features.
    fewest_training : int, optional
        Where it ends: by default at three with ``jrmpc``. With ``robust`` it ends where it starts, so that
        only probe features are selected: features that are not touched do no harm in an atlas.
    settings : JrmpcSettings
        Of ``jrmpc``.
    executor : concurrent.futures.Executor, optional
        Runs the candidates; the result does not depend on it.
    checkpoint : path-like, optional
        Where results are stored as they come in; a search that finds this file resumes from it.
    progress : callable, optional
        Receives a `SearchProgress` for each candidate; if it raises, the search stops.

    Returns
    -------
    SearchReport
        The steps of the elimination.

    Raises
    ------
    GpError
        Too few animals or features, or a checkpoint of another study.

    References
    ----------
    Usevitch et al., "Estimating the pose of a guinea-pig cochlea without medical imaging", 2021, Figure 5.
    """
    start, fewest = check_start(specimens, method, training, fewest_training)
    used = settings if method == "jrmpc" else None
    memory = Checkpoint(checkpoint, fingerprint(specimens, used, ("search", method)))
    ticker = Ticker(progress)
    elimination = Elimination(problem_of(specimens, method, settings), executor, memory, ticker)
    steps = elimination.run(start, fewest)
    return SearchReport(method, used, steps, ticker.fits, ticker.seconds)


def check_start(
    specimens: Sequence[Specimen], method: str, training: Iterable[str], fewest: int | None
) -> tuple[Codes, int]:
    """Return the training features that a search starts from, and the number that it ends at.

    Parameters
    ----------
    specimens : sequence of Specimen
        Labelled animals.
    method : {"jrmpc", "robust"}
        The estimator.
    training : iterable of str
        Requested features.
    fewest : int or None
        Requested end; None: the default of the method.

    Returns
    -------
    start : tuple of str
        Training features.
    fewest : int
        Number of training features to end at.

    Raises
    ------
    GpError
        Unknown or too few features, or an impossible end.
    """
    check_option(method, "method", METHODS)
    start = check_codes(training, "the training features", at_least=FEWEST)
    if len(external(start)) < FEWEST:
        raise FeatureError(f"the training features hold fewer than {FEWEST} that can be touched")
    check_labels(specimens, start)
    if fewest is None:
        fewest = FEWEST if method == "jrmpc" else len(start)
    if not FEWEST <= fewest <= len(start):
        raise GpError(f"the search must end at {FEWEST} to {len(start)} training features, got {fewest}")
    return start, fewest


def problem_of(specimens: Sequence[Specimen], method: str, settings: JrmpcSettings) -> SelectionProblem:
    """Return the leave-one-out problem of some animals.

    Parameters
    ----------
    specimens : sequence of Specimen
        Labelled animals.
    method : {"jrmpc", "robust"}
        The estimator.
    settings : JrmpcSettings
        Of ``jrmpc``.

    Returns
    -------
    SelectionProblem
        Scores features.
    """
    if method == "robust":
        return RobustProblem(tuple(specimens))
    return JrmpcProblem(tuple(folds_of(specimens)), settings)
