"""First labels: suggestions from the lab's own labelled scans, made in the background."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gp_core.errors import GpError
from gp_core.landmarks.features import Side, feature
from gp_labeler.autolabel.labelled_scan import flat_points
from gp_labeler.document.edits import SuggestPoints, point_text
from gp_labeler.document.signals import Signal
from gp_labeler.document.specimen_document import SpecimenDocument
from gp_labeler.document.state import How
from gp_labeler.jobs.first_labels import FirstLabels, SuggestFromScans, templates_folder
from gp_labeler.jobs.runner import Jobs, Task
from gp_labeler.models.atlas import AtlasModel
from gp_labeler.models.head import HeadModel
from gp_labeler.models.labels import LabelsModel
from gp_labeler.models.messages import Messages
from gp_labeler.models.scan import ScanModel

if TYPE_CHECKING:
    from gp_labeler.autolabel import Proposal

__all__ = ["FirstLabelsModel"]

_KEY = "suggest from scans"
_FEWEST_PLACED = 3


class FirstLabelsModel:
    """Suggests the landmarks of the open scan from labelled scans, in the background.

    Parameters
    ----------
    document : SpecimenDocument
        Takes the suggestions.
    scan : ScanModel
        The scan that is open.
    labels : LabelsModel
        The most doubtful suggestion becomes its active point.
    head : HeadModel
        It is straightened too, unless it is already.
    atlas : AtlasModel
        Suggestions are compared with its atlas.
    jobs : Jobs
        Where the search runs.
    messages : Messages
        What the user is told by.
    directory : Path, optional
        Where what is prepared of labelled scans is kept; by default a folder of the user.
    """

    changed = Signal()
    """It began, or ended."""

    def __init__(
        self,
        document: SpecimenDocument,
        scan: ScanModel,
        labels: LabelsModel,
        head: HeadModel,
        atlas: AtlasModel,
        jobs: Jobs,
        messages: Messages,
        directory: Path | None = None,
    ) -> None:
        self._document, self._scan, self._labels, self._head = document, scan, labels, head
        self._atlas = atlas
        self._jobs, self._messages = jobs, messages
        self._folder = templates_folder(directory)
        self.labelled: tuple[Path, ...] = ()
        """Labelled scans that suggestions were made from last, of whatever specimen."""
        self.proposal: Proposal | None = None
        """What was suggested last for the specimen that is open."""
        document.reset.connect(self._on_reset)
        for signal in (jobs.started, jobs.done, jobs.cancelled, jobs.failed):
            signal.connect(self._on_task)

    @property
    def is_running(self) -> bool:
        """Whether suggestions are being made."""
        return self._jobs.is_running(_KEY)

    @property
    def knows_left(self) -> bool:
        """Whether a person has said which side is left, or placed a feature of one side."""
        frame = self._document.state.head_frame
        if frame is not None and frame.left_confirmed:
            return True
        return any(
            not (feature(code).shared or feature(code).computed)
            for side in Side
            for code in self._document.landmarks(side).placed
        )

    def suggest(self, labelled: Iterable[str | PathLike[str]], *, left_confirmed: bool = False) -> None:
        """Suggest landmarks from labelled scans; what is placed or unseen stays.

        Left and right are taken as the scan has them: ask the user first, unless `knows_left`. The views are
        turned into the frame of the head, unless they were before, or its symmetry does not tell.

        Parameters
        ----------
        labelled : iterable of path
            Specimen files, landmark files beside their scans, and folders of them.
        left_confirmed : bool
            Whether a person has just said that left is as the scan has it.

        Raises
        ------
        GpError
            No scan is open.
        """
        if self._scan.volume is None:
            raise GpError("there is no scan to suggest landmarks in", remedy="Open one first.")
        placed = flat_points({side: self._document.landmarks(side) for side in Side})
        known = placed if len(placed) >= _FEWEST_PLACED else {}
        job = SuggestFromScans(
            self._scan.volume,
            tuple(map(Path, labelled)),
            self._folder,
            known,
            straighten=self._head.frame is None,
            threshold=self._document.state.threshold,
            atlas=self._atlas.expected_by,
        )
        if left_confirmed and self._head.asks_left:
            self._head.confirm_left()
        self._jobs.submit(job, partial(self._take, job.labelled, left_confirmed), key=_KEY)

    def cancel(self) -> None:
        """Stop; nothing is suggested."""
        self._jobs.cancel(_KEY)
        self.changed.emit()

    def _take(self, labelled: tuple[Path, ...], left_confirmed: bool, found: FirstLabels) -> None:
        self.labelled = labelled
        if found.head is not None and self._head.frame is None:
            self._head.take(found.head, left_confirmed=left_confirmed)
        self.proposal = proposal = found.proposal
        for side, suggestions in proposal.suggestions().items():
            if suggestions:
                self._document.do(SuggestPoints(side, suggestions, self._document.provenance(How.GHOST)))
        self._choose_first(proposal)
        self._messages.say(_told(proposal), "warning" if proposal.warnings else "info")
        self.changed.emit()

    def _choose_first(self, proposal: Proposal) -> None:
        """Make the most doubtful suggestion of the proposal the active point, and show it closely."""
        still = [
            one for one in _by_uncertainty(proposal) if one[1] in self._document.landmarks(one[0]).suggested
        ]
        if still:
            self._labels.look_closely(*still[0])

    def _on_reset(self) -> None:
        self.proposal = None
        self.cancel()

    def _on_task(self, task: Task[Any]) -> None:
        if task.key == _KEY:
            self.changed.emit()


def _told(proposal: Proposal) -> str:
    """Say what was suggested, and what to look at first."""
    found = _by_uncertainty(proposal)
    radii = sorted(guess.radius_95 for guess in proposal.guesses if guess.radius_95 is not None)
    within = f", 95 % within {radii[len(radii) // 2]:.2f} mm (median)" if radii else ""
    words = [f"{len(found)} points suggested from {proposal.source}{within}"]
    uncertain = {guess.name for guess in proposal.guesses if guess.is_doubtful}
    if uncertain:
        worst = [point_text(side, code) for side, code in found[: min(len(uncertain), 4)]]
        words.append(f"look closely at {', '.join(worst)}")
    if proposal.outside:
        words.append(f"beyond the edge of the scan: {', '.join(proposal.outside[:6])}")
    return "; ".join([*words, *proposal.warnings])


def _by_uncertainty(proposal: Proposal) -> list[tuple[Side, str]]:
    """Return the suggested features, the most doubtful first."""
    found = {
        (side, code): suggestion.uncertainty
        for side, suggestions in proposal.suggestions().items()
        for code, suggestion in suggestions.items()
    }
    return sorted(found, key=lambda key: found[key], reverse=True)
