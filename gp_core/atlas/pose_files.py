"""Files of a pose: the project's own JSON read back, and what Slicer and robots read."""

from __future__ import annotations

import json
from os import PathLike
from typing import Any

import numpy as np

from gp_core.atlas.mixture import Hypothesis
from gp_core.atlas.pose import METHODS, ROUND_WINDOWS, CochleaPose
from gp_core.checks import FloatArray
from gp_core.disk import write_text
from gp_core.errors import FileFormatError, GpError
from gp_core.frames import FRAMES, RigidTransform
from gp_core.landmarks.features import Side
from gp_core.landmarks.files import FileHeader, LabelledPoint
from gp_core.landmarks.files.disk import read_text
from gp_core.landmarks.files.markups import write_point_lists
from gp_core.landmarks.files.text import rows_text, shown
from gp_core.landmarks.sets import Status

__all__ = ["AXIS_POINT_MM", "read_pose", "tfm_text", "write_csv", "write_landmarks", "write_tfm"]

AXIS_POINT_MM = 5.0
"""How far from CO, towards the apex, the point ``axis`` lies in a landmark file: about a cochlea's height."""

_VERSION = 1
_AGREE = 1e-6
_REMEDY = "Estimate the pose again."


def read_pose(path: str | PathLike[str]) -> CochleaPose:
    """Read a pose that `CochleaPose.save` or ``gp-core estimate --json`` wrote, to the last bit.

    Raises
    ------
    FileFormatError
        Not such a file, damaged, or of a later version.

    Examples
    --------
    >>> read_pose("pose.json").origin  # doctest: +SKIP
    """
    content = _load(path)
    try:
        pose = _pose(content)
    except KeyError as error:
        raise FileFormatError(f"is a damaged pose: it lacks {error}", file=path, remedy=_REMEDY) from None
    except GpError as error:
        raise FileFormatError(f"is a damaged pose: {error.problem}", file=path, remedy=_REMEDY) from None
    except (TypeError, ValueError, AttributeError, OverflowError):
        raise FileFormatError(
            "is a damaged pose: numbers or names are not where they should be", file=path, remedy=_REMEDY
        ) from None
    return pose


def _load(path: str | PathLike[str]) -> dict[str, Any]:
    try:
        content = json.loads(read_text(path))
    except (ValueError, RecursionError):
        raise FileFormatError("is not JSON: damaged or cut off", file=path, remedy=_REMEDY) from None
    if not isinstance(content, dict) or "gpPose" not in content:
        raise FileFormatError(
            "is not a pose", file=path, remedy="Give what gp-core estimate --json has written."
        )
    if content["gpPose"] != _VERSION:
        raise FileFormatError(
            f"has pose version {shown(content['gpPose'])}, not {_VERSION}",
            file=path,
            remedy="Update gp-labeler.",
        )
    return content


def _pose(content: dict[str, Any]) -> CochleaPose:
    frame = content["frame"]
    if frame not in FRAMES or content["method"] not in METHODS:
        raise GpError(f"unknown frame {shown(frame)} or method {shown(content['method'])}")
    T_touches_cochlea = RigidTransform(_numbers(content, "transform", (4, 4)), frame, "cochlea")
    for key, meant in (
        ("cochlea_origin_mm", T_touches_cochlea.translation),
        ("modiolar_axis", T_touches_cochlea.rotation[:, 0]),
    ):
        if not np.allclose(_numbers(content, key, (3,)), meant, rtol=0, atol=_AGREE):
            raise GpError(f"its {key} is not that of its transform")
    covariance = _covariance(content)
    round_window = content.get("round_window", "expected")
    if round_window not in ROUND_WINDOWS:
        raise GpError(f"unknown round window {shown(round_window)}")
    registered = content.get("registered_atlas")
    return CochleaPose(
        side=Side.parse(content["side"]),
        method=content["method"],
        atlas=_text(content["atlas"]),
        transform_to_touches=T_touches_cochlea,
        covariance=covariance,
        residuals={_text(code): _number(mm) for code, mm in content["residuals_mm"].items()},
        suspects=_texts(content["suspect"]),
        warnings=_texts(content["warnings"]),
        probe_noise=None if content["probe_noise_mm"] is None else _number(content["probe_noise_mm"]),
        T_touches_atlas=None
        if registered is None
        else RigidTransform(_numbers(content, "registered_atlas", (4, 4)), frame, "atlas"),
        round_window=round_window,
        swapped=_pair(content.get("swapped")),
        side_state=_text(content.get("side_state", "unchecked")),
        names_state=_text(content.get("names_state", "unchecked")),
        shared_error=None if content.get("shared_error_mm") is None else _number(content["shared_error_mm"]),
        probability=_probability(content.get("probability", 1.0)),
        hypotheses=tuple(_hypothesis(entry, frame) for entry in content.get("hypotheses", ())),
    )


