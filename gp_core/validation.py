"""Small validators; each names the argument, the given value and the allowed ones."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields
from difflib import get_close_matches
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gp_core.errors import GpError

__all__ = ["FloatArray", "as_points", "as_vectors", "check_option", "freeze_arrays", "near_matches"]

FloatArray = NDArray[np.float64]


def as_points(value: ArrayLike, name: str, *, missing_allowed: bool = False) -> FloatArray:
    """Return `value` as an (N, 3) float64 array.

    Parameters
    ----------
    value : (N, 3) array_like
        Points, mm.
    name : str
        What the message calls them.
    missing_allowed : bool
        Whether rows of NaN may mark missing points. Infinite values are never allowed.

    Returns
    -------
    (N, 3) array
        Points, mm.

    Raises
    ------
    GpError
        Not numbers, not of shape (N, 3), or not finite.
    """
    try:
        points = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise GpError(f"{name} must be numbers in (N, 3), got {type(value).__name__}") from None
    if points.ndim != 2 or points.shape[1] != 3:
        raise GpError(f"{name} must have the shape (N, 3), got {points.shape}")
    bad = np.isinf(points) if missing_allowed else ~np.isfinite(points)
    if bad.any():
        row = int(np.flatnonzero(bad.any(axis=1))[0])
        raise GpError(f"{name} must be finite, got {points[row].tolist()} in row {row}")
    return points


def as_vectors(value: ArrayLike, name: str) -> FloatArray:
    """Return `value` as a (..., 3) float64 array; NaN, for what is missing, stays.

    Parameters
    ----------
    value : (..., 3) array_like
        Vectors.
    name : str
        What the message calls them.

    Returns
    -------
    (..., 3) array
        Vectors.

    Raises
    ------
    GpError
        Not numbers, or not three in the last dimension.
    """
    try:
        vectors = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise GpError(f"{name} must be numbers in (..., 3), got {type(value).__name__}") from None
    if vectors.ndim < 1 or vectors.shape[-1] != 3:
        raise GpError(f"{name} must have the shape (..., 3), got {vectors.shape}")
    return vectors


def freeze_arrays(instance: Any) -> None:
    """Give a frozen dataclass arrays of its own that cannot be written to; call it in ``__post_init__``.

    Parameters
    ----------
    instance : dataclass
        Its fields that are arrays, and those that are a dict of arrays.
    """
    for one in fields(instance):
        value = getattr(instance, one.name)
        if isinstance(value, np.ndarray):
            object.__setattr__(instance, one.name, _own(value))
        elif isinstance(value, dict) and any(isinstance(each, np.ndarray) for each in value.values()):
            object.__setattr__(instance, one.name, {key: _own(each) for key, each in value.items()})


def _own(value: Any) -> Any:
    if not isinstance(value, np.ndarray):
        return value
    own = value.copy()
    own.setflags(write=False)
    return own


def check_option(value: Any, name: str, allowed: Iterable[Any]) -> None:
    """Raise an error unless a value is one of the allowed ones.

    Parameters
    ----------
    value : object
        The given value.
    name : str
        What the message calls it.
    allowed : iterable
        The allowed values.

    Raises
    ------
    GpError
        It is none of them; the message suggests similar values.
    """
    options = list(allowed)
    if not isinstance(value, str | int | float) or value not in options:
        shown = ", ".join(str(o) for o in options)
        raise GpError(f"{name} must be one of {shown}, got {value!r}{near_matches(str(value), options)}")


def near_matches(text: str, allowed: Iterable[Any]) -> str:
    """Return a suggestion of similar words for a message.

    Parameters
    ----------
    text : str
        The given word.
    allowed : iterable
        The allowed words.

    Returns
    -------
    str
        ``" (did you mean A or B?)"``, or an empty string where nothing is similar.
    """
    near = get_close_matches(text.upper(), [str(a).upper() for a in allowed], n=3, cutoff=0.5)
    return f" (did you mean {' or '.join(near)}?)" if near else ""
