"""The plan of an import: all that can be said of a scan before anything big is loaded."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from gp_core.errors import GpError
from gp_core.validation import FloatArray
from gp_labeler.imaging.disk_cache import cache_folder, needs_cache, space_problem
from gp_labeler.imaging.progress import Report
from gp_labeler.imaging.readers.choosing import Choice
from gp_labeler.imaging.readers.grey import loaded_dtype, narrowing
from gp_labeler.imaging.readers.options import ImportOptions, Spacing
from gp_labeler.imaging.readers.problems import Problem, failing_as_volume_error, warning
from gp_labeler.imaging.readers.source import RawSource, SliceSource, window
from gp_labeler.imaging.readers.spacing import shown, spacing_problems

__all__ = ["MORE_ROOM", "Geometry", "ImportPlan", "ScanReader"]

MORE_ROOM = "Free space, set another folder or limit (the settings cache and cache_gb), or use --stride 2."

_LARGE_BYTES = 2 << 30
_UNPACKED_A_SECOND = 60e6
"""Bytes; a slow computer's gzip."""

_PREVIEW_VOXELS = 160
_ORTHOGONAL = 1e-4


@dataclass(frozen=True, eq=False)
class Geometry:
    """Where voxels lie, as far as the file says.

    Parameters
    ----------
    spacing : (3,) float, mm, optional
        Voxel size along x, y, z; None where the file does not say.
    origin : (3,) float
        LPS mm: the centre of the first voxel.
    direction : (3, 3) array
        Columns: where x, y, z of the grid point in LPS.
    sides_known : bool
        Whether the format says which side is left; else a mirrored reading is as likely.
    suggested : (3,) float, mm, optional
        A voxel size that the file hints at without saying it.
    reason : str
        Why there is no voxel size, where the reader knows.

    Raises
    ------
    GpError
        The axes are not at right angles, or the origin is not finite.
    """

    spacing: Spacing | None = None
    origin: Spacing = (0.0, 0.0, 0.0)
    direction: FloatArray = field(default_factory=lambda: np.eye(3))
    sides_known: bool = True
    suggested: Spacing | None = None
    reason: str = ""

    def __post_init__(self) -> None:
        if self.spacing is not None and not (np.isfinite(self.spacing).all() and min(self.spacing) > 0):
            object.__setattr__(self, "spacing", None)
        if not np.isfinite(self.origin).all():
            raise GpError(f"its origin is not a valid position: {self.origin}")
        off = self.direction.T @ self.direction - np.eye(3)
        if not np.isfinite(off).all() or np.abs(off).max() > _ORTHOGONAL:
            raise GpError(
                "its voxel axes are sheared (not at right angles to each other)",
                remedy="Resample it to a rectangular grid, e.g. in 3D Slicer, or correct its header.",
            )


