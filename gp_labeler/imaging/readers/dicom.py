"""DICOM: a folder of slices sorted into series by their own tags, or one file of many frames."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gp_core.checks import FloatArray
from gp_labeler.imaging.progress import Report
from gp_labeler.imaging.readers.choosing import Choice, choose
from gp_labeler.imaging.readers.dicom_tags import Frame, Pixels, scan_dicom
from gp_labeler.imaging.readers.grey import to_grey
from gp_labeler.imaging.readers.options import ImportOptions, Spacing
from gp_labeler.imaging.readers.plan import Geometry, ImportPlan
from gp_labeler.imaging.readers.problems import Problem, VolumeError, names, warning
from gp_labeler.imaging.readers.simpleitk import ItkSource, read_itk_planes
from gp_labeler.imaging.readers.source import FileSource, Plane, RawSource, SliceSource

__all__ = ["inspect_dicom"]

_SAME = 0.25
"""Positions nearer than this part of the slice distance are the same one; all tolerances are relative, for a
whole slice of a micro-CT may measure less than the absolute 0.01 mm that suffices for people."""


@dataclass(frozen=True, eq=False)
class _Order:
    """Frames along their normal: None where one is missing."""

    frames: tuple[Frame | None, ...]
    distance: float | None
    placed: bool
    problems: tuple[Problem, ...]


def inspect_dicom(
    folder: Path, files: Sequence[Path], options: ImportOptions, report: Report, chosen: Path | None = None
) -> ImportPlan:
    """Look into the DICOM files of a folder.

    Parameters
    ----------
    folder : Path
        What was asked for.
    files : sequence of Path
        Files that may be DICOM.
    options : ImportOptions
        `series` chooses where there are several.
    report : Report
        Told how far it is.
    chosen : Path, optional
        A slice that was picked: its series is meant.

    Raises
    ------
    VolumeError
        None is a DICOM image, or none belongs to a volume.
    """
    frames, junk, damaged = scan_dicom(files, report)
    series = _series(frames)
    if not series:
        raise VolumeError(
            f"no DICOM image can be read in {names(files)}",
            file=folder,
            remedy="Give the folder of a CT series.",
        )
    series, scouts = _without_scouts(series)
    ids = [_id(one, series) for one in series]
    choices = tuple(Choice(id_, _text(one), _depth(one)) for id_, one in zip(ids, series, strict=True))
    paths = [{frame.path for frame in one} for one in series]
    picked = next((n for n, members in enumerate(paths) if chosen in members), None)
    index, problems = choose(choices, options, picked, folder)
    if picked is not None and len(series) > 1:
        options = replace(options, series=ids[picked])
    found = list(problems)
    if damaged:
        text = f"files are DICOM, but damaged: {names(damaged)}"
        remedy = "Copy them again, or accept that they are left out (--accept damaged)."
        found.append(Problem("damaged", text, remedy=remedy, resolved_by=("accept",)))
    if junk:
        found.append(warning("junk", f"files that are no DICOM images are left out: {names(junk)}"))
    if scouts:
        found.append(
            warning("scout", f"scout images are left out: {names([f.path for s in scouts for f in s])}")
        )
    plan = _multi_frame if series[index][0].n_frames > 1 else _single_frames
    return plan(folder, series[index], options, tuple(found), choices, ids[index])


def _series(frames: Sequence[Frame]) -> list[list[Frame]]:
    """Group frames by series, size and orientation; the one with most slices comes first."""
    groups: dict[tuple[object, ...], list[Frame]] = defaultdict(list)
    for frame in frames:
        turned = None if frame.axes is None else tuple((np.round(frame.axes, 2) + 0.0).ravel())
        own_file = frame.path if frame.n_frames > 1 else None
        groups[frame.series, frame.shape, turned, frame.channels, own_file].append(frame)
    return sorted(groups.values(), key=lambda group: (-_depth(group), group[0].description, group[0].path))


def _depth(group: Sequence[Frame]) -> int:
    return sum(frame.n_frames for frame in group)


def _without_scouts(series: list[list[Frame]]) -> tuple[list[list[Frame]], list[list[Frame]]]:
    """Part what may be a volume from scouts: those that say so, and single slices."""
    scouts = [one for one in series if _depth(one) < 2 or all(frame.localizer for frame in one)]
    volumes = [one for one in series if one not in scouts]
    return (volumes, scouts) if volumes else (series[:1], series[1:])


def _id(group: Sequence[Frame], among: Sequence[Sequence[Frame]]) -> str:
    """Return the UID of a series; where another group shares it, with the size and the first file's name."""
    uid = group[0].series
    shared = sum(other[0].series == uid for other in among) > 1
    return f"{uid} {_times(group[0].shape)} {group[0].path.name}" if shared or not uid else uid


