"""TIFF files that hold a whole volume: multi-page, ImageJ, OME."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import tifffile
from PIL import Image

from gp_core.errors import GpError
from gp_labeler.imaging.readers.formats import volume_stem
from gp_labeler.imaging.readers.grey import palette_as_grey, to_grey
from gp_labeler.imaging.readers.options import ImportOptions
from gp_labeler.imaging.readers.pixel_size import stack_geometry, tiff_pixel_size
from gp_labeler.imaging.readers.plan import ImportPlan
from gp_labeler.imaging.readers.problems import Problem, VolumeError, warning
from gp_labeler.imaging.readers.source import Plane, RawSource, SliceSource

__all__ = ["finishing", "inspect_tiff", "is_multi_page", "page_array"]

_MIN_IS_WHITE, _PALETTE = 0, 3


def is_multi_page(path: Path) -> bool:
    """Return whether a TIFF file holds more than one page, or one with depth."""
    with tifffile.TiffFile(path) as tif:
        first = tif.pages.first
        deep = isinstance(first, tifffile.TiffPage) and first.imagedepth > 1
        return deep or len(tif.pages) > 1 or bool(tif.is_imagej and tif.series[0].ndim > 2)


def inspect_tiff(path: Path, options: ImportOptions) -> ImportPlan:
    """Look into a TIFF file of several pages.

    Raises
    ------
    VolumeError
        It holds no volume.
    """
    with tifffile.TiffFile(path) as tif:
        stack = _Stack.of(tif, options.channel, path)
        source = stack.source(path, tif, options.channel)
        first = stack.first
        return ImportPlan(
            path=path,
            format="OME-TIFF" if tif.is_ome else "ImageJ TIFF" if tif.is_imagej else "multi-page TIFF",
            files=(path,),
            size=(first.imagewidth, first.imagelength, len(stack.numbers)),
            stored_dtype=np.dtype(np.uint8 if first.photometric == _PALETTE else first.dtype),
            source=source,
            geometry=stack_geometry(tiff_pixel_size(tif)),
            found=(
                *(source.shortage() if isinstance(source, RawSource) else ()),
                *_findings(stack, options),
            ),
            options=options,
            name=volume_stem(path),
        )


@dataclass(frozen=True, eq=False)
class _Stack:
    """The pages that are slices.

    `series` counts among the file's series; None where pages of one kind were gathered one by one. `numbers`
    count within it, or in the file. `offset` is where its voxels begin, if they lie in one piece.
    """

    series: int | None
    numbers: tuple[int, ...]
    first: tifffile.TiffPage
    offset: int | None = None
    aside: str = ""
    n_others: int = 0

    @classmethod
    def of(cls, tif: tifffile.TiffFile, channel: int | None, path: Path) -> _Stack:
        """Find the slices: the largest series, or, where no series has depth, all pages like the most."""
        series = max(tif.series, key=lambda one: math.prod(one.shape))
        first = series.keyframe
        shape = series.shape[: len(series.axes) - len(first.axes)]
        if math.prod(shape) < 2:
            return cls._gathered(tif, path)
        numbers, aside = _slices_of(series.axes, shape, channel)
        n_others = len(tif.pages) - len(series.pages) if len(tif.series) > 1 else 0
        return cls(tif.series.index(series), numbers, first, series.dataoffset, aside, max(0, n_others))

    @classmethod
    def _gathered(cls, tif: tifffile.TiffFile, path: Path) -> _Stack:
        """Gather pages of the same size and type, as programs leave them that write page by page."""
        kinds: dict[tuple[object, ...], list[int]] = defaultdict(list)
        for number, page in enumerate(tif.pages):
            photometric = None if page.keyframe is None else page.keyframe.photometric
            kinds[page.shape, page.dtype, photometric].append(number)
        numbers = max(kinds.values(), key=len)
        if len(numbers) < 2:
            raise VolumeError(
                f"it holds no stack of slices, but {len(tif.pages)} pages that differ",
                file=path,
                remedy="Give the folder of a stack, or a file of several pages.",
            )
        first = tif.pages[numbers[0]].keyframe
        assert first is not None
        return cls(None, tuple(numbers), first, n_others=len(tif.pages) - len(numbers))

    def source(self, path: Path, tif: tifffile.TiffFile, channel: int | None) -> SliceSource:
        """Return where the slices are read."""
        finish = finishing(self.first, channel)
        if self.offset is None or self.first.dtype is None:
            return _PageSource(path, self.series, self.numbers, finish)
        page_bytes = math.prod(self.first.shape) * self.first.dtype.itemsize
        return RawSource(
            path=path,
            offset=self.offset + self.numbers[0] * page_bytes,
            dtype=np.dtype(self.first.dtype).newbyteorder(tif.byteorder),
            plane_shape=self.first.shape,
            n_planes=len(self.numbers),
            plane_step=(self.numbers[1] - self.numbers[0]) * page_bytes,
            finish=finish,
        )


def _slices_of(axes: str, shape: tuple[int, ...], channel: int | None) -> tuple[tuple[int, ...], str]:
    """Return the pages along Z, else along the longest axis, at the start (or the channel) of all others."""
    stack = (
        axes.index("Z") if "Z" in axes[: len(shape)] else max(range(len(shape)), key=lambda axis: shape[axis])
    )
    others = [axis for axis in range(len(shape)) if axis != stack and shape[axis] > 1]
    index = [0] * len(shape)
    for axis in others:
        if axes[axis] == "C" and channel is not None:
            if not 0 <= channel < shape[axis]:
                raise GpError(f"channel must be 0 to {shape[axis] - 1}, got {channel}")
            index[axis] = channel
    step = math.prod(shape[stack + 1 :])
    first = int(np.ravel_multi_index(index, shape))
    aside = ", ".join(f"{index[axis] + 1} of {shape[axis]} along {axes[axis]}" for axis in others)
    return tuple(range(first, first + step * shape[stack], step)), aside


@dataclass(frozen=True)
class _PageSource:
    """Slices that are pages, each packed or placed for itself."""

    path: Path
    series: int | None
    numbers: tuple[int, ...]
    finish: Callable[[Plane], Plane]

    def planes(self, wanted: Sequence[int]) -> Iterator[Plane]:
        """Yield the (y, x) grey planes with the numbers `wanted`."""
        with tifffile.TiffFile(self.path) as tif:
            pages: Any = tif.pages if self.series is None else tif.series[self.series].pages
            for number in wanted:
                page = pages[self.numbers[number]]
                if page is None:
                    raise VolumeError(f"slice {number + 1} is missing in it", file=self.path)
                yield self.finish(page_array(page, self.path, page.index))


def page_array(page: Any, path: Path, number: int) -> Plane:
    """Return the values of a TIFF page, by Pillow where tifffile lacks the decoder (LZW, JPEG)."""
    try:
        plane: Plane = page.asarray()
    except ValueError as problem:
        if "imagecodecs" not in str(problem):
            raise
        with Image.open(path) as image:
            image.seek(number)
            plane = np.asarray(image)
    return plane


def finishing(page: tifffile.TiffPage, channel: int | None) -> Callable[[Plane], Plane]:
    """Return what makes the values of a page grey: palette, inverted, planar and interleaved colours."""
    if page.photometric == _PALETTE and page.colormap is not None:
        return partial(_finish_palette, colours=page.colormap.T, channel=channel)
    return partial(
        _finish,
        planar=page.axes.startswith("S"),
        inverted=page.photometric == _MIN_IS_WHITE and page.dtype is not None and page.dtype.kind == "u",
        channel=channel,
    )


def _finish_palette(plane: Plane, colours: Plane, channel: int | None) -> Plane:
    return palette_as_grey(plane, colours, channel)


def _finish(plane: Plane, planar: bool, inverted: bool, channel: int | None) -> Plane:
    grey = to_grey(np.moveaxis(plane, 0, -1) if planar and plane.ndim == 3 else plane, channel)
    return np.iinfo(grey.dtype).max - grey if inverted else grey


def _findings(stack: _Stack, options: ImportOptions) -> tuple[Problem, ...]:
    page = stack.first
    found = []
    if stack.aside:
        found.append(warning("channel", f"of several volumes in it, one is taken: {stack.aside}"))
    if page.photometric == _PALETTE:
        found.append(warning("palette", "its colours come from a palette and become grey"))
    elif page.samplesperpixel > 1:
        taken = "luminance" if options.channel is None and page.samplesperpixel > 2 else "one channel"
        found.append(warning("colour", f"its pixels have {page.samplesperpixel} channels; {taken} is taken"))
    if page.photometric == _MIN_IS_WHITE:
        found.append(warning("inverted", "its values run from white to black and are inverted"))
    if stack.n_others:
        found.append(warning("stray-pages", f"{stack.n_others} pages of another size or type are left out"))
    return tuple(found)
