"""The job that measures how repeatable labels are."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from gp_core.errors import GpError
from gp_core.study.reliability import ReliabilityReport, reliability
from gp_labeler.document.repeated_labels import RepeatedLabels, read_labellings
from gp_labeler.jobs.loading import load_modules
from gp_labeler.jobs.runner import Progress

__all__ = ["MeasureReliability", "MeasuredReliability"]


@dataclass(frozen=True)
class MeasuredReliability:
    """How repeatable the labels of some files are.

    Parameters
    ----------
    report : ReliabilityReport
        What was found.
    read : RepeatedLabels
        What it was found in.
    """

    report: ReliabilityReport
    read: RepeatedLabels


@dataclass(frozen=True)
class MeasureReliability:
    """Read labellings, and compare those of the same animals.

    Parameters
    ----------
    paths : tuple of Path
        Files and folders.
    """

    paths: tuple[Path, ...]
    title = "Comparing labels"

    def run(self, progress: Progress) -> MeasuredReliability:
        """Read and compare.

        Raises
        ------
        GpError
            No side was labelled twice; says what was skipped.
        """
        load_modules("scipy.stats", "gp_core.atlas.published")
        read = read_labellings(self.paths, lambda fraction: progress(0.7 * fraction))
        progress(0.7)
        try:
            return MeasuredReliability(reliability(read.labellings), read)
        except GpError as error:
            skipped = " ".join(f"Skipped {each.text}" for each in read.skipped[:3])
            remedy = " ".join(filter(None, (error.remedy, skipped)))
            raise GpError(error.problem, specimen=error.specimen, remedy=remedy) from None
