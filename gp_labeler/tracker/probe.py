"""The probe: where its tip is, and the rotations from which a pivot calibration finds that."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from gp_core.errors import GpError
from gp_core.validation import FloatArray
from gp_labeler.tracker.rigid import turn_deg
from gp_labeler.tracker.samples import Fault, Sample

if TYPE_CHECKING:
    from gp_core.registration.pivot import PivotCalibration

__all__ = ["PivotCollector", "Probe"]

_LONGEST_PROBE_MM = 1000.0


class Probe:
    """A marker with a tip.

    Parameters
    ----------
    tip_offset : (3,) array_like
        The tip in the marker's frame, mm; zeros where the tracker's messages are of the tip itself.

    Raises
    ------
    GpError
        Not three finite numbers, or longer than a probe is.
    """

    def __init__(self, tip_offset: ArrayLike = (0.0, 0.0, 0.0)) -> None:
        remedy = "Give x, y, z of the tip in the marker's frame, in mm, or make a pivot calibration."
        try:
            offset = np.array(tip_offset, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            raise GpError("the tip offset must be three numbers", remedy=remedy) from None
        if offset.shape != (3,) or not np.isfinite(offset).all():
            raise GpError(
                f"the tip offset must be three finite numbers, got {offset.tolist()}", remedy=remedy
            )
        if np.linalg.norm(offset) > _LONGEST_PROBE_MM:
            raise GpError(f"the tip offset is {np.linalg.norm(offset):.0f} mm long", remedy=remedy)
        offset.setflags(write=False)
        self.tip_offset: FloatArray = offset

    def lacks_orientation(self, sample: Sample) -> bool:
        """Whether the tip is unknown, as the sample has a position only, and the tip lies elsewhere."""
        return not sample.oriented and bool(self.tip_offset.any())

    def tip(self, sample: Sample) -> FloatArray | None:
        """Return the (3,) tip, mm, in the sample's frame; None where the marker's pose is not known."""
        if sample.matrix is None or self.lacks_orientation(sample):
            return None
        tip: FloatArray = sample.matrix[:3, :3] @ self.tip_offset + sample.matrix[:3, 3]
        return tip


class PivotCollector:
    """Collects marker poses while the tip stays in one small hollow and the marker is turned about it.

    Poses that hardly differ from the one before add nothing and are passed over, so that resting does not
    outweigh turning.

    Parameters
    ----------
    turn_wanted_deg : float
        How far apart the two most different orientations should be.
    poses_wanted : int
        How many poses there should be.
    step_deg : float
        How far the marker must have turned since the last pose taken.
    """

    def __init__(
        self, *, turn_wanted_deg: float = 40.0, poses_wanted: int = 50, step_deg: float = 1.0
    ) -> None:
        self.turn_wanted_deg = turn_wanted_deg
        self.poses_wanted = poses_wanted
        self._step_deg = step_deg
        self._poses: list[FloatArray] = []
        self.turned_deg = 0.0
        """How far apart the two most different orientations are, degrees."""
        self.refused: Counter[Fault] = Counter()
        """How many samples were not taken, by what was wrong with them."""

    @property
    def count(self) -> int:
        """How many poses are collected."""
        return len(self._poses)

    @property
    def poses(self) -> FloatArray:
        """(N, 4, 4) poses of the marker, mm."""
        return np.array(self._poses).reshape(-1, 4, 4)

    @property
    def ready(self) -> bool:
        """Whether there are enough poses, far enough apart."""
        return self.count >= self.poses_wanted and self.turned_deg >= self.turn_wanted_deg

    @property
    def words(self) -> str:
        """What to do next."""
        if self.ready:
            return f"Complete: {self.count} poses, rotated by {self.turned_deg:.0f} degrees."
        if self.turned_deg < self.turn_wanted_deg:
            return (
                "Keep the tip in the hollow and tilt the probe in all directions: "
                f"{self.turned_deg:.0f} of {self.turn_wanted_deg:.0f} degrees."
            )
        return f"Continue to tilt the probe: {self.count} of {self.poses_wanted} poses."

    def update(self, samples: Iterable[Sample]) -> int:
        """Take samples; return how many of them became poses."""
        before = self.count
        for sample in samples:
            if not sample.usable or sample.matrix is None or not sample.oriented:
                self.refused[sample.fault] += 1
            else:
                self._take(sample.matrix)
        return self.count - before

    def _take(self, pose: FloatArray) -> None:
        if self._poses:
            turns = turn_deg(self.poses[:, :3, :3].transpose(0, 2, 1) @ pose[:3, :3])
            if turns[-1] < self._step_deg:
                return
            self.turned_deg = max(self.turned_deg, float(turns.max()))
        self._poses.append(pose)

    def clear(self) -> None:
        """Begin again."""
        self._poses.clear()
        self.refused.clear()
        self.turned_deg = 0.0

    def finish(self) -> PivotCalibration:
        """Find the tip from the poses collected.

        Raises
        ------
        GeometryError
            Too few poses, or too little turning, to find it.
        """
        from gp_core.registration.pivot import calibrate_pivot

        return calibrate_pivot(self.poses)