def _text(group: Sequence[Frame]) -> str:
    first = group[0]
    size = "" if first.pixel is None else f" of {first.pixel[0]:.4g} mm"
    return f"{first.description}: {_depth(group)} slices, {_times(first.shape)} pixels{size}"


def _single_frames(
    folder: Path,
    frames: Sequence[Frame],
    options: ImportOptions,
    found: tuple[Problem, ...],
    choices: tuple[Choice, ...],
    choice: str,
) -> ImportPlan:
    order = _order(frames)
    there = [frame for frame in order.frames if frame is not None]
    first = there[0]
    files = tuple(None if frame is None else frame.path for frame in order.frames)
    return ImportPlan(
        path=folder,
        format="DICOM series",
        files=tuple(frame.path for frame in there),
        size=(first.shape[1], first.shape[0], len(files)),
        stored_dtype=_dtype(there),
        source=FileSource(files, partial(_decode, frames=_by_path(there), channel=options.channel)),
        geometry=_geometry(first, order, first.positions[0] if order.placed else np.zeros(3)),
        found=(*found, *order.problems, *_pixel_problems(first)),
        notes=_value_notes(there),
        choices=choices,
        choice=choice,
        options=options,
        name=folder.name,
    )


def _multi_frame(
    folder: Path,
    frames: Sequence[Frame],
    options: ImportOptions,
    found: tuple[Problem, ...],
    choices: tuple[Choice, ...],
    choice: str,
) -> ImportPlan:
    frame = frames[0]
    order = _order_within(frame)
    return ImportPlan(
        path=folder,
        format="DICOM multi-frame",
        files=(frame.path,),
        size=(frame.shape[1], frame.shape[0], frame.n_frames),
        stored_dtype=_dtype([frame]),
        source=_frames_source(frame, options.channel),
        geometry=_geometry(frame, order, frame.positions[0] if order.placed else np.zeros(3)),
        found=(*found, *order.problems, *_pixel_problems(frame)),
        notes=_value_notes([frame]),
        choices=choices,
        choice=choice,
        options=options,
        name=frame.path.stem,
    )


def _geometry(first: Frame, order: _Order, origin: FloatArray) -> Geometry:
    axes = np.eye(3) if first.axes is None else first.axes
    if order.distance is not None and order.distance < 0:  # frames of one file that run against the normal
        axes = axes * np.array([1.0, 1.0, -1.0])
    distance = None if order.distance is None else abs(order.distance)
    x, y, z = (float(value) for value in origin)
    spacing: Spacing | None = None
    suggested: Spacing | None = None
    reason = ""
    if first.pixel is not None and distance is not None:
        spacing = (*first.pixel, distance)
    elif first.pixel is not None:
        suggested = (*first.pixel, first.pixel[0])
        reason = "the slices have neither positions nor a thickness, so their distance is unknown"
    elif distance is not None:
        suggested = (distance, distance, distance)
        reason = "the slices have no PixelSpacing"
    sides_known = order.placed and first.axes is not None
    return Geometry(spacing, (x, y, z), axes, sides_known, suggested, reason)


