"""Stacks: a folder with one image file for each slice."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import tifffile

from gp_labeler.imaging.progress import Report
from gp_labeler.imaging.readers.choosing import FEW, Choice, choose
from gp_labeler.imaging.readers.formats import TIFF_SUFFIXES
from gp_labeler.imaging.readers.grey import check_channel
from gp_labeler.imaging.readers.image_files import image_header, image_pixel_size, read_image
from gp_labeler.imaging.readers.naming import Numbering, SliceGroup, group_slices, number_slices
from gp_labeler.imaging.readers.ome import ome_images
from gp_labeler.imaging.readers.options import ImportOptions
from gp_labeler.imaging.readers.orientation import swaps_axes
from gp_labeler.imaging.readers.pixel_size import PixelSize, stack_geometry, tiff_pixel_size
from gp_labeler.imaging.readers.plan import Geometry, ImportPlan
from gp_labeler.imaging.readers.problems import Problem, VolumeError, names, warning
from gp_labeler.imaging.readers.skyscan import SkyScanLog, find_log, log_geometry
from gp_labeler.imaging.readers.source import FileSource, Plane
from gp_labeler.imaging.readers.tiff_pages import (
    PALETTE,
    check_page,
    finishing,
    full_page,
    orientation_of,
    orientation_problems,
    page_shape,
)

__all__ = ["inspect_stack"]


@dataclass(frozen=True)
class _Slice:
    """What the header of one image says."""

    shape: tuple[int, int]
    dtype: np.dtype[np.generic]
    channels: int
    palette: bool
    orientation: int = 1


def inspect_stack(
    folder: Path, files: Sequence[Path], options: ImportOptions, report: Report, chosen: Path | None = None
) -> ImportPlan:
    """Look into the image files of a folder.

    Parameters
    ----------
    folder : Path
        Where they are.
    files : sequence of Path
        Those with an image suffix.
    options : ImportOptions
        `series` chooses where there are several stacks.
    report : Report
        Told how far it is.
    chosen : Path, optional
        A slice that was picked: its stack is meant.

    Raises
    ------
    VolumeError
        There is no stack.
    """
    slices = [file for file in files if not file.stem.lower().endswith("_spr")]
    groups = group_slices(slices)
    stacks = [group for group in groups if len(group.files) > 1]
    if not stacks:
        raise VolumeError(
            f"it holds no stack of slices, but {names(files)}",
            file=folder,
            remedy="A stack needs one image file for each slice, with names that differ in a number.",
        )
    choices = tuple(_choice(group) for group in stacks)
    picked = next((n for n, group in enumerate(stacks) if chosen in group.files), None)
    index, found = choose(choices, options, picked, folder)
    if picked is not None and len(stacks) > 1:
        options = replace(options, series=choices[picked].id)
    headers = _read_headers(stacks[index].files, report)
    left_out = _left_out(files, slices, groups)
    return _plan(folder, stacks[index], headers, [*found, *left_out], choices, options)


def _choice(group: SliceGroup) -> Choice:
    return Choice(group.pattern, f"{group.pattern} ({len(group.files)} slices)", len(group.files))


def _left_out(files: Sequence[Path], slices: Sequence[Path], groups: Sequence[SliceGroup]) -> list[Problem]:
    found = []
    scouts = sorted(set(files) - set(slices))
    if scouts:
        found.append(warning("scout", f"scout images are left out: {names(scouts)}"))
    few = [group for group in groups if len(group.files) < max(2, FEW * len(groups[0].files))]
    if few:
        stray = [file for group in few for file in group.files]
        found.append(warning("stray", f"images that are not part of a stack are left out: {names(stray)}"))
    return found


def _read_headers(files: Sequence[Path], report: Report) -> dict[Path, _Slice]:
    headers = {}
    for n, file in enumerate(files):
        report(n / len(files))
        if file.stat().st_size == 0:
            raise VolumeError("it is empty", file=file, remedy="Copy it again, or remove it from the stack.")
        try:
            headers[file] = _tiff_slice(file) if file.suffix.lower() in TIFF_SUFFIXES else _image_slice(file)
        except (OSError, ValueError, SyntaxError, tifffile.TiffFileError) as problem:
            raise VolumeError(
                f"it is not an image: {problem}",
                file=file,
                remedy="Copy it again, or remove it from the stack.",
            ) from None
    return headers


def _tiff_slice(path: Path) -> _Slice:
    with tifffile.TiffFile(path) as tif:
        page = full_page(tif, path)
        check_page(page, path)
        return _Slice(
            page_shape(page),
            np.dtype(page.dtype),
            page.samplesperpixel,
            page.photometric == PALETTE,
            orientation_of(page),
        )


def _image_slice(path: Path) -> _Slice:
    return _Slice(*image_header(path))


def _pixel_size(path: Path, orientation: int) -> PixelSize:
    size = _stored_pixel_size(path)
    return size.turned() if swaps_axes(orientation) else size


def _stored_pixel_size(path: Path) -> PixelSize:
    if path.suffix.lower() in TIFF_SUFFIXES:
        with tifffile.TiffFile(path) as tif:
            page = full_page(tif, path)
            images, _ = ome_images(tif.ome_metadata or "", path.parent) if tif.is_ome else ((), "")
            shape = {"X": page.imagewidth, "Y": page.imagelength}
            fitting = (image for image in images if all(image.sizes[a] == n for a, n in shape.items()))
            return tiff_pixel_size(tif, page, next(fitting, None))
    return image_pixel_size(path)


def _plan(
    folder: Path,
    group: SliceGroup,
    headers: dict[Path, _Slice],
    found: list[Problem],
    choices: tuple[Choice, ...],
    options: ImportOptions,
) -> ImportPlan:
    shape = Counter(header.shape for header in headers.values()).most_common(1)[0][0]
    group, strays = _trimmed(group, headers, shape)
    numbering = number_slices(group)
    odd = [file for file in numbering.files if file is not None and headers[file].shape != shape]
    files = tuple(None if file in odd else file for file in numbering.files)
    usable = {file: headers[file] for file in files if file is not None}
    log = find_log(folder, group.pattern)
    kind = (
        "SkyScan" if log else group.files[0].suffix[1:].upper().replace("TIFF", "TIF").replace("TIF", "TIFF")
    )
    found += _numbering_problems(group, numbering, given=options.spacing is not None)
    found += _odd_sizes(strays, odd, headers, shape)
    found += _mixtures(usable, options)
    found += orientation_problems({header.orientation for header in usable.values()})
    first = next(iter(usable))
    size = _pixel_size(first, usable[first].orientation)
    geometry, log_problems = _geometry(size, numbering, log, shape, group)
    dtypes = [np.dtype(np.uint8) if header.palette else header.dtype for header in usable.values()]
    return ImportPlan(
        path=folder,
        format=f"{kind} stack",
        files=tuple(usable),
        size=(shape[1], shape[0], len(files)),
        stored_dtype=np.result_type(*set(dtypes)),
        source=FileSource(files, _decoder(options.channel)),
        geometry=geometry,
        found=(*found, *log_problems),
        choices=choices,
        choice=group.pattern,
        options=options,
        name=log.prefix.rstrip("_") if log and log.prefix else folder.name,
    )


def _numbering_problems(group: SliceGroup, numbering: Numbering, *, given: bool) -> list[Problem]:
    """Find missing and doubled numbers, and say what steps mean where the voxel size is not given."""
    found = []
    if numbering.missing:
        gap = names([str(number) for number in numbering.missing], 6)
        where, n = f"{group.files[0].name} and {group.files[-1].name}", len(numbering.missing)
        missing = f"the numbers {gap} are missing ({n} slices)" if n > 1 else f"the number {gap} is missing"
        found.append(
            Problem(
                "gap",
                f"between {where} {missing}",
                remedy="Put the files back, or accept copies of the neighbouring slices (--accept gap).",
                resolved_by=("accept",),
            )
        )
    if numbering.doubled:
        text = f"slice numbers are there twice: {names(numbering.doubled)}"
        remedy = "Remove one of each, or accept the first (--accept doubled)."
        found.append(Problem("doubled", text, remedy=remedy, resolved_by=("accept",)))
    if numbering.step > 1:
        text = f"the numbers of the slices run in steps of {numbering.step}"
        told = "" if given else ": the distance of slices is taken to be as many times larger"
        found.append(warning("step", text + told))
    return found


def _trimmed(
    group: SliceGroup, headers: dict[Path, _Slice], shape: tuple[int, int]
) -> tuple[SliceGroup, tuple[Path, ...]]:
    """Drop images of another size before the first and behind the last slice: they are no slices."""
    fitting = [n for n, file in enumerate(group.files) if headers[file].shape == shape]
    first, last = fitting[0], fitting[-1] + 1
    strays = (*group.files[:first], *group.files[last:])
    return SliceGroup(group.pattern, group.files[first:last], group.numbers[first:last]), strays


def _odd_sizes(
    strays: Sequence[Path], odd: Sequence[Path], headers: dict[Path, _Slice], shape: tuple[int, int]
) -> list[Problem]:
    def listed(files: Sequence[Path]) -> str:
        return names([f"{file.name} ({_times(headers[file].shape)})" for file in files])

    found = []
    if strays:
        text = (
            f"images of another size than the slices' {_times(shape)} pixels are left out: {listed(strays)}"
        )
        found.append(warning("stray", text))
    if odd:
        text = f"slices differ in size from the others' {_times(shape)} pixels: {listed(odd)}"
        remedy = (
            "Remove them, or accept copies of the neighbouring slices in their place (--accept slice-size)."
        )
        found.append(Problem("slice-size", text, remedy=remedy, resolved_by=("accept",)))
    return found


def _mixtures(headers: dict[Path, _Slice], options: ImportOptions) -> list[Problem]:
    """Say where slices differ in number type or colour; values of another type rarely mean the same."""
    found = []
    kinds = {file: "palette" if h.palette else str(h.dtype) for file, h in headers.items()}
    usual = Counter(kinds.values()).most_common(1)[0][0]
    rare = [f"{file.name} ({kind})" for file, kind in kinds.items() if kind != usual]
    if rare:
        text = f"slices differ in bit depth from the others' {usual}: {names(rare)}"
        remedy = "Export the stack again with one bit depth, or accept the values (--accept mixed-depth)."
        found.append(Problem("mixed-depth", text, remedy=remedy, resolved_by=("accept",)))
    coloured = [file for file, h in headers.items() if h.channels > 2]
    if coloured and len(coloured) < len(headers):
        few = (
            coloured
            if 2 * len(coloured) <= len(headers)
            else [file for file in headers if file not in set(coloured)]
        )
        text = f"some slices are in colour and some are grey; the exceptions are {names(few)}"
        remedy = "Export the stack again in grey, or accept luminance (--accept mixed-colour)."
        found.append(Problem("mixed-colour", text, remedy=remedy, resolved_by=("accept",)))
    elif coloured:
        taken = "luminance" if options.channel is None else f"channel {options.channel}"
        found.append(warning("colour", f"the slices are in colour; {taken} is taken"))
        check_channel(options.channel, min(h.channels for h in headers.values()))
    if usual == "palette":
        found.append(warning("palette", "the slices have a palette; its colours become grey"))
    return found


def _geometry(
    size: PixelSize, numbering: Numbering, log: SkyScanLog | None, shape: tuple[int, int], group: SliceGroup
) -> tuple[Geometry, list[Problem]]:
    if log is None or (log.pixel_mm is None and log.projection_mm is None):
        return stack_geometry(size, numbering.step), []
    return log_geometry(log, group.pattern, group.numbers, numbering.step, shape)


def _decoder(channel: int | None) -> Callable[[Path], Plane]:
    return partial(_decode, channel=channel)


def _decode(path: Path, channel: int | None) -> Plane:
    if path.suffix.lower() in TIFF_SUFFIXES:
        with tifffile.TiffFile(path) as tif:
            page = full_page(tif, path)
            return finishing(page, channel if page.samplesperpixel > 1 else None)(page.asarray(maxworkers=1))
    return read_image(path, channel)


def _times(shape: tuple[int, int]) -> str:
    return f"{shape[1]} x {shape[0]}"
