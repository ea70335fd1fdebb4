"""Labelled animals read from many files for an atlas: what can be used, what cannot, and what to look at."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path

import numpy as np

from gp_core.atlas.label_check import Finding
from gp_core.atlas.screening import Screened, screen_labels
from gp_core.errors import GpError
from gp_core.io import load_specimens, mean_labels
from gp_core.io.file_names import natural_key
from gp_core.io.markups import has_point_list
from gp_core.landmarks.features import Side, feature
from gp_core.landmarks.sets import LandmarkSet, Specimen
from gp_labeler.document.specimen_file import SUFFIX, read_specimen
from gp_labeler.document.state import SpecimenState

__all__ = [
    "Animals",
    "Skipped",
    "are_same_labels",
    "files_at",
    "labelled_files",
    "may_hold_labels",
    "read_animals",
]

FEWEST_PLACED = 4
"""A side with fewer says nothing that an atlas could learn from."""

_IN_FOLDERS = (".mrk.json", ".fcsv", SUFFIX)
_SAME_MM = 1e-3


@dataclass(frozen=True)
class Skipped:
    """A file, or one side of an animal, that is not used, and why."""

    what: str
    why: str

    @property
    def text(self) -> str:
        """One sentence."""
        return f"{self.what}: {self.why}."


@dataclass(frozen=True)
class Animals:
    """What was read.

    Parameters
    ----------
    specimens : tuple of Specimen
        By name; only sides that can be used.
    skipped : tuple of Skipped
        What cannot be used.
    screened : Screened, optional
        What is left of them without the labels that are known to be wrong, and what was found.
    files : mapping of (str, Side) to Path
        Where each side was read from.
    confirmed : frozenset of (str, Side, str)
        Labels that a person marked as checked: animal, side, feature.
    """

    specimens: tuple[Specimen, ...]
    skipped: tuple[Skipped, ...] = ()
    screened: Screened | None = None
    files: Mapping[tuple[str, Side], Path] = field(default_factory=dict)
    confirmed: frozenset[tuple[str, Side, str]] = frozenset()

    @property
    def problems(self) -> tuple[Finding, ...]:
        """Labels that a person should look at, the worst first."""
        found = () if self.screened is None else self.screened.problems
        return tuple(finding for finding in found if finding.kind != "other side")  # those are skipped

    def specimen_file(self, name: str, side: Side) -> Path | None:
        """Return the specimen file of an animal: what was read, or one of its name beside that."""
        read = self.files.get((name, side))
        if read is None or read.name.endswith(SUFFIX):
            return read
        beside = read.with_name(f"{name}{SUFFIX}")
        return beside if beside.is_file() else None

    @property
    def n_sides(self) -> int:
        """Sides of all of them."""
        return sum(len(specimen.sides) for specimen in self.specimens)

    @property
    def text(self) -> str:
        """Such as ``11 animals, 22 sides``."""
        n = len(self.specimens)
        return f"{n} animal{'' if n == 1 else 's'}, {self.n_sides} side{'' if self.n_sides == 1 else 's'}"


def may_hold_labels(path: Path) -> bool:
    """Return whether labelled animals may be in a file or folder, by its name."""
    return path.name.lower().endswith(_IN_FOLDERS) or path.is_dir()


def read_animals(
    paths: Iterable[str | PathLike[str]], tell: Callable[[float], object] = lambda fraction: None
) -> Animals:
    """Read landmark files, specimen files, and folders of them; what cannot be used is skipped.

    Parameters
    ----------
    paths : iterable of path
        Files and folders; a folder that holds none is searched one level deeper.
    tell : callable
        Receives the fraction done, and may raise to stop.

    Returns
    -------
    Animals
        Sides with too few labels, or labelled on the wrong side, are left out. Doubtful labels are not.

    Raises
    ------
    GpError
        A folder holds no labelled animals.
    """
    reading = _Reading()
    files = list(dict.fromkeys(file for path in paths for file in files_at(Path(path))))
    for n, file in enumerate(files):
        tell(0.3 * n / max(len(files), 1))
        reading.read(file)
    specimens = [reading.specimen(name) for name in sorted(reading.sides, key=natural_key)]
    screened = screen_labels(
        specimens, confirmed=reading.confirmed, tell=lambda fraction: tell(0.3 + 0.7 * fraction)
    )
    screened = replace(screened, notes=(*reading.notes, *screened.notes))
    exchanged = {(f.specimen, f.side): f for f in screened.findings if f.kind == "other side"}
    skipped = [Skipped(f"{name} {side.word}", f.text) for (name, side), f in exchanged.items()]
    usable = [_without_sides(specimen, exchanged) for specimen in specimens]
    return Animals(
        tuple(specimen for specimen in usable if specimen.sides),
        (*reading.skipped, *skipped),
        screened,
        reading.sources,
        frozenset(reading.confirmed),
    )


def _without_sides(specimen: Specimen, unwanted: Collection[tuple[str, Side]]) -> Specimen:
    name = specimen.name
    return Specimen(name, {s: marks for s, marks in specimen.sides.items() if (name, s) not in unwanted})


class _Reading:
    """The animals read so far, and what was wrong with the rest."""

    def __init__(self) -> None:
        self.sides: dict[str, dict[Side, LandmarkSet]] = {}
        self.sources: dict[tuple[str, Side], Path] = {}
        self.skipped: list[Skipped] = []
        self.confirmed: set[tuple[str, Side, str]] = set()
        self._repeats: dict[tuple[str, Side], list[LandmarkSet]] = {}

    @property
    def notes(self) -> list[str]:
        """Which sides have the mean of several labellings."""
        return [
            f"{name} {side.word}: the mean of {1 + len(repeats)} labellings is taken."
            for (name, side), repeats in self._repeats.items()
        ]

    def specimen(self, name: str) -> Specimen:
        """Return an animal, with the mean of the labels of a side that was labelled several times."""
        sides = {
            side: mean_labels([first, *self._repeats.get((name, side), ())], name)
            for side, first in self.sides[name].items()
        }
        return Specimen(name, sides)

    def read(self, file: Path) -> None:
        """Take in the sides that a file holds."""
        try:
            specimens = self._specimens_in(file)
        except GpError as error:
            self.skipped.append(Skipped(file.name, error.problem.rstrip(".")))
            return
        for specimen in specimens:
            for landmarks in specimen.sides.values():
                self._take(specimen.name, landmarks, file)

    def _specimens_in(self, file: Path) -> list[Specimen]:
        if not file.name.endswith(SUFFIX):
            return load_specimens(file)
        specimens = [specimen for state in read_specimen(file).labellings if (specimen := self._of(state))]
        if not specimens:
            raise GpError("nothing is placed in it", file=file)
        return specimens

    def _of(self, state: SpecimenState) -> Specimen | None:
        """Return one labelling of a specimen file, and take down what was checked; None for an empty one."""
        sides = {side: marks for side in Side if _has_own_labels(marks := state.described_side(side))}
        self.confirmed |= {
            (state.specimen, side, code)
            for side, landmarks in sides.items()
            for code in landmarks.placed
            if not feature(code).computed and state.landmark(side, code).checked
        }
        return Specimen(state.specimen, sides) if sides else None

    def _take(self, name: str, landmarks: LandmarkSet, file: Path) -> None:
        side, what = landmarks.side, f"{name} {landmarks.side.word} ({file.name})"
        n_placed = sum(code != "CO" for code in landmarks.placed)
        if n_placed < FEWEST_PLACED:
            others = f" and {len(landmarks.suggested)} only suggested" if landmarks.suggested else ""
            words = f"{n_placed} placed{others}, {FEWEST_PLACED} or more are needed"
            self.skipped.append(Skipped(what, words))
        elif side not in self.sides.get(name, {}):
            self.sides.setdefault(name, {})[side] = landmarks
            self.sources[name, side] = file
        elif any(are_same_labels(known, landmarks) for known in self._labelled(name, side)):
            return
        elif self._is_another_labelling(name, landmarks):
            self._repeats.setdefault((name, side), []).append(landmarks)
        else:
            earlier = self.sources[name, side].name
            self.skipped.append(Skipped(what, f"this side is in {earlier} too, with other labels"))

    def _is_another_labelling(self, name: str, landmarks: LandmarkSet) -> bool:
        """Whether it is by another observer, or of another round, in the same frame."""
        known = self._labelled(name, landmarks.side)
        sittings = {(each.observer, each.round) for each in known}
        return (landmarks.observer, landmarks.round) not in sittings and landmarks.frame == known[0].frame

    def _labelled(self, name: str, side: Side) -> list[LandmarkSet]:
        """Return the labellings of a side that were read so far."""
        return [self.sides[name][side], *self._repeats.get((name, side), ())]


def _has_own_labels(landmarks: LandmarkSet) -> bool:
    """Whether anything is placed that does not belong to the other side as well."""
    rows = [feature(code) for code in landmarks.placed]
    return any(not (row.shared or row.computed) for row in rows)


def are_same_labels(one: LandmarkSet, other: LandmarkSet) -> bool:
    """Whether two files hold the same labels, such as a specimen and what was exported from it."""
    return one.placed == other.placed and bool(
        np.abs(one.array(one.placed) - other.array(one.placed)).max(initial=0.0) < _SAME_MM
    )


def files_at(path: Path) -> list[Path]:
    """Return the labelled files of a folder, else of the folders in it; a file itself."""
    if not path.is_dir():
        return [path]
    here = list(labelled_files(path))
    found = here or [file for folder in sorted(path.iterdir()) for file in labelled_files(folder)]
    if not found:
        raise GpError(
            f"holds no labelled animals ({', '.join('*' + suffix for suffix in _IN_FOLDERS)})",
            file=path,
            remedy="Choose another folder, or the files themselves.",
        )
    return found


def labelled_files(folder: Path) -> Iterator[Path]:
    """Yield the landmark and specimen files of a folder, not deeper."""
    if folder.is_dir():
        for file in sorted(folder.iterdir()):
            if _may_be_read(file):
                yield file


def _may_be_read(file: Path) -> bool:
    """Whether a file of a folder may hold labels: rulers and angles do not."""
    name = file.name.lower()
    is_named_so = name.endswith(_IN_FOLDERS) and not name.startswith(".")
    return is_named_so and (not name.endswith(".mrk.json") or has_point_list(file))
