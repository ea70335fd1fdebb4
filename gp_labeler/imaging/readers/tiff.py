"""TIFF files that hold a whole volume: multi-page, ImageJ, OME."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tifffile

from gp_labeler.imaging.readers.choosing import Choice, choose
from gp_labeler.imaging.readers.formats import volume_stem
from gp_labeler.imaging.readers.options import ImportOptions
from gp_labeler.imaging.readers.orientation import swaps_axes
from gp_labeler.imaging.readers.pixel_size import stack_geometry, tiff_pixel_size
from gp_labeler.imaging.readers.plan import ImportPlan
from gp_labeler.imaging.readers.problems import Problem, VolumeError, names, warning
from gp_labeler.imaging.readers.source import Plane, RawSource, SliceSource, in_threads, nearest_there
from gp_labeler.imaging.readers.tiff_pages import (
    check_page,
    finishing,
    grey_dtype,
    is_reduced,
    orientation_of,
    page_problems,
    page_shape,
)
from gp_labeler.imaging.readers.tiff_stacks import PageStack, page_stacks

__all__ = ["inspect_tiff", "is_multi_page"]


def is_multi_page(path: Path) -> bool:
    """Return whether a TIFF file holds several slices: smaller copies and masks of a slice are none.

    Raises
    ------
    VolumeError
        It holds nothing.
    """
    with tifffile.TiffFile(path) as tif:
        if not len(tif.pages):
            raise VolumeError("it holds no image", file=path, remedy="Copy it again.")
        first = tif.pages.first
        if isinstance(first, tifffile.TiffPage) and first.imagedepth > 1:
            return True
        if len(tif.pages) == 1:
            imagej = tif.imagej_metadata or {}
            return bool(imagej.get("images", 1) > 1 or tif.is_stk)
        shapes = set()
        for page in tif.pages:
            if is_reduced(page):
                continue
            if page.shape in shapes:
                return True
            shapes.add(page.shape)
        return False


def inspect_tiff(path: Path, options: ImportOptions) -> ImportPlan:
    """Look into a TIFF file of several pages.

    Raises
    ------
    VolumeError
        It holds no volume, or none that can be read.
    """
    with tifffile.TiffFile(path) as tif, tifffile.TiffFile(path) as pages:
        stacks = page_stacks(tif, pages, options.channel, path)
        choices = tuple(Choice(stack.name, stack.text, len(stack.pages)) for stack in stacks)
        index, rivals = choose(choices, options, None, path)
        stack = stacks[index]
        check_page(stack.first, path)
        source = _source(stack, path, tif if stack.series is not None else pages, options.channel)
        size = tiff_pixel_size(tif, stack.first, stack.ome, stack.axis)
        rows, columns = page_shape(stack.first)
        return ImportPlan(
            path=path,
            format="OME-TIFF" if tif.is_ome else "ImageJ TIFF" if tif.is_imagej else "multi-page TIFF",
            files=(path,),
            size=(columns, rows, len(stack.pages)),
            stored_dtype=grey_dtype(stack.first),
            source=source,
            geometry=stack_geometry(size.turned() if swaps_axes(orientation_of(stack.first)) else size),
            found=(
                *rivals,
                *(source.shortage() if isinstance(source, RawSource) else ()),
                *_findings(stack, path),
                *(warning("pixel-size", text) for text in size.warnings),
                *_calibration(tif.imagej_metadata or {}),
                *page_problems(stack.first, options.channel),
            ),
            choices=choices if len(choices) > 1 else (),
            choice=stack.name if len(choices) > 1 else None,
            options=options,
            name=volume_stem(path),
        )


def _findings(stack: PageStack, path: Path) -> list[Problem]:
    found = []
    if stack.aside:
        found.append(warning("channel", f"of several volumes in it, one is taken: {stack.aside}"))
    if stack.n_others:
        found.append(warning("stray-pages", f"{stack.n_others} pages of another size or type are left out"))
    gone = [
        name for name in (stack.ome.files if stack.ome else ()) if name and not (path.parent / name).is_file()
    ]
    missing = [n + 1 for n, page in enumerate(stack.pages) if page is None]
    if missing and gone and not stack.odd:
        text = f"its OME description puts slices into files that are not there: {names(gone)}"
        found.append(Problem("missing-file", text, remedy="Put them into its folder."))
    elif missing:
        which = names([*stack.odd] or [f"page {number}" for number in missing], 6)
        text = f"pages between its slices are missing or differ from them in size or type: {which}"
        remedy = "Save it again, or accept copies of the neighbouring slices (--accept slice-size)."
        found.append(Problem("slice-size", text, remedy=remedy, resolved_by=("accept",)))
    return found


def _calibration(meta: Mapping[str, Any]) -> list[Problem]:
    """Say so where ImageJ shows other grey values than it stores: nobody else calibrates them."""
    if "cf" not in meta or (meta["cf"], meta.get("c0", 0), meta.get("c1", 1)) == (0, 0, 1):
        return []
    numbers = ", ".join(f"{name}={meta[name]}" for name in ("cf", "c0", "c1", "vunit") if name in meta)
    return [warning("calibration", f"ImageJ's calibration of its grey values ({numbers}) is not applied")]


def _source(stack: PageStack, path: Path, tif: tifffile.TiffFile, channel: int | None) -> SliceSource:
    """Return where the slices are read: in one piece where they lie so, else page by page."""
    finish = finishing(stack.first, channel)
    if stack.deep:
        return _DeepPage(path, finish)
    if stack.offset is None:
        there = [page for page in stack.pages if page is not None]
        numbers = tuple(there[n] for n in nearest_there([page is not None for page in stack.pages]))
        slices = _PageSource(path, stack.series, numbers, finish)
        return _evenly_placed(slices, stack.first, tif) or slices
    first = stack.first
    dtype = np.dtype(first.dtype).newbyteorder(tif.byteorder)
    page_bytes = int(np.prod(first.shape)) * dtype.itemsize
    numbers = tuple(page or 0 for page in stack.pages)
    return RawSource(
        path=path,
        offset=stack.offset + numbers[0] * page_bytes,
        dtype=dtype,
        plane_shape=first.shape,
        n_planes=len(numbers),
        plane_step=(numbers[1] - numbers[0]) * page_bytes,
        finish=finish,
    )


def _evenly_placed(slices: _PageSource, first: tifffile.TiffPage, tif: tifffile.TiffFile) -> RawSource | None:
    """Return the slices as one piece of the file, where each is one, and they lie at even distances.

    So they do where a program writes page after page without compression, the tags of each beside it.
    """
    if not first.is_contiguous or first.dtype is None:
        return None
    dtype = np.dtype(first.dtype).newbyteorder(tif.byteorder)
    n_bytes = int(np.prod(first.shape)) * dtype.itemsize
    begins = []
    for page in slices.pages_of(tif):
        offsets, counts = np.array(page.dataoffsets), np.array(page.databytecounts)
        in_one_piece = len(offsets) and (offsets[1:] == (offsets + counts)[:-1]).all()
        if not in_one_piece or counts.sum() != n_bytes or page.parent is not tif:
            return None
        begins.append(int(offsets[0]))
    steps = set(np.diff(begins).tolist())
    if len(steps) != 1 or min(steps) < n_bytes:
        return None
    return RawSource(
        path=slices.path,
        offset=begins[0],
        dtype=dtype,
        plane_shape=first.shape,
        n_planes=len(begins),
        plane_step=steps.pop(),
        finish=slices.finish,
    )


@dataclass(frozen=True)
class _PageSource:
    """Slices that are pages, each packed or placed for itself.

    Parameters
    ----------
    path : Path
        The file.
    series : int, optional
        Which of its series `numbers` count in; None where they count all pages of the file.
    numbers : tuple of int
        One for each slice.
    finish : callable
        Makes a page grey.
    """

    path: Path
    series: int | None
    numbers: tuple[int, ...]
    finish: Callable[[Plane], Plane]

    def planes(self, wanted: Sequence[int]) -> Iterator[Plane]:
        """Yield the (y, x) grey planes with the numbers `wanted`; pages are unpacked by several threads."""
        with tifffile.TiffFile(self.path) as tif:
            pages: Any = tif.pages if self.series is None else tif.series[self.series].pages
            tif.filehandle.set_lock(True)
            chosen = (self._page(tif, pages, self.numbers[number]) for number in wanted)
            one_file = self.series is None or all(page is None or page.parent is tif for page in pages)
            yield from in_threads(self._plane, chosen) if one_file else map(self._plane, chosen)

    def pages_of(self, tif: tifffile.TiffFile) -> Iterator[Any]:
        """Yield the page of each slice, of the file as it is open."""
        pages: Any = tif.pages if self.series is None else tif.series[self.series].pages
        yield from (pages[number] for number in self.numbers)

    @staticmethod
    def _page(tif: tifffile.TiffFile, pages: Any, number: int) -> Any:
        with tif.filehandle.lock:  # other threads read from the same file
            return pages[number]

    def _plane(self, page: Any) -> Plane:
        return self.finish(page.asarray(maxworkers=1))


@dataclass(frozen=True)
class _DeepPage:
    """All slices in one page with depth (tag ImageDepth)."""

    path: Path
    finish: Callable[[Plane], Plane]

    def planes(self, wanted: Sequence[int]) -> Iterator[Plane]:
        """Yield the (y, x) grey planes with the numbers `wanted`."""
        with tifffile.TiffFile(self.path) as tif:
            volume = tif.pages[0].asarray()
        yield from (self.finish(volume[number]) for number in wanted)
