"""First labels of a scan from labelled scans: the one function that window, script, shell and Python call."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from gp_core.atlas.atlas import Atlas
from gp_core.errors import GpError
from gp_core.validation import FloatArray
from gp_labeler.autolabel.atlas_agreement import compare_with_atlas, disagreement_text
from gp_labeler.autolabel.confidence import GuessConfidence
from gp_labeler.autolabel.cross_check import FEWEST_SCANS, check_predictions
from gp_labeler.autolabel.library import TemplateLibrary
from gp_labeler.autolabel.pose_search import ACCEPTED
from gp_labeler.autolabel.prediction import Prediction, predict
from gp_labeler.autolabel.proposal import Guess, Proposal, most_doubtful_first
from gp_labeler.autolabel.registration import COARSER, Registration, engine_named
from gp_labeler.autolabel.registration_process import HereRegistration
from gp_labeler.imaging.progress import Progress, Report
from gp_labeler.imaging.volume import Volume

__all__ = ["Stored", "propose"]

Stored = Literal["as it is", "mirrored"]

_MIRROR = np.diag([-1.0, 1.0, 1.0, 1.0])
_HISTORY_SHARE = 0.6
_FEWEST_PLACED = 3


@dataclass(frozen=True)
class _Contradicted:
    """Labelled scans that the others contradict.

    Parameters
    ----------
    wholly : tuple of str
        Names of those whose labels cannot be used; fewer than half of all.
    partly : tuple of str
        Names of those with some labels to look at.
    """

    wholly: tuple[str, ...] = ()
    partly: tuple[str, ...] = ()

    @classmethod
    def of(cls, library: TemplateLibrary, registration: Registration, report: Report) -> _Contradicted:
        """Predict every labelled scan from the others, and compare; two scans alone say nothing."""
        predictions = library.held_out(registration, report)
        if len(library.scans) < FEWEST_SCANS:
            return cls()
        found = check_predictions(library.scans, predictions).findings
        named = tuple(dict.fromkeys(finding.specimen for finding in found))
        wholly = tuple(dict.fromkeys(finding.specimen for finding in found if finding.concerns_all))
        if 2 * len(wholly) >= len(library.scans):
            wholly = ()
        return cls(wholly, tuple(name for name in named if name not in wholly))


def propose(
    volume: Volume,
    library: TemplateLibrary,
    *,
    placed: Mapping[str, ArrayLike] | None = None,
    stored: Stored | None = None,
    registration: Registration | None = None,
    with_history: bool = True,
    atlas: Atlas | None = None,
    progress: Progress | None = None,
    cancel: Callable[[], bool] | None = None,
) -> Proposal:
    """Guess the landmarks of a scan from labelled scans.

    Parameters
    ----------
    volume : Volume
        The scan.
    library : TemplateLibrary
        Labelled scans; that of the volume itself, or a copy of it, if it is among them, does not count.
    placed : mapping of str to (3,) array_like, optional
        Landmarks that are known in the scan, LPS mm; three or more say how the head lies.
    stored : {"as it is", "mirrored"}, optional
        What is known of left and right: nothing in a scan tells whether it was stored as its mirror image.
        None: not known; the file is believed, and the proposal warns.
    registration : Registration, optional
        By default greedy in this process, or demons where it is not installed.
    with_history : bool
        Predict the labelled scans from each other first, once, for the radii; without, there are none.
    atlas : Atlas, optional
        Guesses of the guinea pig's features are compared with it; by default the published one.
    progress, cancel : callable, optional
        Told the fraction done; asked whether to stop.

    Returns
    -------
    Proposal

    Raises
    ------
    HeadNotFoundError
        The head was not found in the scan.
    GpError
        A scan cannot be read, or has no bone or contrast.
    Cancelled
        `cancel` said so.
    """
    registration = registration or HereRegistration(engine_named())
    report = Report(progress, cancel)
    first = _HISTORY_SHARE if with_history else 0.1
    confidence, contradicted = GuessConfidence(()), _Contradicted()
    if with_history:
        contradicted = _Contradicted.of(library, registration, report.part(0.0, first))
        confidence = library.confidence(registration, without=contradicted.wholly)
    checksum = volume.find_checksum(report.part(first, first))
    own = [scan.name for scan in library.scans if library.checksum_of(scan) == checksum]
    if len(own) == len(library.scans):
        raise GpError("it is the only labelled scan", file=volume.path)
    scan = replace(volume, T_scan_voxel=_MIRROR @ volume.T_scan_voxel) if stored == "mirrored" else volume
    known = {name: np.asarray(xyz, dtype=np.float64).reshape(3) for name, xyz in (placed or {}).items()}
    if stored == "mirrored":
        known = {name: _mirrored(xyz) for name, xyz in known.items()}
    prediction = predict(
        scan,
        library.templates(report.part(first, first), without=[*own, *contradicted.wholly]),
        registration,
        library.settings,
        placed=known,
        most=library.most,
        report=report.part(first, 1.0),
    )
    detours = library.detours(prediction)
    if stored == "mirrored":
        prediction = _mirrored_prediction(prediction)
    found, outside = _guesses(volume, prediction, confidence, detours)
    guesses = compare_with_atlas(found, atlas or Atlas.published())
    assert prediction.pose is not None
    score = prediction.pose.score
    uncertain = score if score > ACCEPTED and len(known) < _FEWEST_PLACED else None
    return Proposal(
        most_doubtful_first(guesses),
        prediction.names,
        tuple(outside),
        prediction.templates,
        score,
        registration.name,
        _LEFT[stored],
        (
            *_warnings(guesses, confidence, registration, stored, uncertain),
            *_warnings_of_scans(contradicted, prediction.left_out),
        ),
    )


def _guesses(
    volume: Volume, prediction: Prediction, confidence: GuessConfidence, detours: Mapping[str, float]
) -> tuple[list[Guess], list[str]]:
    """Return the guesses, and the names of what is expected beyond the edge of the scan."""
    guesses, outside = [], []
    for name in prediction.names:
        centre, spread = prediction.centres[name], prediction.spreads[name]
        if not volume.contains(centre[None])[0]:
            outside.append(name)
            continue
        guesses.append(
            Guess(
                name,
                centre,
                confidence.radius_95(name, spread, detours.get(name, np.nan)),
                None if np.isnan(spread) else spread,
                confidence.history_of(name),
                len(prediction.of(name)),
            )
        )
    return guesses, outside


def _warnings(
    guesses: Sequence[Guess],
    confidence: GuessConfidence,
    registration: Registration,
    stored: Stored | None,
    uncertain_score: float | None,
) -> Iterator[str]:
    """Yield what a person should look at."""
    if uncertain_score is not None:
        yield f"the head's pose is uncertain (score {uncertain_score:.2f}): check the suggestions"
    if registration.name == "demons":
        yield COARSER
    if not confidence.history:
        yield "the radii are not known: suggest from two labelled scans or more"
    disagreement = disagreement_text(guesses)
    if disagreement:
        yield disagreement
    if stored is None:
        yield _LEFT[stored]


def _warnings_of_scans(contradicted: _Contradicted, left_out: Sequence[str]) -> Iterator[str]:
    """Yield which labelled scans a person should look at."""
    if contradicted.wholly:
        named = ", ".join(contradicted.wholly)
        yield f"not used, since the other labelled scans contradict their labels: {named}"
    if contradicted.partly:
        named = ", ".join(contradicted.partly)
        yield f"check the labels of {named}: the other labelled scans contradict some of them"
    if left_out:
        yield f"not used, since their bone does not fit this scan: {', '.join(left_out)}"


_LEFT = {
    None: "left and right are taken from the file; state whether the scan is stored mirrored (--stored)",
    "as it is": "left and right are taken from the file, as confirmed",
    "mirrored": "the scan is stored as its mirror image, as stated",
}


def _mirrored(point: FloatArray) -> FloatArray:
    return point * (-1.0, 1.0, 1.0)


def _mirrored_prediction(prediction: Prediction) -> Prediction:
    carried = {
        template: {name: _mirrored(xyz) for name, xyz in points.items()}
        for template, points in prediction.carried.items()
    }
    return Prediction(carried, prediction.pose, prediction.scores)
