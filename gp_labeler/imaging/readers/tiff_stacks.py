"""Which pages of a TIFF file are the slices of a volume, and in which order."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import tifffile

from gp_labeler.imaging.readers.choosing import FEW
from gp_labeler.imaging.readers.grey import check_channel
from gp_labeler.imaging.readers.ome import OmeImage, ome_images
from gp_labeler.imaging.readers.problems import VolumeError
from gp_labeler.imaging.readers.tiff_pages import check_orientations, is_reduced

__all__ = ["PageStack", "page_stacks"]

_DESCRIBED = (
    "ome",
    "imagej",
    "shaped",
    "stk",
    "lsm",
    "fluoview",
    "nih",
    "micromanager",
    "ndtiff",
    "scanimage",
)
"""Kinds of TIFF of which tifffile knows how pages follow each other; elsewhere the pages say it."""


@dataclass(frozen=True, eq=False)
class PageStack:
    """The pages that are slices.

    Parameters
    ----------
    pages : tuple of int or None
        One for each slice, counted in the series, or in the file; None where a slice is missing.
    first : TiffPage
        The page that stands for all.
    series : int, optional
        Which of the file's series they count in; None: they count in the file.
    offset : int, optional
        Byte where page 0 begins, if pages lie in one piece.
    name, text : str
        What the option `series` takes, and what a person chooses by.
    aside : str
        Which channel or time it is, where there are several.
    axis : str
        Letter of the axis that the slices run along, as tifffile has it.
    n_others : int
        Pages of the file that belong to no stack.
    odd : tuple of str
        Pages between the slices that differ from them.
    ome : OmeImage, optional
        What the file's OME description says of it.
    deep : bool
        Whether all slices are in one page.
    """

    pages: tuple[int | None, ...]
    first: tifffile.TiffPage
    series: int | None = None
    offset: int | None = None
    name: str = ""
    text: str = ""
    aside: str = ""
    axis: str = "I"
    n_others: int = 0
    odd: tuple[str, ...] = ()
    ome: OmeImage | None = None
    deep: bool = False


def page_stacks(
    tif: tifffile.TiffFile, pages: tifffile.TiffFile, channel: int | None, path: Path
) -> list[PageStack]:
    """Return the volumes of a TIFF file, the largest first; small ones, as overviews are, are left out.

    Parameters
    ----------
    tif, pages : TiffFile
        The file, opened twice: once asked for its series, tifffile does not read every page for itself.
    channel : int, optional
        Which of several channels.
    path : Path
        To name in errors.

    Raises
    ------
    VolumeError
        There is none.
    """
    images, companion = ome_images(tif.ome_metadata or "", path.parent) if tif.is_ome else ((), "")
    first = tif.pages.first
    assert isinstance(first, tifffile.TiffPage)
    if first.imagedepth > 1:
        return [PageStack(tuple(range(first.imagedepth)), first, deep=True)]
    if (one_ifd := _imagej_in_one_ifd(tif, first, channel)) is not None:
        return [one_ifd]
    described = any(getattr(tif, f"is_{kind}", False) for kind in _DESCRIBED) and not companion
    found = list(_described(tif, images, channel)) if described else []
    found = found or _gathered(pages, path)
    if not found:
        raise VolumeError(
            f"it holds no stack of slices, but {len(tif.pages)} pages that differ",
            file=path,
            remedy="Give the folder of a stack, or a file of several pages.",
        )
    if companion:
        found = [_with_companion(found[0], images, companion, path)]
    voxels = [len(stack.pages) * math.prod(stack.first.shape) for stack in found]
    order = sorted(range(len(found)), key=lambda n: -voxels[n])
    return [found[n] for n in order if voxels[n] >= FEW * max(voxels)]


def _described(
    tif: tifffile.TiffFile, images: tuple[OmeImage, ...], channel: int | None
) -> Iterator[PageStack]:
    """Yield the series that have depth."""
    left = list(images)
    for number, series in enumerate(tif.series):
        first = series.keyframe
        shape = series.shape[: len(series.axes) - len(first.axes)]
        image = next((image for image in left if _is_of(image, series)), None)
        if image is not None:
            left.remove(image)
        if math.prod(shape) < 2:
            continue
        numbers, aside, axis = _slices_of(series.axes, shape, channel)
        in_one_piece = series.dataoffset is not None and _in_this_file(series, tif)
        name = series.name or f"series {number + 1}"
        yield PageStack(
            pages=tuple(n if in_one_piece or series.pages[n] is not None else None for n in numbers),
            first=first,
            series=number,
            offset=series.dataoffset if in_one_piece else None,
            name=name,
            text=f"{name} ({first.imagewidth} x {first.imagelength} x {len(numbers)})",
            aside=aside,
            axis=axis,
            n_others=max(0, len(tif.pages) - len(series.pages)) if len(tif.series) > 1 else 0,
            ome=image,
        )


def _is_of(image: OmeImage, series: tifffile.TiffPageSeries) -> bool:
    """Return whether an image of an OME description has the sizes of a series."""
    sizes = dict(zip(series.axes, series.shape, strict=False))
    return all(sizes.get(axis, 1) == image.sizes[axis] for axis in "XYZ")


def _in_this_file(series: tifffile.TiffPageSeries, tif: tifffile.TiffFile) -> bool:
    return all(page is None or page.parent is tif for page in series.pages)


def _slices_of(axes: str, shape: tuple[int, ...], channel: int | None) -> tuple[tuple[int, ...], str, str]:
    """Return the pages along Z, else along the longest axis, at the start (or the channel) of all others."""
    before = axes[: len(shape)]
    stack = before.index("Z") if "Z" in before else max(range(len(shape)), key=lambda axis: shape[axis])
    others = [axis for axis in range(len(shape)) if axis != stack and shape[axis] > 1]
    index = [0] * len(shape)
    for axis in others:
        if axes[axis] == "C" and channel is not None:
            check_channel(channel, shape[axis])
            index[axis] = channel
    step = math.prod(shape[stack + 1 :])
    first = int(np.ravel_multi_index(index, shape))
    aside = ", ".join(f"{index[axis] + 1} of {shape[axis]} along {axes[axis]}" for axis in others)
    return tuple(range(first, first + step * shape[stack], step)), aside, axes[stack]


def _imagej_in_one_ifd(
    tif: tifffile.TiffFile, first: tifffile.TiffPage, channel: int | None
) -> PageStack | None:
    """Return the slices that ImageJ wrote one behind the other after a single page, or None."""
    meta = tif.imagej_metadata or {}
    shape = tuple(int(meta.get(name, 1)) for name in ("frames", "slices", "channels"))
    n_images = int(meta.get("images", 1))
    if len(tif.pages) > 1 or n_images < 2 or not first.dataoffsets or not first.is_final:
        return None
    if math.prod(shape) != n_images:
        shape = (1, n_images, 1)
    numbers, aside, axis = _slices_of("TZC" + first.axes, shape, channel)
    if len(numbers) < 2:
        return None
    return PageStack(numbers, first, offset=first.dataoffsets[0], aside=aside, axis=axis)


def _gathered(tif: tifffile.TiffFile, path: Path) -> list[PageStack]:
    """Gather pages of the same size and type, as programs leave them that write page by page.

    Single pages of another kind in between are slices gone wrong; many of them are something else.
    """
    kinds: dict[tuple[object, ...], list[int]] = defaultdict(list)
    pages: dict[int, tifffile.TiffPage] = {}
    for number, page in enumerate(tif.pages):
        if not isinstance(page, tifffile.TiffPage) or is_reduced(page):
            continue
        kind = (page.shape, page.dtype, page.photometric, page.samplesperpixel)
        kinds[kind].append(number)
        pages[number] = page
    stacks = [numbers for numbers in kinds.values() if len(numbers) > 1]
    found = []
    for n, numbers in enumerate(stacks):
        strange = {m for m in pages if numbers[0] < m < numbers[-1]} - set(numbers)
        between = sorted(strange) if len(strange) <= max(1, FEW * len(numbers)) else []
        slices = sorted({*numbers, *between})
        first = pages[numbers[0]]
        check_orientations([pages[m] for m in numbers], path)
        name = f"pages of {first.imagewidth} x {first.imagelength}"
        found.append(
            PageStack(
                pages=tuple(None if m in strange else m for m in slices),
                first=first,
                name=name if len(stacks) > 1 else f"stack {n + 1}",
                text=f"{len(slices)} {name} pixels, {first.dtype}",
                n_others=len(pages) - len(slices),
                odd=tuple(f"page {m + 1} ({_kind(pages[m])})" for m in between),
            )
        )
    return found


def _kind(page: tifffile.TiffPage) -> str:
    return f"{page.imagewidth} x {page.imagelength} {page.dtype}"


def _with_companion(stack: PageStack, images: tuple[OmeImage, ...], companion: str, path: Path) -> PageStack:
    """Return a stack with the image of a companion file that fits it."""
    if not images:
        raise VolumeError(
            f"its OME description is in the file {companion}, which is not there",
            file=path,
            remedy=f"Put {companion} into its folder, or save the volume as one OME-TIFF file.",
        )
    sizes = {"X": stack.first.imagewidth, "Y": stack.first.imagelength, "Z": len(stack.pages)}
    fitting = [image for image in images if all(image.sizes[axis] == n for axis, n in sizes.items())]
    if not fitting:
        raise VolumeError(
            f"its {len(stack.pages)} pages are no image of the description in {companion}",
            file=path,
            remedy="Save the volume as one OME-TIFF file, in Fiji or Bio-Formats.",
        )
    return replace(stack, ome=fitting[0])
