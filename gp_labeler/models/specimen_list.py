"""The list of specimens in the folders of a lab: progress of each, which comes next, work on all of them."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from os import PathLike
from pathlib import Path

from gp_core.disk import read_json, write_text
from gp_core.errors import GpError
from gp_core.validation import check_option
from gp_labeler.document.paths import absolute_path
from gp_labeler.document.signals import Signal
from gp_labeler.document.specimen_document import SpecimenDocument
from gp_labeler.document.specimen_list import ListedSpecimen, progress_text
from gp_labeler.jobs.contact_sheet import MakeContactSheets, SheetsMade
from gp_labeler.jobs.first_labels import templates_folder
from gp_labeler.jobs.library_check import CheckLibrary, LibraryChecked
from gp_labeler.jobs.runner import Jobs
from gp_labeler.jobs.specimen_list import CountProblems, ExportSpecimens, ListSpecimens
from gp_labeler.models.atlas import AtlasModel
from gp_labeler.models.messages import Messages

__all__ = ["FILTERS", "SpecimenListModel"]

FILTERS = ("all", "unfinished", "not begun", "finished", "doubtful", "repeated", "with notes")
"""Which specimens are shown."""

_LISTING = "list specimens"
_MOST_FOLDERS = 20
_NO_FOLDERS = "Add a folder to list its specimens and scans, with their progress"


class SpecimenListModel:
    """Keeps the list, and remembers its folders.

    Parameters
    ----------
    document : SpecimenDocument
        The open specimen: its row is read again when it is saved.
    atlas : AtlasModel
        By which labels are checked.
    jobs : Jobs
        Where files are read.
    messages : Messages
        What the user is told by.
    directory : Path, optional
        State directory, where the folders are remembered.
    """

    changed = Signal()
    """Other rows, another filter, or problems were counted."""

    def __init__(
        self,
        document: SpecimenDocument,
        atlas: AtlasModel,
        jobs: Jobs,
        messages: Messages,
        directory: Path | None = None,
    ) -> None:
        self._document, self._atlas, self._jobs, self._messages = document, atlas, jobs, messages
        self._file = None if directory is None else directory / "specimen_list.json"
        self._templates = templates_folder(directory)
        self.folders = self._recalled()
        self._every: tuple[ListedSpecimen, ...] = ()
        self._problems: Mapping[Path, int] = {}
        self._counted: Mapping[Path, ListedSpecimen] = {}
        self._counted_by: tuple[object, object] = (None, None)
        self.words, self.kind = "", FILTERS[0]
        self.library_checked: LibraryChecked | None = None
        """What the last check of labels against each other found."""
        document.saved.connect(self._on_saved)
        for signal in (atlas.changed, atlas.details_changed):
            signal.connect(self._on_atlas_changed)

    @property
    def every(self) -> tuple[ListedSpecimen, ...]:
        """All specimens of the folders."""
        return self._every

    @property
    def rows(self) -> tuple[ListedSpecimen, ...]:
        """The specimens that the filter leaves."""
        words = self.words.casefold().split()
        return tuple(
            row
            for row in self._every
            if self._is_of_kind(row) and all(word in row.text.casefold() for word in words)
        )

    @property
    def is_listing(self) -> bool:
        """Whether files are being read."""
        return self._jobs.is_running(_LISTING)

    @property
    def text(self) -> str:
        """Such as ``12 of 40 specimens, 7 finished, 3 not begun``."""
        n, shown = len(self._every), len(self.rows)
        if not n:
            return "No specimens yet" if self.folders else _NO_FOLDERS
        many = "" if n == 1 else "s"
        count = f"{n} specimen{many}" if shown == n else f"{shown} of {n} specimens"
        return f"{count}, {progress_text(self._every)}"

    def n_problems(self, row: ListedSpecimen) -> int | None:
        """Return how many labels of a specimen are doubtful; None while that is not known."""
        return self._problems.get(row.path)

    def add(self, *folders: str | PathLike[str]) -> None:
        """Take folders, or specimen files, into the list, and read it again."""
        for folder in folders:
            if not Path(folder).exists():
                raise GpError("does not exist", file=folder, remedy="Choose another folder.")
        new = dict.fromkeys((*self.folders, *map(absolute_path, folders)))
        self.folders = tuple(new)[-_MOST_FOLDERS:]
        self._remember()
        self.refresh()

    def remove(self, folder: str | PathLike[str]) -> None:
        """Take a folder out of the list; its files stay where they are."""
        gone = absolute_path(folder)
        self.folders = tuple(each for each in self.folders if each != gone)
        self._remember()
        self.refresh()

    def refresh(self) -> None:
        """Read all files again in the background."""
        there = tuple(folder for folder in self.folders if folder.exists())
        self._jobs.submit(ListSpecimens(there, self._every), self._take, key=_LISTING)

    def show(self, *, words: str | None = None, kind: str | None = None) -> None:
        """Filter the list by words, or by one of `FILTERS`."""
        if kind is not None:
            check_option(kind, "filter", FILTERS)
            self.kind = kind
        self.words = self.words if words is None else words
        self.changed.emit()

    def next_unfinished(self) -> ListedSpecimen:
        """Return the unfinished specimen after the open one, round the list.

        Raises
        ------
        GpError
            There is none.
        """
        rows, here = self._every, self._document.path
        at = next((n for n, row in enumerate(rows) if row.path == here), -1)
        for row in (*rows[at + 1 :], *rows[: max(at, 0)]):
            if not row.is_finished and not row.problem:
                return row
        raise GpError("no specimen of the list is unfinished", remedy="Add a folder, or look at the list.")

    def export(
        self, folder: str | PathLike[str], rows: Iterable[ListedSpecimen] | None = None, **options: object
    ) -> None:
        """Export the landmarks of specimens, by default of all that are shown, in the background."""
        chosen = self._files(rows)
        job = ExportSpecimens(chosen, Path(folder), **options)  # type: ignore[arg-type]
        self._jobs.submit(job, self._tell, key="export specimens")

    def fit(self, rows: Iterable[ListedSpecimen] | None = None) -> None:
        """Fit the atlas to specimens, by default to all that are shown."""
        self._atlas.fit(self._files(rows))

    def make_contact_sheets(
        self,
        where: str | PathLike[str],
        rows: Iterable[ListedSpecimen] | None = None,
        *,
        all_labellings: bool = False,
    ) -> None:
        """Make contact sheets in the background: one file, or one for each specimen in a folder.

        With `all_labellings`, specimens that were labelled several times have pages for each labelling.
        """
        self.make_contact_sheets_of(self._files(rows), where, all_labellings=all_labellings)

    def make_contact_sheets_of(
        self, files: Iterable[Path], where: str | PathLike[str], *, all_labellings: bool = False
    ) -> None:
        """Make contact sheets of specimen files in the background."""
        job = MakeContactSheets(tuple(files), Path(where), all_labellings)
        self._jobs.submit(job, self._take_sheets, key="contact sheets")

    def check_library(self, where: str | PathLike[str], rows: Iterable[ListedSpecimen] | None = None) -> None:
        """Check the labels of specimens against each other in the background, and draw what is found.

        Parameters
        ----------
        where : path
            A ``.pdf`` file, or a folder for one file each.
        rows : iterable of ListedSpecimen, optional
            By default all that are shown.
        """
        self.check_library_of(self._files(rows), where)

    def check_library_of(self, labelled: Iterable[Path], where: str | PathLike[str]) -> None:
        """Check labelled scans against each other: specimen files, landmark files, and folders of them."""
        self.library_checked = None
        job = CheckLibrary(tuple(labelled), self._templates, Path(where))
        self._jobs.submit(job, self._take_check, key="check library")

    # Inside

    def _take_check(self, checked: LibraryChecked) -> None:
        self.library_checked = checked
        for file in checked.files:
            self._messages.wrote.emit("check of the library", file)
        self._tell(checked.lines)

    def _is_of_kind(self, row: ListedSpecimen) -> bool:
        tests = {
            "unfinished": not row.is_finished,
            "not begun": not row.is_begun,
            "finished": row.is_finished,
            "doubtful": bool(self.n_problems(row)) or bool(row.problem),
            "repeated": len(row.labellings) > 1,
            "with notes": bool(row.notes) or row.n_notes > 0,
        }
        return tests.get(self.kind, True)

    def _files(self, rows: Iterable[ListedSpecimen] | None) -> tuple[Path, ...]:
        chosen = self.rows if rows is None else tuple(rows)
        files = tuple(row.path for row in chosen if row.is_begun and not row.problem)
        if not files:
            raise GpError("no labelled specimens are listed", remedy="Add a folder of them, or show all.")
        return files

    def _take(self, rows: list[ListedSpecimen]) -> None:
        self._every = tuple(rows)
        there = {row.path for row in rows}
        self._problems = {path: n for path, n in self._problems.items() if path in there}
        self.changed.emit()
        self._count_problems()

    def _count_problems(self) -> None:
        """Check the labels of the rows that were read since, or of all where the atlas is another one."""
        rows = self._every
        if self._atlas.check is None or not rows:
            return
        by = self._atlas.current, self._atlas.labelling_error
        known = self._counted if by == self._counted_by else {}
        changed = tuple(row for row in rows if known.get(row.path) is not row)

        def take(problems: Mapping[Path, int]) -> None:
            self._counted, self._counted_by = {row.path: row for row in rows}, by
            self._problems = {**self._problems, **problems}
            self.changed.emit()

        self._jobs.submit(CountProblems(changed, self._atlas.check), take, key=_LISTING)

    def _take_sheets(self, made: SheetsMade) -> None:
        for file in made.files:
            self._messages.wrote.emit("contact sheet", file)
        self._tell(made.lines)

    def _tell(self, lines: tuple[str, ...]) -> None:
        self._messages.say("  ".join(lines), "info" if len(lines) == 1 else "warning")

    def _on_atlas_changed(self) -> None:
        if self._counted_by != (self._atlas.current, self._atlas.labelling_error):
            self._count_problems()

    def _on_saved(self, file: Path) -> None:
        if any(row.path == file for row in self._every) or any(f in file.parents for f in self.folders):
            self.refresh()

    def _recalled(self) -> tuple[Path, ...]:
        if self._file is None:
            return ()
        try:
            content = read_json(self._file)
        except GpError:
            return ()
        folders = content.get("folders") if isinstance(content, dict) else None
        return (
            tuple(Path(each) for each in folders if isinstance(each, str))
            if isinstance(folders, list)
            else ()
        )

    def _remember(self) -> None:
        if self._file is None:
            return
        try:
            self._file.parent.mkdir(parents=True, exist_ok=True)
            write_text(self._file, json.dumps({"folders": [str(each) for each in self.folders]}, indent=1))
        except (OSError, GpError):
            return
