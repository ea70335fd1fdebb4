"""An insertion path, planned in the cochlea frame and moved to an estimated cochlea."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from os import PathLike

import numpy as np
from numpy.typing import ArrayLike

from gp_core.argument_types import checks_arguments
from gp_core.disk import write_text
from gp_core.errors import FileFormatError, GpError
from gp_core.io.table import read_rows
from gp_core.io.text import parse_position, rows_text, shown
from gp_core.landmarks.features import Side
from gp_core.pose.cochlea_pose import CochleaPose
from gp_core.validation import FloatArray, as_points, check_option

__all__ = [
    "UNITS",
    "angle_about",
    "carry_path",
    "check_winding",
    "read_path",
    "rows_before_centre",
    "winding_side",
    "write_path",
]

UNITS = {"m": 1e3, "cm": 10.0, "mm": 1.0, "um": 1e-3}
"""Units that a path may be in, in mm."""

_SMALLEST_MM = 0.5
_NEAREST_MM = 5.0
_FARTHEST_MM = 300.0
_ON_AXIS_MM = 0.05
_CENTRE_MM = 1e-3
_LEAST_WINDING = 4.0
"""Winding angle, rad, from which on a path shows the side of its ear; a straight one gives at most pi."""
_CLEARLY = 1.25

_MIRROR_Z = np.array([1.0, 1.0, -1.0])


@checks_arguments
def read_path(
    path: str | PathLike[str], *, units: str, axes: str = "x,y,z", rows: int | None = None
) -> FloatArray:
    """Read an insertion path from a table of three columns, with or without a header.

    Parameters
    ----------
    path : path-like
        Text with commas, semicolons, tabs or blanks between the columns.
    units : {"m", "cm", "mm", "um"}
        Unit of its numbers. There is no default: a path of the wrong size would be driven into bone.
    axes : str
        Which of the file's axes is the x (modiolar axis, towards the apex), y (towards the round window) and
        z of the cochlea frame, such as ``"z,-y,x"``. Right-handed; mirroring is left to `carry_path`.
    rows : int, optional
        How many rows to read, where rows follow that do not belong to the path.

    Returns
    -------
    (N, 3) array, mm, cochlea frame
        Points of the path.

    Raises
    ------
    FileFormatError
        Not such a table.
    GpError
        In this unit, the numbers are no path in a cochlea (the likely unit is named); the path winds about
        another axis than x; or the axes are invalid.
    """
    check_option(units, "units of the path", UNITS)
    turn = _as_rotation(axes)
    raw = _read_rows(path)
    if rows is not None and not 2 <= rows <= len(raw):
        raise GpError(f"rows of the path must be 2 to {len(raw)}, got {rows}", file=path)
    raw = raw[:rows]
    if len(raw) < 2:
        raise FileFormatError(f"a path needs two rows or more, got {len(raw)}", file=path)
    _check_size(raw, units, path)
    points: FloatArray = UNITS[units] * raw @ turn.T
    _check_axis(points, path)
    return points


@checks_arguments
def carry_path(path: ArrayLike, pose: CochleaPose, *, path_side: Side | str) -> FloatArray:
    """Move a path to the cochlea of a pose.

    The frame of a pose has x along the axis CB->CA and y towards the round window on both sides; so for two
    ears that are mirror images, x and y correspond, and z = x × y is reversed. Hence a path for the other ear
    is mirrored in z.

    Parameters
    ----------
    path : (N, 3) array_like, mm, cochlea frame
        Points of the path.
    pose : CochleaPose
        An estimate.
    path_side : {"L", "R"}
        The ear that the path was planned for; may differ from the side of the pose.

    Returns
    -------
    (N, 3) array, mm, the frame of the touches
        The moved path.

    Raises
    ------
    GpError
        Not points, or the path winds as in an ear of the other side.
    """
    points, side = as_points(path, "path"), Side.parse(path_side)
    check_winding(points, side)
    return pose.transform_to_touches.apply(points if side is pose.side else points * _MIRROR_Z)


def rows_before_centre(path: ArrayLike) -> int | None:
    """Return how many points precede one that is CO itself, where no path can be.

    Parameters
    ----------
    path : (N, 3) array_like, mm, cochlea frame
        Points of the path.

    Returns
    -------
    int or None
        None where no point is CO.
    """
    at_centre = np.flatnonzero(np.linalg.norm(as_points(path, "path"), axis=1) < _CENTRE_MM)
    return int(at_centre[0]) if len(at_centre) and at_centre[0] > 1 else None


def winding_side(path: ArrayLike) -> Side | None:
    """Return the side of the ear whose cochlea winds as a path does.

    On its way to the apex, a left cochlea turns clockwise about x as seen from the apex: from the round
    window (y) away from the vestibule, which lies at +z in the frame of the left ear.

    Parameters
    ----------
    path : (N, 3) array_like, mm, cochlea frame
        From the base to the apex. Points on the axis do not count.

    Returns
    -------
    Side or None
        None where the path hardly winds.
    """
    turn = angle_about(as_points(path, "path"), 0)
    if abs(turn) < _LEAST_WINDING:
        return None
    return Side.LEFT if turn < 0 else Side.RIGHT


def check_winding(path: ArrayLike, side: Side | str) -> None:
    """Raise where a path winds as in an ear of the other side.

    Parameters
    ----------
    path : (N, 3) array_like, mm, cochlea frame
        From the base to the apex.
    side : {"L", "R"}
        The ear that the path is declared to be for.

    Raises
    ------
    GpError
        Not points, or they wind the other way.
    """
    declared = Side.parse(side)
    if winding_side(path) not in (None, declared):
        other = declared.other.word
        raise GpError(
            f"the path is declared as that of a {declared.word} ear, but winds as in a {other} ear",
            remedy="Check its side, which way its axes point, and that it runs from the base to the apex.",
        )


def write_path(path: str | PathLike[str], points: FloatArray) -> None:
    """Write points as comma-separated lines of three plain numbers in mm, with full precision.

    Parameters
    ----------
    path : path-like
        Where to write.
    points : (N, 3) array
        Points, mm.

    Raises
    ------
    GpError
        The file cannot be written.
    """
    write_text(path, rows_text(points))


def _read_rows(path: str | PathLike[str]) -> FloatArray:
    found = []
    for i, (number, fields) in enumerate(read_rows(path, aligned=True)):
        if i == 0 and not any(_is_number(field) for field in fields):
            continue  # a header
        point = parse_position(fields, file=path, landmark=f"row {number}") if len(fields) == 3 else None
        if point is None:
            raise FileFormatError(
                f"line {number} must be three numbers, got {shown(' '.join(fields))}",
                file=path,
                remedy="Write x, y, z in every row, with decimal points.",
            )
        found.append(point)
    return np.reshape(found, (-1, 3))


def _is_number(text: str) -> bool:
    with suppress(ValueError):
        float(text)
        return True
    return False


def _as_rotation(axes: str) -> FloatArray:
    """Return the (3, 3) rotation from a file's axes to those of the cochlea frame."""
    rows = []
    for word in axes.replace(",", " ").split():
        sign, letter = (-1.0, word[1:]) if word.startswith("-") else (1.0, word.removeprefix("+"))
        if letter in ("x", "y", "z"):
            rows.append(sign * np.eye(3)["xyz".index(letter)])
    rotation = np.reshape(rows, (-1, 3))
    if rotation.shape != (3, 3) or round(float(np.linalg.det(rotation))) != 1:
        raise GpError(
            f"axes must name x, y and z once each, right-handed, such as 'z,-y,x', got {axes!r}",
            remedy="Reverse one of them. To mirror a path for the other ear, state its side instead.",
        )
    return rotation


