"""Jobs on many specimens: listing them, counting doubtful labels, exporting."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from gp_core.atlas.label_check import SideCheck
from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_labeler.document.landmark_export import export_landmarks
from gp_labeler.document.specimen_file import read_specimen
from gp_labeler.document.specimen_list import ListedSpecimen, list_specimens
from gp_labeler.jobs.runner import Progress

__all__ = ["CountProblems", "ExportSpecimens", "ListSpecimens"]


@dataclass(frozen=True)
class ListSpecimens:
    """Read the specimen files of folders.

    Parameters
    ----------
    folders : tuple of Path
        Folders, and specimen files.
    known : tuple of ListedSpecimen
        What was read before; only files that have changed are read again.
    """

    folders: tuple[Path, ...]
    known: tuple[ListedSpecimen, ...] = ()
    title = "Reading the list of specimens"

    def run(self, progress: Progress) -> list[ListedSpecimen]:
        """Read them."""
        return list_specimens(self.folders, progress, known=self.known)


@dataclass(frozen=True, eq=False)
class CountProblems:
    """Count the doubtful labels of each specimen of a list.

    Parameters
    ----------
    rows : tuple of ListedSpecimen
        The list.
    check : callable
        Checks one side.
    """

    rows: tuple[ListedSpecimen, ...]
    check: Callable[..., SideCheck]
    title = "Checking the labels of the list"

    def run(self, progress: Progress) -> dict[Path, int]:
        """Check them, one after the other."""
        found = {}
        for n, row in enumerate(self.rows):
            progress(n / len(self.rows))
            if row.state is not None:
                found[row.path] = sum(self._count(row, side) for side in Side)
        return found

    def _count(self, row: ListedSpecimen, side: Side) -> int:
        assert row.state is not None
        landmarks = row.state.described_side(side)
        return (
            sum(not found.is_checked for found in self.check(landmarks).problems.values())
            if landmarks.placed
            else 0
        )


@dataclass(frozen=True)
class ExportSpecimens:
    """Export the landmarks of specimen files into one folder.

    Parameters
    ----------
    files : tuple of Path
        Specimen files.
    folder : Path
        Where to.
    formats : tuple of str
        As for `export_landmarks`.
    overwrite : bool
        Whether files of the same names may be replaced.
    """

    files: tuple[Path, ...]
    folder: Path
    formats: tuple[str, ...] = (".mrk.json",)
    overwrite: bool = True
    title = "Exporting landmarks"

    def run(self, progress: Progress) -> tuple[str, ...]:
        """Export them; what cannot be exported is named.

        Raises
        ------
        GpError
            Two specimens have the same name, so that one would replace the other.
        """
        states = {file: read_specimen(file) for file in self.files}
        self._check_names({file: state.specimen for file, state in states.items()})
        n_files, problems = 0, []
        for n, state in enumerate(states.values()):
            progress(n / len(states))
            try:
                report = export_landmarks(state, self.folder, formats=self.formats, overwrite=self.overwrite)
            except GpError as error:
                problems.append(f"{state.specimen}: {error.problem}.")
            else:
                n_files += len(report.files)
        n = len(states) - len(problems)
        return (f"Exported {n} specimen{'' if n == 1 else 's'}, {n_files} files", *problems)

    def _check_names(self, names: dict[Path, str]) -> None:
        seen: dict[str, Path] = {}
        for file, name in names.items():
            earlier = seen.setdefault(name, file)
            if earlier is not file:
                raise GpError(
                    f"is called {name}, as {earlier} is, and its landmarks would replace those",
                    file=file,
                    remedy="Rename one of the specimens, or export them into two folders.",
                )
