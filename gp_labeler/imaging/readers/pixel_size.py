"""What image files say of the size of their pixels, and whether to believe it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import tifffile

from gp_labeler.imaging.readers.ome import OmeImage
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
    reason : str
        Why a length is not known, where the file says something else in its place.
    warnings : tuple of str
        What a person should know of how the lengths were read.
    """

    x: float | None = None
    y: float | None = None
    z: float | None = None
    said_by: str = ""
    reason: str = ""
    warnings: tuple[str, ...] = ()

    def turned(self) -> PixelSize:
        """Return the size of pixels whose rows and columns are exchanged."""
        return replace(self, x=self.y, y=self.x)


UNKNOWN = PixelSize()


def dots_per_inch(x: float, y: float) -> PixelSize:
    """Return the size of pixels by their number on an inch."""
    if not (np.isfinite([x, y]).all() and min(x, y) > 1):  # 0 and 1 stand for "unknown"
        return UNKNOWN
    return PixelSize(25.4 / x, 25.4 / y, None, "the resolution tag")


def tiff_pixel_size(
    tif: tifffile.TiffFile, page: tifffile.TiffPage, ome: OmeImage | None = None, axis: str = "Z"
) -> PixelSize:
    """Return what an open TIFF says: in its OME or ImageJ description, else in its resolution tags.

    Parameters
    ----------
    tif : TiffFile
        The file.
    page : TiffPage
        A page of the volume that is meant; an overview in the same file has other pixels.
    ome : OmeImage, optional
        What the OME description says of that volume.
    axis : str
        Letter of the axis that the slices run along; along times no distance is given.
    """
    size = _described(tif, page, ome)
    if size != UNKNOWN:
        return replace(size, z=None) if axis == "T" else size
    x, y = page.resolution
    factor = {_INCH: 1.0, _CENTIMETRE: 2.54}.get(int(page.resolutionunit))
    return UNKNOWN if factor is None else dots_per_inch(x * factor, y * factor)


def _described(tif: tifffile.TiffFile, page: tifffile.TiffPage, ome: OmeImage | None) -> PixelSize:
    """Return what the OME or ImageJ description says."""
    if ome is not None and (size := _ome(ome)) != UNKNOWN:
        return size
    x, y = page.resolution
    return _imagej(tif.imagej_metadata, x, y) if tif.imagej_metadata and x > 0 and y > 0 else UNKNOWN


def _imagej(meta: Mapping[str, Any], x: float, y: float) -> PixelSize:
    """Read ImageJ's description; `x` and `y` are pixels per unit. `yunit` and `zunit` may be left out."""
    words = [str(meta.get("unit", ""))]
    words += [str(meta.get(name) or words[0]) for name in ("yunit", "zunit")]
    unit_x, unit_y, unit_z = (unit_in_mm(word) for word in words)
    if unit_x is None or unit_y is None:
        return UNKNOWN
    warnings: tuple[str, ...] = ()
    try:
        depth = float(meta.get("spacing", 0))
    except (TypeError, ValueError, OverflowError):
        depth = 0.0
    if depth < 0:
        warnings = (f"ImageJ's description gives a spacing of {depth:g}; its size counts, as in ImageJ",)
    z = None if depth == 0 or unit_z is None or not np.isfinite(depth) else abs(depth) * unit_z
    reason = "" if unit_z is not None else f"ImageJ's description gives the slice distance in {words[2]!r}"
    return PixelSize(unit_x / x, unit_y / y, z, "ImageJ's description", reason, warnings)


def _ome(image: OmeImage) -> PixelSize:
    x, y, z = image.pixel_mm
    if image.units:
        reason = (
            f"its OME description gives the voxel size in {' and '.join(image.units)}, which is not a length"
        )
        return PixelSize(x, y, z, "its OME description", reason)
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
        return Geometry(sides_known=False, reason=size.reason)
    if size.z is not None and z_factor == 1:
        return Geometry((size.x, size.y, size.z), sides_known=False)
    if size.z is not None:
        reason = (
            f"{size.said_by} gives slices {shown((size.z,))} apart, but their numbers run in steps of "
            f"{z_factor:g}: if slices were removed, the distance is larger"
        )
        suggested: Spacing = (size.x, size.y, size.z * z_factor)
        return Geometry(sides_known=False, suggested=suggested, reason=reason)
    if is_screen_resolution(size.x):
        dpi = round(25.4 / size.x)
        reason = f"the voxel size is not in the file: its {dpi} dpi are a screen's or printer's"
        return Geometry(sides_known=False, reason=reason)
    suggested = (size.x, size.y, size.x * z_factor)
    reason = size.reason or (
        f"{size.said_by} gives pixels of {shown((size.x, size.y))}, but not the distance between slices"
    )
    return Geometry(sides_known=False, suggested=suggested, reason=reason)
