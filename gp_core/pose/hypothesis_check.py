"""Whether side and names of a pose are clear, undecided or wrong: from the odds of the other readings."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from gp_core.errors import FeatureError
from gp_core.landmarks.features import feature
from gp_core.landmarks.sets import LandmarkSet
from gp_core.pose.cochlea_pose import CochleaPose
from gp_core.pose.mixture import UNDECIDED, Hypothesis

__all__ = ["decide", "read_as", "reading_warnings", "with_names_exchanged"]

_WRONG = 0.5
"""Probability of other readings from which the one given is called wrong."""

_SAME_MM, _SAME_DEG = 0.25, 5.0
"""Up to here an exchange of names changes nothing that matters: the two lie at nearly the same place."""


def decide(pose: CochleaPose, better_exchanged: tuple[str, str] | None) -> dict[str, Any]:
    """Return `side_state`, `names_state` and `swapped` of a pose.

    Parameters
    ----------
    pose : CochleaPose
        With its hypotheses.
    better_exchanged : (str, str) or None
        Two features whose touches fit much better with their names exchanged: that is told however seldom
        names are exchanged, and however little it moves the pose; it makes the names wrong if it moves it.
    """
    others = [h for h in pose.hypotheses if h.exchanged is None]
    exchanges = [h for h in pose.hypotheses if h.exchanged is not None]
    side = _state(sum(h.probability for h in others))
    told = [h for h in exchanges if _matters(pose, h)]
    names = _state(sum(h.probability for h in told))
    if sum(h.probability for h in exchanges) >= _WRONG:
        names, told = "wrong", exchanges
    if names != "wrong" and better_exchanged is not None:
        if any(h.exchanged == better_exchanged for h in told):
            names = "wrong"
        return {"side_state": side, "names_state": names, "swapped": better_exchanged}
    heaviest = max(told, key=lambda h: h.probability, default=None)
    return {
        "side_state": side,
        "names_state": names,
        "swapped": None if names == "clear" or heaviest is None else heaviest.exchanged,
    }


def _state(probability: float) -> str:
    if probability >= _WRONG:
        return "wrong"
    return "undecided" if probability >= UNDECIDED else "clear"


def _matters(pose: CochleaPose, other: Hypothesis) -> bool:
    """Whether an exchange moves the pose: then its names are not a matter of words."""
    mm = float(np.linalg.norm(other.origin - pose.origin))
    degrees = float(np.degrees(np.arccos(np.clip(other.axis @ pose.axis, -1, 1))))
    return mm > _SAME_MM or degrees > _SAME_DEG


def reading_warnings(pose: CochleaPose) -> Iterator[str]:
    """Say so where the touches may be of the other ear, or two of them exchanged."""
    names = " and ".join(pose.swapped or ())
    this, other = pose.side.word, pose.side.other.word
    if pose.names_state == "undecided":
        yield f"{names} may be exchanged: touch both again"
    elif pose.swapped is not None:
        yield f"{names} look exchanged"
    if pose.side_state == "wrong":
        yield f"the {other} side fits these points better than the {this}: check the side"
    elif pose.side_state == "undecided":
        yield (
            f"these points fit the {other} side about as well, so a wrong side would pass: "
            "touch one more feature away from their plane"
        )


def read_as(touches: LandmarkSet, reading: Hypothesis) -> LandmarkSet:
    """Return touches as a hypothesis reads them: of the other ear, or with two names exchanged.

    Examples
    --------
    >>> from gp_core.atlas.atlas import Atlas
    >>> from gp_core.pose.cochlea_pose import estimate_pose
    >>> atlas = Atlas.published()
    >>> names = {"CL": "OS", "OS": "CL", "MN": "MN", "LLI": "LLI", "RWA": "RWA", "RWP": "RWP"}
    >>> touches = LandmarkSet.from_mapping({a: atlas[b] for a, b in names.items()}, "L", frame="tracker")
    >>> best = estimate_pose(touches, "L", atlas).likelier_reading
    >>> estimate_pose(read_as(touches, best), "L", atlas).state
    'side clear, names clear'
    """
    if reading.exchanged is not None:
        touches = with_names_exchanged(touches, reading.exchanged)
    return replace(touches, side=reading.side)


def with_names_exchanged(touches: LandmarkSet, pair: tuple[str, str]) -> LandmarkSet:
    """Return touches in which two features have each other's position.

    Raises
    ------
    FeatureError
        One of them is not touched, or no feature.
    """
    a, b = (feature(name).code for name in pair)
    missing = [code for code in (a, b) if code not in touches]
    if missing:
        raise FeatureError(
            f"{a} and {b} cannot be exchanged: {' and '.join(missing)} not touched",
            remedy=f"Touched are {' '.join(touches.placed)}.",
        )
    return touches.with_point(a, touches[b]).with_point(b, touches[a])
