"""Contact sheets of specimens as PDF, for review: scans are opened one at a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_labeler.document.specimen_file import SUFFIX, read_specimen
from gp_labeler.document.state import SpecimenState
from gp_labeler.jobs.contact_page import contact_page, feature_pictures
from gp_labeler.jobs.loading import load_modules
from gp_labeler.jobs.picture_page import pdf_file
from gp_labeler.jobs.runner import Progress
from gp_labeler.jobs.scan import MakeDemo, phantom_seed

if TYPE_CHECKING:
    from matplotlib.backends.backend_pdf import PdfPages

    from gp_labeler.imaging.volume import Volume

__all__ = ["MakeContactSheets", "SheetsMade", "contact_sheet_name", "open_scan_of"]


@dataclass(frozen=True)
class SheetsMade:
    """What was made.

    Parameters
    ----------
    files : tuple of Path
        PDF files.
    n_specimens : int
        That are in them.
    problems : tuple of str
        Specimens that are not, and why.
    """

    files: tuple[Path, ...]
    n_specimens: int
    problems: tuple[str, ...] = ()

    @property
    def lines(self) -> tuple[str, ...]:
        """What the user should know, a sentence each."""
        many = "" if self.n_specimens == 1 else "s"
        named = ", ".join(file.name for file in self.files[:3]) + (", …" if len(self.files) > 3 else "")
        return (f"Contact sheets of {self.n_specimens} specimen{many}: {named}", *self.problems)


def contact_sheet_name(specimen: str) -> str:
    """Return the name of the sheet of one specimen."""
    return f"{specimen}_contact.pdf"


def open_scan_of(state: SpecimenState, progress: Progress) -> Volume:
    """Read the scan that a specimen refers to.

    Raises
    ------
    GpError
        It refers to none, or that is not where it was, or cannot be read.
    """
    reference = state.volume
    if reference is None:
        raise GpError("it has no scan", specimen=state.specimen, remedy="Open its scan, and save it.")
    seed = phantom_seed(reference.name) if reference.path is None else None
    if seed is not None:
        return MakeDemo(seed, min(reference.spacing)).run(progress).volume
    if reference.path is None or not Path(reference.path).exists():
        raise GpError(
            f"its scan is not at {reference.path}",
            specimen=state.specimen,
            remedy="Open the specimen, and locate its scan with File > Find scan.",
        )
    from gp_labeler.imaging.readers import read_volume

    return read_volume(reference.path, **dict(state.import_choices))


@dataclass(frozen=True)
class MakeContactSheets:
    """Make contact sheets: two pages for each labelled specimen.

    Parameters
    ----------
    files : tuple of Path
        Specimen files.
    where : Path
        A ``.pdf`` file for all of them, or a folder, for one file each.
    all_labellings : bool
        Whether a specimen that was labelled several times has pages for each labelling, not only for the one
        in work. Where that one is made blind, it is the only one all the same.
    """

    files: tuple[Path, ...]
    where: Path
    all_labellings: bool = False
    title = "Making contact sheets"

    def run(self, progress: Progress) -> SheetsMade:
        """Make them; a specimen whose scan cannot be opened is named, and left out.

        Raises
        ------
        GpError
            Nothing could be made, or a file cannot be written.
        """
        load_modules("matplotlib.figure", "matplotlib.backends.backend_pdf", "scipy.ndimage")
        together = self.where.suffix.lower() == ".pdf"
        made, n_made, problems = self._in_one(progress) if together else self._one_each(progress)
        return SheetsMade(made, n_made, problems)

    def _in_one(self, progress: Progress) -> tuple[tuple[Path, ...], int, tuple[str, ...]]:
        problems: list[str] = []
        with pdf_file(self.where) as pages:
            n_made = sum(self._try(n, pages, progress, problems) for n in range(len(self.files)))
            _require(n_made, problems)
        return (self.where,), n_made, tuple(problems)

    def _one_each(self, progress: Progress) -> tuple[tuple[Path, ...], int, tuple[str, ...]]:
        made: list[Path] = []
        problems: list[str] = []
        for n, file in enumerate(self.files):
            target = self.where / contact_sheet_name(file.name.removesuffix(SUFFIX))
            try:
                with pdf_file(target) as pages:
                    if not self._try(n, pages, progress, problems):
                        raise _NothingMadeError
            except _NothingMadeError:
                continue
            made.append(target)
        _require(len(made), problems)
        return tuple(made), len(made), tuple(problems)

    def _try(self, n: int, pages: PdfPages, progress: Progress, problems: list[str]) -> bool:
        name = self.files[n].name.removesuffix(SUFFIX)
        progress(n / len(self.files), f"Contact sheet of {name}")
        try:
            self._add(read_specimen(self.files[n]), pages, progress, n)
        except GpError as error:
            problems.append(f"{name}: {error.problem}.")
            return False
        return True

    def _add(self, state: SpecimenState, pages: PdfPages, progress: Progress, n: int) -> None:
        """Add the pages of one specimen; its scan is released before the next is opened."""
        sheets = [(each, side) for side in Side for each in self._labellings(state) if each.side(side).placed]
        if not sheets:
            raise GpError("nothing is placed in it", specimen=state.specimen)
        volume = open_scan_of(state, progress)
        threshold = state.threshold
        if threshold is None:
            from gp_labeler.imaging.threshold import propose_threshold

            threshold = propose_threshold(volume)
        scan = f"{volume.name}, {' x '.join(f'{mm:.3g}' for mm in dict.fromkeys(volume.spacing))} mm"
        for i, (labelled, side) in enumerate(sheets):

            def tell(fraction: float, i: int = i) -> None:
                progress((n + (i + fraction) / len(sheets)) / len(self.files))

            features = list(feature_pictures(labelled, side, volume, threshold, tell))
            pages.savefig(contact_page(labelled, side, features, scan))  # type: ignore[no-untyped-call]

    def _labellings(self, state: SpecimenState) -> Sequence[SpecimenState]:
        """Return the specimen in each labelling; one that is made blind hides the others."""
        return state.labellings if self.all_labellings and not state.blind else (state,)


class _NothingMadeError(Exception):
    """Raised where nothing was drawn, so that no empty file remains."""


def _require(n_made: int, problems: list[str]) -> None:
    if not n_made:
        raise GpError(f"no contact sheet could be made. {' '.join(problems[:3])}")
