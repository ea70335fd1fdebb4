"""A simulated probe: the poses of its marker and of the head's, with noise and faults."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from gp_core.errors import GpError
from gp_core.validation import FloatArray
from gp_labeler.tracker.rigid import rotation_of

__all__ = ["Reading", "SimulatedProbe"]

_WOBBLE = np.radians(3.0)
_TILT = np.radians(35.0)
_TILT_PER_SECOND = np.radians(60.0)
_TURNS_PER_SECOND = 0.7
_SWAYS_PER_SECOND = 0.4
_SWAY_TURN = np.radians(0.3)
"""How far the head turns for each mm that it sways."""


@dataclass(frozen=True, eq=False)
class Reading:
    """What the tracker tells of one marker: its (4, 4) pose, and whether it is seen."""

    matrix: FloatArray
    seen: bool = True


@dataclass
class _Way:
    """The tip's way from one place to another, slow at both ends."""

    start: FloatArray
    end: FloatArray
    begins: float
    seconds: float

    def at(self, time: float) -> FloatArray:
        done = min(max((time - self.begins) / self.seconds, 0.0), 1.0) if self.seconds > 0 else 1.0
        place: FloatArray = self.start + (3 * done**2 - 2 * done**3) * (self.end - self.start)
        return place


@dataclass
class SimulatedProbe:
    """A probe that moves between points of a head.

    Parameters
    ----------
    points : mapping of str to (3,) array
        Where the tip can be sent, mm: in the reference's frame, or in the tracker's without a reference.
    tip_offset : (3,) array_like
        The tip in the marker's frame, mm.
    noise_mm, noise_deg : float
        Standard deviation of a marker's position (per coordinate) and orientation (per axis).
    sway_mm : float
        How far the head, and the reference on it, sways.
    reference : bool
        Whether there is a reference; without it the head holds still.
    rng : numpy Generator
    """

    points: Mapping[str, FloatArray]
    tip_offset: ArrayLike = (0.0, 0.0, -120.0)
    noise_mm: float = 0.1
    noise_deg: float = 0.02
    sway_mm: float = 0.0
    reference: bool = False
    rng: np.random.Generator = field(default_factory=np.random.default_rng)

    hidden: set[str] = field(default_factory=set)
    """Which markers cannot be seen: ``probe``, ``reference``."""
    displaced: FloatArray = field(default_factory=lambda: np.zeros(3))
    """By how much the probe's marker is reported at a wrong place, mm."""

    def __post_init__(self) -> None:
        if not self.points:
            raise GpError("a simulated probe needs points to touch")
        places = np.array(list(self.points.values()))
        middle = places.mean(axis=0)
        length = float(np.linalg.norm(middle))
        self._outward = middle / length if length > 1 else np.array([0.0, 1.0, 0.0])
        self._base = rotation_of(np.array([0.7, -0.4, 0.9]))
        self._offset = np.asarray(self.tip_offset, dtype=np.float64)
        self._home = middle + 60.0 * self._outward
        self._way = _Way(self._home, self._home, 0.0, 0.0)
        self._turning = False
        self._tilt = _WOBBLE
        self._last = 0.0

    def go(self, name: str, seconds: float, time: float) -> None:
        """Send the tip to a point, or ``home``.

        Raises
        ------
        GpError
            There is no such point.
        """
        if name != "home" and name not in self.points:
            raise GpError(f"there is no point {name!r}", remedy=f"Known: home, {', '.join(self.points)}.")
        end = self._home if name == "home" else np.asarray(self.points[name], dtype=np.float64)
        self._way = _Way(self._way.at(time), end, time, seconds)

    def lift(self, mm: float, seconds: float, time: float) -> None:
        """Lift the tip away from the head."""
        start = self._way.at(time)
        self._way = _Way(start, start + mm * self._outward, time, seconds)

    def turn(self, turning: bool) -> None:
        """Tilt the probe about its tip to all sides, or stop that."""
        self._turning = turning

    def tip(self, time: float) -> FloatArray:
        """Return where the tip is, (3,), mm: the truth."""
        return self._way.at(time)

    def read(self, time: float) -> dict[str, Reading]:
        """Return what the tracker sees: ``probe``, and ``reference`` where there is one."""
        T_tracker_head = self._head(time) if self.reference else np.eye(4)
        readings = {"probe": self._reading("probe", T_tracker_head @ self._marker(time))}
        if self.reference:
            readings["reference"] = self._reading("reference", T_tracker_head)
        return readings

    def _marker(self, time: float) -> FloatArray:
        wanted = _TILT if self._turning else _WOBBLE
        most = _TILT_PER_SECOND * max(time - self._last, 0.0)
        self._tilt += float(np.clip(wanted - self._tilt, -most, most))
        self._last = time
        angle = 2 * np.pi * _TURNS_PER_SECOND * time
        sides = np.array([np.sin(angle), np.cos(angle), 0.3 * np.sin(0.37 * angle)])
        pose = np.eye(4)
        pose[:3, :3] = self._base @ rotation_of(self._tilt * sides)
        pose[:3, 3] = self._way.at(time) - pose[:3, :3] @ self._offset
        return pose

    def _head(self, time: float) -> FloatArray:
        angle = 2 * np.pi * _SWAYS_PER_SECOND * time
        sway = self.sway_mm * np.array([np.sin(angle), np.cos(0.7 * angle), np.sin(1.3 * angle)])
        pose = np.eye(4)
        pose[:3, :3] = rotation_of(np.array([0.2, 1.1, -0.5])) @ rotation_of(_SWAY_TURN * sway[::-1])
        pose[:3, 3] = np.array([120.0, -80.0, -900.0]) + sway
        return pose

    def _reading(self, name: str, pose: FloatArray) -> Reading:
        if name in self.hidden:
            return Reading(np.eye(4), seen=False)
        noisy = pose.copy()
        noisy[:3, :3] = pose[:3, :3] @ rotation_of(np.radians(self.noise_deg) * self.rng.standard_normal(3))
        noisy[:3, 3] += self.noise_mm * self.rng.standard_normal(3)
        if name == "probe":
            noisy[:3, 3] += self.displaced
        return Reading(noisy)
