"""What a tracker's messages become: samples of the probe's pose, each with the fault that it has."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

from gp_core.validation import FloatArray

__all__ = ["UNTIMELY", "Fault", "Limits", "Sample"]


class Fault(str, Enum):
    """What is wrong with a sample."""

    NONE = ""
    HIDDEN = "hidden"
    """The tracker reports that it does not see the marker, by a status or by an identity matrix."""
    DAMAGED = "damaged"
    """The checksum of the message is wrong, or its content cannot be read."""
    LATE = "late"
    """It arrived long after it was measured."""
    REPEATED = "repeated"
    """A message with the same time stamp came before."""
    BACKWARDS = "out of order"
    """Measured before one that has already arrived."""
    CLOCK = "clock changed"
    """Its time stamp does not fit the clock that the tracker had until now."""
    NOT_RIGID = "not rigid"
    """Not finite, scaled, sheared or mirrored."""
    FROZEN = "frozen"
    """The last digit has not changed for a while: the tracker repeats what it saw last."""
    JUMP = "jump"
    """The marker changed its place faster than a hand can move it."""
    NO_REFERENCE = "no reference"
    """The reference was not seen at that moment."""


UNTIMELY = (Fault.LATE, Fault.REPEATED, Fault.BACKWARDS, Fault.CLOCK)
"""Faults of the time stamp: when the pose was measured is not known."""


@dataclass(frozen=True)
class Limits:
    """What is believed.

    Parameters
    ----------
    speed_mm_s, turn_deg_s : float
        The fastest that a hand moves and turns a marker.
    acceleration_mm_s2, turn_acceleration_deg_s2 : float
        The hardest that it starts and stops it.
    head_speed_mm_s, head_acceleration_mm_s2 : float
        The same of the reference on the head: one that moves faster was knocked, or is read wrongly.
    noise_mm, noise_deg : float
        Steps up to this are no jump, however short the time.
    confirm_s : float
        How long nothing is recorded after a jump that the marker does not take back.
    late_s : float
        How much longer than the quickest a message may take.
    reference_gap_s : float
        The longest time between the two readings of the reference between which its pose is interpolated.
    frozen_s : float, optional
        How long a marker may stand still to the last digit; None for a device without noise (a robot's arm).
    rigid : float
        How far a rotation may be from orthonormal.
    """

    speed_mm_s: float = 1000.0
    turn_deg_s: float = 720.0
    acceleration_mm_s2: float = 3_000.0
    turn_acceleration_deg_s2: float = 4_000.0
    head_speed_mm_s: float = 150.0
    head_acceleration_mm_s2: float = 1_000.0
    noise_mm: float = 1.5
    noise_deg: float = 3.0
    confirm_s: float = 2.0
    late_s: float = 0.25
    reference_gap_s: float = 0.12
    frozen_s: float | None = 0.2
    rigid: float = 2e-3

    @property
    def of_head(self) -> Limits:
        """The limits of the reference."""
        return replace(self, speed_mm_s=self.head_speed_mm_s, acceleration_mm_s2=self.head_acceleration_mm_s2)


@dataclass(frozen=True, eq=False)
class Sample:
    """Where the probe's marker was at one moment.

    Parameters
    ----------
    time : float
        When it was measured, seconds of the tracker's clock.
    received : float
        When it arrived, seconds of this computer's monotonic clock.
    matrix : (4, 4) array or None
        ``T_tracker_marker``, mm; where a reference is named, ``T_reference_marker``. None where nothing rigid
        is known. It may be there beside a fault, for showing; use it only where `usable`.
    fault : Fault
    detail : str
        The fault in words; empty without one.
    segment : int
        Counts the jumps that the marker has not taken back: samples of different segments may be in frames
        that differ by the jump between them.
    oriented : bool
        Whether the orientation is known; else only the position of the marker's origin is.
    """

    time: float
    received: float
    matrix: FloatArray | None
    fault: Fault = Fault.NONE
    detail: str = ""
    segment: int = 0
    oriented: bool = True

    @property
    def usable(self) -> bool:
        """Whether it may become part of a recording."""
        return self.fault is Fault.NONE and self.matrix is not None

    @property
    def visible(self) -> bool:
        """Whether the tracker saw all that it takes."""
        return self.fault not in (Fault.HIDDEN, Fault.FROZEN, Fault.NO_REFERENCE)
