"""Whether a pose may be sent to a robot, and if not, why not.

One rule for the window, the shell, scripts and Python. It knows nothing of files or networks: the caller says
whether a person has accepted the pose, and how old the last valid measurement of the reference marker is.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gp_core.argument_types import check_fields, checks_arguments
from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_core.pose.cochlea_pose import CochleaPose

__all__ = [
    "GateReason",
    "PoseGate",
    "named_for_other_side",
    "reasons_against_writing",
    "reasons_of_ambiguity",
]


@dataclass(frozen=True)
class GateReason:
    """One reason to hold a pose back.

    Attributes
    ----------
    code : str
        For programs: ``no pose``, ``wrong side``, ``side undecided``, ``side unchecked``, ``wrong names``,
        ``names undecided``, ``names unchecked``, ``ears disagree``, ``radius``, ``cone``, ``not accepted`` or
        ``stale``.
    text : str
        For people, a clause without a full stop.
    """

    code: str
    text: str


@dataclass(frozen=True)
class PoseGate:
    """The limits within which a pose may be sent.

    Parameters
    ----------
    max_radius_mm : float
        Largest 95 % radius about the origin, mm.
    max_cone_deg : float
        Largest 95 % cone about the axis, half-angle in degrees.
    max_age_s : float
        How long ago the reference marker may have been seen last, s.

    Raises
    ------
    GpError
        A limit is no positive number.

    Examples
    --------
    >>> gate = PoseGate(max_radius_mm=0.8)
    >>> [reason.code for reason in gate.reasons(None, accepted=False)]
    ['no pose']
    """

    max_radius_mm: float = 1.0
    max_cone_deg: float = 15.0
    max_age_s: float = 1.0

    def __post_init__(self) -> None:
        check_fields(self)
        for name, value, unit in (
            ("radius", self.max_radius_mm, "mm"),
            ("cone", self.max_cone_deg, "degrees"),
            ("age", self.max_age_s, "s"),
        ):
            if not (math.isfinite(value) and value > 0):
                raise GpError(
                    f"the largest {name} of a pose that is sent must be above 0 {unit}, got {value!r}"
                )

    @checks_arguments
    def reasons(
        self, pose: CochleaPose | None, *, accepted: bool, reference_age_s: float | None = None
    ) -> tuple[GateReason, ...]:
        """Return every reason to hold a pose back, the most serious first; empty where it may be sent.

        Parameters
        ----------
        pose : CochleaPose or None
            The current estimate, if there is one.
        accepted : bool
            Whether a person accepted this very pose, after touches, atlas and settings last changed.
        reference_age_s : float, optional
            Time since the last valid measurement of the reference marker, s; infinite before the first one.
            None where the pose does not depend on a reference marker.

        Returns
        -------
        tuple of GateReason
            Each with a code for programs and a text for people.
        """
        if pose is None:
            return (GateReason("no pose", "there is no estimate"),)
        return tuple(self._reasons(pose, accepted, reference_age_s))

    def _reasons(self, pose: CochleaPose, accepted: bool, age: float | None) -> Iterator[GateReason]:
        yield from reasons_of_ambiguity(pose)
        radius, cone = pose.radius_95, float(np.degrees(pose.cone_95))
        if not radius <= self.max_radius_mm:
            yield GateReason("radius", f"the 95 % radius is {radius:.2f} mm, above {self.max_radius_mm:g} mm")
        if not cone <= self.max_cone_deg:
            yield GateReason("cone", f"the 95 % cone is {cone:.1f} deg, above {self.max_cone_deg:g} deg")
        if not accepted:
            yield GateReason(
                "not accepted", "nobody has accepted it since touches, atlas or settings changed"
            )
        if age is not None and not age <= self.max_age_s:
            yield GateReason("stale", _stale(age, self.max_age_s))


def reasons_of_ambiguity(pose: CochleaPose) -> Iterator[GateReason]:
    """Yield the reasons that no limit and no person can override: side, names, and ears that disagree.

    Parameters
    ----------
    pose : CochleaPose
        An estimate.

    Yields
    ------
    GateReason
        One for the side, and one for the names, where they are not clear; one where the ears disagree.
    """
    other = pose.side.other.word
    words = {
        "wrong": ("wrong side", f"the touches look like those of the {other} ear"),
        "undecided": (
            "side undecided",
            f"the touches may be those of the {other} ear ({100 * pose.other_side_probability:.1f} %)",
        ),
        "unchecked": ("side unchecked", "the side has not been checked"),
    }
    if pose.side_state in words:
        yield GateReason(*words[pose.side_state])
    words = {
        "wrong": ("wrong names", f"{_pair(pose)} look exchanged"),
        "undecided": ("names undecided", f"{_pair(pose)} may be exchanged"),
        "unchecked": ("names unchecked", "the names have not been checked"),
    }
    if pose.names_state in words:
        yield GateReason(*words[pose.names_state])
    if pose.ears_disagree:
        yield GateReason("ears disagree", str(pose.other_ear["text"]))


def named_for_other_side(file: str, side: Side) -> GateReason:
    """Return the reason against a pose whose file of touches is named for the other side.

    Parameters
    ----------
    file : str
        Its name.
    side : Side
        The given side of the touches.

    Returns
    -------
    GateReason
        The side is ambiguous.
    """
    return GateReason("side undecided", f"the name {file} indicates the {side.other.word} side")


def reasons_against_writing(pose: CochleaPose) -> tuple[GateReason, ...]:
    """Return why a pose must not be written for a robot: side or names are not clear, or the ears disagree.

    Parameters
    ----------
    pose : CochleaPose
        An estimate.

    Returns
    -------
    tuple of GateReason
        Empty where it may be written.
    """
    return tuple(reasons_of_ambiguity(pose))


def _pair(pose: CochleaPose) -> str:
    return " and ".join(pose.swapped or ()) or "two touches"


def _stale(age: float, limit: float) -> str:
    if not math.isfinite(age):
        return "the reference marker has not been seen yet"
    return f"the reference marker was last seen {age:.1f} s ago, more than {limit:g} s"
