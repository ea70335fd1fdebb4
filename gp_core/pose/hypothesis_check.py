"""Whether side and names of a pose are clear, undecided or wrong, from the odds of the other hypotheses."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from gp_core.argument_types import checks_arguments
from gp_core.errors import FeatureError
from gp_core.landmarks.features import feature
from gp_core.landmarks.sets import LandmarkSet
from gp_core.pose.cochlea_pose import CochleaPose
from gp_core.pose.mixture import UNDECIDED, Hypothesis

__all__ = ["hypothesis_states", "hypothesis_warnings", "read_as", "with_names_exchanged"]

_WRONG = 0.5
"""Total probability of the other hypotheses from which on the given one is called wrong."""

_SAME_MM, _SAME_DEG = 0.25, 5.0
"""Up to here, an exchange of names is irrelevant: it hardly moves the pose."""


def hypothesis_states(pose: CochleaPose, better_exchanged: tuple[str, str] | None) -> dict[str, Any]:
    """Return `side_state`, `names_state` and `swapped` of a pose.

    Parameters
    ----------
    pose : CochleaPose
        With its hypotheses.
    better_exchanged : (str, str) or None
        Two features whose touches fit much better with their names exchanged. They are reported even if the
        prior makes an exchange unlikely, or it hardly moves the pose; the names are ``wrong`` only if it
        moves the pose.

    Returns
    -------
    dict
        The three fields, by name.
    """
    others = [h for h in pose.hypotheses if h.exchanged is None]
    exchanges = [h for h in pose.hypotheses if h.exchanged is not None]
    side = _state(sum(h.probability for h in others))
    relevant = [h for h in exchanges if _matters(pose, h)]
    names = _state(sum(h.probability for h in relevant))
    if sum(h.probability for h in exchanges) >= _WRONG:
        names, relevant = "wrong", exchanges
    if names != "wrong" and better_exchanged is not None:
        if any(h.exchanged == better_exchanged for h in relevant):
            names = "wrong"
        return {"side_state": side, "names_state": names, "swapped": better_exchanged}
    likeliest = max(relevant, key=lambda h: h.probability, default=None)
    return {
        "side_state": side,
        "names_state": names,
        "swapped": None if names == "clear" or likeliest is None else likeliest.exchanged,
    }


def _state(probability: float) -> str:
    if probability >= _WRONG:
        return "wrong"
    return "undecided" if probability >= UNDECIDED else "clear"


def _matters(pose: CochleaPose, other: Hypothesis) -> bool:
    """Whether an exchange moves the pose; otherwise it is a mere matter of names."""
    mm = float(np.linalg.norm(other.origin - pose.origin))
    degrees = float(np.degrees(np.arccos(np.clip(other.axis @ pose.axis, -1, 1))))
    return mm > _SAME_MM or degrees > _SAME_DEG


def hypothesis_warnings(pose: CochleaPose) -> Iterator[str]:
    """Yield a warning where the touches may be of the other ear, or two of them exchanged.

    Parameters
    ----------
    pose : CochleaPose
        With its states.

    Yields
    ------
    str
        A clause without a full stop.
    """
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
            f"these points may belong to the {other} side ({100 * pose.other_side_probability:.1f} %): "
            "touch one more feature away from their plane"
        )


@checks_arguments
def read_as(touches: LandmarkSet, hypothesis: Hypothesis) -> LandmarkSet:
    """Return touches as a hypothesis takes them: of the other ear, or with two names exchanged.

    Parameters
    ----------
    touches : LandmarkSet
        As they were named, mm.
    hypothesis : Hypothesis
        Such as `CochleaPose.likelier_hypothesis`.

    Returns
    -------
    LandmarkSet
        The same positions, mm.

    Raises
    ------
    FeatureError
        An exchanged feature is not touched.

    Examples
    --------
    >>> from gp_core import Atlas, estimate_pose
    >>> atlas = Atlas.published()
    >>> names = {"CL": "OS", "OS": "CL", "MN": "MN", "LLI": "LLI", "RWA": "RWA", "RWP": "RWP"}
    >>> touches = LandmarkSet.from_mapping({a: atlas[b] for a, b in names.items()}, "L", frame="tracker")
    >>> best = estimate_pose(touches, "L", atlas).likelier_hypothesis
    >>> estimate_pose(read_as(touches, best), "L", atlas).state
    'side clear, names clear'
    """
    if hypothesis.exchanged is not None:
        touches = with_names_exchanged(touches, hypothesis.exchanged)
    return replace(touches, side=hypothesis.side)


def with_names_exchanged(touches: LandmarkSet, pair: tuple[str, str]) -> LandmarkSet:
    """Return touches with the names of two features exchanged.

    Parameters
    ----------
    touches : LandmarkSet
        Touched features, mm.
    pair : (str, str)
        The two features.

    Returns
    -------
    LandmarkSet
        The same positions, mm.

    Raises
    ------
    FeatureError
        One of them is not touched, or not a feature.
    """
    a, b = (feature(name).code for name in pair)
    missing = [code for code in (a, b) if code not in touches]
    if missing:
        raise FeatureError(
            f"{a} and {b} cannot be exchanged: {' and '.join(missing)} not touched",
            remedy=f"Touched are {' '.join(touches.placed)}.",
        )
    other = {a: b, b: a}
    repeats = {other.get(name, name): one for name, one in touches.repeats.items()}
    return replace(touches.with_point(a, touches[b]).with_point(b, touches[a]), repeats=repeats)