def _check_size(raw: FloatArray, units: str, file: str | PathLike[str]) -> None:
    """Raise `GpError` for a path that does not come near the cochlea, or is tiny in it."""
    if _is_plausible(UNITS[units] * raw):
        return
    likely = [unit for unit, mm in UNITS.items() if _is_plausible(mm * raw)]
    lengths = UNITS[units] * np.linalg.norm(raw, axis=1)
    raise GpError(
        f"in {units} this path would lie {lengths.min():.3g} to {lengths.max():.3g} mm from CO",
        file=file,
        remedy=f"Its numbers look like {' or '.join(likely)}."
        if likely
        else "It must be given in the cochlea frame, with CO as its origin.",
    )


def _is_plausible(points: FloatArray) -> bool:
    lengths = np.linalg.norm(points, axis=1)
    extent = float(np.ptp(points, axis=0).max())
    return bool(extent >= _SMALLEST_MM and lengths.min() <= _NEAREST_MM and lengths.max() <= _FARTHEST_MM)


def _check_axis(points: FloatArray, file: str | PathLike[str]) -> None:
    about_x, *others = (abs(angle_about(points, axis)) for axis in range(3))
    if max(others) > max(_LEAST_WINDING, _CLEARLY * about_x):
        raise GpError(
            "the path winds about another axis than x, the modiolar axis of the cochlea frame",
            file=file,
            remedy="Give its axes, such as 'z,-y,x' if z is the modiolar axis and the round window is at -y.",
        )


def angle_about(points: FloatArray, axis: int) -> float:
    """Return the angle through which a path winds about an axis.

    Parameters
    ----------
    points : (N, 3) array, mm
        Points of the path.
    axis : {0, 1, 2}
        x, y or z.

    Returns
    -------
    float
        Angle, rad, right-handed.
    """
    first, second = points[:, (axis + 1) % 3], points[:, (axis + 2) % 3]
    off_axis = np.hypot(first, second) > _ON_AXIS_MM
    angles = np.arctan2(second[off_axis], first[off_axis])
    steps: Sequence[float] = np.diff(np.unwrap(angles)).tolist() if len(angles) > 1 else [0.0]
    return float(sum(steps))
