"""What the degrees of certainty mean, in the words of the card, the menu and the manual."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from gp_core.landmarks.provenance import Certainty

__all__ = ["CERTAINTY_HINTS"]

CERTAINTY_HINTS: Mapping[Certainty, str] = MappingProxyType(
    {
        Certainty.SURE: "The feature is clearly visible, and the point is on it (Alt+1)",
        Certainty.FAIR: "The feature is visible, but its position is not sharp (Alt+2)",
        Certainty.GUESS: "The position is inferred from the surrounding anatomy (Alt+3)",
    }
)
