"""Animals from many landmark files, a side each."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike, fspath
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gp_core.argument_types import checks_arguments
from gp_core.errors import FeatureError, FileFormatError, GpError
from gp_core.io.file_names import landmark_file_name, named_side, natural_key
from gp_core.io.markups import has_point_list
from gp_core.io.reading import read_points, sides_of, specimen_of
from gp_core.io.table import read_rows
from gp_core.landmarks.anatomy import with_cochlea_origin
from gp_core.landmarks.features import CODES, FEATURES, Side
from gp_core.landmarks.labels import LabelNames, parse_label
from gp_core.landmarks.plausible_size import check_plausible_size
from gp_core.landmarks.provenance import Certainty, LabelProvenance
from gp_core.landmarks.sets import LandmarkSet, Specimen, Status

__all__ = ["Labelling", "landmark_files", "load_labellings", "load_specimens", "mean_labels"]

_log = logging.getLogger(__name__)

_SAME_MM = 1e-6
_ROUNDED_MM = 1e-3
"""Two files of a side that differ by no more hold the same labels in different formats."""

_IN_FOLDERS = (".mrk.json", ".fcsv")
_TABLES = (".csv", ".tsv")
_RICHEST_FIRST = (".mrk.json", ".json", ".fcsv")


@dataclass(frozen=True)
class Labelling:
    """One animal as one observer labelled it in one round.

    Parameters
    ----------
    specimen : Specimen
        The animal with the landmarks of its labelled sides.
    observer : str
        Who labelled it; empty where nobody said.
    round : int
        Which of the observer's labellings of the animal it is, from 1.
    """

    specimen: Specimen
    observer: str = ""
    round: int = 1

    @property
    def who(self) -> str:
        """Such as ``AB, round 2``."""
        return f"{self.observer or 'unnamed'}, round {self.round}"


@checks_arguments
def load_specimens(
    paths: str | PathLike[str] | Iterable[str | PathLike[str]],
    *,
    names: LabelNames | None = None,
    observer: str | None = None,
    round: int | None = None,
) -> list[Specimen]:
    """Read landmark files, or folders of them, and put the sides of each animal together.

    Parameters
    ----------
    paths : path or iterable of path
        Landmark files of any kind, and folders; these are searched, not deeper, for ``.mrk.json`` and
        ``.fcsv``; a warning names tables of a side that are left out. A file may hold both sides, told by its
        labels (``CA_L``) or a column ``side``.
    names : LabelNames, optional
        A lab's own names of the features.
    observer : str, optional
        Take the labels of this observer alone.
    round : int, optional
        Take the labels of this round alone.

    Returns
    -------
    list of Specimen
        By name, GP2 before GP10. Files belong together by the specimen in their ``gpLabeler`` object,
        else by their name without ``_L`` or ``_R``. CO is computed where a file lacks it or differs.
        A file of suggestions (``_L_suggested``) adds to the file of that side. IN, which both sides share,
        counts for both where one file alone has it. An animal that was labelled several times is one
        specimen, with the mean of its labels (which is logged); `load_labellings` keeps them apart.

    Raises
    ------
    FileFormatError
        A file cannot be read, or a folder holds none.
    FeatureError
        Two files hold the same side of a specimen by one observer in one round, with other labels; nothing
        is by that observer or of that round; a side is not known, or a label is unknown or doubled.
    GeometryError
        All points of a file are at one place, or not in millimetres.
    """
    of_animals: dict[str, list[Labelling]] = {}
    for each in load_labellings(paths, names=names, observer=observer, round=round):
        of_animals.setdefault(each.specimen.name, []).append(each)
    return [_mean_of(labellings) for labellings in of_animals.values()]


@checks_arguments
def load_labellings(
    paths: str | PathLike[str] | Iterable[str | PathLike[str]],
    *,
    names: LabelNames | None = None,
    observer: str | None = None,
    round: int | None = None,
) -> list[Labelling]:
    """Read landmark files, or folders of them, and keep each observer's labels, and each round's, apart.

    Parameters
    ----------
    paths, names, observer, round
        As for `load_specimens`. Observer and round are those in the file's ``gpLabeler`` object, else in its
        points' descriptions, else in its name (``GP01_AB_r2_L``).

    Returns
    -------
    list of Labelling
        By animal, observer and round.

    Raises
    ------
    GpError
        As for `load_specimens`.
    """
    files = _files([paths] if isinstance(paths, (str, PathLike)) else list(paths))
    sides: dict[_Key, dict[Side, LandmarkSet]] = {}
    sources: dict[tuple[_Key, Side, bool], tuple[Path, LandmarkSet]] = {}
    read = ((file, read_points(file, names=names)) for file in sorted(files, key=_richest))
    for file, name, landmarks in (
        (file, specimen_of(points), one) for file, points in read for one in sides_of(points)
    ):
        check_plausible_size(landmarks, file)
        key = _Key(name, landmarks.observer, landmarks.round)
        only_suggested = bool(landmarks.suggested) and not landmarks.placed
        if only_suggested and key not in sides:
            key = next((k for k in sides if k.name == name and landmarks.side in sides[k]), key)
        earlier, labels = sources.setdefault((key, landmarks.side, only_suggested), (file, landmarks))
        if earlier is not file:
            if _kind(earlier) != _kind(file) and _are_same(labels, landmarks):
                continue  # one export in two formats
            raise FeatureError(
                f"the {landmarks.side.word} side is in {fspath(earlier)} too",
                file=file,
                specimen=name,
                remedy=f"Leave one of them out. If it was labelled twice, say so in the names: "
                f"{landmark_file_name(name, landmarks.side, observer='AB', round_=2)} (observer, round).",
            )
        known = sides.setdefault(key, {})
        known[landmarks.side] = _together(known.get(landmarks.side), _with_true_origin(landmarks), file)
    order = sorted(sides, key=lambda k: (natural_key(k.name), natural_key(k.observer), k.round))
    found = [Labelling(Specimen(key.name, _sharing(sides[key])), key.observer, key.round) for key in order]
    return _chosen(found, observer, round)


def _chosen(found: list[Labelling], observer: str | None, number: int | None) -> list[Labelling]:
    chosen = [
        each
        for each in found
        if (observer is None or each.observer.casefold() == observer.casefold())
        and (number is None or each.round == number)
    ]
    if not chosen:
        what = [] if observer is None else [f"by {observer}"]
        what += [] if number is None else [f"of round {number}"]
        raise FeatureError(
            f"no labels {' '.join(what)} are among the files",
            remedy=f"There are: {'; '.join(dict.fromkeys(each.who for each in found))}.",
        )
    return chosen


class _Key(NamedTuple):
    name: str
    observer: str
    round: int


def _kind(file: Path) -> int:
    """Rank formats; those with more information on their labels come first."""
    name = file.name.lower()
    return next((i for i, suffix in enumerate(_RICHEST_FIRST) if name.endswith(suffix)), len(_RICHEST_FIRST))


def _richest(file: Path) -> int:
    """Sort files by the information on their labels, most first, suggestions last."""
    return _kind(file) + 10 * ("suggested" in file.name.lower())


def _are_same(one: LandmarkSet, other: LandmarkSet) -> bool:
    """Whether two files hold the same labels up to rounding, such as one set exported in two formats."""
    return (
        one.frame == other.frame
        and one.placed == other.placed
        and bool(np.abs(one.array(one.placed) - other.array(one.placed)).max(initial=0.0) < _ROUNDED_MM)
        and set(one.suggested) == set(other.suggested)
    )


def _sharing(sides: Mapping[Side, LandmarkSet]) -> dict[Side, LandmarkSet]:
    """Use a midline point that only one side has for the other side too."""
    found = dict(sides)
    if len({landmarks.frame for landmarks in sides.values()}) > 1:
        return found
    for side, landmarks in sides.items():
        for row in FEATURES:
            other = found.get(side.other)
            if not row.shared or other is None or landmarks.frame == "cochlea":
                continue
            if row.code in landmarks and other.status(row.code) is not Status.PLACED:
                about = landmarks.provenance.get(row.code)
                other = other.with_point(row.code, landmarks[row.code])
                found[side.other] = other if about is None else other.with_provenance({row.code: about})
    return found


def _mean_of(labellings: list[Labelling]) -> Specimen:
    """Return one animal with the mean of its labels."""
    first = labellings[0].specimen
    if len(labellings) == 1:
        return first
    sides = {}
    for side in Side:
        of_side = [each.specimen.sides[side] for each in labellings if side in each.specimen.sides]
        if of_side:
            sides[side] = mean_labels(of_side, first.name)
    told = "; ".join(each.who for each in labellings)
    _log.warning("%s: labelled %d times, the mean is taken (%s)", first.name, len(labellings), told)
    return Specimen(first.name, sides)


def mean_labels(labelled: Sequence[LandmarkSet], specimen: str) -> LandmarkSet:
    """Return the mean of several labellings of one side.

    Parameters
    ----------
    labelled : sequence of LandmarkSet
        Of one side, in one frame.
    specimen : str
        Whose they are, for messages.

    Returns
    -------
    LandmarkSet
        Each feature is the mean of the labellings that have it, as certain as the least certain of them; of
        one labelling, that itself.

    Raises
    ------
    FeatureError
        They are in different frames.
    """
    if len(labelled) == 1:
        return labelled[0]
    first = labelled[0]
    if other := next((each for each in labelled if each.frame != first.frame), None):
        raise FeatureError(
            f"its labels are in the frames {first.frame} and {other.frame}",
            specimen=specimen,
            remedy="Export them all in the frame of the scan.",
        )
    points = {
        row.code: np.mean([each[row.code] for each in labelled if row.code in each], axis=0)
        for row in FEATURES
        if not row.computed and any(row.code in each for each in labelled)
    }
    unseen = frozenset.union(*(each.unseen for each in labelled))
    mean = LandmarkSet.from_mapping(points, first.side, frame=first.frame)
    mean = replace(mean, unseen=unseen - set(points)).with_provenance(_least_certain(labelled, points))
    return with_cochlea_origin(mean)


def _least_certain(labelled: Sequence[LandmarkSet], codes: Iterable[str]) -> dict[str, LabelProvenance]:
    """Return the certainty of means: that of the least certain label, where anybody said one."""
    order = list(Certainty)
    found = {}
    for code in codes:
        known = [each.provenance[code] for each in labelled if code in each and code in each.provenance]
        said = [about.certainty for about in known if about.certainty is not None]
        if said:
            found[code] = LabelProvenance(certainty=max(said, key=order.index))
    return found


def _together(known: LandmarkSet | None, read: LandmarkSet, file: Path) -> LandmarkSet:
    """Add the suggestions of one file to the observations of another of the same side."""
    if known is None:
        return read
    if known.frame != read.frame:
        raise FeatureError(
            f"is in the frame {read.frame}, but the other file of the {read.side.word} side in {known.frame}",
            file=file,
            remedy="Leave out one of them.",
        )
    observed, other = (known, read) if known.placed else (read, known)
    return observed.with_suggestions({**other.suggested, **observed.suggested})


def _with_true_origin(landmarks: LandmarkSet) -> LandmarkSet:
    """Compute CO, but keep the file's own value, to the last bit, where it agrees."""
    computed = with_cochlea_origin(landmarks)
    same = "CO" in landmarks and np.abs(computed["CO"] - landmarks["CO"]).max() < _SAME_MM
    return landmarks if same else computed


