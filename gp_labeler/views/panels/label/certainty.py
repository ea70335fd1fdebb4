"""What the degrees of certainty mean, in the words of the card, the menu and the manual."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from gp_core.landmarks.provenance import Certainty

__all__ = ["CERTAINTY_HINTS"]

CERTAINTY_HINTS: Mapping[Certainty, str] = MappingProxyType(
    {
        Certainty.SURE: "The feature is seen clearly, and the point is on it; Alt+1",
        Certainty.FAIR: "The feature is seen, but its place is not sharp; Alt+2",
        Certainty.GUESS: "The place is inferred from what lies around it; Alt+3",
    }
)
