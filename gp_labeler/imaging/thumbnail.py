"""A small picture of a head, made of the bone surface that is there already: no voxel is read for it."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from gp_labeler.imaging.mesh import Surface

__all__ = ["THUMBNAIL_SIZE", "thumbnail"]

THUMBNAIL_SIZE = (128, 96)
"""Width and height, pixels."""

_BONE = np.array([236.0, 224.0, 200.0])
_MARGIN = 0.94
_SUPERSAMPLED = 2
_FARTHEST_SHADE = 0.35


def thumbnail(surfaces: Sequence[Surface]) -> bytes | None:
    """Draw a head as seen from its left, as PNG with a transparent background.

    It shows bone alone, no points: in the list of specimens nobody sees what another observer placed.

    Parameters
    ----------
    surfaces : sequence of Surface
        The bone; the corners of its triangles lie closer than the pixels.

    Returns
    -------
    bytes or None
        None where there is no surface.
    """
    points = [surface.points for surface in surfaces if len(surface.points)]
    if not points:
        return None
    corners = np.concatenate(points)
    width, height = (n * _SUPERSAMPLED for n in THUMBNAIL_SIZE)
    low, high = corners.min(axis=0), corners.max(axis=0)
    middle, size = (low + high) / 2, np.maximum(high - low, 1e-3)
    scale = _MARGIN * min(width / size[1], height / size[2])
    x = ((corners[:, 1] - middle[1]) * scale + width / 2).astype(np.intp)
    y = ((middle[2] - corners[:, 2]) * scale + height / 2).astype(np.intp)
    depth = np.full((height, width), -np.inf, np.float32)
    np.maximum.at(depth, (y.clip(0, height - 1), x.clip(0, width - 1)), corners[:, 0])
    return _png(_shaded(_closed(depth), scale, float(size[0])))


def _closed(depth: NDArray[np.float32]) -> NDArray[np.float32]:
    """Fill the gaps between the corners of a coarse mesh."""
    from scipy.ndimage import grey_closing, uniform_filter

    seen = np.isfinite(depth)
    low = depth[seen].min() - 1000.0
    filled = grey_closing(np.where(seen, depth, low), size=(5, 5))
    is_bone = filled > low + 500.0
    weight = uniform_filter(is_bone.astype(np.float32), 3)
    smooth = uniform_filter(np.where(is_bone, filled, 0.0), 3) / np.maximum(weight, 1e-6)
    closed: NDArray[np.float32] = np.where(is_bone, smooth, -np.inf).astype(np.float32)
    return closed


def _shaded(depth: NDArray[np.float32], scale: float, thickness: float) -> NDArray[np.uint8]:
    """Return RGBA: bright where the surface faces the viewer and lies near."""
    seen = np.isfinite(depth)
    filled = np.where(seen, depth, depth[seen].min())
    down, right = np.gradient(filled * scale)
    facing = 1 / np.sqrt(1 + 0.25 * (down**2 + right**2))
    near = 1 - (filled.max() - filled) / thickness * _FARTHEST_SHADE
    rgba = np.zeros((*depth.shape, 4), np.uint8)
    rgba[..., :3] = (_BONE * (0.25 + 0.75 * facing * near)[..., None]).clip(0, 255)
    rgba[..., 3] = 255 * seen
    return rgba


def _png(rgba: NDArray[np.uint8]) -> bytes:
    from PIL import Image  # here: the window need not wait for it

    buffer = io.BytesIO()
    small = Image.fromarray(rgba, "RGBA").resize(THUMBNAIL_SIZE, Image.Resampling.BOX)
    small.save(buffer, "PNG", optimize=True)
    return buffer.getvalue()
