"""Read a micro-CT scan, whatever it is kept in: look first, then load.

`inspect_volume` reads headers and names only, and says what it found: size, voxel size, what stands against
loading it and what can be chosen. `read_volume` loads what was looked into, or refuses with the same words.
"""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from gp_labeler.imaging.disk_cache import available_memory, cache_folder, space_problem, unpacked
from gp_labeler.imaging.fill import Fill, Replacement, find_fill, lowest, replace_fill, replacement_of
from gp_labeler.imaging.progress import Progress, Report
from gp_labeler.imaging.readers.choosing import Choice
from gp_labeler.imaging.readers.formats import READABLE, is_readable_name
from gp_labeler.imaging.readers.grey import needs_float64
from gp_labeler.imaging.readers.options import ImportOptions
from gp_labeler.imaging.readers.plan import MORE_ROOM, ImportPlan
from gp_labeler.imaging.readers.problems import Problem, VolumeError, failing_as_volume_error, quiet
from gp_labeler.imaging.readers.source import Mapped, assemble, mapped_part, wanted_planes
from gp_labeler.imaging.volume import Volume
from gp_labeler.imaging.voxels import ArrayVoxels, MappedVoxels, Voxels

__all__ = [
    "MAPPED_FROM",
    "READABLE",
    "Choice",
    "ImportOptions",
    "ImportPlan",
    "Problem",
    "VolumeError",
    "inspect_volume",
    "is_readable_name",
    "read_preview",
    "read_volume",
]

MAPPED_FROM = 1 << 27
"""Bytes: smaller scans are read at once in any case, and are then safe from whatever happens to the file."""

PathOrPlan = str | PathLike[str] | ImportPlan


def inspect_volume(
    path: PathOrPlan,
    *,
    progress: Progress | None = None,
    cancel: Callable[[], bool] | None = None,
    **options: Any,
) -> ImportPlan:
    """Look into a file or folder without loading it.

    Parameters
    ----------
    path : path or ImportPlan
        File or folder; a slice of a stack or series means the whole of it. Of a plan, the same path is looked
        into again, under its options changed by those given.
    progress, cancel : callable, optional
        Told the fraction done; asked whether to stop.
    **options
        Fields of `ImportOptions`.

    Returns
    -------
    ImportPlan
        Whose `errors` must be empty before it can be loaded.

    Raises
    ------
    VolumeError
        It is no scan, or too damaged to say anything about it.
    Cancelled
        `cancel` said so.

    Examples
    --------
    >>> plan = inspect_volume("scans/head_tif")  # doctest: +SKIP
    >>> [problem.code for problem in plan.errors]  # doctest: +SKIP
    ['spacing-missing']
    """
    before = path.options.as_json() if isinstance(path, ImportPlan) else {}
    where = path.path if isinstance(path, ImportPlan) else path
    return _inspect(where, ImportOptions.make(**before | options), Report(progress, cancel))


def read_volume(
    path: PathOrPlan,
    *,
    progress: Progress | None = None,
    cancel: Callable[[], bool] | None = None,
    mapped: bool | None = None,
    **options: Any,
) -> Volume:
    """Load a scan as one grey volume in LPS mm.

    Parameters
    ----------
    path : path or ImportPlan
        File or folder, or what `inspect_volume` returned.
    progress, cancel : callable, optional
        Told the fraction done; asked whether to stop.
    mapped : bool, optional
        Leave the voxels in their file, which the system then reads where they are needed: NRRD, MetaImage,
        NIfTI and TIFF that are neither packed nor scaled. By default scans from `MAPPED_FROM` bytes on. What
        other programs do to the file meanwhile is seen: ask `Volume.check` after reading.
    **options
        Fields of `ImportOptions`: `spacing`, `series`, `channel`, `accept`, `reverse`, `stride`, `region`.
        They come with the volume as `choices`, and read the same again.

    Raises
    ------
    VolumeError
        Something must be decided first (before anything big is loaded), the data are damaged, or the file
        cannot be mapped.
    Cancelled
        `cancel` said so.

    Examples
    --------
    >>> volume = read_volume("scans/head_tif", spacing=0.035)  # doctest: +SKIP
    """
    plan = _planned(path, options, Report(None, cancel))
    if plan.errors:
        raise VolumeError.of(plan.errors, plan.path)
    return _load(plan, Report(progress, cancel), mapped)


def read_preview(
    plan: ImportPlan, *, cancel: Callable[[], bool] | None = None, reverse: bool | None = None
) -> Volume:
    """Load a coarse picture of a plan, whatever stands against it; a missing voxel size counts as 1 mm."""
    backward = plan.options.reverse if reverse is None else reverse
    return _load(plan.with_options(stride=plan.preview_stride, reverse=backward), Report(None, cancel), False)


def _planned(path: PathOrPlan, options: dict[str, Any], report: Report) -> ImportPlan:
    """Return a plan under the options; it is looked into again only where they change what is read."""
    if not isinstance(path, ImportPlan):
        return _inspect(path, ImportOptions.make(**options), report)
    changed = path.with_options(**options)
    if (changed.options.series, changed.options.channel) == (path.options.series, path.options.channel):
        return changed
    return _inspect(path.path, changed.options, report)


