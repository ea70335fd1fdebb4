"""The frame in which directions are named: the axes of the scan, or those of the head within it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from gp_core.frames import RigidTransform
from gp_core.validation import FloatArray, check_option
from gp_labeler.imaging.slice_plane import SlicePlane

__all__ = ["FRAMES", "LETTERS", "SCAN_FRAME", "AnatomicalFrame", "letter_of"]

FRAMES = ("scan", "head")
"""Names of the frames."""

LETTERS = (("R", "L"), ("A", "P"), ("I", "S"))
"""What lies at the negative and the positive end of x, y and z (LPS)."""

_L, _P, _S = np.eye(3)
_ON_SCREEN: Mapping[str, tuple[FloatArray, FloatArray, FloatArray]] = MappingProxyType(
    {"axial": (_L, _P, _S), "sagittal": (_P, -_S, _L), "coronal": (_L, -_S, _P)}
)
"""What is right, down and across (LPS): radiological, the right on the left of the screen, the nose left."""

_SECOND_LETTER = float(np.sin(np.radians(22.5)))


@dataclass(frozen=True, eq=False)
class AnatomicalFrame:
    """Left, posterior and superior as directions in the scan, and where the head's own zero lies.

    Parameters
    ----------
    name : str
        One of `FRAMES`.
    T_frame_scan : RigidTransform
        From the scan to this frame: x left, y posterior, z superior.
    """

    name: str
    T_frame_scan: RigidTransform

    def __post_init__(self) -> None:
        check_option(self.name, "frame", FRAMES)

    @property
    def axes(self) -> FloatArray:
        """(3, 3) unit columns: left, posterior and superior, in the scan."""
        axes: FloatArray = self.T_frame_scan.rotation.T
        return axes

    @property
    def origin(self) -> FloatArray:
        """(3,) scan position that is 0 in this frame, mm."""
        origin: FloatArray = self.T_frame_scan.inverse().translation
        return origin

    def plane(self, name: str) -> SlicePlane:
        """Return the ``axial``, ``sagittal`` or ``coronal`` plane of this frame."""
        return self._planes[name]

    def planes(self) -> dict[str, SlicePlane]:
        """Return all three planes by name."""
        return dict(self._planes)

    @cached_property
    def _planes(self) -> Mapping[str, SlicePlane]:
        axes, origin = self.axes, self.origin
        return {
            name: SlicePlane(axes @ right, axes @ down, axes @ normal, origin)
            for name, (right, down, normal) in _ON_SCREEN.items()
        }

    def components(self, direction: ArrayLike) -> FloatArray:
        """Return the (3,) parts of a scan direction towards left, posterior and superior."""
        parts: FloatArray = np.asarray(direction, dtype=np.float64) @ self.axes
        return parts

    def letter(self, direction: ArrayLike) -> str:
        """Return the letter nearest to a direction of the scan."""
        return letter_of(self.components(direction))

    def letters(self, direction: ArrayLike) -> str:
        """Return one letter, or two where a direction lies between: ``A``, ``AL``; as DICOM has them."""
        parts = self.components(direction)
        order = np.argsort(-np.abs(parts), kind="stable")
        strong = [
            int(axis) for axis in order[:2] if abs(parts[axis]) > _SECOND_LETTER * np.linalg.norm(parts)
        ]
        return "".join(LETTERS[axis][int(parts[axis] > 0)] for axis in strong)

    def edge_letters(self, plane: SlicePlane) -> tuple[str, str, str, str]:
        """Return the letters at the left, right, top and bottom of a view of a plane."""
        right, down = plane.right, plane.down
        return self.letters(-right), self.letters(right), self.letters(-down), self.letters(down)

    def position_text(self, plane: SlicePlane, position: float) -> str:
        """Say where a slice is, such as ``"S 12.4 mm"``; ``"+3.1 mm"`` from its zero where it is oblique."""
        across = self.letters(plane.normal)
        if len(across) > 1:
            return f"{position:+.1f} mm {across}"
        return f"{across if position >= 0 else self.letters(-plane.normal)} {abs(position):.1f} mm"


SCAN_FRAME = AnatomicalFrame("scan", RigidTransform.identity(dst="scan", src="scan"))
"""The axes of the scan itself."""


def letter_of(direction: ArrayLike) -> str:
    """Return the anatomical letter of the scan axis nearest to a direction."""
    vector = np.asarray(direction, dtype=np.float64)
    axis = int(np.abs(vector).argmax())
    return LETTERS[axis][int(vector[axis] > 0)]
