"""Writing the landmarks of both sides into files that Slicer, SlicerMorph and ``gp-core`` read."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

from gp_core.disk import all_or_none, make_room
from gp_core.errors import GpError
from gp_core.io import landmark_file_name, write_csv, write_fcsv, write_markups, write_suggestions
from gp_core.landmarks.features import CODES, Side, feature
from gp_core.landmarks.sets import LandmarkSet, Status
from gp_core.validation import check_option
from gp_labeler.document.specimen_json import volume_document
from gp_labeler.document.state import SpecimenState

__all__ = ["FORMATS", "ExportReport", "export_landmarks", "export_names"]

Writer = Callable[[Path, LandmarkSet, SpecimenState], None]


def _volume(state: SpecimenState) -> dict[str, object] | None:
    volume = None if state.volume is None else volume_document(state.volume)
    if volume is not None:
        volume.pop("path", None)  # of no use to others, and nobody's business
    return volume


def _write_suggestions(path: Path, landmarks: LandmarkSet, state: SpecimenState) -> None:
    write_suggestions(path, landmarks, specimen=state.specimen, volume=_volume(state))


def _write_markups(path: Path, landmarks: LandmarkSet, state: SpecimenState) -> None:
    write_markups(path, landmarks, specimen=state.specimen, volume=_volume(state))


_WRITERS: Mapping[str, Writer] = {
    ".mrk.json": _write_markups,
    ".fcsv": lambda path, landmarks, state: write_fcsv(path, landmarks),
    ".csv": lambda path, landmarks, state: write_csv(path, landmarks),
}
FORMATS = tuple(_WRITERS)


CO_IS_MISSING = "CO is missing: it is computed from CA, CB, RWA and RWP"
"""Said where CO is missing: nobody is to place it."""


@dataclass(frozen=True)
class ExportReport:
    """What was written, and what was not there to write.

    Parameters
    ----------
    files : tuple of Path
        The files.
    to_do, unseen : mapping of Side to tuple of str
        Of the sides written: features without a position, because nobody placed them or they cannot be seen.
    suggested : mapping of Side to tuple of str
        Features that are only suggested, and so without a position in the landmark files.
    """

    files: tuple[Path, ...]
    to_do: Mapping[Side, tuple[str, ...]] = field(default_factory=dict)
    unseen: Mapping[Side, tuple[str, ...]] = field(default_factory=dict)
    suggested: Mapping[Side, tuple[str, ...]] = field(default_factory=dict)

    @property
    def is_complete(self) -> bool:
        """Whether both sides have all 20 features."""
        missing = (*self.to_do.values(), *self.unseen.values(), *self.suggested.values())
        return len(self.to_do) == len(Side) and not any(missing)

    @property
    def text(self) -> str:
        """Say, a line each, what was written and what is missing."""
        lines = [f"Wrote {', '.join(path.name for path in self.files)}."]
        for side in Side:
            if side not in self.to_do:
                name = landmark_file_name("", side, suggested=True)
                is_suggested = any(path.name.endswith(name) for path in self.files)
                but = "; only its suggestions were written" if is_suggested else " and was not written"
                lines.append(f"The {side.word} side is not labelled{but}.")
                continue
            for what, codes in (
                ("to do", tuple(code for code in self.to_do[side] if not feature(code).computed)),
                ("suggested, not confirmed", self.suggested.get(side, ())),
                ("not seen", self.unseen[side]),
            ):
                if codes:
                    lines.append(f"Missing on the {side.word} side, {what}: {' '.join(codes)}.")
            if "CO" in self.to_do[side]:
                lines.append(f"On the {side.word} side, {CO_IS_MISSING}.")
        return "\n".join(lines)


def export_landmarks(
    state: SpecimenState,
    directory: str | PathLike[str],
    *,
    formats: Iterable[str] = (".mrk.json",),
    overwrite: bool = False,
    suggested: bool = False,
) -> ExportReport:
    """Write ``<specimen>_L`` and ``<specimen>_R`` into a folder, each side on which something is placed.

    A specimen that was labelled several times has files for each labelling, such as
    ``<specimen>_<observer>_r<round>_L``; the report is of the one in work.

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
    suggested : bool
        Whether to write what is only suggested too, into ``<specimen>_L_suggested.mrk.json`` and ``_R_``; the
        landmark files never hold it.

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
    files = {folder / name: job for name, job in _files(state, suffixes, suggested).items()}
    if not files:
        raise _nothing_placed(state)
    make_room(folder, files, overwrite=overwrite)
    with all_or_none():
        for path, (write, side, labelling) in files.items():
            write(path, labelling.described_side(side), labelling)
    sides = [side for side in Side if _is_labelled(state, side)]
    return ExportReport(
        tuple(files),
        {side: _codes(state.side(side), Status.TO_DO) for side in sides},
        {side: _codes(state.side(side), Status.UNSEEN) for side in sides},
        {side: _codes(state.side(side), Status.SUGGESTED) for side in sides},
    )


def export_names(state: SpecimenState, formats: Iterable[str], *, suggested: bool = False) -> tuple[str, ...]:
    """Return the names of the files that `export_landmarks` would write."""
    return tuple(_files(state, tuple(formats), suggested))


def _files(
    state: SpecimenState, suffixes: tuple[str, ...], suggested: bool
) -> dict[str, tuple[Writer, Side, SpecimenState]]:
    """Return what to write, by file name."""
    files: dict[str, tuple[Writer, Side, SpecimenState]] = {}
    labelled = [each for each in state.labellings if each.landmarks]
    for labelling in labelled:
        who = _file_words(labelling, files) if len(labelled) > 1 else {}
        for side in Side:
            if _is_labelled(labelling, side):
                name = landmark_file_name(state.specimen, side, **who).removesuffix(".mrk.json")
                files |= {f"{name}{suffix}": (_WRITERS[suffix], side, labelling) for suffix in suffixes}
            if suggested and labelling.side(side).suggested:  # IN, which both sides share, is in both files
                name = landmark_file_name(state.specimen, side, suggested=True, **who)
                files[name] = (_write_suggestions, side, labelling)
    return files


def _file_words(labelling: SpecimenState, taken: Iterable[str]) -> dict[str, Any]:
    """Return observer and round for file names; observers whose names look alike in them are told apart."""
    who: dict[str, Any] = {"observer": labelling.observer, "round_": labelling.round}
    stems = [name.rsplit("_", 1)[0] for name in taken]
    number = 1
    while landmark_file_name(labelling.specimen, Side.LEFT, **who).rsplit("_", 1)[0] in stems:
        number += 1
        who["observer"] = f"{labelling.observer}-{number}"
    return who


def _nothing_placed(state: SpecimenState) -> GpError:
    n = sum(mark.suggestion is not None for mark in state.landmarks.values())
    if not n:
        return GpError("nothing is placed yet", specimen=state.specimen, remedy="Place some features first.")
    return GpError(
        f"nothing is placed yet, {n} point{' is' if n == 1 else 's are'} only suggested",
        specimen=state.specimen,
        remedy="Confirm them, or also export the suggestions.",
    )


def _is_labelled(state: SpecimenState, side: Side) -> bool:
    return any(owner is side and mark.position is not None for (owner, _), mark in state.landmarks.items())


def _codes(landmarks: LandmarkSet, status: Status) -> tuple[str, ...]:
    return tuple(code for code in CODES if landmarks.status(code) is status)