def _hypothesis(content: dict[str, Any], frame: str) -> Hypothesis:
    return Hypothesis(
        side=Side.parse(content["side"]),
        exchanged=_pair(content["exchanged"]),
        probability=_probability(content["probability"]),
        transform_to_touches=RigidTransform(_numbers(content, "transform", (4, 4)), frame, "cochlea"),
        covariance=_covariance(content),
    )


def _covariance(content: dict[str, Any]) -> FloatArray:
    covariance = _numbers(content, "covariance", (6, 6))
    if not np.array_equal(covariance, covariance.T) or np.linalg.eigvalsh(covariance)[0] < -_AGREE:
        raise GpError("its covariance is none")
    return covariance


def _probability(value: Any) -> float:
    number = _number(value)
    if not 0 <= number <= 1:
        raise GpError(f"{shown(value)} stands for a probability")
    return number


def _numbers(content: dict[str, Any], key: str, shape: tuple[int, ...]) -> FloatArray:
    values = np.array(content[key], dtype=np.float64)
    if values.shape != shape or not np.isfinite(values).all():
        raise GpError(f"its {key} must be finite numbers in {shape}, got {shown(content[key])}")
    return values


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not np.isfinite(value):
        raise GpError(f"{shown(value)} stands for a number")
    return float(value)


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise GpError(f"{shown(value)} stands for a name")
    return value


def _texts(value: Any) -> tuple[str, ...]:
    if not isinstance(value, list):
        raise GpError(f"{shown(value)} stands for a list")
    return tuple(_text(text) for text in value)


def _pair(value: Any) -> tuple[str, str] | None:
    if value is None:
        return None
    names = _texts(value)
    if len(names) != 2:
        raise GpError(f"{shown(value)} stands for two names")
    return names[0], names[1]


def write_csv(path: str | PathLike[str], pose: CochleaPose) -> None:
    """Write ``T_tracker_cochlea`` as four lines of four numbers, commas between them, and nothing else.

    Rows of the matrix as they are written down, mm; it acts on columns: its first column is the modiolar axis
    CB->CA, its last one CO. Numbers keep every bit.

    Raises
    ------
    GpError
        The file cannot be written.
    """
    write_text(path, rows_text(pose.transform))


def write_landmarks(path: str | PathLike[str], pose: CochleaPose) -> None:
    """Write CO and a point of the axis as 3D Slicer markups: a point list, and the line between them.

    The points are ``CO`` and ``axis``, `AXIS_POINT_MM` from it towards the apex. The coordinates are those of
    the touches' frame, which ``gpLabeler`` in the file names; Slicer takes them for LPS. So a pose in a
    tracker's frame shows up over a scan only under the registration of the two.

    Raises
    ------
    GpError
        The file cannot be written.
    """
    end = pose.origin + AXIS_POINT_MM * pose.axis
    points = (
        LabelledPoint("CO", pose.origin, Status.PLACED, f"Cochlea origin, {pose.side.word} side, estimated"),
        LabelledPoint("axis", end, Status.PLACED, f"{AXIS_POINT_MM:g} mm from CO towards the apex"),
    )
    header = FileHeader(side=pose.side, frame=pose.transform_to_touches.dst, extra=("axis",))
    write_point_lists(path, {"Fiducial": points, "Line": points}, header)


def write_tfm(path: str | PathLike[str], pose: CochleaPose) -> None:
    """Write the pose as an ITK transform file that 3D Slicer shows as cochlea to tracker.

    By ITK's convention, which Slicer undoes on reading, the file holds the way back: it maps points of
    the touches' frame into the cochlea frame.

    Raises
    ------
    GpError
        The file cannot be written.
    """
    write_text(path, tfm_text(pose.transform_to_touches))


def tfm_text(T_dst_src: RigidTransform) -> str:
    """Return the text of an ITK transform file that 3D Slicer shows as `T_dst_src`."""
    back = T_dst_src.inverse()
    numbers = " ".join(repr(float(n)) for n in (*back.rotation.ravel(), *back.translation))
    return (
        "#Insight Transform File V1.0\n"
        f"# maps {back.src} points to {back.dst} points (mm); Slicer shows the way back\n"
        "#Transform 0\nTransform: AffineTransform_double_3_3\n"
        f"Parameters: {numbers}\nFixedParameters: 0 0 0\n"
    )
