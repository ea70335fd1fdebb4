"""Poses read back from the JSON that `gp_core.CochleaPose.save` writes."""

from __future__ import annotations

import math
from datetime import datetime
from os import PathLike
from typing import Any

import numpy as np

from gp_core.argument_types import checks_arguments
from gp_core.constants import METHODS
from gp_core.disk import parse_json, read_head
from gp_core.errors import FileFormatError, GpError, blaming
from gp_core.extensions import added_names
from gp_core.frames import FRAMES, RigidTransform
from gp_core.io.pose_inputs_json import inputs_from
from gp_core.io.text import shown
from gp_core.io.text_files import read_text
from gp_core.landmarks.features import Side
from gp_core.landmarks.repeats import RepeatedTouches
from gp_core.pose.cochlea_pose import ROUND_WINDOWS, CochleaPose
from gp_core.pose.mixture import Hypothesis
from gp_core.validation import FloatArray

__all__ = ["is_pose_file", "read_pose"]

_VERSION = 1
_AGREE = 1e-6
_HEAD_BYTES = 1000
_REMEDY = "Estimate the pose again."


@checks_arguments
def read_pose(path: str | PathLike[str]) -> CochleaPose:
    """Read a pose that `CochleaPose.save` or ``gp-core estimate --json`` wrote, to the last bit.

    Parameters
    ----------
    path : path-like
        The JSON file.

    Returns
    -------
    CochleaPose
        Equal to the saved one.

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
            "is a damaged pose: numbers or names are missing or misplaced", file=path, remedy=_REMEDY
        ) from None
    return pose


def is_pose_file(path: str | PathLike[str]) -> bool:
    """Whether a file identifies itself as a pose; it may still be damaged.

    Parameters
    ----------
    path : path-like
        Any path.

    Returns
    -------
    bool
        False for folders, and for files that do not exist or cannot be read.
    """
    return b'"gpPose"' in read_head(path, _HEAD_BYTES)


def _load(path: str | PathLike[str]) -> dict[str, Any]:
    try:
        with blaming(path):
            content = parse_json(read_text(path))
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
    if frame not in FRAMES or content["method"] not in (*METHODS, *added_names("gp_labeler.estimators")):
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
        repeats={_text(name): _repeated(one) for name, one in content.get("repeated_touches", {}).items()},
        of_both_ears=content.get("axis_of_both_ears", False) is True,
        other_ear=_ears(content.get("other_ear", {})),
        stamp=_stamp(content.get("stamp", "")),
        inputs=None if content.get("inputs") is None else inputs_from(content["inputs"]),
    )


def _ears(content: dict[str, Any]) -> dict[str, Any]:
    """Return what was found of the other ear; files of earlier versions have no text."""
    if not content:
        return {}
    if not isinstance(content["agrees"], bool):
        raise GpError(f"expected true or false, got {shown(content['agrees'])}")
    word = "agree" if content["agrees"] else "disagree"
    return {**content, "text": _text(content.get("text", f"the two ears {word}"))}


def _repeated(content: dict[str, Any]) -> RepeatedTouches:
    used = content["used"]
    points = _numbers(content, "points", (len(used), 3))
    return RepeatedTouches(
        points, np.array(used, dtype=bool), _numbers(content, "mean", (3,)), _number(content["spread_mm"])
    )


def _stamp(value: Any) -> str:
    text = _text(value)
    if text and datetime.fromisoformat(text).tzinfo is None:
        raise GpError("its stamp has no time zone")
    return text


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
        raise GpError("its covariance is not valid")
    return covariance


def _probability(value: Any) -> float:
    number = _number(value)
    if not 0 <= number <= 1:
        raise GpError(f"expected a probability, got {shown(value)}")
    return number


def _numbers(content: dict[str, Any], key: str, shape: tuple[int, ...]) -> FloatArray:
    values = np.array(content[key], dtype=np.float64)
    if values.shape != shape or not np.isfinite(values).all():
        raise GpError(f"its {key} must be finite numbers in {shape}, got {shown(content[key])}")
    return values


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise GpError(f"expected a number, got {shown(value)}")
    return float(value)


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise GpError(f"expected a name, got {shown(value)}")
    return value


def _texts(value: Any) -> tuple[str, ...]:
    if not isinstance(value, list):
        raise GpError(f"expected a list, got {shown(value)}")
    return tuple(_text(text) for text in value)


def _pair(value: Any) -> tuple[str, str] | None:
    if value is None:
        return None
    names = _texts(value)
    if len(names) != 2:
        raise GpError(f"expected two names, got {shown(value)}")
    return names[0], names[1]
