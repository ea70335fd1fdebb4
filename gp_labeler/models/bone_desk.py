"""What of a workbench concerns the bone: where it begins, its surface, saving it, what lies near it."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gp_core.errors import GpError
from gp_core.landmarks.scan_evidence import ScanEvidence
from gp_core.landmarks.sets import LandmarkSet
from gp_core.terminal import printable
from gp_core.validation import FloatArray
from gp_labeler.document.specimen_edits import SetThreshold
from gp_labeler.imaging.bone_distance import scan_evidence
from gp_labeler.imaging.near_bone import near_bone
from gp_labeler.imaging.surface import Surface
from gp_labeler.imaging.volume import Volume
from gp_labeler.jobs.runner import Jobs
from gp_labeler.jobs.work import SaveMesh
from gp_labeler.models.bone import Bone
from gp_labeler.models.desk_signals import DeskSignals
from gp_labeler.models.session import Session

__all__ = ["BoneDesk"]


class BoneDesk(DeskSignals):
    """Keeps the bone of the scan that is open; `Workbench` is one."""

    jobs: Jobs
    session: Session

    def __init__(self) -> None:
        super().__init__()
        self._bone = Bone(self)

    @property
    def volume(self) -> Volume | None:
        """The scan, with its voxels; None before one is loaded."""
        volume = self.session.volume
        return volume if isinstance(volume, Volume) else None

    @property
    def threshold(self) -> float | None:
        """The grey value at which bone begins: what the user set, else what was proposed."""
        chosen = self.session.state.threshold
        return self._bone.proposed if chosen is None else chosen

    @property
    def surfaces(self) -> tuple[Surface, ...]:
        """The bone: parts that do not overlap, the ears at full resolution once that is done."""
        return self._bone.meshes.parts

    @property
    def quick_surfaces(self) -> tuple[Surface, ...]:
        """A coarse stand-in to draw while the camera moves; may be empty."""
        return self._bone.meshes.quick

    @property
    def smallest_part_mm(self) -> float:
        """Parts of the bone that are smaller across are left out, mm."""
        return self._bone.smallest_mm

    def preview_threshold(self, value: float | None) -> None:
        """Try a threshold out on the slices; None ends that."""
        self.threshold_previewed.emit(value)

    def set_threshold(self, value: float) -> None:
        """Set the bone threshold, one undoable edit, and mesh anew."""
        self.threshold_previewed.emit(None)
        self.session.do(SetThreshold(float(value)))

    def set_smallest_part(self, mm: float) -> None:
        """Leave out parts of the bone that are smaller across, and mesh anew; 0 keeps all."""
        if not (math.isfinite(mm) and mm >= 0):
            raise GpError(f"the smallest part must be a length in mm from 0, got {mm:g}")
        if mm != self._bone.smallest_mm:
            self._bone.smallest_mm = float(mm)
            self._bone.mesh()

    def mesh_ears(self, half_mm: float | None = None) -> None:
        """Mesh around the ears at full resolution now, wherever their place is known."""
        self._bone.mesh_ears(half_mm=half_mm, anew=True)

    def near_bone(self, points: FloatArray) -> NDArray[np.bool_]:
        """Return which of (N, 3) scan positions lie within three voxels of bone; all, where there is none."""
        if self.volume is None or self.threshold is None:
            return np.ones(len(points), dtype=bool)
        return near_bone(self.volume, self.threshold, points)

    @property
    def scan_evidence(self) -> Callable[[LandmarkSet], ScanEvidence] | None:
        """Tells how far the labels of a side are from the bone of this scan; None while there is none."""
        if self.volume is None or self.threshold is None:
            return None
        return partial(scan_evidence, self.volume, self.threshold)

    def save_mesh(self, path: Path) -> None:
        """Write the whole bone surface at full resolution, in the background."""
        if self.volume is not None and self.threshold is not None:
            job = SaveMesh(self.volume, self.threshold, Path(path), self.smallest_part_mm)
            self.jobs.submit(job, lambda file: self.message.emit(printable(f"Wrote {file.name}"), "info"))
