"""Writing the landmarks of both sides into files that Slicer, SlicerMorph and ``gp-core`` read."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path

from gp_core.checks import check_option
from gp_core.errors import GpError
from gp_core.landmarks.features import CODES, FEATURES, Side
from gp_core.landmarks.files import write_csv, write_fcsv, write_markups
from gp_core.landmarks.sets import LandmarkSet, Status
from gp_labeler.session.document import provenance_document, volume_document
from gp_labeler.session.state import SpecimenState

__all__ = ["FORMATS", "ExportReport", "export_landmarks"]

Writer = Callable[[Path, LandmarkSet, SpecimenState], None]


def _write_markups(path: Path, landmarks: LandmarkSet, state: SpecimenState) -> None:
    volume = None if state.volume is None else volume_document(state.volume)
    if volume is not None:
        volume.pop("path", None)  # of no use to others, and nobody's business
    marks = {f.code: state.landmark(landmarks.side, f.code) for f in FEATURES if not f.computed}
    provenance = {c: provenance_document(m.provenance) for c, m in marks.items() if m.provenance is not None}
    write_markups(path, landmarks, specimen=state.specimen, volume=volume, provenance=provenance)


_WRITERS: Mapping[str, Writer] = {
    ".mrk.json": _write_markups,
    ".fcsv": lambda path, landmarks, _: write_fcsv(path, landmarks),
    ".csv": lambda path, landmarks, _: write_csv(path, landmarks),
}
FORMATS = tuple(_WRITERS)


@dataclass(frozen=True)
class ExportReport:
    """What was written, and what was not there to write.

    Parameters
    ----------
    files : tuple of Path
        The files.
    to_do, unseen : mapping of Side to tuple of str
        Of the sides written: features without a position, because nobody placed them or they cannot be seen.
    """

    files: tuple[Path, ...]
    to_do: Mapping[Side, tuple[str, ...]] = field(default_factory=dict)
    unseen: Mapping[Side, tuple[str, ...]] = field(default_factory=dict)

    @property
    def is_complete(self) -> bool:
        """Whether both sides have all 20 features."""
        return len(self.to_do) == len(Side) and not any((*self.to_do.values(), *self.unseen.values()))

    @property
    def text(self) -> str:
        """Say, a line each, what was written and what is missing."""
        lines = [f"Wrote {', '.join(path.name for path in self.files)}."]
        for side in Side:
            if side not in self.to_do:
                lines.append(f"The {side.word} side is not labelled and was not written.")
                continue
            for what, codes in (("to do", self.to_do[side]), ("not seen", self.unseen[side])):
                if codes:
                    lines.append(f"Missing on the {side.word} side, {what}: {' '.join(codes)}.")
        return "\n".join(lines)


def export_landmarks(
    state: SpecimenState,
    directory: str | PathLike[str],
    *,
    formats: Iterable[str] = (".mrk.json",),
    overwrite: bool = False,
) -> ExportReport:
    """Write ``<specimen>_L`` and ``<specimen>_R`` into a folder, each side on which something is placed.

    Parameters
    ----------
    state : SpecimenState
        What to write.
    directory : path
        The folder; made if need be.
    formats : iterable of str
        Of `FORMATS`. ``.mrk.json`` alone says everything; the others are for programs that cannot read it.
    overwrite : bool
        Whether files of that name may be replaced.

    Returns
    -------
    ExportReport
        With what is missing.

    Raises
    ------
    GpError
        Nothing is placed, a file is there already, or it cannot be written.
    """
    folder = Path(directory)
    suffixes = tuple(formats)
    for suffix in suffixes:
        check_option(suffix, "format", FORMATS)
    sides = [side for side in Side if _is_labelled(state, side)]
    if not sides:
        raise GpError("nothing is placed yet", specimen=state.specimen, remedy="Place some features first.")
    files = {folder / f"{state.specimen}_{side.value}{suffix}": side for side in sides for suffix in suffixes}
    _make_room(folder, files, overwrite)
    for path, side in files.items():
        _WRITERS[next(s for s in suffixes if path.name.endswith(s))](path, state.side(side), state)
    return ExportReport(
        tuple(files),
        {side: _codes(state.side(side), Status.TO_DO) for side in sides},
        {side: _codes(state.side(side), Status.UNSEEN) for side in sides},
    )


def _is_labelled(state: SpecimenState, side: Side) -> bool:
    return any(owner is side and mark.position is not None for (owner, _), mark in state.landmarks.items())


def _codes(landmarks: LandmarkSet, status: Status) -> tuple[str, ...]:
    return tuple(code for code in CODES if landmarks.status(code) is status)


def _make_room(folder: Path, files: Iterable[Path], overwrite: bool) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise GpError(f"cannot be made: {error.strerror}", file=folder) from None
    there = [path for path in files if path.exists()]
    if there and not overwrite:
        raise GpError("exists already", file=there[0], remedy="Choose another folder, or overwrite it.")
