"""Labels of points as they are kept, and when two of them name one point."""

from __future__ import annotations

import re

from gp_core.landmarks.features import CODES

__all__ = ["is_skull_feature", "same_label", "tidy_label"]

_SKULL_FEATURE = re.compile(r"S[0-9]{1,2}", re.IGNORECASE)


def is_skull_feature(label: str) -> bool:
    """Whether a label names one of the skull's registration features, ``S1``, ``S2``, ..."""
    return _SKULL_FEATURE.fullmatch(label) is not None


def tidy_label(label: str) -> str:
    """Return a label as it is kept: features and skull features in capitals, blanks tidied."""
    text = " ".join(label.split())
    return text.upper() if text.upper() in CODES or is_skull_feature(text) else text


def same_label(one: str, other: str) -> bool:
    """Whether two labels name one point, as ``Bolt`` and ``bolt`` do."""
    return tidy_label(one).casefold() == tidy_label(other).casefold()
