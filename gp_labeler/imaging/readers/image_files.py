"""One slice in a BMP, PNG, JPEG or JPEG 2000 file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from gp_labeler.imaging.readers.grey import palette_as_grey, to_grey
from gp_labeler.imaging.readers.orientation import ORIENTATION_TAG, oriented, swaps_axes
from gp_labeler.imaging.readers.pixel_size import UNKNOWN, PixelSize, dots_per_inch
from gp_labeler.imaging.readers.source import Plane

__all__ = ["image_header", "image_pixel_size", "read_image"]

_WIDE_MODES = {"I": "int32", "F": "float32"}


def image_header(path: Path) -> tuple[tuple[int, int], np.dtype[Any], int, bool, int]:
    """Return (rows, columns), number type, channels, whether it has a palette, and the tag Orientation."""
    with Image.open(path) as image:
        wide = "uint16" if ";16" in image.mode or _is_wide_colour(path) else "uint8"
        orientation = _orientation(image)
        stored = (image.height, image.width)
        return (
            stored[::-1] if swaps_axes(orientation) else stored,
            np.dtype(_WIDE_MODES.get(image.mode, wide)),
            len(image.getbands()),
            image.mode in ("P", "PA"),
            orientation,
        )


def image_pixel_size(path: Path) -> PixelSize:
    """Return what the file says of the size of its pixels, as stored."""
    with Image.open(path) as image:
        dpi = image.info.get("dpi")
        return dots_per_inch(float(dpi[0]), float(dpi[1])) if dpi else UNKNOWN


def read_image(path: Path, channel: int | None) -> Plane:
    """Return the (y, x) grey values of a file."""
    with Image.open(path) as image:
        grey = _wide_colours(path, channel) if _is_wide_colour(path) else _grey(image, channel)
        return np.asarray(oriented(grey, _orientation(image)))


def _grey(image: Image.Image, channel: int | None) -> Plane:
    if image.mode in ("P", "PA"):
        colours = np.array(image.getpalette("RGB"), np.uint8).reshape(-1, 3)
        indices = np.asarray(image)
        return palette_as_grey(indices if indices.ndim == 2 else indices[..., 0], colours, channel)
    usual = image.convert("RGB") if image.mode in ("CMYK", "YCbCr", "LAB", "HSV") else image
    return to_grey(np.asarray(usual), channel)


def _is_wide_colour(path: Path) -> bool:
    """Return whether it is a PNG with 16 bits a channel and several channels, of which Pillow keeps 8."""
    with path.open("rb") as file:
        head = file.read(26)
    return head.startswith(b"\x89PNG") and len(head) == 26 and head[24] == 16 and head[25] in (2, 4, 6)


def _wide_colours(path: Path, channel: int | None) -> Plane:
    import imagecodecs  # takes a while, and is rarely needed

    with Image.open(path) as image:
        image.verify()  # libpng writes to the terminal where a checksum is wrong
    return to_grey(np.asarray(imagecodecs.png_decode(path.read_bytes())), channel)


def _orientation(image: Image.Image) -> int:
    """Return the tag Orientation of an open image, 1 where it has none; reads no pixels."""
    raw = image.info.get("exif")
    if not raw:
        return 1
    exif = Image.Exif()
    exif.load(raw)
    value = exif.get(ORIENTATION_TAG, 1)
    return value if isinstance(value, int) and 1 <= value <= 8 else 1