def _inspect(path: str | PathLike[str], options: ImportOptions, report: Report) -> ImportPlan:
    # Here, not above: SimpleITK, pydicom and tifffile take half a second to load, and a window opens without.
    from gp_labeler.imaging.readers.probe import inspect_path

    return inspect_path(path, options, report)


def _load(plan: ImportPlan, report: Report, mapped: bool | None) -> Volume:
    with quiet(), failing_as_volume_error(plan.path):
        if (held := _map_of(plan, mapped)) is not None:
            voxels, fill, notes = _in_file(plan, held, report, "its voxels stay in the file")
        elif (held := _unpacked_of(plan, mapped, report.part(0.0, 0.9))) is not None:
            words = f"its voxels were unpacked into a file in {cache_folder()}"
            voxels, fill, notes = _in_file(plan, held, report.part(0.9, 1.0), words)
        else:
            voxels, fill, notes = _in_memory(plan, report)
        volume = Volume(
            voxels,
            plan.T_scan_voxel(),
            name=plan.name,
            path=Path(plan.path).resolve(),
            notes=notes,
            choices=plan.options.as_json(),
            fill=fill,
        )
        if held is None:
            volume.checksum  # noqa: B018 - computed here, off the UI thread
        volume.check()
    return volume


def _in_memory(plan: ImportPlan, report: Report) -> tuple[Voxels, float | None, tuple[str, ...]]:
    """Read the voxels; return them, the value of those that were not measured, and what was done."""
    _check_memory(plan)
    array = assemble(plan.source, plan.size, plan.dtype, plan.options, report)
    wide = needs_float64(plan.stored_dtype, array)
    if wide:
        array = assemble(plan.source, plan.size, np.float64, plan.options, report)
    fills = find_fill(array, plan.fill)
    replacement = replacement_of(array, fills)
    replace_fill(array, fills, replacement)
    notes = (*plan.all_notes(narrowed=not wide), *replacement.notes)
    return ArrayVoxels(array), replacement.fill, notes


def _in_file(
    plan: ImportPlan, held: Mapped, report: Report, words: str
) -> tuple[Voxels, float | None, tuple[str, ...]]:
    """Leave the voxels in their file; fill values are replaced whenever some are read.

    All of them are read here only where some were not measured: their value has to be below all others.
    """
    stored, file = held
    fills = find_fill(stored, plan.fill, sampled=True)
    report(0.5)
    replacement = replacement_of(stored, fills)
    if not fills and stored.dtype.kind == "f":  # there may be some all the same, in slices not looked at
        fills, replacement = (Fill(np.nan),), Replacement(below=lowest(stored))
    report(1.0)
    narrowed = stored.dtype.name == plan.dtype.name
    notes = (*plan.all_notes(narrowed=narrowed), *replacement.notes, words)
    return MappedVoxels(stored, fills, replacement.below, file), replacement.fill, notes


def _map_of(plan: ImportPlan, mapped: bool | None) -> Mapped | None:
    """Return the file as it is mapped, if that is asked for, or needed and possible.

    Raises
    ------
    VolumeError
        It is asked for, and cannot be.
    """
    if mapped is False or (mapped is None and plan.n_bytes < MAPPED_FROM):
        return None
    is_kept = plan.stored_dtype.name == plan.dtype.name
    held = mapped_part(plan.source, plan.size, plan.options) if is_kept else None
    if mapped and held is None:
        raise VolumeError(
            "its voxels cannot be shown as they are stored: they are packed, scaled or in several files",
            remedy="Open it without mapping, or save it as raw NRRD.",
        )
    return held


def _unpacked_of(plan: ImportPlan, mapped: bool | None, report: Report) -> Mapped | None:
    """Return a large packed scan as it was unpacked into a file; None where the memory holds it.

    Raises
    ------
    GpError
        There is no room for it.
    """
    if mapped is False or not plan.is_unpacked_to_disk:
        return None
    if (problem := space_problem(plan.n_bytes)) is not None:
        raise VolumeError(problem, remedy=MORE_ROOM)
    nx, ny, nz = plan.loaded_size
    planes = wanted_planes(plan.source, plan.size, plan.options, report)
    array, file = unpacked(planes, (nz, ny, nx), plan.dtype)
    if needs_float64(plan.stored_dtype, array):
        planes = wanted_planes(plan.source, plan.size, plan.options, report)
        array, file = unpacked(planes, (nz, ny, nx), np.dtype(np.float64))
    return array[:: -1 if plan.options.reverse else 1], file


def _check_memory(plan: ImportPlan) -> None:
    """Refuse what the memory of this machine cannot hold."""
    there = available_memory()
    if plan.n_bytes > there:
        need, have = (f"{n / (1 << 30):.0f} GB" for n in (plan.n_bytes, there))
        raise VolumeError(
            f"it takes {need} of memory, and this machine has {have} free",
            remedy="Load every second voxel (--stride 2), or a region.",
        )
