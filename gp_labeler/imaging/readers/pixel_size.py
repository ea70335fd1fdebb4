"""What image files say of the size of their pixels, and whether to believe it."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass

import numpy as np
import tifffile

from gp_labeler.imaging.readers.options import Spacing
from gp_labeler.imaging.readers.plan import Geometry
from gp_labeler.imaging.readers.spacing import is_screen_resolution, shown, unit_in_mm

__all__ = ["UNKNOWN", "PixelSize", "dots_per_inch", "stack_geometry", "tiff_pixel_size"]

_INCH, _CENTIMETRE = 2, 3


@dataclass(frozen=True)
class PixelSize:
    """Lengths in mm, None where the file does not say.

    Parameters
    ----------
    x, y, z : float, mm, optional
        Pixel size, and the distance of slices.
    said_by : str
        Which part of the file says so.
    """

    x: float | None = None
    y: float | None = None
    z: float | None = None
    said_by: str = ""


UNKNOWN = PixelSize()


def dots_per_inch(x: float, y: float) -> PixelSize:
    """Return the size of pixels by their number on an inch."""
    if not (np.isfinite([x, y]).all() and min(x, y) > 1):  # 0 and 1 stand for "unknown"
        return UNKNOWN
    return PixelSize(25.4 / x, 25.4 / y, None, "the resolution tag")


def tiff_pixel_size(tif: tifffile.TiffFile) -> PixelSize:
    """Return what an open TIFF says: in its OME or ImageJ description, else in its resolution tags."""
    if tif.ome_metadata and (size := _ome(tif.ome_metadata)) != UNKNOWN:
        return size
    page = tif.pages.first
    assert isinstance(page, tifffile.TiffPage)
    x, y = page.resolution
    if tif.imagej_metadata and x > 0 and y > 0:
        unit = unit_in_mm(str(tif.imagej_metadata.get("unit", "")))
        depth = tif.imagej_metadata.get("spacing")
        if unit is not None:
            z = None if depth is None or float(depth) <= 0 else float(depth) * unit
            return PixelSize(unit / x, unit / y, z, "ImageJ's description")
    factor = {_INCH: 1.0, _CENTIMETRE: 2.54}.get(int(page.resolutionunit))
    return UNKNOWN if factor is None else dots_per_inch(x * factor, y * factor)


def _ome(text: str) -> PixelSize:
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError:
        return UNKNOWN
    pixels = next((element for element in root.iter() if element.tag.endswith("Pixels")), None)
    if pixels is None:
        return UNKNOWN

    def length(axis: str) -> float | None:
        unit = unit_in_mm(pixels.get(f"PhysicalSize{axis}Unit", "µm"))
        try:
            value = float(pixels.get(f"PhysicalSize{axis}", ""))
        except ValueError:
            return None
        return value * unit if unit is not None and value > 0 else None

    x, y, z = length("X"), length("Y"), length("Z")
    return UNKNOWN if x is None or y is None else PixelSize(x, y, z, "its OME description")


def stack_geometry(size: PixelSize, z_factor: float = 1.0) -> Geometry:
    """Make the geometry of a stack: no side is known, and the slice distance only where a file gives it.

    Parameters
    ----------
    size : PixelSize
        What a slice says.
    z_factor : float
        Numbers from one slice to the next.
    """
    if size.x is None or size.y is None:
        return Geometry(sides_known=False)
    if size.z is not None:
        return Geometry((size.x, size.y, size.z * z_factor), sides_known=False)
    if is_screen_resolution(size.x):
        dpi = round(25.4 / size.x)
        reason = f"the voxel size is not in the file: its {dpi} dpi are a screen's or printer's"
        return Geometry(sides_known=False, reason=reason)
    suggested: Spacing = (size.x, size.y, size.x * z_factor)
    reason = (
        f"{size.said_by} gives pixels of {shown((size.x, size.y))}, but nothing gives the distance of slices"
    )
    return Geometry(sides_known=False, suggested=suggested, reason=reason)
