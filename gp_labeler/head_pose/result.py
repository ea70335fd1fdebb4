"""The pose of a head in its scan, and why none was found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gp_core.errors import GpError
from gp_core.frames import RigidTransform
from gp_core.validation import FloatArray
from gp_labeler.head_pose.mid_plane import MidPlane

__all__ = [
    "DOUBTFUL_DEG",
    "LEFT_OF_LANDMARKS",
    "MOST_DEG",
    "Confidence",
    "HeadPose",
    "HeadPoseError",
    "SeveralHeadsError",
]

LEFT_OF_LANDMARKS = "the sides of the landmarks"
"""What left is taken from where a head was straightened by its landmarks."""

DOUBTFUL_DEG, MOST_DEG = 1.5, 3.0
"""Uncertainty of a mid-plane with which it is accepted with a warning, as it may be 3 degrees off (two
standard deviations), and beyond which it is refused."""

_REMEDY = (
    "Place IN and a pair such as OI, and straighten by landmarks; or give three points: midline, left, right."
)


class HeadPoseError(GpError):
    """No pose of the head was found that can be trusted; says why, and what to do instead."""

    def __init__(self, reason: str, *, file: Any = None, remedy: str = _REMEDY) -> None:
        super().__init__(reason, file=file, remedy=remedy)


class SeveralHeadsError(HeadPoseError):
    """The scan contains several heads, and nobody has said which one is meant.

    Parameters
    ----------
    centres : sequence of (3,) array, LPS mm
        The middle of each head's bone.
    """

    def __init__(self, centres: Sequence[FloatArray], *, file: Any = None) -> None:
        places = "; ".join(" ".join(f"{x:.1f}" for x in centre) for centre in centres)
        super().__init__(
            f"the scan contains {len(centres)} heads, at {places} mm (LPS)",
            file=file,
            remedy="Say which one is meant: give a point in it, or a box around it.",
        )
        self.centres = tuple(centres)


@dataclass(frozen=True)
class Confidence:
    """What speaks for a mid-plane.

    Parameters
    ----------
    agreement : float
        Share of the mirrored surface that meets bone, 0 to 1.
    overlap : float
        Share of the surface whose mirror image lies in the scan, 0 to 1.
    margin : float
        Lead in agreement over the best other plane.
    uncertainty_deg : float
        Standard deviation of its direction, degrees, from halves of the head; 0 before it is known.
    """

    agreement: float
    overlap: float
    margin: float
    uncertainty_deg: float = 0.0

    @property
    def warnings(self) -> tuple[str, ...]:
        """A warning, where the plane may well be off by more than a user should accept unseen."""
        if self.uncertainty_deg <= DOUBTFUL_DEG:
            return ()
        return (
            f"the mid-plane is uncertain by {self.uncertainty_deg:.0f} degrees: "
            "compare left and right in the coronal and axial slices",
        )


@dataclass(frozen=True, eq=False)
class HeadPose:
    """How a head lies in its scan.

    Parameters
    ----------
    T_head_scan : RigidTransform
        From the scan (LPS, mm) to the head: x left, y posterior, z superior; x = 0 is the mid-sagittal plane.
    found_by : str
        ``symmetry``, ``points`` or ``landmarks``.
    confidence : Confidence, optional
        What speaks for the mid-plane; None where the bone was not asked.
    pitch : str
        What the pitch was taken from, in words. It is a proposal unless it comes from points.
    left : str
        What left was taken from, in words: nothing in the scan can prove it.
    warnings : tuple of str
        What a person should look at.
    """

    T_head_scan: RigidTransform
    found_by: str
    confidence: Confidence | None
    pitch: str
    left: str
    warnings: tuple[str, ...] = ()

    @property
    def mid_plane(self) -> MidPlane:
        """The mid-sagittal plane in the scan; its normal points left."""
        return MidPlane(self.T_head_scan.rotation[0], -float(self.T_head_scan.translation[0]))

    @property
    def tilt_deg(self) -> float:
        """By how much the head is turned from straight in the scan, degrees."""
        cosine = (float(np.trace(self.T_head_scan.rotation)) - 1) / 2
        return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))

    def as_json(self) -> dict[str, Any]:
        """Return the pose as JSON values."""
        confidence = self.confidence
        return {
            "T_head_scan": self.T_head_scan.matrix.tolist(),
            "midPlane": {
                "normal": self.mid_plane.normal.tolist(),
                "offset": self.mid_plane.offset,
            },
            "tiltDegrees": self.tilt_deg,
            "foundBy": self.found_by,
            "confidence": None
            if confidence is None
            else {
                "agreement": confidence.agreement,
                "overlap": confidence.overlap,
                "margin": confidence.margin,
                "uncertaintyDegrees": confidence.uncertainty_deg,
            },
            "pitch": self.pitch,
            "left": self.left,
            "warnings": list(self.warnings),
        }
