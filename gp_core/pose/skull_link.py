"""Two ears of a head in one frame: by the skull features that were touched with each of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from gp_core.argument_types import checks_arguments
from gp_core.errors import GpError
from gp_core.frames import RigidTransform
from gp_core.landmarks.sets import LandmarkSet
from gp_core.registration.fiducials import register_fiducials

__all__ = ["SkullLink", "link_by_skull"]

_FEWEST = 3
_BY_CHANCE = 0.01
"""So rarely do skull features that have not moved lie as far apart as ones that have."""

_LEAST_NOISE_MM = 0.1
"""Noise of a touch that is assumed at least, mm per coordinate: a few features may fit better by chance."""


@dataclass(frozen=True)
class SkullLink:
    """How the skull features that were touched with both ears lie to each other.

    Attributes
    ----------
    names : tuple of str
        Features that were touched with both.
    apart_mm : float
        RMS distance of their two touches.
    fre_mm : float
        What is left of that once one ear is moved onto the other.
    suspects : tuple of str
        Features that contradict the others, and are not used.
    T_ear_other : RigidTransform or None
        Moves the touches of the other ear to where they would be, had head and reference not moved; None
        where they have not.
    """

    names: tuple[str, ...]
    apart_mm: float
    fre_mm: float
    suspects: tuple[str, ...]
    T_ear_other: RigidTransform | None

    @property
    def has_moved(self) -> bool:
        """Whether the head moved against its reference between the ears, by more than touch errors."""
        return self.T_ear_other is not None

    @property
    def text(self) -> str:
        """The finding in a sentence."""
        n = len(self.names) - len(self.suspects)
        doubtful = f", without {' and '.join(self.suspects)}" if self.suspects else ""
        if not self.has_moved:
            return f"the head did not move between the ears: {n} skull features agree{doubtful}"
        return (
            f"the head moved against its reference between the ears: {n} skull features lie "
            f"{self.apart_mm:.2f} mm apart{doubtful}; the touches of the other ear were "
            f"moved back by them (FRE {self.fre_mm:.2f} mm)"
        )

    def as_dict(self) -> dict[str, Any]:
        """Return it for a JSON file, mm.

        Returns
        -------
        dict
            Plain values.
        """
        T = self.T_ear_other
        return {
            "names": list(self.names),
            "apart_mm": self.apart_mm,
            "fre_mm": self.fre_mm,
            "suspect": list(self.suspects),
            "text": self.text,
            "moved": self.has_moved,
            "T_ear_other": None if T is None else T.matrix.tolist(),
        }


@checks_arguments
def link_by_skull(touches: LandmarkSet, other: LandmarkSet) -> SkullLink | None:
    """Compare the skull features that were touched with both ears of a head.

    Parameters
    ----------
    touches, other : LandmarkSet
        Touches of the two ears, mm; skull features (``S1``, ...) are in their `extra`.

    Returns
    -------
    SkullLink or None
        None with fewer than three skull features in common.

    Raises
    ------
    GpError
        The frames differ, or the skull features lie on one line.
    """
    names = tuple(name for name in touches.extra if name in other.extra)
    if len(names) < _FEWEST:
        return None
    if touches.frame != other.frame:
        raise GpError(f"the ears were touched in different frames, {touches.frame} and {other.frame}")
    found = register_fiducials(other.extra, touches.extra, dst=touches.frame, src=other.frame)
    kept = [name for name in names if name not in found.suspects]
    apart = np.array([touches.extra[name] - other.extra[name] for name in kept])
    squared = float((apart**2).sum(axis=1).mean())
    moved = _is_motion(len(kept), squared, found.fre_mm**2)
    return SkullLink(
        names, squared**0.5, found.fre_mm, found.suspects, found.T_scan_tracker if moved else None
    )


def _is_motion(n: int, before: float, after: float) -> bool:
    """Whether the mean squared distance of n pairs before and after a rigid fit tells of a motion.

    Without one, the six degrees of freedom of the fit take as much of it as any other six (F test).
    """
    from scipy.special import fdtrc  # here: estimates of one ear need not wait for it

    freedom = 3 * n - 6
    noise = max(n * after / freedom, 2 * _LEAST_NOISE_MM**2)
    ratio = n * (before - after) / 6 / noise
    return float(fdtrc(6, freedom, ratio)) < _BY_CHANCE
