"""A scan position as people type it."""

from __future__ import annotations

import re

import numpy as np

from gp_core.errors import GpError
from gp_core.validation import FloatArray

__all__ = ["typed_position"]

_AXES = {"R": (0, -1.0), "L": (0, 1.0), "A": (1, -1.0), "P": (1, 1.0), "I": (2, -1.0), "S": (2, 1.0)}
_LETTERED = re.compile(r"([A-Z])\s*([-+]?\d+(?:[.,]\d+)?)\s*(?:MM)?[\s,;]*")
_EXAMPLES = "For example L 4.6 P 9.1 S 12.4, or three numbers towards left, posterior and superior."


def typed_position(text: str) -> FloatArray:
    """Return the (3,) scan position that a text says, mm, LPS.

    Parameters
    ----------
    text : str
        ``L 4.6 P 9.1 S 12.4`` in any order, with R, A or I for the other directions; or three numbers
        towards left, posterior and superior, between blanks, commas or semicolons. A decimal comma is
        understood where numbers stand between blanks or behind letters.

    Raises
    ------
    GpError
        It is not a position.
    """
    words = text.strip().upper()
    values = _by_letters(words) if re.search(r"[A-LN-Z]", words) else _by_order(words)
    if values is None or not np.isfinite(values).all():
        raise GpError(f"{text.strip()!r:.60} is not a position", remedy=_EXAMPLES)
    return values


def _by_letters(words: str) -> FloatArray | None:
    found = _LETTERED.findall(words)
    if _LETTERED.sub("", words).strip() or any(letter not in _AXES for letter, _ in found):
        return None
    values = np.full(3, np.nan)
    for letter, number in found:
        axis, sign = _AXES[letter]
        if not np.isnan(values[axis]):
            return None
        values[axis] = sign * float(number.replace(",", "."))
    return values


def _by_order(words: str) -> FloatArray | None:
    words = words.removesuffix("MM").strip("()[] \t")
    parts = re.split(r"[\s;]+", words)
    if len(parts) == 1:
        parts = words.split(",")
    numbers = [part.rstrip(",").replace(",", ".") for part in parts]
    try:
        return np.array([float(number) for number in numbers]) if len(numbers) == 3 else None
    except ValueError:
        return None
