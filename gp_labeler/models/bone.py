"""The bone of the scan: which meshes there are, and when they are made again."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_core.validation import FloatArray
from gp_labeler.document.signals import Signal
from gp_labeler.document.specimen_document import SpecimenDocument
from gp_labeler.imaging.refined_pick import refined_hit
from gp_labeler.imaging.surface import SMALLEST_PART_MM, Surface, SurfaceHit, box_around
from gp_labeler.jobs.mesh import MeshEars, Meshes, MeshFirst, MeshOverview, SaveMesh
from gp_labeler.jobs.runner import Jobs
from gp_labeler.models.labels import LabelsModel
from gp_labeler.models.messages import Messages
from gp_labeler.models.scan import ScanModel

__all__ = ["MESHING", "BoneModel"]

MESHING = ("mesh first", "mesh", "mesh ears", "mesh threshold")
"""Keys of the jobs that lead to a mesh; the last one proposes its threshold."""

EAR_HALF_MM = 7.0
"""All features of an ear but those of jaw, zygoma and incisors lie within this of its middle."""

CUT_PART_MM = 0.3
"""Parts that the walls of an ear's box cut off are kept from this size on."""

_NEAR = ("CA", "CB", "RWA", "RWP", "RWL", "RWM", "FPA", "FPP", "OS", "OI", "LLI", "MH", "CC", "CO")
_MARGIN_MM = 2.0
"""An ear is not meshed again before its middle has moved by more."""

_SOME_POINTS = 4000