@dataclass(frozen=True, eq=False)
class ImportPlan:
    """What an import would load, what stands against it, and what can be chosen.

    Parameters
    ----------
    path : Path
        File or folder that was asked for.
    format : str
        For people: ``"NRRD"``, ``"DICOM series"``, ``"TIFF stack"``.
    files : tuple of Path
        Files to be read, in slice order where there is one file a slice.
    size : (3,) int
        Voxels along x, y, z of the whole scan.
    stored_dtype : dtype
        Type of the grey values in the file.
    source : SliceSource
        Where the planes come from.
    geometry : Geometry
        Where the file says that they lie.
    found : tuple of Problem
        What the reader found, without what follows from voxel size and choices (see `problems`).
    notes : tuple of str
        What the import decides, for the record.
    choices, choice : tuple of Choice, str
        Scans of the folder, and the id of the one that the plan is about.
    options : ImportOptions
        As they stand now.
    name : str
        What the volume will be called.
    fill : float, optional
        The value by which the file marks voxels that were not measured, where it says so.
    """

    path: Path
    format: str
    files: tuple[Path, ...]
    size: tuple[int, int, int]
    stored_dtype: np.dtype[Any]
    source: SliceSource
    geometry: Geometry
    found: tuple[Problem, ...] = ()
    notes: tuple[str, ...] = ()
    choices: tuple[Choice, ...] = ()
    choice: str | None = None
    options: ImportOptions = field(default_factory=ImportOptions)
    name: str = "volume"
    fill: float | None = None

    @property
    def spacing(self) -> Spacing | None:
        """(3,) mm: voxel size in effect, given or from the file; None where neither says."""
        return self.options.spacing or self.geometry.spacing

    @property
    def suggested_spacing(self) -> Spacing | None:
        """(3,) mm: what to propose where the voxel size is asked for."""
        return self.geometry.suggested or self.geometry.spacing

    @property
    def sides_known(self) -> bool:
        """Whether the format says which side is left; if not, the dialog shows R / L and offers `reverse`."""
        return self.geometry.sides_known

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of the voxels once loaded; raises `VolumeError` where they are no plain numbers."""
        with failing_as_volume_error(self.path):
            return loaded_dtype(self.stored_dtype)

    @property
    def loaded_size(self) -> tuple[int, int, int]:
        """Voxels along x, y, z that `region` and `stride` leave."""
        i, j, k = window(self.size, self.options)
        return len(i), len(j), len(k)

    @property
    def n_bytes(self) -> int:
        """Memory that the voxels will take."""
        return math.prod(self.loaded_size) * self.dtype.itemsize

    @property
    def is_unpacked_to_disk(self) -> bool:
        """Whether loading unpacks it into a file of the cache: it cannot stay in its own, nor in memory."""
        return not self.stays_in_file and needs_cache(self.n_bytes)

    @property
    def stays_in_file(self) -> bool:
        """Whether its voxels can be shown as they are stored."""
        is_kept = self.stored_dtype.name == self.dtype.name
        return is_kept and isinstance(self.source, RawSource) and self.source.is_mappable

    @property
    def preview_stride(self) -> int:
        """A stride that shows the whole within a moment."""
        return max(1, math.ceil(max(self.size) / _PREVIEW_VOXELS))

    @property
    def problems(self) -> tuple[Problem, ...]:
        """All findings; what the options in effect accept is turned into warnings."""
        spacing = spacing_problems(
            self.spacing,
            self.size,
            given=self.options.spacing is not None,
            suggested=self.geometry.suggested,
            reason=self.geometry.reason,
        )
        every = (*self.found, *spacing, *self._size_problems(), *self._side_problems())
        return tuple(
            replace(problem, severity="warning") if _accepted(problem, self.options) else problem
            for problem in every
        )

    @property
    def errors(self) -> tuple[Problem, ...]:
        """Problems that must be resolved before anything loads."""
        return tuple(problem for problem in self.problems if problem.severity == "error")

    @property
    def warnings(self) -> tuple[Problem, ...]:
        """Problems to show."""
        return tuple(problem for problem in self.problems if problem.severity == "warning")

    def with_options(self, **options: Any) -> ImportPlan:
        """Return the plan with some options changed; another `series` or `channel` needs `inspect_volume`."""
        return replace(self, options=ImportOptions.make(**self.options.as_json() | options))

    def T_scan_voxel(self) -> FloatArray:  # noqa: N802 - a transform keeps its name
        """Return the (4, 4) affine of the part that will be loaded; a missing voxel size counts as 1 mm."""
        spacing = np.array(self.spacing or (1.0, 1.0, 1.0))
        axes = self.geometry.direction * spacing
        first = np.array([axis.start for axis in window(self.size, self.options)], dtype=np.float64)
        affine = np.eye(4)
        affine[:3, :3] = axes * self.options.stride
        affine[:3, 3] = self._origin() + axes @ first
        return affine

    def _origin(self) -> FloatArray:
        """Return the file's origin, corrected as the voxel size is, if that is by one factor on all axes."""
        origin = np.array(self.geometry.origin)
        if self.options.spacing is None or self.geometry.spacing is None:
            return origin
        factors = np.array(self.options.spacing) / np.array(self.geometry.spacing)
        same = bool(np.ptp(factors) < 1e-6 * factors.mean())
        return origin * (factors.mean() if same else 1.0)

    def _size_problems(self) -> tuple[Problem, ...]:
        found = []
        if min(self.size) < 2:
            text = f"it holds {' x '.join(map(str, self.size))} voxels, which is not a volume"
            found.append(Problem("flat", text, remedy="Give the whole scan, not one slice of it."))
        if self.is_unpacked_to_disk:
            found.append(self._unpacking())
        elif self.n_bytes > _LARGE_BYTES and not self.stays_in_file:
            text = f"it takes {self.n_bytes / (1 << 30):.1f} GB of memory; every second voxel takes an eighth"
            found.append(warning("large", text))
        return tuple(found)

    def _unpacking(self) -> Problem:
        """Say that it is unpacked into a file, or why it cannot be."""
        if (why := space_problem(self.n_bytes)) is not None:
            return Problem("no-room", why, remedy=MORE_ROOM)
        minutes = math.ceil(self.n_bytes / _UNPACKED_A_SECOND / 60)
        text = (
            f"it is unpacked into a file of {self.n_bytes / 1e9:.1f} GB in {cache_folder()}, in about "
            f"{minutes} min; that can be cancelled, and the file goes when the scan is closed"
        )
        return warning("unpacked", text)

    def _side_problems(self) -> tuple[Problem, ...]:
        if self.sides_known:
            return ()
        text = (
            f"{self.format} does not say which side is left: check a structure whose side you know, "
            "and reverse the slices if left and right are exchanged"
        )
        return (warning("sides-unknown", text),)

    def all_notes(self, *, narrowed: bool = True) -> tuple[str, ...]:
        """Return what goes on record with the volume: decisions, warnings and what was chosen.

        Parameters
        ----------
        narrowed : bool
            Whether the voxels came to be of the type `dtype`, and not wider.
        """
        spacing, options = self.geometry.spacing, self.options
        notes = [narrowing(self.stored_dtype) if narrowed else None, *self.notes]
        if options.spacing is not None:
            said = "did not say" if spacing is None else f"said {shown(spacing)}"
            notes.append(f"voxel size {shown(options.spacing)} was given; the file {said}")
        if options.reverse:
            notes.append("the order of the slices was reversed")
        if options.stride > 1:
            notes.append(f"only every {options.stride}th voxel along each axis was kept")
        if options.region is not None:
            notes.append(f"only the region {options.region} (voxels along x, y, z) was kept")
        notes += [problem.text for problem in self.warnings if problem.code not in ("large", "unpacked")]
        return tuple(note for note in notes if note)


def _accepted(problem: Problem, options: ImportOptions) -> bool:
    return problem.code in options.accept and "accept" in problem.resolved_by


@dataclass(frozen=True)
class ScanReader:
    """One kind of scan.

    Parameters
    ----------
    endings : tuple of str
        Endings of the names of its files, without the dot, in lower case.
    knows : callable
        Whether a file, which is not empty, is of this kind, by its name or its content.
    inspect : callable
        Looks into the scan that a file belongs to.
    """

    endings: tuple[str, ...]
    knows: Callable[[Path], bool]
    inspect: Callable[[Path, ImportOptions, Report], ImportPlan]
