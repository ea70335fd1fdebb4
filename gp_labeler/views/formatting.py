"""Numbers as people read them: lengths, angles, positions, sizes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from gp_core.landmarks.suggestion import Suggestion

__all__ = [
    "NONE",
    "TIMES",
    "bytes_text",
    "capitalised",
    "degrees_text",
    "mm_text",
    "number_text",
    "position_text",
    "sentence",
    "size_text",
    "spacing_text",
    "suggestion_text",
    "value_text",
]

NONE = "\N{EN DASH}"
TIMES = " \N{MULTIPLICATION SIGN} "
_MINUS = "\N{MINUS SIGN}"
_AXES = (("L", "R"), ("P", "A"), ("S", "I"))


def capitalised(text: str) -> str:
    """Return a sentence with a capital letter, unless a file or a name begins it."""
    first = text.partition(" ")[0]
    return text[:1].upper() + text[1:] if first.isalpha() and first.islower() else text


def sentence(text: str) -> str:
    """Return a clause with a capital letter and a full stop."""
    return text[:1].upper() + text[1:].rstrip(".") + "."


def number_text(value: float, digits: int, *, signed: bool = False) -> str:
    """Return a number with a true minus sign, `signed` with a plus sign too; a zero has neither."""
    shown = round(float(value), digits) + 0.0
    return f"{shown:{'+' if signed and shown else ''}.{digits}f}".replace("-", _MINUS)


def mm_text(length: float) -> str:
    """Return a length such as ``2.6 mm``; finer below a tenth of a millimetre."""
    if not math.isfinite(length):
        return NONE
    digits = 1 if abs(length) >= 0.995 else 2 if abs(length) >= 0.0995 else 3
    return f"{number_text(length, digits)} mm"


def suggestion_text(suggestion: Suggestion) -> str:
    """Return what a suggestion says of itself, such as ``atlas, 95 % within 0.86 mm``; empty for nothing."""
    radius, away = suggestion.radius_95, suggestion.atlas_distance
    within = "" if radius is None else f"95 % within {mm_text(radius)}"
    atlas = "" if away is None else f"the atlas expects it {mm_text(away)} away"
    return ", ".join(filter(None, (suggestion.source, within, atlas)))


def degrees_text(angle_rad: float) -> str:
    """Return an angle in radians such as ``4.3°``."""
    return f"{number_text(math.degrees(angle_rad), 1)}°" if math.isfinite(angle_rad) else NONE


def position_text(position: Iterable[float]) -> str:
    """Return a position in the scan frame (LPS, mm) such as ``L 4.6  P 9.1  S 12.4 mm``."""
    parts = []
    for value, (plus, minus) in zip(position, _AXES, strict=True):
        if not math.isfinite(value):
            return NONE
        shown = round(float(value), 1)
        parts.append(f"{plus if shown >= 0 else minus} {abs(shown):.1f}")
    return "  ".join(parts) + " mm"


def value_text(value: float | None) -> str:
    """Return a grey value with as many digits as it has a meaning for."""
    return NONE if value is None or not math.isfinite(value) else f"{value:.5g}".replace("-", _MINUS)


def bytes_text(n_bytes: int) -> str:
    """Return a size in memory or on disk such as ``62 kB`` or ``1.2 GB``."""
    for unit, size in (("GB", 2**30), ("MB", 2**20)):
        if n_bytes >= size:
            return f"{n_bytes / size:.3g} {unit}"
    return f"{n_bytes / 2**10:.0f} kB"


def size_text(size: Sequence[int]) -> str:
    """Return voxels along x, y, z such as ``512 x 512 x 600``, with true multiplication signs."""
    return TIMES.join(str(n) for n in size)


def spacing_text(spacing: Sequence[float]) -> str:
    """Return a voxel size such as ``0.035 mm``, or all three numbers where they differ."""
    texts = [f"{length:.4g}" for length in spacing]
    return f"{texts[0] if len(set(texts)) == 1 else TIMES.join(texts)} mm"
