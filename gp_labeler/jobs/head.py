"""Jobs that find how a head lies in its scan."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_core.landmarks.sets import LandmarkSet
from gp_labeler.head_pose import HeadPose
from gp_labeler.imaging.preview import PreviewPlane, straight_preview_planes
from gp_labeler.imaging.readers import ImportPlan, read_preview
from gp_labeler.imaging.volume import Volume
from gp_labeler.jobs.loading import load_modules
from gp_labeler.jobs.runner import Progress

__all__ = ["StraightPreview", "Straighten", "StraightenByLandmarks", "StraightenByPoints"]

_MODULES = ("scipy.ndimage", "scipy.optimize", "scipy.spatial", "SimpleITK", "gp_labeler.phantom")


@dataclass(frozen=True, eq=False)
class Straighten:
    """Find the head by the symmetry of its bone: of several, the one that a point lies in."""

    volume: Volume
    threshold: float | None = None
    near: tuple[float, float, float] | None = None
    like: Path | None = None
    """Specimen file of a straightened head that says which way is front and up."""

    @property
    def title(self) -> str:
        """What the user reads."""
        return "Straightening the head"

    def run(self, progress: Progress) -> HeadPose:
        """Search the mid-plane, then front and up."""
        load_modules(*_MODULES)
        from gp_labeler.document.head_template import read_head_template
        from gp_labeler.head_pose import straighten

        template = None if self.like is None else read_head_template(self.like, cancel=progress.cancelled)
        return straighten(
            self.volume,
            threshold=self.threshold,
            near=self.near,
            template=template,
            progress=progress,
            cancel=progress.cancelled,
        )


@dataclass(frozen=True, eq=False)
class StraightenByLandmarks:
    """Find the head by placed landmarks, and refine it by the symmetry of its bone."""

    volume: Volume
    sides: Mapping[Side, LandmarkSet]
    threshold: float | None = None

    @property
    def title(self) -> str:
        """What the user reads."""
        return "Straightening the head by its landmarks"

    def run(self, progress: Progress) -> HeadPose:
        """Lay the mean head onto the points, then ask the bone."""
        load_modules(*_MODULES)
        from gp_labeler.head_pose import straighten_by_landmarks

        progress(0.1)
        return straighten_by_landmarks(self.volume, self.sides, threshold=self.threshold)


@dataclass(frozen=True, eq=False)
class StraightenByPoints:
    """Find the head by a point of its midline and a pair, and refine it by the symmetry of its bone."""

    volume: Volume
    midline: tuple[float, float, float]
    left: tuple[float, float, float]
    right: tuple[float, float, float]
    threshold: float | None = None

    @property
    def title(self) -> str:
        """What the user reads."""
        return "Straightening the head by three points"

    def run(self, progress: Progress) -> HeadPose:
        """Begin with the plane halfway between the pair, then ask the bone."""
        load_modules(*_MODULES)
        from gp_labeler.head_pose import straighten_by_points

        progress(0.1)
        return straighten_by_points(
            self.volume,
            midline=self.midline,
            left=self.left,
            right=self.right,
            threshold=self.threshold,
        )


@dataclass(frozen=True, eq=False)
class StraightPreview:
    """Lay the preview of a scan straight along its head, where the symmetry of the bone tells how."""

    plan: ImportPlan
    title: str = "Straightening the preview"

    def run(self, progress: Progress) -> tuple[PreviewPlane, PreviewPlane] | None:
        """Return its axial and coronal slice; None where the head cannot be straightened by itself."""
        load_modules(*_MODULES)
        from gp_labeler.head_pose import straighten

        volume = read_preview(self.plan, cancel=progress.cancelled)
        try:
            pose = straighten(volume, progress=progress, cancel=progress.cancelled)
        except GpError:
            return None
        return straight_preview_planes(volume, pose.T_head_scan)
