"""Labellings of animals from many files, with observers and rounds apart."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path

from gp_core.errors import GpError
from gp_core.io import Labelling, load_labellings
from gp_core.io.file_names import natural_key
from gp_core.landmarks.features import Side
from gp_core.landmarks.sets import LandmarkSet, Specimen
from gp_labeler.document.animals import Skipped, are_same_labels, files_at
from gp_labeler.document.specimen_file import SUFFIX, read_specimen

__all__ = ["RepeatedLabels", "labellings_in", "read_labellings"]


@dataclass(frozen=True)
class RepeatedLabels:
    """What was read.

    Parameters
    ----------
    labellings : tuple of Labelling
        In the order of the files; those of one animal, observer and round once.
    skipped : tuple of Skipped
        What cannot be used, and why.
    files : mapping of str to Path
        The specimen file of an animal, where it is among the files or beside them.
    """

    labellings: tuple[Labelling, ...]
    skipped: tuple[Skipped, ...] = ()
    files: Mapping[str, Path] = field(default_factory=dict)


def labellings_in(path: str | PathLike[str]) -> list[Labelling]:
    """Return every labelling that a specimen file holds; raises `GpError` where it cannot be read."""
    found = []
    for state in read_specimen(path).labellings:
        sides = {side: marks for side in Side if (marks := state.described_side(side)).placed}
        if sides:
            found.append(Labelling(Specimen(state.specimen, sides), state.labeller, state.round))
    return found


def read_labellings(
    paths: Iterable[str | PathLike[str]], tell: Callable[[float], object] = lambda fraction: None
) -> RepeatedLabels:
    """Read landmark files, specimen files, and folders of them.

    Parameters
    ----------
    paths : iterable of path
        Files and folders; a folder that holds none is searched one level deeper.
    tell : callable
        Receives the fraction done, and may raise to stop.

    Returns
    -------
    RepeatedLabels
        A specimen file goes before its exported files, which hold the same.

    Raises
    ------
    GpError
        A folder holds no labelled animals.
    """
    every = list(dict.fromkeys(file for path in paths for file in files_at(Path(path))))
    every.sort(key=lambda file: not file.name.endswith(SUFFIX))
    reading = _Reading()
    for n, file in enumerate(every):
        tell(n / len(every))
        reading.read(file)
    return RepeatedLabels(tuple(reading.labellings()), tuple(reading.skipped), reading.files)


class _Reading:
    """The sides read so far, by animal, observer and round."""

    def __init__(self) -> None:
        self._sides: dict[tuple[str, str, int], dict[Side, LandmarkSet]] = {}
        self._observers: dict[str, str] = {}
        self.skipped: list[Skipped] = []
        self.files: dict[str, Path] = {}

    def read(self, file: Path) -> None:
        """Take in the labellings that a file holds."""
        try:
            found = labellings_in(file) if file.name.endswith(SUFFIX) else load_labellings(file)
        except GpError as error:
            self.skipped.append(Skipped(file.name, error.problem.rstrip(".")))
            return
        for each in found:
            self._take(each, file)

    def labellings(self) -> list[Labelling]:
        """Return what was read, by animal, observer and round."""
        order = sorted(self._sides, key=lambda key: (natural_key(key[0]), *key[1:]))
        return [
            Labelling(Specimen(name, self._sides[name, who, number]), self._observers[who], number)
            for name, who, number in order
        ]

    def _take(self, found: Labelling, file: Path) -> None:
        name, who = found.specimen.name, found.observer.casefold()
        beside = file if file.name.endswith(SUFFIX) else file.with_name(f"{name}{SUFFIX}")
        if beside.is_file():
            self.files.setdefault(name, beside)
        self._observers.setdefault(who, found.observer)
        sides = self._sides.setdefault((name, who, found.round), {})
        for side, landmarks in found.specimen.sides.items():
            if not are_same_labels(sides.setdefault(side, landmarks), landmarks):
                why = f"the labels by {found.who} are in another file too, and differ"
                self.skipped.append(Skipped(f"{name} {side.word} ({file.name})", why))