def _files(paths: list[str | PathLike[str]]) -> list[Path]:
    if not paths:
        raise FileFormatError("no landmark files were given", remedy="Name files, or folders of them.")
    found = [file for path in paths for file in landmark_files(path)]
    for path in paths:
        _tell_of_tables(Path(path), found)
    return list(
        {file.absolute(): file for file in found}.values()
    )  # a file may be named along with its folder


def _tell_of_tables(place: Path, found: Sequence[Path]) -> None:
    """Warn of tables of a folder that hold a side which none of the files that are read is named after."""
    tables = sorted(file for file in place.glob("*") if file.suffix.lower() in _TABLES)
    read = {
        file.name[: -len(suffix)] for file in found for suffix in _IN_FOLDERS if file.name.endswith(suffix)
    }
    left_out = [file.name for file in tables if file.stem not in read and _is_of_a_side(file)]
    if left_out:
        _log.warning(
            "%s: its tables of landmarks are left out: %s. Name the files to read them",
            place,
            ", ".join(left_out),
        )


def _is_of_a_side(table: Path) -> bool:
    """Return whether a table holds features, and it or its name tells the side; touches tell none."""
    if table.name.startswith("."):
        return False
    try:
        words = {word for _, fields in read_rows(table) for word in fields[:2]}
        if not any(parse_label(word).name in CODES for word in words):
            return False
        return bool(read_points(table).sides or named_side(table))
    except GpError:
        return False


def _is_markups(file: Path) -> bool:
    return file.name.lower().endswith(".mrk.json")


def landmark_files(place: str | PathLike[str]) -> list[Path]:
    """Return the landmark files of a folder (not of its subfolders), or the given file.

    Parameters
    ----------
    place : path-like
        A folder or a file.

    Returns
    -------
    list of pathlib.Path
        In natural order.

    Raises
    ------
    FileFormatError
        The folder holds none, or cannot be searched.
    """
    path = Path(place)
    try:
        if not path.is_dir():
            return [path]
        found = sorted(file for file in path.iterdir() if file.name.lower().endswith(_IN_FOLDERS))
    except (OSError, ValueError) as error:
        raise FileFormatError(f"cannot be searched ({error})", file=path, remedy="Check the name.") from None
    found = [file for file in found if not file.name.startswith(".")]  # temporary files, and those of macOS
    found = [file for file in found if not _is_markups(file) or has_point_list(file)]  # no rulers and angles
    if not found:
        raise FileFormatError(
            f"holds no landmark files ({', '.join('*' + suffix for suffix in _IN_FOLDERS)})",
            file=path,
            remedy="Name another folder, or the files themselves.",
        )
    return found
