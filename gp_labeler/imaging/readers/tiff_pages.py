"""One page of a TIFF file: whether it can be read, its values, and how they become a grey slice."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import tifffile

from gp_labeler.imaging.readers.grey import palette_as_grey, to_grey
from gp_labeler.imaging.readers.orientation import ORIENTATION_TAG, orienting, swaps_axes
from gp_labeler.imaging.readers.problems import Problem, VolumeError, names, warning
from gp_labeler.imaging.readers.source import Plane

__all__ = [
    "PALETTE",
    "check_orientations",
    "check_page",
    "finishing",
    "full_page",
    "grey_dtype",
    "is_reduced",
    "orientation_of",
    "orientation_problems",
    "page_problems",
    "page_shape",
]

PALETTE = 3
_MIN_IS_WHITE, _YCBCR = 0, 6
_GREY_OR_COLOUR = {_MIN_IS_WHITE, 1, 2, PALETTE, _YCBCR}
_REDUCED, _MASK = 1, 4
_UNPACKED_AT_MOST = {1: 1, 5: 1400, 8: 1032, 32946: 1032, 32773: 64}
"""Bytes that one stored byte can stand for at most: none, LZW, Deflate, PackBits."""


def is_reduced(page: Any) -> bool:
    """Return whether a page is marked as a smaller copy or a mask of another one (tag NewSubfileType)."""
    return bool(int(page.subfiletype) & (_REDUCED | _MASK)) if hasattr(page, "subfiletype") else False


def full_page(tif: tifffile.TiffFile, path: Path) -> tifffile.TiffPage:
    """Return the page that stands for a file of one slice: the largest, no thumbnail.

    Raises
    ------
    VolumeError
        Several are as large.
    """
    pages = [page for page in tif.pages if isinstance(page, tifffile.TiffPage) and not is_reduced(page)]
    if not pages:
        first = tif.pages.first
        assert isinstance(first, tifffile.TiffPage)
        return first
    page = max(pages, key=lambda page: page.imagelength * page.imagewidth)
    n_alike = sum(other.shape == page.shape for other in pages)
    if n_alike > 1 or page.imagedepth > 1:
        raise VolumeError(
            f"it holds {max(n_alike, page.imagedepth)} slices; a stack has one slice in each file",
            file=path,
            remedy="Put files that are volumes by themselves into folders of their own.",
        )
    return page


def orientation_of(page: tifffile.TiffPage) -> int:
    """Return the value of the tag Orientation, 1 to 8; 1 where it is missing or makes no sense."""
    value = page.tags.valueof(ORIENTATION_TAG, default=1)
    return int(value) if isinstance(value, int) and 1 <= value <= 8 else 1  # an enumeration in old tifffile


def check_orientations(pages: Sequence[tifffile.TiffPage], path: Path) -> None:
    """Raise `VolumeError` where slices of one file are turned differently; the first may speak for all."""
    found = {page.tags.valueof(ORIENTATION_TAG, default=None) for page in pages[1:]} - {None}
    said = {int(value) if isinstance(value, int) else value for value in found}
    if said - {orientation_of(pages[0])}:
        values = names([str(value) for value in sorted({*said, orientation_of(pages[0])})])
        raise VolumeError(
            f"its pages have the tag Orientation {values}: they are not aligned",
            file=path,
            remedy="Save the slices again with one orientation.",
        )


def page_shape(page: tifffile.TiffPage) -> tuple[int, int]:
    """Return the (rows, columns) of the picture."""
    shape = (page.imagelength, page.imagewidth)
    return shape[::-1] if swaps_axes(orientation_of(page)) else shape


def grey_dtype(page: tifffile.TiffPage) -> np.dtype[Any]:
    """Return the type of the page's grey values."""
    return np.dtype(np.uint8 if page.photometric == PALETTE else page.dtype)


