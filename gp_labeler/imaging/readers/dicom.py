"""DICOM: slices of a folder or frames of a file, sorted into series and placed by their own tags."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from gp_core.validation import FloatArray
from gp_labeler.imaging.progress import Report
from gp_labeler.imaging.readers.choosing import Choice, choose
from gp_labeler.imaging.readers.dicom_grid import Grid, on_grid
from gp_labeler.imaging.readers.dicom_pixels import DicomSource, value_dtype, value_notes
from gp_labeler.imaging.readers.dicom_series import Series, find_series
from gp_labeler.imaging.readers.dicom_tags import DicomSlice, same_pixel_size, scan_dicom
from gp_labeler.imaging.readers.options import ImportOptions, Spacing
from gp_labeler.imaging.readers.plan import Geometry, ImportPlan
from gp_labeler.imaging.readers.problems import Problem, VolumeError, names, warning

__all__ = ["inspect_dicom"]


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
    slices, junk, damaged = scan_dicom(files, report)
    series = find_series(slices)
    if not series:
        raise VolumeError(
            f"no DICOM image can be read in {names(files)}",
            file=folder,
            remedy="Give the folder of a CT series.",
        )
    volumes = [one for one in series if not one.is_scout] or series[:1]
    scouts = [one for one in series if one not in volumes]
    choices = tuple(Choice(one.id, one.text, len(one.slices)) for one in volumes)
    of_chosen = [n for n, one in enumerate(volumes) if chosen in {slice_.file.path for slice_ in one.slices}]
    picked = of_chosen[0] if len(of_chosen) == 1 else None
    index, problems = choose(choices, options, picked, folder)
    if picked is not None and len(volumes) > 1:
        options = replace(options, series=choices[picked].id)
    found = (*problems, *_left_out(damaged, junk, scouts))
    return _plan(folder, volumes[index], options, found, choices, choices[index].id)


def _left_out(damaged: Sequence[Path], junk: Sequence[Path], scouts: Sequence[Series]) -> list[Problem]:
    found = []
    if damaged:
        text = f"files are DICOM, but damaged: {names(damaged)}"
        remedy = "Copy them again, or accept that they are left out (--accept damaged)."
        found.append(Problem("damaged", text, remedy=remedy, resolved_by=("accept",)))
    if junk:
        found.append(warning("junk", f"files that are not DICOM images are left out: {names(junk)}"))
    if scouts:
        files = [one.file.path for series in scouts for one in series.slices]
        found.append(warning("scout", f"scout images are left out: {names(files)}"))
    return found


def _plan(
    folder: Path,
    series: Series,
    options: ImportOptions,
    found: tuple[Problem, ...],
    choices: tuple[Choice, ...],
    choice: str,
) -> ImportPlan:
    grid = on_grid(series.slices)
    first = grid.there[0]
    files = tuple(dict.fromkeys(one.file.path for one in grid.there))
    one_file = len(files) == 1 and len(grid.there) > 1
    source = DicomSource(grid.slices, options.channel)
    return ImportPlan(
        path=folder,
        format="DICOM multi-frame" if one_file else "DICOM series",
        files=files,
        size=(first.file.shape[1], first.file.shape[0], len(grid.slices)),
        stored_dtype=value_dtype(grid.there),
        source=source,
        geometry=_geometry(first, grid),
        found=(*found, *series.found, *grid.problems, *_pixel_problems(grid.there)),
        notes=value_notes(grid.there),
        choices=choices,
        choice=choice,
        options=options,
        name=first.file.path.stem if one_file else folder.name,
        fill=source.fill,
    )


def _geometry(first: DicomSlice, grid: Grid) -> Geometry:
    """Return where the slices lie; their thickness is no distance, but a hint."""
    axes: FloatArray = np.eye(3) if grid.axes is None else grid.axes
    place = first.position if grid.placed else grid.origin
    place = np.zeros(3) if place is None else place
    x, y, z = (float(value) for value in place)
    spacing: Spacing | None = None
    suggested: Spacing | None = None
    reason = ""
    if first.pixel is not None and grid.distance is not None:
        spacing = (*first.pixel, grid.distance)
    elif first.pixel is not None:
        thickness = first.file.thickness
        suggested = (*first.pixel, thickness or first.pixel[0])
        reason = "the slices have neither positions nor SpacingBetweenSlices, so their distance is unknown"
        if thickness is not None:
            reason += f"; their SliceThickness of {thickness:.4g} mm need not be it"
    elif grid.distance is not None:
        suggested = (grid.distance, grid.distance, grid.distance)
        reason = "the slices have no PixelSpacing"
    return Geometry(spacing, (x, y, z), axes, grid.placed, suggested, reason)


def _pixel_problems(slices: Sequence[DicomSlice]) -> list[Problem]:
    """Find colours, pixel sizes that differ, and values that are scaled by what is no number."""
    found = []
    first = slices[0]
    if first.file.channels > 1:
        found.append(warning("colour", f"its pixels have {first.file.channels} channels; luminance is taken"))
    other = next((one for one in slices if not same_pixel_size(one, first)), None)
    if other is not None:
        text = f"PixelSpacing of {other.name} differs from that of {first.name}"
        remedy = "Choose another series, or accept the first's (--accept pixel-size)."
        found.append(Problem("pixel-size", text, remedy=remedy, resolved_by=("accept",)))
    plain = next((one for one in slices if not one.scaled), None)
    if plain is not None and any((one.slope, one.intercept) != (1.0, 0.0) for one in slices):
        text = f"{plain.name} has no RescaleSlope, other slices have"
        remedy = "Correct it, or accept its values as they are stored (--accept scaling)."
        found.append(Problem("scaling", text, remedy=remedy, resolved_by=("accept",)))
    doubtful = next((one for one in slices if one.trouble), None)
    if doubtful is not None:
        text = f"of {doubtful.name}, {doubtful.trouble}"
        remedy = "Correct it, or accept the values as they are stored (--accept scaling)."
        found.append(Problem("scaling", text, remedy=remedy, resolved_by=("accept",)))
    return found
