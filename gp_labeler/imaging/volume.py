"""A scan: grey voxels and where they lie."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gp_core.errors import GeometryError, GpError
from gp_core.validation import FloatArray, as_points
from gp_labeler.imaging.progress import Report
from gp_labeler.imaging.voxels import ArrayVoxels, GreyArray, Voxels

if TYPE_CHECKING:
    import pyvista as pv

__all__ = ["GreyArray", "Volume"]

_PERCENTILES = (0.1, 99.9)
_SAMPLES = 1_000_000
_SLAB_BYTES = 1 << 26
_BLOCK = 8192  # words of 8 bytes: one sum stands for 64 KiB of voxels


@dataclass(frozen=True, eq=False)
class Volume:
    """One grey channel on a regular grid, in the scan frame.

    Voxel indices are (i, j, k) = (x, y, z) in all methods, while `voxels` are indexed ``[k, j, i]``. An index
    names the *centre* of its voxel. Size, type and geometry are there without any voxel being read.

    Parameters
    ----------
    voxels : Voxels or (z, y, x) array
        Grey values. An array is made C-contiguous, of native byte order and read-only.
    T_scan_voxel : (4, 4) array_like
        Affine from voxel index to LPS mm: direction (possibly mirrored) times spacing, and origin.
    name : str
        What to call it.
    path : Path, optional
        File or folder it came from.
    notes : tuple of str
        What the import decided, for the record: channel chosen, type narrowed, order of slices, ...
    choices : mapping
        The import options that were used, as JSON values; `read_volume(path, **choices)` reads the same.
    fill : float, optional
        The value of voxels that were not measured, such as those outside the scanner's circle; it is below
        all others and counts in no statistics.

    Raises
    ------
    GeometryError
        Not three-dimensional, or the affine is singular, sheared or not finite.

    Examples
    --------
    >>> volume = Volume(np.zeros((4, 5, 6), np.uint8), np.diag([0.1, 0.1, 0.2, 1.0]))
    >>> volume.size, volume.spacing
    ((6, 5, 4), (0.1, 0.1, 0.2))
    """

    voxels: Voxels
    T_scan_voxel: FloatArray
    name: str = "volume"
    path: Path | None = None
    notes: tuple[str, ...] = ()
    choices: Mapping[str, Any] = field(default_factory=dict)
    fill: float | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.voxels, Voxels):
            object.__setattr__(self, "voxels", ArrayVoxels(self.voxels))
        object.__setattr__(self, "T_scan_voxel", _checked_affine(self.T_scan_voxel))

    @classmethod
    def from_parts(
        cls,
        array: GreyArray,
        spacing: ArrayLike,
        origin: ArrayLike = (0.0, 0.0, 0.0),
        direction: ArrayLike | None = None,
        **rest: Any,
    ) -> Volume:
        """Make a volume of a (z, y, x) array, (3,) spacing and origin (LPS), mm, and (3, 3) direction."""
        affine = np.eye(4)
        axes = np.eye(3) if direction is None else np.asarray(direction, dtype=np.float64)
        affine[:3, :3] = axes * np.asarray(spacing, dtype=np.float64)
        affine[:3, 3] = origin
        return cls(ArrayVoxels(array), affine, **rest)

    @property
    def array(self) -> GreyArray:
        """All voxels as one (z, y, x) array, for scripts and small scans; the program reads parts of them."""
        return self.voxels.whole()

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of the grey values."""
        return self.voxels.dtype

    @property
    def size(self) -> tuple[int, int, int]:
        """Voxels along i, j, k."""
        nz, ny, nx = self.voxels.shape
        return nx, ny, nz

    @cached_property
    def spacing(self) -> tuple[float, float, float]:
        """Voxel size along i, j, k, mm."""
        x, y, z = (float(length) for length in np.linalg.norm(self.T_scan_voxel[:3, :3], axis=0))
        return x, y, z

    @property
    def origin(self) -> FloatArray:
        """(3,) LPS mm: the centre of voxel (0, 0, 0)."""
        return self.T_scan_voxel[:3, 3]

    @cached_property
    def direction(self) -> FloatArray:
        """(3, 3) unit columns: where i, j, k point in LPS; determinant -1 if the grid is left-handed."""
        axes: FloatArray = self.T_scan_voxel[:3, :3] / np.asarray(self.spacing)
        axes.setflags(write=False)
        return axes

    @property
    def is_mirrored(self) -> bool:
        """Whether i, j, k are left-handed, so that surfaces made in voxels must be turned inside out."""
        return float(np.linalg.det(self.T_scan_voxel[:3, :3])) < 0

    @cached_property
    def T_voxel_scan(self) -> FloatArray:  # noqa: N802 - a transform keeps its name
        """(4, 4) affine from LPS mm to voxel index."""
        inverse: FloatArray = np.linalg.inv(self.T_scan_voxel).astype(np.float64)
        inverse.setflags(write=False)
        return inverse

    @property
    def extent(self) -> FloatArray:
        """(2, 3) LPS mm: lowest and highest corner of the box around all voxels, half widths included."""
        nx, ny, nz = self.size
        corners = np.array([(i, j, k) for i in (0, nx) for j in (0, ny) for k in (0, nz)]) - 0.5
        points = self.voxel_to_scan(corners)
        return np.stack([points.min(axis=0), points.max(axis=0)])

    def voxel_to_scan(self, indices: ArrayLike) -> FloatArray:
        """Return the LPS mm positions of (N, 3) voxel indices (i, j, k), which may be fractions."""
        affine = self.T_scan_voxel
        moved: FloatArray = (
            as_points(indices, "indices", missing_allowed=True) @ affine[:3, :3].T + affine[:3, 3]
        )
        return moved

    def scan_to_voxel(self, points: ArrayLike) -> FloatArray:
        """Return the voxel indices (i, j, k), fractions, of (N, 3) LPS mm points; missing stays NaN."""
        affine = self.T_voxel_scan
        moved: FloatArray = (
            as_points(points, "points", missing_allowed=True) @ affine[:3, :3].T + affine[:3, 3]
        )
        return moved

    def step_along(self, direction: ArrayLike) -> float:
        """Return how long a step of one voxel is in a (3,) unit direction, mm."""
        in_voxels = self.direction.T @ np.asarray(direction) / self.spacing
        return 1.0 / float(np.linalg.norm(in_voxels))

    def contains(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Return for (N, 3) LPS mm points whether each lies in a voxel; missing points do not."""
        index = self.scan_to_voxel(points)
        inside: NDArray[np.bool_] = np.all((index >= -0.5) & (index < np.array(self.size) - 0.5), axis=1)
        return inside

    def values_at(self, points: ArrayLike) -> FloatArray:
        """Return the values of the voxels that hold (N, 3) LPS mm points, NaN outside."""
        inside = self.contains(points)
        values = np.full(len(inside), np.nan)
        i, j, k = np.floor(self.scan_to_voxel(points)[inside] + 0.5).astype(np.intp).T
        values[inside] = self.voxels.at(k, j, i)
        return values

    def value_at(self, point: ArrayLike) -> float | None:
        """Return the value of the voxel that holds the (3,) LPS mm point, or None outside."""
        value = float(self.values_at(np.reshape(point, (1, 3)))[0])
        return None if np.isnan(value) else value

    @cached_property
    def intensity_range(self) -> tuple[float, float]:
        """The 0.1 and 99.9 percentiles of rows all over the scan: where a window may start."""
        low, high = np.percentile(self.measured(self.voxels.rows(_SAMPLES)), _PERCENTILES)
        return float(low), float(high)

    def measured(self, values: GreyArray) -> GreyArray:
        """Return those of some voxels' values that were measured and are finite, (N,); all, if none was."""
        fit = np.isfinite(values)
        if self.fill is not None:
            fit &= values != self.fill
        return np.asarray(values[fit] if fit.any() else np.ravel(values))

    def to_pyvista(self) -> pv.ImageData:
        """Return the scan as ``ImageData``: origin, spacing and direction in LPS mm, a point for each voxel.

        Its point data ``values`` are the voxels themselves, not a copy, but for types that VTK has not (bool,
        float16). So what is written there is written into the scan.
        """
        import pyvista as pv  # takes 0.6 s: not before the window shows

        from gp_labeler.imaging.vtk_arrays import to_vtk, vtk_ready

        image = pv.ImageData(
            dimensions=self.size, spacing=self.spacing, origin=self.origin, direction_matrix=self.direction
        )
        image.GetPointData().SetScalars(to_vtk(vtk_ready(self.array).reshape(-1), "values", share=True))
        return image

    def check(self) -> None:
        """Raise where the file was cut or changed since it was opened: what was read may be wrong.

        Raises
        ------
        GpError
            With what happened.
        """
        if (problem := self.voxels.problem) is not None:
            raise GpError(
                f"it {problem}", file=self.path, remedy="Copy it again, and open it. All labels are kept."
            )

    @property
    def known_checksum(self) -> str:
        """The checksum, where it was asked for before; else empty."""
        return str(self.__dict__.get("checksum", ""))

    def find_checksum(self, report: Report) -> str:
        """Return the checksum, telling how far it is; for scans in their files, which are read as a whole."""
        if not self.known_checksum:
            self.__dict__["checksum"] = self._digest(report)
        return self.checksum

    @cached_property
    def checksum(self) -> str:
        """32 hex digits of the voxels and where they lie; the same for the same scan in another file format.

        Every voxel counts, through one wrapping 64-bit sum for each 64 KiB, and every 64th block of them is
        hashed as it is; so a change of any one voxel shows, and 1 GB takes well under a second. Positions
        count to 0.0001 mm.

        Raises
        ------
        GpError
            The file was changed meanwhile.
        """
        return self._digest(Report())

    def _digest(self, report: Report) -> str:
        digest = hashlib.blake2b(digest_size=16)
        digest.update(f"{self.voxels.shape}{self.dtype.str[1:]}".encode())
        digest.update((np.round(self.T_scan_voxel, 4) + 0.0).astype("<f8").tobytes())  # + 0.0: no minus zero
        sums, samples, n, rest = [], [], 0, np.zeros(0, np.uint8)
        for raw in self._bytes(report):
            raw = np.concatenate([rest, raw]) if rest.size else raw
            whole = raw.size - raw.size % (8 * _BLOCK)
            blocks, rest = raw[:whole].view("<u8").reshape(-1, _BLOCK), raw[whole:]
            sums.append(blocks.sum(axis=1, dtype=np.uint64).astype("<u8").tobytes())
            samples.append(blocks[-n % 64 :: 64].tobytes())
            n += len(blocks)
        for part in (*sums, *samples, rest.tobytes()):
            digest.update(part)
        self.check()
        return digest.hexdigest()

    def _bytes(self, report: Report) -> Iterator[NDArray[np.uint8]]:
        """Yield the voxels as bytes, a few planes at a time."""
        nz, ny, nx = self.voxels.shape
        n = max(1, _SLAB_BYTES // (ny * nx * self.dtype.itemsize))
        for k in range(0, nz, n):
            report(k / nz)
            slab = self.voxels.read(slice(k, k + n), slice(None), slice(None))
            yield np.ascontiguousarray(slab).reshape(-1).view(np.uint8)


def _checked_affine(affine: ArrayLike) -> FloatArray:
    matrix = np.array(affine, dtype=np.float64)
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        raise GeometryError(f"T_scan_voxel must be a finite (4, 4) matrix, got shape {matrix.shape}")
    lengths = np.linalg.norm(matrix[:3, :3], axis=0)
    if not np.array_equal(matrix[3], [0, 0, 0, 1]) or lengths.min() <= 0:
        raise GeometryError(
            f"T_scan_voxel must have three voxel axes and the last row 0 0 0 1, got {matrix.tolist()}"
        )
    axes = matrix[:3, :3] / lengths
    if np.abs(axes.T @ axes - np.eye(3)).max() > 1e-4:
        raise GeometryError("the voxel axes of T_scan_voxel must be orthogonal; resample the volume first")
    matrix.setflags(write=False)
    return matrix
