"""The authors' labelled animals, two ``.mat`` files, and their import as landmark JSON."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from pathlib import Path

import numpy as np

from gp_core.argument_types import checks_arguments
from gp_core.disk import all_or_none
from gp_core.errors import FileFormatError, GpError
from gp_core.io.file_names import landmark_file_name
from gp_core.io.markups import write_markups
from gp_core.io.mat5 import read_mat5
from gp_core.io.text import shown
from gp_core.landmarks.features import CODES, Side, named_set
from gp_core.landmarks.sets import LandmarkSet, Specimen
from gp_core.validation import FloatArray

__all__ = ["import_mat", "read_authors_mat"]


def read_authors_mat(path_left: str | PathLike[str], path_right: str | PathLike[str]) -> list[Specimen]:
    """Read the labelled sets of Usevitch et al. 2021.

    Parameters
    ----------
    path_left, path_right : path
        Files with the variables ``cc_L`` and ``cc_R``: (20 features, 3, animals) in mm, each set in its
        own cochlea frame, rows as the feature table's ``authors_mat`` names them.

    Returns
    -------
    list of Specimen
        ``GP01``, ``GP02``, ...; both sides, cochlea frame.

    Raises
    ------
    FileFormatError
        Not such files.
    """
    left = _read_sets(path_left, Side.LEFT)
    right = _read_sets(path_right, Side.RIGHT)
    if len(left) != len(right):
        raise FileFormatError(
            f"holds {len(right)} animals, the left side's file {len(left)}",
            file=path_right,
            remedy="Give the two files of one study.",
        )
    pairs = enumerate(zip(left, right, strict=True), start=1)
    return [Specimen(f"GP{i:02d}", {Side.LEFT: a, Side.RIGHT: b}) for i, (a, b) in pairs]


@checks_arguments
def import_mat(
    path_left: str | PathLike[str],
    path_right: str | PathLike[str],
    directory: str | PathLike[str],
    *,
    overwrite: bool = False,
) -> list[Path]:
    """Write the authors' sets as landmark JSON, one file for each side.

    Parameters
    ----------
    path_left, path_right : path-like
        The authors' sets of each side.
    directory : path-like
        Where to write; created if it is missing.
    overwrite : bool
        Replace files of the same names, which may hold somebody's corrected labels.

    Returns
    -------
    list of pathlib.Path
        The written files.

    Raises
    ------
    FileFormatError
        See `read_authors_mat`.
    GpError
        The folder cannot be made or written, or a file is there already.
    """
    specimens = read_authors_mat(path_left, path_right)
    folder = Path(directory)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        raise GpError(f"cannot be made a folder ({error})", file=folder, remedy="Name another.") from None
    files = {
        folder / landmark_file_name(specimen.name, side): (specimen.name, landmarks)
        for specimen in specimens
        for side, landmarks in specimen.sides.items()
    }
    if not overwrite and (there := next((file for file in files if file.exists()), None)):
        remedy = "Name an empty folder, or replace what is there (--replace)."
        raise GpError("already exists", file=there, remedy=remedy)
    with all_or_none():
        for file, (name, landmarks) in files.items():
            source = Path(path_left if landmarks.side is Side.LEFT else path_right).name
            provenance = {code: {"method": "imported", "source": source} for code in landmarks.placed}
            write_markups(file, landmarks, specimen=name, provenance=provenance)
    return list(files)


def _read_sets(path: str | PathLike[str], side: Side) -> list[LandmarkSet]:
    rows = [named_set("authors_mat").index(code) for code in CODES]
    values = _values(read_mat5(path), f"cc_{side.value}", path)
    return [LandmarkSet(values[rows, :, i], side, "cochlea") for i in range(values.shape[2])]


def _values(content: Mapping[str, FloatArray | None], variable: str, file: str | PathLike[str]) -> FloatArray:
    n_rows = len(named_set("authors_mat"))
    if variable not in content:
        raise FileFormatError(
            f"has no variable {variable}; it holds {shown(', '.join(content))}",
            file=file,
            remedy="Give the left side's file first, then the right side's.",
        )
    values = content[variable]
    if values is None or values.ndim != 3 or values.shape[:2] != (n_rows, 3):
        got = "none" if values is None else values.shape
        raise FileFormatError(f"{variable} must be numbers in ({n_rows}, 3, animals), got {got}", file=file)
    if np.isinf(values).any():
        raise FileFormatError(f"{variable} holds infinite values", file=file, remedy="Correct them.")
    return values
