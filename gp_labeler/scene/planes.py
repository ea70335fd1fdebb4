"""The three slice views: their names and colours. What each shows is a `SlicePlane`, and may be any plane."""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from types import MappingProxyType

from gp_labeler.imaging.anatomical_frame import SCAN_FRAME
from gp_labeler.imaging.slice_plane import SlicePlane

__all__ = ["Plane"]


class Plane(Enum):
    """A slice view, named after the anatomical plane that it shows unless it is turned."""

    AXIAL = "axial"
    SAGITTAL = "sagittal"
    CORONAL = "coronal"

    @property
    def colour(self) -> str:
        """Colour of the view in all others, as 3D Slicer has it."""
        return _COLOURS[self.value]

    @property
    def in_scan(self) -> SlicePlane:
        """The plane of this name along the axes of the scan."""
        return SCAN_FRAME.plane(self.value)


_COLOURS: Mapping[str, str] = MappingProxyType(
    {"axial": "#F34A33", "sagittal": "#EDD54C", "coronal": "#6EB04B"}
)
