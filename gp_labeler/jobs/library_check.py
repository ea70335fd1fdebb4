"""The job that checks labelled specimens against each other, and draws what it finds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gp_labeler.jobs.loading import load_modules
from gp_labeler.jobs.runner import Progress

__all__ = ["CheckLibrary", "LibraryChecked"]

_MODULES = (
    "scipy.ndimage",
    "scipy.spatial",
    "scipy.fft",
    "SimpleITK",
    "skimage.filters",
    "matplotlib.figure",
    "matplotlib.backends.backend_pdf",
)
_PREDICTED = 0.95
_TOLD = 3
"""Findings that are told; the pictures have all."""


@dataclass(frozen=True)
class LibraryChecked:
    """What was found.

    Parameters
    ----------
    findings : tuple of str
        A sentence each, with the specimen's name.
    files : tuple of Path
        Pictures of them.
    n_checked : int
        Specimens that were predicted from the others.
    problems : tuple of str
        Specimens that were not, and why.
    content : mapping
        All of it as JSON values; see `gp_labeler.autolabel.cross_check.LibraryCheck.as_json`.
    """

    findings: tuple[str, ...]
    files: tuple[Path, ...]
    n_checked: int
    problems: tuple[str, ...] = ()
    content: Mapping[str, Any] = field(default_factory=dict)

    @property
    def lines(self) -> tuple[str, ...]:
        """What the user should know, a sentence each."""
        n = len(self.findings)
        found = "they agree" if n == 0 else "1 finding" if n == 1 else f"{n} findings"
        first = f"{self.n_checked} specimens checked against each other: {found}."
        more = [f"And {n - _TOLD} more."] if n > _TOLD else []
        return (first, *(f"{text}." for text in self.findings[:_TOLD]), *more, *self.problems)


@dataclass(frozen=True)
class CheckLibrary:
    """Predict each labelled specimen from the others, and compare.

    Parameters
    ----------
    files : tuple of Path
        Specimen files, landmark files beside their scans, and folders of them.
    folder : Path
        Where what is prepared of labelled scans is kept.
    where : Path
        A ``.pdf`` file for the pictures, or a folder, for one file each.
    """

    files: tuple[Path, ...]
    folder: Path
    where: Path
    title = "Checking labels against each other"

    def run(self, progress: Progress) -> LibraryChecked:
        """Read, register, compare and draw.

        Raises
        ------
        GpError
            There are fewer than three labelled scans, or a file cannot be read or written.
        """
        load_modules(*_MODULES)
        from gp_labeler.autolabel import TemplateLibrary
        from gp_labeler.autolabel.cross_check import check_predictions, require_enough
        from gp_labeler.autolabel.registration import engine_named
        from gp_labeler.autolabel.registration_process import ProcessRegistration
        from gp_labeler.document.labelled_scans import read_labelled_scans
        from gp_labeler.imaging.progress import Report
        from gp_labeler.jobs.library_sheet import draw_library_check

        progress(0.0, "Reading the labelled scans")
        found = read_labelled_scans(self.files)
        require_enough(found.scans)
        library = TemplateLibrary(found.scans, self.folder)
        with ProcessRegistration(engine_named()) as registration:
            report = Report(
                lambda fraction: progress(_PREDICTED * fraction, "Registering"), progress.cancelled
            )
            predictions = library.held_out(registration, report)
        check = check_predictions(library.scans, predictions)
        files = draw_library_check(
            check,
            library.scans,
            predictions,
            self.where,
            lambda name: progress(_PREDICTED, f"Drawing {name}"),
        )
        problems = [skipped.text for skipped in found.skipped]
        problems += [f"{name}: the head was not found." for name in check.unchecked]
        told = tuple(f"{finding.specimen}: {finding.text}" for finding in check.findings)
        return LibraryChecked(told, files, len(check.checked), tuple(problems), check.as_json())
