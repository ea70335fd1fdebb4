"""TIFF files that hold a whole volume: multi-page, ImageJ, OME."""

from __future__ import annotations

import math
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
        series = max(tif.series, key=lambda one: math.prod(one.shape))
        pages = _Pages.of(series, options.channel, path)
        geometry = stack_geometry(tiff_pixel_size(tif))
        kind = "OME-TIFF" if tif.is_ome else "ImageJ TIFF" if tif.is_imagej else "multi-page TIFF"
        source = _source(path, tif, series, pages, options.channel)
        found = _findings(tif, series, pages, options)
        first = _first_page(series)
        return ImportPlan(
            path=path,
            format=kind,
            files=(path,),
            size=(first.imagewidth, first.imagelength, pages.count),
            stored_dtype=np.dtype(np.uint8) if first.photometric == _PALETTE else np.dtype(series.dtype),
            source=source,
            geometry=geometry,
            found=found,
            options=options,
            name=volume_stem(path),
        )


@dataclass(frozen=True)
class _Pages:
    """Which pages of a series are the slices: `first`, then every `step`, `count` of them."""

    first: int
    step: int
    count: int
    set_aside: str

    @classmethod
    def of(cls, series: tifffile.TiffPageSeries, channel: int | None, path: Path) -> _Pages:
        """Find the stack axis: Z if there is one, else the longest; of the others take the first."""
        n_lead = len(series.axes) - len(_first_page(series).axes)
        axes, shape = series.axes[:n_lead], series.shape[:n_lead]
        if math.prod(shape) < 2 or math.prod(shape) != len(series.pages):
            raise VolumeError(
                f"it holds no stack of slices (axes {series.axes}, {series.shape})",
                file=path,
                remedy="Give the folder of a stack, or a file of several pages.",
            )
        stack = axes.index("Z") if "Z" in axes else max(range(n_lead), key=lambda axis: shape[axis])
        index = [0] * n_lead
        others = [axis for axis in range(n_lead) if axis != stack and shape[axis] > 1]
        for axis in others:
            if axes[axis] == "C" and channel is not None:
                index[axis] = channel
                if not 0 <= channel < shape[axis]:
                    raise GpError(f"channel must be 0 to {shape[axis] - 1}, got {channel}")
        aside = ", ".join(f"{index[axis] + 1} of {shape[axis]} along {axes[axis]}" for axis in others)
        first = int(np.ravel_multi_index(index, shape))
        return cls(first, math.prod(shape[stack + 1 :]), shape[stack], aside)


def _first_page(series: tifffile.TiffPageSeries) -> tifffile.TiffPage:
    page = series.keyframe
    assert isinstance(page, tifffile.TiffPage)
    return page


def _source(
    path: Path, tif: tifffile.TiffFile, series: tifffile.TiffPageSeries, pages: _Pages, channel: int | None
) -> SliceSource:
    page = _first_page(series)
    finish = finishing(page, channel)
    if series.dataoffset is None:
        return _PageSource(path, tif.series.index(series), pages, finish)
    page_bytes = math.prod(page.shape) * page.dtype.itemsize  # type: ignore[union-attr]
    return RawSource(
        path=path,
        offset=series.dataoffset + pages.first * page_bytes,
        dtype=np.dtype(page.dtype).newbyteorder(tif.byteorder),
        plane_shape=page.shape,
        n_planes=pages.count,
        plane_step=pages.step * page_bytes,
        finish=finish,
    )


@dataclass(frozen=True)
class _PageSource:
    """Slices that are pages, each packed or placed for itself."""

    path: Path
    series: int
    pages: _Pages
    finish: Callable[[Plane], Plane]

    def planes(self, wanted: Sequence[int]) -> Iterator[Plane]:
        """Yield the (y, x) grey planes with the numbers `wanted`."""
        with tifffile.TiffFile(self.path) as tif:
            series = tif.series[self.series]
            for number in wanted:
                page = series.pages[self.pages.first + self.pages.step * number]
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


def _findings(
    tif: tifffile.TiffFile, series: tifffile.TiffPageSeries, pages: _Pages, options: ImportOptions
) -> tuple[Problem, ...]:
    page = _first_page(series)
    found = []
    if pages.set_aside:
        found.append(warning("channel", f"of several volumes in it, one is taken: {pages.set_aside}"))
    if page.photometric == _PALETTE:
        found.append(warning("palette", "its colours come from a palette and become grey"))
    elif page.samplesperpixel > 1:
        taken = "luminance" if options.channel is None and page.samplesperpixel > 2 else "one channel"
        found.append(warning("colour", f"its pixels have {page.samplesperpixel} channels; {taken} is taken"))
    if page.photometric == _MIN_IS_WHITE:
        found.append(warning("inverted", "its values run from white to black and are inverted"))
    others = [one for one in tif.series if one is not series]
    if others:
        pages_aside = sum(len(one.pages) for one in others)
        found.append(warning("stray-pages", f"{pages_aside} pages of another size or type are left out"))
    return tuple(found)
