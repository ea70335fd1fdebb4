"""How far an estimated pose can be trusted, in one word."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gp_core.argument_types import checks_arguments
from gp_core.pose.cochlea_pose import CochleaPose

__all__ = ["PoseQuality", "pose_quality"]

_GOOD_MM, _GOOD_DEG = 0.75, 14.0
"""What six careful touches of an ordinary animal achieve, with some margin."""

_POOR_MM, _POOR_DEG = 1.5, 25.0
"""Beyond this, an opening drilled for the round window may well miss it."""


@dataclass(frozen=True)
class PoseQuality:
    """A rating of an estimate, before anybody has reviewed it.

    Attributes
    ----------
    level : str
        ``good``, ``warning`` or ``danger``.
    word : str
        For a label, such as ``Good``.
    reason : str
        A sentence.
    """

    level: str
    word: str
    reason: str


@checks_arguments
def pose_quality(pose: CochleaPose) -> PoseQuality:
    """Rate a pose by its side and names, its 95 % region and its warnings.

    Parameters
    ----------
    pose : CochleaPose
        An estimate.

    Returns
    -------
    PoseQuality
        Level, label and reason.

    Examples
    --------
    >>> from gp_core import Atlas, estimate_pose
    >>> atlas = Atlas.published()
    >>> touched = {code: atlas[code] for code in ("CL", "IN", "LLI", "MN", "OS", "RWA", "RWP")}
    >>> pose_quality(estimate_pose(touched, "L", atlas)).word
    'Good'
    """
    if (found := _ambiguity(pose)) is not None:
        return found
    radius, cone = pose.radius_95, float(np.degrees(pose.cone_95))
    if radius > _POOR_MM or cone > _POOR_DEG:
        return PoseQuality("danger", "Poor", "The true cochlea may be far from this estimate.")
    if pose.warnings or pose.suspects:
        return PoseQuality(
            "warning", "Check first", "Use this pose only if none of the warnings below applies."
        )
    if radius > _GOOD_MM or cone > _GOOD_DEG:
        return PoseQuality(
            "warning", "Fair", "Less certain than with six careful touches; touch more features."
        )
    return PoseQuality("good", "Good", "The touches agree, and there are enough of them.")


def _ambiguity(pose: CochleaPose) -> PoseQuality | None:
    """Return the rating of touches of the other side, wrongly named, or contradicted by the other ear."""
    if pose.side_state == "wrong":
        return PoseQuality("danger", "Check the side", "The touches look like those of the other ear.")
    if pose.names_state == "wrong":
        return PoseQuality("danger", "Check the names", "The names of two touches look exchanged.")
    if pose.names_state == "undecided":
        return PoseQuality("danger", "Names undecided", "The names of two touches may be exchanged.")
    if pose.side_state == "undecided":
        return PoseQuality(
            "warning",
            "Side undecided",
            "The touches may be those of the other ear; touch one more feature.",
        )
    if pose.ears_disagree:
        return PoseQuality(
            "warning", "Ears disagree", "This estimate and that of the other ear contradict each other."
        )
    return None