def _pixel_problems(frame: Frame) -> tuple[Problem, ...]:
    if frame.channels == 1:
        return ()
    return (warning("colour", f"its pixels have {frame.channels} channels; luminance is taken"),)


def _order(frames: Sequence[Frame]) -> _Order:
    """Sort single frames along their normal, and find what is missing or doubled there."""
    positions = [frame.positions[0] for frame in frames if len(frame.positions)]
    axes = frames[0].axes
    if len(positions) < len(frames) or axes is None or np.ptp(np.array(positions) @ axes[:, 2]) == 0:
        return _by_number(frames)
    along = np.array(positions) @ axes[:, 2]
    order = np.argsort(along, kind="stable")
    ordered, along = [frames[n] for n in order], along[order]
    step = _usual_step(along)
    same = np.diff(along, prepend=-math.inf) < _SAME * step
    problems = _doubled(ordered, same)
    kept = [frame for frame, doubled in zip(ordered, same, strict=True) if not doubled]
    return _on_grid(kept, along[~same], step, problems)


def _usual_step(along: FloatArray) -> float:
    steps = np.diff(along)
    return float(np.median(steps[steps > 1e-3 * steps.max()]))


def _doubled(ordered: Sequence[Frame], same: NDArray[np.bool_]) -> list[Problem]:
    files = [frame.path for frame, doubled in zip(ordered, same, strict=True) if doubled]
    if not files:
        return []
    text = f"{len(files)} slices lie where another one lies: {names(files)}"
    remedy = "Remove one of each, or accept the first (--accept doubled)."
    return [Problem("doubled", text, remedy=remedy, resolved_by=("accept",))]


def _on_grid(kept: list[Frame], along: FloatArray, step: float, problems: list[Problem]) -> _Order:
    """Put sorted slices on a regular grid; places that stay empty are the gaps."""
    places = np.concatenate([[0], np.cumsum(np.maximum(1, np.rint(np.diff(along) / step)))]).astype(int)
    slope, start = np.polyfit(places, along, 1)
    off = np.abs(along - (start + slope * places)).max() / slope
    if off > _SAME:
        problems.append(_uneven(kept, along))
    frames: list[Frame | None] = [None] * (int(places[-1]) + 1)
    for place, frame in zip(places, kept, strict=True):
        frames[place] = frame
    if len(kept) < len(frames):
        problems.append(_gap(kept, places, along, float(slope)))
    return _Order(tuple(frames), float(slope), True, (*problems, *_leaning(kept, float(slope))))


def _uneven(kept: Sequence[Frame], along: FloatArray) -> Problem:
    steps = np.diff(along)
    text = f"the slices lie unevenly: their distances run from {steps.min():.4g} to {steps.max():.4g} mm"
    remedy = "Choose another series, or accept their mean distance (--accept uneven)."
    return Problem("uneven", text, remedy=remedy, resolved_by=("accept",))


def _gap(kept: Sequence[Frame], places: FloatArray, along: FloatArray, step: float) -> Problem:
    before = np.flatnonzero(np.diff(places) > 1)
    where = [
        f"between {kept[n].path.name} ({along[n]:.4g} mm) and {kept[n + 1].path.name} ({along[n + 1]:.4g} mm)"
        for n in before.tolist()
    ]
    n_missing = int(places[-1]) + 1 - len(kept)
    text = f"{n_missing} of its slices, {step:.4g} mm apart, are missing: {names(where, 3)}"
    remedy = "Find the missing files, or accept copies of the neighbouring slices (--accept gap)."
    return Problem("gap", text, remedy=remedy, resolved_by=("accept",))


def _leaning(kept: Sequence[Frame], step: float) -> list[Problem]:
    """Find a tilted gantry: slices that are shifted sideways against each other."""
    first, last = kept[0], kept[-1]
    assert first.axes is not None
    sideways = (last.positions[0] - first.positions[0]) @ first.axes[:, :2]
    pixel = min(first.pixel) if first.pixel else step
    if np.abs(sideways).max() <= 0.5 * pixel:
        return []
    text = f"the slices are shifted sideways by {np.abs(sideways).max():.3g} mm from the first to the last"
    remedy = "Resample the scan to a rectangular grid first, or accept it unshifted (--accept tilted)."
    return [Problem("tilted", text, remedy=remedy, resolved_by=("accept",))]


