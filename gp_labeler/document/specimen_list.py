"""The specimens in some folders, told by their files alone: no scan is opened for it."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime, timezone
from os import PathLike
from pathlib import Path
from typing import Any

from gp_core.errors import GpError
from gp_core.io.file_names import natural_key
from gp_core.landmarks.features import CODES, Side
from gp_labeler.document.labelling_edits import labelling_text
from gp_labeler.document.scan_files import is_slice_folder, scan_files
from gp_labeler.document.specimen_file import SUFFIX, read_document, state_in, thumbnail_in
from gp_labeler.document.state import SpecimenState
from gp_labeler.imaging.readers.formats import volume_stem

__all__ = ["SIDE_TOTAL", "ListedSpecimen", "list_specimens", "progress_text", "specimen_files"]

SIDE_TOTAL = len(CODES)
"""Features of a side, CO with them."""

_MOST_LEVELS = 4
"""So deep folders are searched: a lab keeps a folder for each animal, and one for each study."""


@dataclass(frozen=True)
class ListedSpecimen:
    """One specimen file, or a scan that nobody has begun, as a list shows it.

    Parameters
    ----------
    path : Path
        The specimen file; the scan, a file or a folder, where there is none.
    specimen : str
        Name of the specimen.
    placed, unseen, suggested : mapping of Side to int
        Points of the labelling in work.
    observer : str
        Who makes it.
    round : int
        In which round.
    labellings : tuple of str
        All labellings, such as ``AB, round 1``.
    changed : str
        When the file was last written, ISO 8601, UTC.
    notes : str
        On the specimen.
    scan : str
        Name of the scan; empty without one.
    scan_is_there : bool
        Whether the file or folder of the scan exists; a phantom, which is in no file, is always there.
    n_notes : int
        Labels with a note, or a guess.
    thumbnail : bytes
        PNG; empty where none was kept.
    state : SpecimenState, optional
        What the file holds; None where it cannot be read.
    problem : str
        Why it cannot be read; empty where it can.
    is_begun : bool
        Whether there is a specimen file.
    stamp : (int, int)
        Time of the last change of the file, ns, and its size: a file with the same is not read again.
    """

    path: Path
    specimen: str
    placed: Mapping[Side, int] = field(default_factory=dict)
    unseen: Mapping[Side, int] = field(default_factory=dict)
    suggested: Mapping[Side, int] = field(default_factory=dict)
    observer: str = ""
    round: int = 1
    labellings: tuple[str, ...] = ()
    changed: str = ""
    notes: str = ""
    scan: str = ""
    scan_is_there: bool = False
    n_notes: int = 0
    thumbnail: bytes = b""
    state: SpecimenState | None = None
    problem: str = ""
    is_begun: bool = True
    stamp: tuple[int, int] = (0, 0)

    def done(self, side: Side) -> int:
        """Return how many features of a side are placed, computed or cannot be seen."""
        return self.placed.get(side, 0) + self.unseen.get(side, 0)

    @property
    def is_finished(self) -> bool:
        """Whether nothing is left to do on either side."""
        return not self.problem and all(self.done(side) >= SIDE_TOTAL for side in Side)

    @property
    def text(self) -> str:
        """All that can be searched for."""
        return " ".join(
            (self.specimen, self.observer, *self.labellings, self.notes, self.scan, str(self.path))
        )

    def as_dict(self) -> dict[str, Any]:
        """Return it for a JSON file."""
        sides = {
            side.value: {
                "placed": self.placed.get(side, 0),
                "unseen": self.unseen.get(side, 0),
                "suggested": self.suggested.get(side, 0),
                "total": SIDE_TOTAL,
            }
            for side in Side
        }
        names = ("observer", "round", "changed", "notes", "scan", "scan_is_there", "n_notes", "problem")
        about = {name: getattr(self, name) for name in names}
        finished = {
            "labellings": list(self.labellings),
            "begun": self.is_begun,
            "finished": self.is_finished,
        }
        return {"path": str(self.path), "specimen": self.specimen, "sides": sides, **about, **finished}


def specimen_files(places: Iterable[str | PathLike[str]]) -> list[Path]:
    """Return the specimen files in folders, and in the folders in them, in natural order; a file itself.

    Raises
    ------
    GpError
        A place does not exist, or cannot be searched.
    """
    found: dict[Path, None] = {}
    for place in places:
        path = Path(place)
        if not path.exists():
            raise GpError("does not exist", file=path, remedy="Name a folder, or specimen files.")
        found |= dict.fromkeys([path] if path.is_file() else _within(path, _MOST_LEVELS))
    return sorted(found, key=lambda file: natural_key(str(file)))


def progress_text(rows: Collection[ListedSpecimen]) -> str:
    """Return how many of some specimens are finished, and not begun: ``7 finished, 3 not begun``."""
    n_new = sum(not row.is_begun for row in rows)
    not_begun = f", {n_new} not begun" if n_new else ""
    return f"{sum(row.is_finished for row in rows)} finished{not_begun}"


def list_specimens(
    places: Iterable[str | PathLike[str]],
    tell: Callable[[float], object] = lambda fraction: None,
    *,
    known: Iterable[ListedSpecimen] = (),
) -> list[ListedSpecimen]:
    """Read the specimen files in some folders, and find the scans that have none.

    Parameters
    ----------
    places : iterable of path
        Folders, and specimen files.
    tell : callable
        Receives the fraction done, and may raise to stop.
    known : iterable of ListedSpecimen
        What was read before: files that have not changed since are not read again.

    Returns
    -------
    list of ListedSpecimen
        One for each file, and for each scan that none of them is of; a file that cannot be read says why.
    """
    places, before = list(places), {row.path: row for row in known}
    files, found = specimen_files(places), []
    for n, file in enumerate(files):
        tell(n / len(files))
        found.append(_listed(file, before.get(file)))
    found += _not_begun(places, found)
    return sorted(found, key=lambda row: natural_key(str(row.path)))


def _not_begun(
    places: Iterable[str | PathLike[str]], listed: Iterable[ListedSpecimen]
) -> list[ListedSpecimen]:
    """Return the scans in folders that no listed specimen is of, by its path or its name beside it."""
    begun: set[Path] = set()
    for row in listed:
        named = row.path.with_name(row.path.name.removesuffix(SUFFIX))
        volume = None if row.state is None else row.state.volume
        of_scan = [] if volume is None or volume.path is None else [Path(volume.path)]
        for path in (named, *of_scan):
            begun |= {path.resolve(), *path.resolve().parents[:1]}  # a folder of slices holds its specimen
    scans = dict.fromkeys(
        scan for place in places if Path(place).is_dir() for scan in _scans_within(Path(place))
    )
    return [
        ListedSpecimen(scan, _name_of(scan), scan=scan.name, scan_is_there=True, is_begun=False)
        for scan in scans
        if not {scan.resolve(), scan.resolve().with_name(_name_of(scan))} & begun
    ]


def _name_of(scan: Path) -> str:
    return scan.name if scan.is_dir() else volume_stem(scan)


def _within(folder: Path, levels: int) -> Iterator[Path]:
    for entry in _entries(folder):
        if entry.name.endswith(SUFFIX):
            yield entry
        elif levels and entry.is_dir() and not entry.is_symlink():
            yield from _within(entry, levels - 1)


def _scans_within(folder: Path, levels: int = _MOST_LEVELS) -> Iterator[Path]:
    entries = _entries(folder)
    if is_slice_folder(entries):
        yield folder
        return
    yield from scan_files(entries)
    for entry in entries:
        if levels and entry.is_dir() and not entry.is_symlink():
            yield from _scans_within(entry, levels - 1)


def _entries(folder: Path) -> list[Path]:
    try:
        return sorted(entry for entry in folder.iterdir() if not entry.name.startswith("."))
    except OSError as error:
        raise GpError(f"cannot be searched ({error.strerror})", file=folder) from None


def _listed(file: Path, known: ListedSpecimen | None) -> ListedSpecimen:
    name = file.name.removesuffix(SUFFIX)
    try:
        status = file.stat()
        stamp = status.st_mtime_ns, status.st_size
        if known is not None and known.stamp == stamp and known.state is not None:
            there = _scan_is_there(known.state)
            return known if there is known.scan_is_there else replace(known, scan_is_there=there)
        document = read_document(file)
        state = state_in(document, file)
        changed = datetime.fromtimestamp(status.st_mtime, timezone.utc).isoformat(timespec="seconds")
    except GpError as error:
        return ListedSpecimen(file, name, problem=error.problem)
    except OSError as error:
        return ListedSpecimen(file, name, problem=str(error.strerror))
    volume = state.volume
    sets = {side: state.side(side) for side in Side}
    return ListedSpecimen(
        file,
        state.specimen,
        placed={side: len(landmarks.placed) for side, landmarks in sets.items()},
        unseen={side: len(landmarks.unseen) for side, landmarks in sets.items()},
        suggested={side: len(landmarks.suggested) for side, landmarks in sets.items()},
        observer=state.labeller,
        round=state.round,
        labellings=_labellings(state),
        changed=changed,
        notes=state.notes,
        scan="" if volume is None else volume.name,
        scan_is_there=_scan_is_there(state),
        n_notes=sum(bool(mark.note) or mark.certainty == "guess" for mark in state.landmarks.values()),
        thumbnail=thumbnail_in(document),
        state=state,
        stamp=stamp,
    )


def _scan_is_there(state: SpecimenState) -> bool:
    volume = state.volume
    return volume is not None and (volume.path is None or Path(volume.path).exists())


def _labellings(state: SpecimenState) -> tuple[str, ...]:
    every = ((state.labeller, state.round), *((each.observer, each.round) for each in state.others))
    return tuple(labelling_text(*sitting) for sitting in sorted(every, key=lambda s: (s[0].casefold(), s[1])))
