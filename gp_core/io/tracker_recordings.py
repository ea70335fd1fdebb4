"""Recorded poses of tracked markers: sequence files of PLUS and 3D Slicer, and tables.

A sequence file is an image file (``.mha``, ``.mhd``, ``.nrrd``) whose header carries a pose for each frame,
such as ``Seq_Frame0007_StylusToTrackerTransform``. Only its header is read.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gp_core.disk import read_head
from gp_core.errors import FileFormatError, GpError
from gp_core.io.table import read_rows
from gp_core.io.text import DECIMAL_POINTS, has_decimal_comma, shown
from gp_core.validation import FloatArray, near_matches

__all__ = ["Recording", "is_sequence", "read_marker_poses", "read_recording"]

_MAX_ROWS = 200_000  # an hour at 60 Hz
_MAX_HEADER_BYTES = 200_000_000
_MAX_FRAMES = 200_000
_PROBE = re.compile(r"stylus|probe|pointer", re.IGNORECASE)
_FIELD = re.compile(
    rb"^Seq_Frame(?P<frame>\d+)_(?P<field>\w+?)\s*:?=\s*(?P<value>[^\r\n]*?)\s*$", re.MULTILINE
)
_POSE, _STATUS, _TIME = "Transform", "TransformStatus", "Timestamp"

_NOT_SEEN = ("", "na", "nan", "null", "missing")
_COLUMNS = {16: 0, 17: 1, 12: 0, 13: 1}
"""Numbers in a row with a whole pose, and how many of them precede it as a time stamp."""

_QUATERNION = (("qw", "qx", "qy", "qz"), ("q0", "qx", "qy", "qz"), ("w", "i", "j", "k"))
_TRANSLATION = (("tx", "ty", "tz"), ("x", "y", "z"), ("px", "py", "pz"))
_EULER = ("rz", "ry", "rx")
"""Columns of a table with a header; angles as NDI's ToolBox writes them: degrees, about z, then y, then x."""

_PREFIXES = {
    **dict.fromkeys(("q", "quat", "quaternion", "rot", "rotation", "orientation"), "q"),
    **dict.fromkeys(("t", "trans", "translation"), "t"),
    **dict.fromkeys(("p", "pos", "position"), "p"),
}
_LONG_NAME = re.compile(rf"(?P<what>{'|'.join(_PREFIXES)})[ _.\-]?(?P<axis>[wxyz])")
_TIMES = ("t", "time", "timestamp", "seconds", "frame")
_STATES = ("state", "status", "valid")
_SEEN_STATES = ("ok", "true", "valid", "enabled")
_FORM = "Export the marker's 4x4 matrices row by row, or quaternions under a header (qw,qx,qy,qz,tx,ty,tz)."


@dataclass(frozen=True, eq=False)
class Recording:
    """Poses of one marker over time.

    Attributes
    ----------
    poses : (N, 4, 4) array
        ``T_tracker_marker``, mm; NaN where the marker was not seen.
    times : (N,) array or None
        Seconds; None where the file holds no time stamps.
    transform : str
        Name of the transform in the file, such as ``StylusToTracker``; empty for a table.
    """

    poses: FloatArray
    times: FloatArray | None = None
    transform: str = ""


def is_sequence(path: str | PathLike[str]) -> bool:
    """Return whether a file's header contains poses of frames.

    Parameters
    ----------
    path : path-like
        Any file.

    Returns
    -------
    bool
        False for other files.
    """
    return _FIELD.search(_head(path, 100_000)) is not None


def _head(path: str | PathLike[str], n_bytes: int) -> bytes:
    """Return the first bytes of a file, unpacked where it is gzipped as a whole."""
    head = read_head(Path(path), n_bytes)
    if not head.startswith(b"\x1f\x8b"):
        return head
    try:
        return zlib.decompressobj(zlib.MAX_WBITS | 16).decompress(head, n_bytes)
    except zlib.error:
        return b""


