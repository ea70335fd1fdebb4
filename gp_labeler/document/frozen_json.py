"""JSON values that cannot be changed, so that a state can hold what other rooms hand it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from gp_core.errors import GpError

__all__ = ["freeze", "thaw"]


def freeze(value: Any, name: str) -> Any:
    """Return `value` with read-only mappings for dicts and tuples for lists and arrays.

    Parameters
    ----------
    value : JSON value, numpy array or numpy scalar
        What to keep.
    name : str
        What the caller calls it; stands in the message.

    Raises
    ------
    GpError
        Something in it has no place in a JSON file: another type, a key that is no text, or a number that is
        not finite.
    """
    if isinstance(value, Mapping):
        for key in value:
            if not isinstance(key, str):
                raise GpError(f"{name} may only have text as keys, got {key!r}")
        return MappingProxyType({key: freeze(item, f"{name}.{key}") for key, item in value.items()})
    if isinstance(value, (list, tuple)):
        return tuple(freeze(item, f"{name}[{i}]") for i, item in enumerate(value))
    if hasattr(value, "tolist"):  # a numpy array or scalar
        return freeze(value.tolist(), name)
    if isinstance(value, float) and not math.isfinite(value):
        raise GpError(f"{name} must be finite, got {value}")
    if value is None or isinstance(value, (str, bool, int, float)):
        return value
    raise GpError(f"{name} must be text, numbers, lists or mappings of these, got {type(value).__name__}")


def thaw(value: Any) -> Any:
    """Return a frozen value as the dicts and lists that `json` writes."""
    if isinstance(value, Mapping):
        return {key: thaw(item) for key, item in value.items()}
    if isinstance(value, tuple):
        return [thaw(item) for item in value]
    return value
