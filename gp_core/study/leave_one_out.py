"""Leave-one-out: every labelled side is estimated from the other animals (Figure 6 A and B)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from gp_core.argument_types import checks_arguments
from gp_core.atlas.atlas import Atlas
from gp_core.atlas.plain_fit import fit_plain_atlas
from gp_core.constants import METHODS
from gp_core.errors import GpError
from gp_core.landmarks.anatomy import round_window_frame, with_cochlea_origin
from gp_core.landmarks.features import PROBE, TRAINING, index_of
from gp_core.landmarks.sets import LandmarkSet, Specimen
from gp_core.pose.jrmpc_estimator import training_sides
from gp_core.registration.jrmpc import ESTIMATION, JrmpcSettings
from gp_core.study.scoring import PoseErrors, jrmpc_errors, robust_errors, touched
from gp_core.study.subsets import check_labels, check_subsets, sides_of
from gp_core.validation import FloatArray, check_option

__all__ = [
    "Folds",
    "LeaveOneOutReport",
    "Row",
    "describe",
    "folds_of",
    "held_out_sides",
    "leave_one_out",
    "summarise",
]


@dataclass(frozen=True)
class Row:
    """Errors of one held-out side.

    Attributes
    ----------
    specimen : str
        Name of the animal.
    side : str
        ``L`` or ``R``.
    e_co_mm : float
        Distance between true and estimated CO, mm.
    e_ma_deg : float
        Angle between true and estimated modiolar axis, degrees.
    """

    specimen: str
    side: str
    e_co_mm: float
    e_ma_deg: float


@dataclass(frozen=True)
class LeaveOneOutReport:
    """Errors of every side, each estimated without its animal.

    Attributes
    ----------
    method : str
        ``jrmpc`` or ``robust``.
    training, probe : tuple of str
        The features of the training animals, and those that were touched.
    settings : JrmpcSettings or None
        Of ``jrmpc``.
    rows : tuple of Row
        Left sides, then right sides.
    """

    method: str
    training: tuple[str, ...]
    probe: tuple[str, ...]
    settings: JrmpcSettings | None
    rows: tuple[Row, ...]

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
        return {
            "rows": [asdict(row) for row in self.rows],
            "summary": summarise(self.errors),
            "settings": describe(self.method, self.training, self.probe, self.settings),
        }


def describe(
    method: str, training: Sequence[str], probe: Sequence[str], settings: JrmpcSettings | None
) -> dict[str, Any]:
    """Return the settings of a study as its JSON file holds them.

    Parameters
    ----------
    method : str
        ``jrmpc`` or ``robust``.
    training, probe : sequence of str
        Features.
    settings : JrmpcSettings or None
        Of the registration.

    Returns
    -------
    dict
        Plain values for JSON.
    """
    numbers = {} if settings is None else asdict(settings)
    return {"method": method, "training": list(training), "probe": list(probe), **numbers}


def summarise(errors: PoseErrors) -> dict[str, Any]:
    """Return mean, median and maximum of both errors, and E_T.

    Parameters
    ----------
    errors : PoseErrors
        Of N sides.

    Returns
    -------
    dict
        Plain values for JSON; mm and degrees.
    """
    return {
        **{name: _summary(getattr(errors, name)) for name in ("e_co_mm", "e_ma_deg")},
        "e_t": errors.e_t,
    }


def _summary(values: FloatArray) -> dict[str, float]:
    return {
        "mean": float(values.mean()),
        "median": float(np.median(values)),
        "max": float(values.max()),
    }


@checks_arguments
def leave_one_out(
    specimens: Sequence[Specimen],
    *,
    method: str = "jrmpc",
    training: Iterable[str] = TRAINING,
    probe: Iterable[str] = PROBE,
    settings: JrmpcSettings = ESTIMATION,
    held_out: Iterable[str] | None = None,
) -> LeaveOneOutReport:
    """Estimate the cochlea of every labelled side from the other animals, and measure the errors.

    With ``jrmpc`` each side is registered with the same side of the other animals, as in the paper. With
    ``robust`` the atlas is fitted to both sides of all other animals.

    Parameters
    ----------
    specimens : sequence of Specimen
        At least three animals that have the features on every labelled side.
    method : {"jrmpc", "robust"}
        The estimator.
    training : iterable of str
        Features of the training animals; CO may be among them.
    probe : iterable of str
        Features touched on the held-out side: external ones among `training`.
    settings : JrmpcSettings
        Of ``jrmpc``; not used by ``robust``.
    held_out : iterable of str, optional
        Names of the animals to hold out, each on its own; by default all.

    Returns
    -------
    LeaveOneOutReport
        One row for each held-out side.

    Raises
    ------
    GpError
        Too few animals, or a feature is missing, not allowed or unknown.
    """
    check_option(method, "method", METHODS)
    features, touches = check_subsets(training, probe)
    check_labels(specimens, features)
    names = _checked_names(specimens, held_out)
    owners = [(specimens[i].name, side.value) for side, which in sides_of(specimens) for i in which]
    if method == "robust":
        owners = [owner for owner in owners if owner[0] in names]
        atlases, truths = held_out_sides(specimens, features, names)
        errors = robust_errors(atlases, [touched(truth, touches) for truth in truths], truths)
    else:
        errors = PoseErrors.joined([fold.errors(features, touches, settings) for fold in folds_of(specimens)])
    rows = [
        Row(name, side, float(e_co), float(e_ma))
        for (name, side), e_co, e_ma in zip(owners, errors.e_co_mm, errors.e_ma_deg, strict=True)
        if name in names
    ]
    used = settings if method == "jrmpc" else None
    return LeaveOneOutReport(method, features, touches, used, tuple(rows))


def _checked_names(specimens: Sequence[Specimen], held_out: Iterable[str] | None) -> tuple[str, ...]:
    known = tuple(specimen.name for specimen in specimens)
    names = known if held_out is None else tuple(held_out)
    if not names:
        raise GpError("no animal is held out", remedy=f"Name one or more of {' '.join(known)}.")
    for name in names:
        if name not in known:
            raise GpError("is not among the animals", specimen=name, remedy=f"These are {' '.join(known)}.")
    return names


@dataclass(frozen=True)
class Folds:
    """The A leave-one-out problems of one side of the head, as JRMPC takes them.

    Attributes
    ----------
    cochlea : (A, 20, 3) array, mm
        Each animal in its own CO frame.
    window : (A, 20, 3) array, mm
        Each animal in its own RW frame.
    """

    cochlea: FloatArray
    window: FloatArray

    def errors(self, features: Sequence[str], probe: Sequence[str], settings: JrmpcSettings) -> PoseErrors:
        """Register each animal with all others and return the errors; see `jrmpc_errors`.

        Parameters
        ----------
        features : sequence of str
            Training features.
        probe : sequence of str
            Touched features.
        settings : JrmpcSettings
            Of the registration.

        Returns
        -------
        PoseErrors
            One for each animal, mm and degrees.
        """
        return self.errors_of_each(features, [probe], settings)[0]

    def errors_of_each(
        self, features: Sequence[str], probes: Sequence[Sequence[str]], settings: JrmpcSettings
    ) -> list[PoseErrors]:
        """Do the same for several sets of equally many touched features, all in one batch.

        A batch is computed several problems at a time, one in each lane of a vector: of one set alone, some
        lanes would stay empty.

        Parameters
        ----------
        features : sequence of str
            Training features.
        probes : sequence of sequence of str
            Touched features, equally many in each.
        settings : JrmpcSettings
            Of the registration.

        Returns
        -------
        list of PoseErrors
            In the order of `probes`; the same, to the last bit, as one after the other.
        """
        animals, n = np.arange(len(self.cochlea)), len(probes)
        others = self.cochlea[np.array([np.delete(animals, held_out) for held_out in animals])]
        touches = np.concatenate([self.window[:, [index_of(code) for code in probe]] for probe in probes])
        repeated = np.tile(others, (n, 1, 1, 1)), touches, np.tile(self.window, (n, 1, 1))
        errors = jrmpc_errors(*repeated, features, settings)
        parts = np.split(errors.e_co_mm, n), np.split(errors.e_ma_deg, n)
        return [PoseErrors(*part) for part in zip(*parts, strict=True)]


def folds_of(specimens: Sequence[Specimen]) -> list[Folds]:
    """Return the leave-one-out problems of each labelled side.

    Parameters
    ----------
    specimens : sequence of Specimen
        Labelled animals.

    Returns
    -------
    list of Folds
        Left side first.
    """
    folds = []
    for side, _ in sides_of(specimens):
        labelled = [training.landmarks for training in training_sides(specimens, side)]
        cochlea = np.array([landmarks.points for landmarks in labelled])
        window = [round_window_frame(landmarks).inverse().apply(landmarks.points) for landmarks in labelled]
        folds.append(Folds(cochlea, np.array(window)))
    return folds


def held_out_sides(
    specimens: Sequence[Specimen], features: Iterable[str], names: Iterable[str] | None = None
) -> tuple[list[Atlas], list[LandmarkSet]]:
    """Return each labelled side, left ones first, with an atlas fitted without its animal.

    Parameters
    ----------
    specimens : sequence of Specimen
        Labelled animals.
    features : iterable of str
        What the atlases hold, in addition to the features that define the cochlea.
    names : iterable of str, optional
        The animals to hold out; by default all.

    Returns
    -------
    atlases : list of Atlas
        One for each held-out side.
    sides : list of LandmarkSet
        The held-out sides, mm.
    """
    wanted = {specimen.name for specimen in specimens} if names is None else set(names)
    features = tuple(features)
    atlases = {
        name: fit_plain_atlas([s for s in specimens if s.name != name], features=features) for name in wanted
    }
    held_out = [
        (specimens[i].name, with_cochlea_origin(specimens[i].side(side)))
        for side, which in sides_of(specimens)
        for i in which
        if specimens[i].name in wanted
    ]
    return [atlases[name] for name, _ in held_out], [truth for _, truth in held_out]