class BoneModel:
    """Keeps the meshes of the bone in step with scan, threshold and the places of the ears.

    Parameters
    ----------
    document : SpecimenDocument
        Its landmarks say where the ears are.
    scan : ScanModel
        What is meshed, and at which threshold.
    labels : LabelsModel
        Where suggestions and ghosts are: the ears before they are labelled.
    jobs : Jobs
        Where meshes are made.
    messages : Messages
        What the user is told by.
    """

    surfaces_changed = Signal()

    def __init__(
        self,
        document: SpecimenDocument,
        scan: ScanModel,
        labels: LabelsModel,
        jobs: Jobs,
        messages: Messages,
    ) -> None:
        self._scan, self._labels, self._jobs, self._messages = scan, labels, jobs, messages
        self._smallest_mm = SMALLEST_PART_MM
        self._meshes = self._overview = Meshes()
        self._some_points = np.zeros((0, 3))
        self._ears: Mapping[Side, FloatArray] = {}
        """The (2, 3) box of each ear that is meshed, or about to be, mm."""
        self._half = EAR_HALF_MM
        document.reset.connect(self._on_reset)
        document.landmarks_changed.connect(self._on_landmarks)
        scan.opened.connect(self._on_scan)
        scan.threshold_changed.connect(self._on_threshold)

    @property
    def surfaces(self) -> tuple[Surface, ...]:
        """The bone: parts that do not overlap, the ears at full resolution once that is done."""
        return self._meshes.parts

    @property
    def quick_surfaces(self) -> tuple[Surface, ...]:
        """A coarse mesh to draw while the camera moves; may be empty."""
        return self._meshes.quick

    @property
    def some_points(self) -> FloatArray:
        """(N, 3) mm: points all over the bone, few enough to ask where it lies in each picture."""
        return self._some_points

    @property
    def smallest_part_mm(self) -> float:
        """Parts of the bone that are smaller across are left out, mm."""
        return self._smallest_mm

    def refine(self, hit: SurfaceHit, direction: FloatArray) -> SurfaceHit:
        """Return where a ray that hit the drawn bone meets the bone at full resolution; takes milliseconds.

        Parameters
        ----------
        hit : SurfaceHit
            Where it hit one of `surfaces`.
        direction : (3,) float array
            Where the ray goes.
        """
        volume, threshold = self._scan.volume, self._scan.threshold
        if volume is None or threshold is None or volume.voxels.problem:
            return hit
        return refined_hit(volume, threshold, hit, direction)

    def set_smallest_part(self, mm: float) -> None:
        """Leave out parts of the bone that are smaller across, and mesh again; 0 keeps all."""
        if not (math.isfinite(mm) and mm >= 0):
            raise GpError(f"the smallest part must be a length in mm from 0, got {mm:g}")
        if mm != self._smallest_mm:
            self._smallest_mm = float(mm)
            self.mesh()

    def mesh(self) -> None:
        """Mesh the whole scan again, coarsely first where there is nothing to see yet."""
        volume, threshold = self._scan.volume, self._scan.threshold
        if volume is None or threshold is None:
            return
        if not self._meshes.parts:
            first = MeshFirst(volume, threshold, self._smallest_mm)
            self._jobs.submit(first, self._take_first, key="mesh first")
        whole = MeshOverview(volume, threshold, self._smallest_mm)
        self._jobs.submit(whole, self._take_overview, key="mesh")

    def mesh_ears(self, half_mm: float | None = None) -> None:
        """Mesh around the ears at full resolution now, wherever their place is known."""
        self._mesh_ears(half_mm=half_mm, again=True)

    def save_mesh(self, path: Path) -> None:
        """Write the whole bone surface at full resolution, in the background."""
        volume, threshold = self._scan.volume, self._scan.threshold
        if volume is not None and threshold is not None:
            job = SaveMesh(volume, threshold, Path(path), self._smallest_mm)
            self._jobs.submit(job, lambda file: self._messages.say(f"Wrote {file.name}"))

    def release(self) -> None:
        """Release all meshes, and stop the work on them."""
        self._jobs.cancel(*MESHING)
        self._forget()

    # Inside

    def _forget(self) -> None:
        self._meshes = self._overview = Meshes()
        self._some_points = np.zeros((0, 3))
        self._ears = {}

    def _on_reset(self) -> None:
        self.release()
        self.surfaces_changed.emit()

    def _on_scan(self, _: object) -> None:
        self._forget()
        self.mesh()

    def _on_threshold(self, _: float | None) -> None:
        self.mesh()

    def _on_landmarks(self, _: object) -> None:
        self._mesh_ears()

    def _mesh_ears(self, *, half_mm: float | None = None, again: bool = False) -> None:
        """Mesh around each ear at full resolution, once its place is known and where that adds anything."""
        volume, threshold = self._scan.volume, self._scan.threshold
        coarse = any(part.stride > 1 for part in self._overview.parts)
        if volume is None or threshold is None or not coarse:
            return
        self._half = half_mm or self._half
        middles = {side: place for side in Side if (place := self._ear(side)) is not None}
        wanted = {
            side: box_around(place, self._half)
            for side, place in middles.items()
            if again or self._has_moved(side, place)
        }
        if not wanted:
            return
        self._ears = {**self._ears, **wanted}
        there = {} if again else self._meshes.ears
        kept = {s: ear for s, ear in there.items() if ear.box is self._ears[s]}
        boxes = {side: box for side, box in self._ears.items() if side not in kept}
        smallest = min(self._smallest_mm, CUT_PART_MM)
        job = MeshEars(volume, threshold, self._overview, boxes, smallest, kept)
        self._jobs.submit(job, self._show, key="mesh ears")

    def _has_moved(self, side: Side, place: FloatArray) -> bool:
        """Whether the middle of an ear left the middle of its box by more than the margin, or has none."""
        box = self._ears.get(side)
        return box is None or float(np.linalg.norm(box.mean(axis=0) - place)) > _MARGIN_MM

    def _ear(self, side: Side) -> FloatArray | None:
        """Return about where the middle of an ear is, (3,) mm: from its labels, suggestions and ghosts."""
        places = [self._labels.place_of(side, code) for code in _NEAR]
        known = [place for place in places if place is not None]
        if not known:
            return None
        middle: FloatArray = np.median(known, axis=0)  # one point in the wrong place does not move it far
        return middle

    def _take_first(self, meshes: Meshes) -> None:
        if not self._overview.parts:
            self._show(meshes)

    def _take_overview(self, meshes: Meshes) -> None:
        self._overview = meshes
        self._ears = {}
        self._show(meshes)
        self._mesh_ears()

    def _show(self, meshes: Meshes) -> None:
        self._meshes = meshes
        self._some_points = _some_points(meshes.parts)
        self.surfaces_changed.emit()


def _some_points(parts: Sequence[Surface]) -> FloatArray:
    """Return points all over some surfaces, the same each time; drawn, for corners are in order of place."""
    rng = np.random.default_rng(0)
    n = max(1, _SOME_POINTS // max(len(parts), 1))
    some = [part.points[rng.integers(len(part.points), size=n)] for part in parts if len(part.points)]
    return np.concatenate([np.zeros((0, 3)), *some])