def read_recording(
    path: str | PathLike[str], *, transform: str | None = None, reference: str | None = None
) -> Recording:
    """Read the recorded poses of a marker.

    Parameters
    ----------
    path : path-like
        A sequence file of PLUS or 3D Slicer (``.igs.mha``, ``.mha``, ``.nrrd``, or its text header alone), or
        a table: see `read_marker_poses`. A sequence file may be gzipped as a whole.
    transform : str, optional
        Name of the transform in a sequence, such as ``StylusToTracker``; required where the sequence has
        several and not exactly one of them is a stylus, probe or pointer.
    reference : str, optional
        Name of the transform of a reference marker, such as ``ReferenceToTracker``: the poses are then in its
        frame.

    Returns
    -------
    Recording
        ``T_tracker_marker`` over time, mm.

    Raises
    ------
    FileFormatError
        Not such a file.
    GpError
        The sequence has no transform of that name, or several and none was named.
    """
    if not is_sequence(path):
        if transform or reference:
            remedy = "Leave --transform and --reference out."
            raise GpError("holds no named transforms", file=path, remedy=remedy)
        return Recording(read_marker_poses(path))
    frames = _read_frames(path)
    names = sorted({name for frame in frames for name in frame.poses})
    if not names:
        raise FileFormatError("its frames hold no transforms", file=path, remedy="Record the stylus with it.")
    chosen = _chosen(names, transform, reference, path)
    poses = _to_tracker(frames, chosen)
    if reference is not None:
        known = _chosen(names, reference, None, path)
        poses = _in_reference(_to_tracker(frames, known), poses)
    times = np.array([frame.time for frame in frames])
    return Recording(poses, times if np.isfinite(times).all() else None, chosen)


@dataclass
class _Frame:
    """The fields of one frame: poses by name, which of them are valid, and the time."""

    poses: dict[str, FloatArray]
    invalid: set[str]
    time: float = np.nan

    def pose(self, name: str) -> FloatArray:
        if name in self.invalid or name not in self.poses:
            return np.full((4, 4), np.nan)
        return self.poses[name]


def _read_frames(path: str | PathLike[str]) -> list[_Frame]:
    frames: dict[int, _Frame] = {}
    for number, field, value in _fields(path):
        frame = frames.setdefault(number, _Frame({}, set()))
        if len(frames) > _MAX_FRAMES:
            raise FileFormatError(f"holds more than {_MAX_FRAMES} frames", file=path, remedy="Cut it.")
        if field.endswith(_STATUS):
            if value.strip().upper() != "OK":
                frame.invalid.add(field.removesuffix(_STATUS))
        elif field.endswith(_POSE):
            frame.poses[field.removesuffix(_POSE)] = _matrix(value, number, field, path)
        elif field == _TIME:
            frame.time = _seconds(value)
    return [frames[number] for number in sorted(frames)]


def _fields(path: str | PathLike[str]) -> Iterator[tuple[int, str, str]]:
    head = _head(path, _MAX_HEADER_BYTES)
    ends = [end for mark in (b"ElementDataFile", b"\n\n", b"\r\n\r\n") if (end := head.find(mark)) >= 0]
    head = head[: min(ends, default=len(head))]  # the images that follow are not needed
    for match in _FIELD.finditer(head):
        yield int(match["frame"]), match["field"].decode(), match["value"].decode("utf-8", "replace")


def _matrix(text: str, number: int, field: str, file: str | PathLike[str]) -> FloatArray:
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError:
        values = np.empty(0)
    if values.shape != (16,):
        raise FileFormatError(
            f"{field} of frame {number} must be 16 numbers, got {shown(text)}",
            file=file,
            remedy="Record the sequence again.",
        )
    matrix: FloatArray = values.reshape(4, 4)
    return matrix