def _by_number(frames: Sequence[Frame]) -> _Order:
    """Sort frames without positions by their instance number, then by name."""
    ordered = sorted(frames, key=lambda frame: (frame.number, frame.path.name))
    distance = ordered[0].thickness
    text = "the slices have no positions: they are ordered by their instance numbers"
    if distance is not None:
        text += f", and lie {distance:.4g} mm apart, their thickness"
    return _Order(tuple(ordered), distance, False, (warning("no-positions", text),))


def _order_within(frame: Frame) -> _Order:
    """Find the distance of the frames of one file; negative where they run against the normal."""
    if len(frame.positions) != frame.n_frames or frame.axes is None or frame.n_frames < 2:
        return _Order((frame,), frame.thickness, False, ())
    along = frame.positions @ frame.axes[:, 2]
    steps = np.diff(along)
    step = float(np.median(steps))
    if step == 0:
        return _Order((frame,), frame.thickness, False, ())
    mean = float(along[-1] - along[0]) / (frame.n_frames - 1)
    problems = [_uneven([frame], along)] if np.abs(steps - step).max() > _SAME * abs(step) else []
    return _Order((frame,), mean, True, tuple(problems))


def _dtype(frames: Sequence[Frame]) -> np.dtype[np.generic]:
    """Return the smallest type that holds every value the frames can have."""
    if not all(frame.integral for frame in frames):
        return np.dtype(np.float32)
    low = min(frame.value_range[0] for frame in frames)
    high = max(frame.value_range[1] for frame in frames)
    for name in ("uint8", "int16", "uint16", "int32", "uint32"):
        if np.iinfo(name).min <= low and high <= np.iinfo(name).max:
            return np.dtype(name)
    return np.dtype(np.float32)


def _value_notes(frames: Sequence[Frame]) -> tuple[str, ...]:
    if all(frame.integral for frame in frames):
        return ()
    return ("values were scaled by the rescale slope of the slices and are held as float32",)


def _by_path(frames: Sequence[Frame]) -> dict[Path, Frame]:
    return {frame.path: frame for frame in frames}


def _decode(path: Path, frames: Mapping[Path, Frame], channel: int | None) -> Plane:
    """Read the values of one slice, through SimpleITK where its pixels are packed."""
    frame = frames[path]
    if frame.pixels is None:
        return to_grey(read_itk_planes(path)[0], channel)
    n_pixels = frame.shape[0] * frame.shape[1]
    stored = np.fromfile(path, frame.pixels.dtype, n_pixels, offset=frame.pixels.offset)
    if stored.size < n_pixels:
        raise VolumeError("it ends before its last pixel", file=path, remedy="Copy it again.")
    return _value(stored.reshape(frame.shape), frame.pixels)


def _value(stored: Plane, pixels: Pixels) -> Plane:
    """Return the values of stored numbers: their unused bits removed, scaled and shifted."""
    unused = 8 * pixels.dtype.itemsize - pixels.bits
    if unused:  # old files keep overlays there
        stored = (stored.astype(stored.dtype.newbyteorder("=")) << unused) >> unused
    if (pixels.slope, pixels.intercept) == (1.0, 0.0):
        return stored
    return stored * pixels.slope + pixels.intercept


def _frames_source(frame: Frame, channel: int | None) -> SliceSource:
    if frame.pixels is None:
        return ItkSource(frame.path, channel)
    finish = partial(_value, pixels=frame.pixels)
    return RawSource(
        frame.path, frame.pixels.offset, frame.pixels.dtype, frame.shape, frame.n_frames, finish=finish
    )


def _times(shape: tuple[int, int]) -> str:
    return f"{shape[1]} x {shape[0]}"
