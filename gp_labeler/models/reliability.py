"""How repeatable labels are: what was measured, and whether checks and regions use it."""

from __future__ import annotations

import json
from collections.abc import Iterable
from os import PathLike
from pathlib import Path

import numpy as np

from gp_core.atlas.labelling_error import LabellingError
from gp_core.disk import write_text
from gp_core.errors import GpError
from gp_core.study.reliability import Disagreement, ReliabilityReport
from gp_labeler.document.labelling_edits import OpenLabelling
from gp_labeler.document.signals import Signal
from gp_labeler.document.specimen_document import SpecimenDocument
from gp_labeler.document.state import point_key
from gp_labeler.jobs.reliability import MeasuredReliability, MeasureReliability
from gp_labeler.jobs.runner import Jobs
from gp_labeler.models.atlas import AtlasModel
from gp_labeler.models.messages import Messages
from gp_labeler.models.reference_points import ReferencePoint, ReferencePointsModel
from gp_labeler.models.workflow import progress

__all__ = ["ReliabilityModel"]

_KEY = "reliability"


class ReliabilityModel:
    """Keeps the last report on repeated labels.

    Parameters
    ----------
    document : SpecimenDocument
        The open specimen: while it is labelled blind, none of its other labels is shown.
    atlas : AtlasModel
        Takes the measured error of labels.
    references : ReferencePointsModel
        Show the other of two labels that lie apart.
    jobs : Jobs
        Where labels are compared.
    messages : Messages
        What the user is told by.
    """

    changed = Signal()
    """Another report, or another answer to whether its error is in use."""

    def __init__(
        self,
        document: SpecimenDocument,
        atlas: AtlasModel,
        references: ReferencePointsModel,
        jobs: Jobs,
        messages: Messages,
    ) -> None:
        self._references = references
        self._document, self._atlas, self._jobs, self._messages = document, atlas, jobs, messages
        self.measured: MeasuredReliability | None = None
        self.paths: tuple[Path, ...] = ()
        atlas.details_changed.connect(self.changed.emit)

    @property
    def report(self) -> ReliabilityReport | None:
        """What was found; None before anything was measured."""
        return None if self.measured is None else self.measured.report

    @property
    def error(self) -> LabellingError | None:
        """The error of labels that the report has measured."""
        return None if self.report is None else LabellingError.from_reliability(self.report.as_dict())

    @property
    def is_used(self) -> bool:
        """Whether checks and regions use the error of this report."""
        return self.error is not None and self.error == self._atlas.labelling_error

    @property
    def is_measuring(self) -> bool:
        """Whether labels are being compared."""
        return self._jobs.is_running(_KEY)

    def measure(self, paths: Iterable[str | PathLike[str]]) -> None:
        """Compare the labels of files and folders in the background."""
        chosen = tuple(map(Path, paths))

        def take(measured: MeasuredReliability) -> None:
            self.measured, self.paths = measured, chosen
            self.changed.emit()
            report, n = measured.report, len(measured.read.skipped)
            text = f"{report.n_labellings} labellings of {report.n_sides} sides were compared"
            self._messages.say(text + (f"; {n} skipped" if n else ""), "warning" if n else "info")

        self._jobs.submit(MeasureReliability(chosen), take, key=_KEY)

    def use_error(self, use: bool) -> None:
        """Let checks and regions allow for the measured error, or for the assumed one."""
        if use and self.error is None:
            raise GpError("no labelling error has been measured yet", remedy="Compare repeated labels first.")
        self._atlas.set_labelling_error(self.error if use else None)
        self.changed.emit()

    def save(self, path: str | PathLike[str]) -> None:
        """Write the report: the table for ``.csv``, the figure for a picture, else everything as JSON.

        Raises
        ------
        GpError
            There is no report, or the file cannot be written.
        """
        report, file = self._require(), Path(path)
        if file.suffix.lower() == ".csv":
            report.save_csv(file)
        elif file.suffix.lower() in (".png", ".pdf", ".svg"):
            from gp_core.study.figures import label_agreement, save_figure  # here: Matplotlib loads slowly

            save_figure(label_agreement(report), file)
        else:
            write_text(file, json.dumps(report.as_dict(), indent=1) + "\n")
        self._messages.wrote.emit("reliability", file)

    def file_of(self, row: Disagreement) -> Path:
        """Return the specimen file in which two labels can be looked at.

        Raises
        ------
        GpError
            There is none, or the open specimen is that animal and is still being labelled blind.
        """
        state = self._document.state
        unfinished = any(
            progress(state, side).n_placed < progress(state, side).n_total for side in state.sets
        )
        if state.blind and unfinished and state.specimen == row.specimen:
            raise GpError(
                f"{row.specimen} is being labelled blind, so its other labels are hidden",
                remedy="Finish this labelling first.",
            )
        file = None if self.measured is None else self.measured.read.files.get(row.specimen)
        if file is None:
            raise GpError(
                f"{row.specimen} has no specimen file beside its landmarks",
                remedy="Open its scan and import its landmarks.",
            )
        return file

    def show(self, row: Disagreement) -> None:
        """Open the first of two labellings in the open specimen; the other's point is a reference point."""
        (observer, number), (other, other_number) = map(_sitting_of, row.labellings)
        state = self._document.state
        if (state.labeller.casefold(), state.round) != (observer.casefold(), number):
            self._document.do(OpenLabelling(observer, number))
        every = self._document.state.others
        there = next((e for e in every if (e.observer, e.round) == (other, other_number)), None)
        mark = None if there is None else there.landmarks.get(point_key(row.side, row.code))
        if mark is not None and mark.position is not None:
            name = f"{row.code} {row.side.value} ({other or 'unnamed'}, round {other_number})"
            self._references.show_points((ReferencePoint(name, np.array(mark.position)),))

    def _require(self) -> ReliabilityReport:
        if self.report is None:
            raise GpError(
                "no labels have been compared yet", remedy="Choose animals labelled more than once."
            )
        return self.report


def _sitting_of(text: str) -> tuple[str, int]:
    """Return observer and round of a labelling's words, such as ``AB, round 2``."""
    observer, _, number = text.rpartition(", round ")
    return ("" if observer == "unnamed" else observer), int(number)
