"""The bone of the scan that is open: which meshes there are, and when they are made anew."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from gp_core.landmarks.features import Side
from gp_core.validation import FloatArray
from gp_labeler.imaging.surface import SMALLEST_PART_MM, box_around
from gp_labeler.imaging.volume import Volume
from gp_labeler.jobs.work import MeshEars, Meshes, MeshFirst, MeshOverview, ProposeThreshold
from gp_labeler.models import labelling

if TYPE_CHECKING:
    from gp_labeler.models.bone_desk import BoneDesk

__all__ = ["Bone"]

EAR_HALF_MM = 7.0
"""All features of an ear but those of jaw, zygoma and incisors lie within this of its middle."""

CUT_PART_MM = 0.3
"""Parts that the walls of an ear's box cut off are kept from this size on."""

_NEAR = ("CA", "CB", "RWA", "RWP", "RWL", "RWM", "FPA", "FPP", "OS", "OI", "LLI", "MH", "CC", "CO")
_MOVED_MM = 2.0


class Bone:
    """Keeps the meshes of a workbench up to date.

    Parameters
    ----------
    desk : BoneDesk
        Whose scan and landmarks it follows.
    """

    def __init__(self, desk: BoneDesk) -> None:
        self._desk = desk
        self.smallest_mm = SMALLEST_PART_MM
        self.proposed: float | None = None
        self.meshes = Meshes()
        self._overview = Meshes()
        self._ears: Mapping[Side, FloatArray] = {}
        self._half = EAR_HALF_MM

    def forget(self) -> None:
        """Let go of all meshes, and of the work on them."""
        for task in self._desk.jobs.running:
            if task.key.startswith("mesh"):
                task.cancel()
        self.proposed = None
        self.meshes = self._overview = Meshes()
        self._ears = {}

    def begin(self, volume: Volume) -> None:
        """Mesh a scan that was just opened."""
        self.meshes = self._overview = Meshes()
        self._ears = {}
        if self._desk.session.state.threshold is not None:
            self.mesh()
        else:
            self._desk.jobs.submit(ProposeThreshold(volume), self._take_proposal, key="mesh threshold")

    def mesh(self) -> None:
        """Mesh the whole scan anew, coarsely first where there is nothing to see yet."""
        volume, threshold = self._desk.volume, self._desk.threshold
        if volume is None or threshold is None:
            return
        if not self.meshes.parts:
            self._desk.jobs.submit(
                MeshFirst(volume, threshold, self.smallest_mm), self._take_first, key="mesh first"
            )
        self._desk.jobs.submit(
            MeshOverview(volume, threshold, self.smallest_mm), self._take_overview, key="mesh"
        )

    def mesh_ears(self, *, half_mm: float | None = None, anew: bool = False) -> None:
        """Mesh around each ear at full resolution, once its place is known and where that adds anything."""
        volume, threshold = self._desk.volume, self._desk.threshold
        coarse = any(part.stride > 1 for part in self._overview.parts)
        if volume is None or threshold is None or not coarse:
            return
        self._half = half_mm or self._half
        middles = {side: place for side in Side if (place := self._ear(side)) is not None}
        if not anew and not any(self._is_news(side, place) for side, place in middles.items()):
            return
        self._ears = middles
        boxes = {side: box_around(place, self._half) for side, place in middles.items()}
        self._desk.jobs.submit(
            MeshEars(volume, threshold, self._overview, boxes, min(self.smallest_mm, CUT_PART_MM)),
            self._take_ears,
            key="mesh ears",
        )

    def _is_news(self, side: Side, place: FloatArray) -> bool:
        before = self._ears.get(side)
        return before is None or float(np.linalg.norm(before - place)) > _MOVED_MM

    def _ear(self, side: Side) -> FloatArray | None:
        """Return about where the middle of an ear is, (3,) mm: from its labels, suggestions and ghosts."""
        places = [labelling.place_of(self._desk.session, side, code) for code in _NEAR]
        known = [place for place in places if place is not None]
        if not known:
            return None
        middle: FloatArray = np.array(known).mean(axis=0)
        return middle

    def _take_proposal(self, threshold: float) -> None:
        self.proposed = threshold
        self._desk.threshold_changed.emit(self._desk.threshold)
        self.mesh()

    def _take_first(self, meshes: Meshes) -> None:
        if not self._overview.parts:
            self._show(meshes)

    def _take_overview(self, meshes: Meshes) -> None:
        self._overview = meshes
        self._ears = {}
        self._show(meshes)
        self.mesh_ears()

    def _take_ears(self, meshes: Meshes) -> None:
        self._show(meshes)

    def _show(self, meshes: Meshes) -> None:
        self.meshes = meshes
        self._desk.surfaces_changed.emit()
