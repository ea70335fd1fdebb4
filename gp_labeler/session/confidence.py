"""How far an estimated pose can be trusted, in one plain word."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gp_core.atlas.pose import CochleaPose

__all__ = ["Confidence", "confidence", "is_other_side"]

_GOOD_MM, _GOOD_DEG = 0.75, 14.0
"""What six careful touches of an ordinary animal give, with some room."""

_POOR_MM, _POOR_DEG = 1.5, 25.0
"""Beyond this, an opening drilled for the round window may well miss it."""

_WRONG_SIDE = "check the side"
"""End of a warning that says that the pose itself is wrong, not only less sure."""


@dataclass(frozen=True)
class Confidence:
    """A verdict on an estimate, before anybody looked at it.

    Parameters
    ----------
    level : str
        ``good``, ``warning`` or ``danger``.
    word : str
        For a chip, such as ``Good``.
    reason : str
        A sentence.
    """

    level: str
    word: str
    reason: str


def is_other_side(pose: CochleaPose) -> bool:
    """Return whether the touches are clearly those of the other side."""
    return any(warning.endswith(_WRONG_SIDE) for warning in pose.warnings)


def confidence(pose: CochleaPose) -> Confidence:
    """Return how far a pose can be trusted, from its 95 % region and its warnings."""
    radius, cone = pose.radius_95, float(np.degrees(pose.cone_95))
    if is_other_side(pose):
        return Confidence("danger", "Check the side", "The touches look like those of the other ear.")
    if pose.swapped is not None:
        return Confidence("danger", "Check the names", "Two touches look as if each had the other's name.")
    if radius > _POOR_MM or cone > _POOR_DEG:
        return Confidence("danger", "Poor", "The true cochlea may lie well beside this one.")
    if pose.warnings or pose.suspects:
        return Confidence(
            "warning", "Look twice", "The pose is usable only if what is said below is all right."
        )
    if radius > _GOOD_MM or cone > _GOOD_DEG:
        return Confidence(
            "warning", "Fair", "Less sure than six careful touches make it; touch more features."
        )
    return Confidence("good", "Good", "The touches agree, and are as many as a sure pose needs.")