def _seconds(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return np.nan


def _chosen(names: list[str], wanted: str | None, reference: str | None, file: str | PathLike[str]) -> str:
    remedy = f"Choose one with --transform: {', '.join(names[:8])}."
    if wanted is not None:
        name = wanted.removesuffix(_POSE)
        if name not in names:
            problem = f"holds no transform {shown(wanted)}{near_matches(name, names)}"
            raise GpError(problem, file=file, remedy=remedy)
        return name
    others = [name for name in names if name != (reference or "").removesuffix(_POSE)]
    likely = others if len(others) == 1 else [name for name in others if _PROBE.search(name)]
    if len(likely) != 1:
        raise GpError("holds several transforms", file=file, remedy=remedy)
    return likely[0]


def _to_tracker(frames: list[_Frame], name: str) -> FloatArray:
    """Return ``T_tracker_marker`` in every frame; one whose name says the opposite is inverted."""
    poses = np.array([frame.pose(name) for frame in frames])
    if not _is_opposite(name):
        return poses
    every = np.tile(np.eye(4), (len(poses), 1, 1))
    return _in_reference(poses, every)


def _is_opposite(name: str) -> bool:
    """Whether a name such as ``TrackerToStylus`` leads to the probe, and not from it."""
    source, _, target = name.partition("To")
    return source == "Tracker" or (not _PROBE.search(source) and _PROBE.search(target) is not None)


def _in_reference(T_tracker_reference: FloatArray, T_tracker_marker: FloatArray) -> FloatArray:
    """Return ``T_reference_marker``, NaN where one of the two was not seen."""
    both = np.concatenate([T_tracker_reference, T_tracker_marker], axis=1)
    seen: NDArray[np.bool_] = np.asarray(np.isfinite(both).all(axis=(1, 2)))
    seen &= np.abs(np.linalg.det(np.where(seen[:, None, None], T_tracker_reference, np.eye(4)))) > 1e-6
    poses = np.full_like(T_tracker_marker, np.nan)
    poses[seen] = np.linalg.inv(T_tracker_reference[seen]) @ T_tracker_marker[seen]
    return poses


def read_marker_poses(path: str | PathLike[str]) -> FloatArray:
    """Read the poses of a marker from a table of numbers, with or without a header.

    A row is a whole pose: the 16 numbers of its 4x4 matrix row by row (or column by column, which is
    detected), or the first 12, after a time stamp or not; alternatively four rows of four make a pose. With a
    header, quaternions (``qw,qx,qy,qz`` or ``Q0,Qx,Qy,Qz``, with ``tx,ty,tz``) and NDI's angles
    (``Rz,Ry,Rx``, degrees) are found by the names of the columns, and a column ``State`` tells where the
    marker was visible. Empty cells, NA and NaN mean that it was not.

    Parameters
    ----------
    path : path-like
        The file.

    Returns
    -------
    (N, 4, 4) array
        ``T_tracker_marker``, mm; NaN where the marker was not visible.

    Raises
    ------
    FileFormatError
        Not such a table.
    """
    rows = read_rows(path, aligned=True, at_most=_MAX_ROWS)
    names = [_column_name(field) for field in rows[0][1]] if rows else []
    if len(rows) > 1 and len(rows[1][1]) == len(names) + 1 and rows[1][1][-1]:
        names = ["", *names]  # R's row names, whose column has no name
    found = _named_columns(names)
    if found is None:
        return _matrices(rows, path)
    _check_one_tool(names, found, path)
    return _poses_by_name(rows[1:], found, path)


def _column_name(field: str) -> str:
    """Return the name of a column in the form of `_QUATERNION`: ``Quat_X`` is qx, ``Pos.x [mm]`` is px."""
    name = re.sub(r"\s*[\[(]\s*mm\s*[\])]$", "", field.lower())
    found = _LONG_NAME.fullmatch(name)
    return f"{_PREFIXES[found['what']]}{found['axis']}" if found else name


@dataclass(frozen=True)
class _PoseColumns:
    """The columns of the poses in a table with a header."""

    rotation: tuple[int, ...]
    translation: tuple[int, ...]
    state: int | None


def _named_columns(names: list[str]) -> _PoseColumns | None:
    """Return where the columns of a pose are by the header; None where it names none."""

    def first(choices: tuple[tuple[str, ...], ...]) -> tuple[int, ...] | None:
        wanted = next((choice for choice in choices if set(choice) <= set(names)), None)
        return None if wanted is None else tuple(names.index(name) for name in wanted)

    rotation, translation = first((*_QUATERNION, _EULER)), first(_TRANSLATION)
    if rotation is None or translation is None:
        return None
    state = next((names.index(name) for name in _STATES if name in names), None)
    return _PoseColumns(rotation, translation, state)


def _check_one_tool(names: list[str], columns: _PoseColumns, file: str | PathLike[str]) -> None:
    """Raise `FileFormatError` where columns of a pose are there twice, as NDI writes those of two tools."""
    twice = [names[i] for i in (*columns.rotation, *columns.translation) if names.count(names[i]) > 1]
    if twice:
        raise FileFormatError(
            f"holds poses of several tools: its columns {' '.join(twice)} are there {names.count(twice[0])} "
            "times",
            file=file,
            remedy="Keep the columns of the probe's marker, and delete the others.",
        )


def _check_degrees(angles: FloatArray, file: str | PathLike[str]) -> None:
    """Raise `FileFormatError` where all angles, (N, 3), may be radians, as of a rotation vector."""
    if len(angles) > 0 and 0 < np.abs(angles).max() <= np.pi:
        raise FileFormatError(
            "all of its angles lie within 3.15: they seem to be radians, and must be degrees",
            file=file,
            remedy="Export degrees (Rz,Ry,Rx), or quaternions (qw,qx,qy,qz).",
        )


def _poses_by_name(
    rows: list[tuple[int, list[str]]], columns: _PoseColumns, file: str | PathLike[str]
) -> FloatArray:
    poses = np.full((len(rows), 4, 4), np.nan)
    turns = []
    for pose, (number, fields) in zip(poses, rows, strict=True):
        if columns.state is not None and not _is_seen(_field(fields, columns.state)):
            continue
        turn = np.array([_value(_field(fields, i), number, file) for i in columns.rotation])
        place = [_value(_field(fields, i), number, file) for i in columns.translation]
        if np.isfinite(turn).all() and np.isfinite(place).all() and turn.any() | (len(turn) == 3):
            pose[:] = np.eye(4)
            pose[:3, :3], pose[:3, 3] = _rotation(turn), place
            turns.append(turn)
    if len(columns.rotation) == 3:
        _check_degrees(np.array(turns), file)
    return poses


def _is_seen(state: str) -> bool:
    try:
        return float(state) == 1
    except ValueError:
        return state.lower() in _SEEN_STATES


def _rotation(numbers: FloatArray) -> FloatArray:
    """Return the rotation of a quaternion (w first) or of three angles about z, y, x, degrees."""
    if len(numbers) == 3:
        from scipy.spatial.transform import Rotation  # takes long to import: only where it is needed

        turned: FloatArray = Rotation.from_euler("ZYX", numbers, degrees=True).as_matrix()
        return turned
    w, x, y, z = numbers
    from scipy.spatial.transform import Rotation  # as above

    rotation: FloatArray = Rotation.from_quat([x, y, z, w]).as_matrix()
    return rotation


def _field(fields: list[str], i: int) -> str:
    return fields[i] if i < len(fields) else ""


def _value(field: str, number: int, file: str | PathLike[str]) -> float:
    if field.lower() in _NOT_SEEN:
        return np.nan
    try:
        return float(field)
    except ValueError:
        raise FileFormatError(
            f"line {number} must hold numbers only, got {shown(field)}",
            file=file,
            remedy=DECIMAL_POINTS if has_decimal_comma(field) else _FORM,
        ) from None


def _matrices(rows: list[tuple[int, list[str]]], file: str | PathLike[str]) -> FloatArray:
    """Return the matrices of a table without names of columns."""
    numbers = _numbers(rows, file)
    width = len(numbers[0]) if numbers else 0
    even = all(len(row) == width for row in numbers)
    if not even or width not in (*_COLUMNS, 4) or (width == 4 and len(numbers) % 4):
        raise FileFormatError(
            f"must hold a pose in every row, as 16 or 12 numbers, or 4 numbers in every four rows; got "
            f"{len(numbers)} rows of {width or 'no'} columns{'' if even else ' and others'}",
            file=file,
            remedy=_FORM,
        )
    values = np.array(numbers)
    n_rows = 4 if width == 4 else (width - _COLUMNS[width]) // 4
    values = values[:, _COLUMNS.get(width, 0) :].reshape(-1, n_rows, 4)
    poses = np.tile(np.eye(4), (len(values), 1, 1))
    poses[:, :n_rows] = values
    return poses.transpose(0, 2, 1) if _by_columns(poses) else poses


def _by_columns(poses: FloatArray) -> bool:
    """Whether matrices were written column by column: the translation is then in the last row."""
    seen = poses[np.isfinite(poses).all(axis=(1, 2))]
    return len(seen) > 0 and not seen[:, :3, 3].any() and bool(seen[:, 3, :3].any())


def _numbers(rows: list[tuple[int, list[str]]], file: str | PathLike[str]) -> list[list[float]]:
    found = []
    for i, (number, fields) in enumerate(rows):
        bare = [field.strip("[](){}") for field in fields]
        try:
            found.append([_value(field, number, file) for field in bare])
        except FileFormatError:
            if i > 0:
                raise
    return found