def check_page(page: tifffile.TiffPage, path: Path) -> None:
    """Raise `VolumeError` where a page cannot be read, with the tag that says so and what to do."""
    if page.dtype is None:
        raise VolumeError(
            f"its voxels have a type that is not read (BitsPerSample {page.bitspersample}, "
            f"SampleFormat {page.sampleformat})",
            file=path,
            remedy="Save it with 8 or 16 bits a voxel.",
        )
    if page.photometric not in _GREY_OR_COLOUR:
        raise VolumeError(
            f"its tag PhotometricInterpretation is {_name(page.photometric)}, "
            "which is neither grey values nor RGB",
            file=path,
            remedy="Save it as grey values.",
        )
    try:
        _ = tifffile.TIFF.DECOMPRESSORS[page.compression]
    except KeyError:
        raise VolumeError(
            f"its tag Compression is {_name(page.compression)}, which needs the package imagecodecs",
            file=path,
            remedy="Install it (pip install imagecodecs), or save the file without compression.",
        ) from None

    have, most = sum(page.databytecounts), _UNPACKED_AT_MOST.get(int(page.compression))
    need = int(np.prod(page.shape)) * int(np.max(page.bitspersample)) // 8
    if most is not None and have * most < need:
        raise VolumeError(
            f"a page of it holds {have:,} bytes, too few for {need:,}: it is incomplete",
            file=path,
            remedy="Copy it again.",
        )


def _name(value: Any) -> str:
    return f"{getattr(value, 'name', '')} ({int(value)})".strip()


def finishing(page: tifffile.TiffPage, channel: int | None) -> Callable[[Plane], Plane]:
    """Return what makes a grey slice of the values of a page: palette, colours, inversion, orientation."""
    finish: Callable[[Plane], Plane]
    if page.photometric == PALETTE and page.colormap is not None:
        finish = partial(palette_as_grey, colours=page.colormap.T, channel=channel)
    elif page.ndim == 2 and page.photometric != _MIN_IS_WHITE:
        finish = to_grey  # the values themselves
    else:
        finish = partial(
            _finish,
            planar=page.axes.startswith("S"),
            white=_white(page) if page.photometric == _MIN_IS_WHITE else None,
            channel=0 if page.photometric == _YCBCR and not _is_jpeg(page) else channel,
        )
    return orienting(finish, orientation_of(page))


def _is_jpeg(page: tifffile.TiffPage) -> bool:
    """Return whether tifffile turns YCbCr into RGB, as it does where the page is JPEG."""
    return "JPEG" in getattr(page.compression, "name", "")


def _white(page: tifffile.TiffPage) -> int:
    """Return the value that becomes 0; unsigned values keep their range, others change their sign only."""
    unsigned = page.dtype is not None and page.dtype.kind in "bu"
    return (1 << int(np.max(page.bitspersample))) - 1 if unsigned else 0


def _finish(plane: Plane, planar: bool, white: int | None, channel: int | None) -> Plane:
    grey = to_grey(np.moveaxis(plane, 0, -1) if planar and plane.ndim == 3 else plane, channel)
    if white is None:
        return grey
    if grey.dtype.kind in "bi":  # -1 - value: the sign changes, and the lowest value has a place to go
        return np.asarray(np.invert(grey))
    return np.asarray(grey.dtype.type(white) - grey)


def page_problems(page: tifffile.TiffPage, channel: int | None) -> list[Problem]:
    """Return what a user should know of how a page becomes grey values."""
    found = []
    if page.photometric == PALETTE:
        found.append(warning("palette", "its colours come from a palette and become grey"))
    elif page.samplesperpixel > 1:
        taken = "luminance" if channel is None and page.samplesperpixel > 2 else "one channel"
        found.append(warning("colour", f"its pixels have {page.samplesperpixel} channels; {taken} is taken"))
    if page.photometric == _MIN_IS_WHITE:
        found.append(warning("inverted", "its values run from white to black and are inverted"))
    found += orientation_problems({orientation_of(page)})
    return found


def orientation_problems(orientations: set[int]) -> list[Problem]:
    """Return the note that pictures are turned or mirrored as their tag Orientation says."""
    turned = sorted(orientations - {1})
    if not turned:
        return []
    values = " and ".join(map(str, turned))
    return [warning("orientation", f"rows and columns are oriented as the tag Orientation ({values}) says")]
