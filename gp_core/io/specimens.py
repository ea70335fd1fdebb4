"""Animals from many landmark files, a side each."""

from __future__ import annotations

from collections.abc import Iterable
from os import PathLike, fspath
from pathlib import Path

import numpy as np

from gp_core.errors import FeatureError, FileFormatError
from gp_core.io.file_names import natural_key
from gp_core.io.reading import read_points, sides_of, specimen_of
from gp_core.landmarks.anatomy import with_cochlea_origin
from gp_core.landmarks.features import Side
from gp_core.landmarks.labels import LabelNames
from gp_core.landmarks.plausible_size import check_plausible_size
from gp_core.landmarks.sets import LandmarkSet, Specimen

__all__ = ["landmark_files", "load_specimens"]

_SAME_MM = 1e-6
_IN_FOLDERS = (".mrk.json", ".fcsv")


def load_specimens(
    paths: str | PathLike[str] | Iterable[str | PathLike[str]],
    *,
    names: LabelNames | None = None,
) -> list[Specimen]:
    """Read landmark files, or folders of them, and put the sides of each animal together.

    Parameters
    ----------
    paths : path or iterable of path
        Landmark files of any kind, and folders; these are searched, not deeper, for ``.mrk.json`` and
        ``.fcsv``. A file may hold both sides, told by its labels (``CA_L``) or a column ``side``.
    names : LabelNames, optional
        A lab's own names of the features.

    Returns
    -------
    list of Specimen
        By name, GP2 before GP10. Files belong together by the specimen in their ``gpLabeler`` object,
        else by their name without ``_L`` or ``_R``. CO is computed where a file lacks it or differs.
        A file of suggestions (``_L_suggested``) adds to the file of that side.

    Raises
    ------
    FileFormatError
        A file cannot be read, or a folder holds none.
    FeatureError
        Two files hold the same side of a specimen, a side is not known, or a label is unknown or doubled.
    GeometryError
        All points of a file are at one place, or not in millimetres.
    """
    files = _files([paths] if isinstance(paths, (str, PathLike)) else list(paths))
    sides: dict[str, dict[Side, LandmarkSet]] = {}
    sources: dict[tuple[str, Side, bool], Path] = {}
    read = ((file, read_points(file, names=names)) for file in files)
    for file, name, landmarks in (
        (file, specimen_of(points), one) for file, points in read for one in sides_of(points)
    ):
        check_plausible_size(landmarks, file)
        only_suggested = bool(landmarks.suggested) and not landmarks.placed
        earlier = sources.setdefault((name, landmarks.side, only_suggested), file)
        if earlier is not file:
            raise FeatureError(
                f"the {landmarks.side.word} side is in {fspath(earlier)} too",
                file=file,
                specimen=name,
                remedy="Give one file a side, or name the specimens apart.",
            )
        known = sides.setdefault(name, {})
        known[landmarks.side] = _together(known.get(landmarks.side), _with_true_origin(landmarks), file)
    return [Specimen(name, sides[name]) for name in sorted(sides, key=natural_key)]


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
    """Compute CO, but keep the file's own number, to the last bit, where it says the same."""
    computed = with_cochlea_origin(landmarks)
    same = "CO" in landmarks and np.abs(computed["CO"] - landmarks["CO"]).max() < _SAME_MM
    return landmarks if same else computed


def _files(paths: list[str | PathLike[str]]) -> list[Path]:
    if not paths:
        raise FileFormatError("no landmark files were given", remedy="Name files, or folders of them.")
    found = [file for path in paths for file in landmark_files(path)]
    return list(
        {file.absolute(): file for file in found}.values()
    )  # a file may be named along with its folder


def landmark_files(place: str | PathLike[str]) -> list[Path]:
    """Return the landmark files of a folder, not deeper, or the one file that is named.

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
    found = [file for file in found if not file.name.startswith(".")]  # drafts, and what macOS leaves
    if not found:
        raise FileFormatError(
            f"holds no landmark files ({', '.join('*' + suffix for suffix in _IN_FOLDERS)})",
            file=path,
            remedy="Name another folder, or the files themselves.",
        )
    return found
