"""A triangle mesh of bone: picking on it, projecting to it, and saving it.

Everything is in the scan frame (LPS, mm).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from vtkmodules.vtkCommonCore import mutable, vtkIdList
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData, vtkStaticCellLocator
from vtkmodules.vtkFiltersCore import vtkProbeFilter

from gp_core.errors import GeometryError
from gp_core.validation import FloatArray
from gp_labeler.imaging.cutting import crossing, joined, part_outside
from gp_labeler.imaging.vtk_arrays import (
    cells_of,
    points_of,
    poly_data,
    to_numpy,
    to_vtk,
    triangles_of,
    triple,
)

if TYPE_CHECKING:
    import pyvista as pv

__all__ = ["Surface", "SurfaceHit"]

_PICK_TOLERANCE = 1e-4


@dataclass(frozen=True)
class SurfaceHit:
    """A point on a surface.

    Parameters
    ----------
    point : (3,) float array, mm, scan frame
        Where.
    normal : (3,) float array
        Unit normal of the triangle there, pointing out of the bone.
    triangle : int
        Row of the triangle.
    stride : int
        Of the surface: 1 where it is at full resolution.
    """

    point: FloatArray
    normal: FloatArray
    triangle: int
    stride: int = 1


@dataclass(frozen=True, eq=False)
class Surface:
    """A triangle mesh in the scan frame, with outward normals.

    Parameters
    ----------
    mesh : pyvista.PolyData
        Triangles, with point normals.
    level : float
        Grey value at which the surface was cut.
    T_voxel_scan : (4, 4) float array
        From scan positions (mm) to voxel indices (i, j, k).
    region : (2, 3) float array
        First and last voxel index of the part of the volume that was meshed.
    stride : int
        Voxels taken along each axis: 1 for full resolution.

    Attributes
    ----------
    locator : vtkStaticCellLocator
        Finds triangles along rays and near points, once it is built: at the first use, or by `prepare`.
    """

    mesh: pv.PolyData
    level: float
    T_voxel_scan: FloatArray
    region: FloatArray
    stride: int = 1
    locator: vtkStaticCellLocator = field(default_factory=vtkStaticCellLocator, init=False, repr=False)
    _lock: Lock = field(default_factory=Lock, init=False, repr=False)

    @property
    def points(self) -> NDArray[np.float32]:
        """(N, 3) float32 corners, mm, scan frame (a view, not a copy)."""
        return to_numpy(self.mesh.GetPoints().GetData())

    @property
    def triangles(self) -> NDArray[np.int64]:
        """(T, 3) rows of point numbers, counter-clockwise seen from outside (a view)."""
        return triangles_of(self.mesh)

    @property
    def n_triangles(self) -> int:
        """Number of triangles."""
        return int(self.mesh.GetNumberOfPolys())

    @property
    def voxel_mm(self) -> float:
        """Smallest distance of two neighbouring voxels that were meshed, mm."""
        spacing = np.linalg.norm(np.linalg.inv(self.T_voxel_scan[:3, :3]), axis=0)
        return float(spacing.min() * self.stride)

    @property
    def bounds(self) -> FloatArray:
        """(2, 3) lowest and highest coordinates, mm."""
        return np.array(self.mesh.GetBounds()).reshape(3, 2).T

    @property
    def ready(self) -> bool:
        """Whether picking answers at once."""
        return self.locator.GetDataSet() is not None

    def prepare(self) -> Surface:
        """Build the search structure for picking, in a job, before the first click needs it.

        `vtkStaticCellLocator.BuildLocator` keeps the interpreter for itself (1.4 s at 5 million triangles),
        so a filter that lets go of it is made to call it: a probe of one point.
        """
        with self._lock:
            if not self.ready and self.n_triangles:
                _build_without_blocking(self.locator, self.mesh)
        return self

    def pick(self, ray_origin: ArrayLike, ray_direction: ArrayLike) -> SurfaceHit | None:
        """Return the first point of the surface along a ray: the one that is seen.

        Parameters
        ----------
        ray_origin : (3,) array_like, mm, scan frame
            Where the ray starts, such as the eye.
        ray_direction : (3,) array_like
            Where it goes; any length.

        Returns
        -------
        SurfaceHit or None
            None where the ray misses.
        """
        origin = np.asarray(ray_origin, dtype=np.float64)
        direction = np.asarray(ray_direction, dtype=np.float64)
        span = _span_in_box(origin, direction, self.bounds) if self.n_triangles else None
        return (
            None
            if span is None
            else self._first_hit(origin + span[0] * direction, origin + span[1] * direction)
        )

    def blocks(self, start: ArrayLike, end: ArrayLike) -> bool:
        """Whether bone lies between two scan positions, mm."""
        first, last = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
        return bool(self.n_triangles) and self._first_hit(first, last) is not None

    def project(self, point: ArrayLike) -> SurfaceHit:
        """Return the point of the surface nearest to a scan position.

        Raises
        ------
        GeometryError
            The surface is empty.
        """
        if not self.n_triangles:
            raise GeometryError("the surface is empty: nothing can be projected onto it")
        self.prepare()
        nearest, triangle, part, squared = [0.0, 0.0, 0.0], _out(0), _out(0), _out(0.0)
        self.locator.FindClosestPoint(triple(point), nearest, triangle, part, squared)
        return self._hit(nearest, int(triangle))

    def outside(self, region: FloatArray) -> Surface:
        """Return the surface without what lies inside a region of voxels, such as a finer surface's.

        Triangles that pass through the faces of the region are cut there: whole ones would stand into the
        finer surface, or leave gaps beside it.

        Parameters
        ----------
        region : (2, 3) float array
            First and last voxel index.
        """
        index = self.points @ self.T_voxel_scan[:3, :3].T + self.T_voxel_scan[:3, 3]
        within, through = crossing(index, self.triangles, region)
        kept, cut = _subset(self.mesh, ~(within | through)), _subset(self.mesh, through)
        mesh = joined(kept, part_outside(cut, self.T_voxel_scan, region)) if through.any() else kept
        return Surface(poly_data(mesh), self.level, self.T_voxel_scan, self.region, self.stride)

    def only(self, kept: NDArray[np.bool_]) -> Surface:
        """Return the surface of some of the triangles, (T,) bool, and of the points they use."""
        return Surface(
            poly_data(_subset(self.mesh, kept)), self.level, self.T_voxel_scan, self.region, self.stride
        )

    def drop_parts(self, *, smallest_mm: float, largest: int | None = None) -> None:
        """Drop small parts from the mesh itself, which nobody else may use yet: no copy is made of it.

        Parameters
        ----------
        smallest_mm : float
            Parts smaller than this across are dropped.
        largest : int, optional
            Keep only so many parts, those of the most triangles.
        """
        from gp_labeler.imaging.islands import compact, kept_points  # numba, as below

        kept = kept_points(self.points, self.triangles, smallest_mm=smallest_mm, largest=largest)
        if kept.all():
            return
        n_points, n_triangles = compact(*_arrays(self.mesh), kept)
        corners = self.mesh.GetPolys().GetConnectivityArray()
        for array, n in (
            (self.mesh.GetPoints().GetData(), n_points),
            (self.mesh.GetPointData().GetNormals(), n_points),
            (corners, 3 * n_triangles),
        ):
            if array is not None:
                array.SetNumberOfTuples(n)
                array.Squeeze()  # gives the memory back
                array.Modified()
        cells = vtkCellArray()
        cells.SetData(3, corners)
        self.mesh.SetPolys(cells)
        self.mesh.GetPoints().Modified()

    def save(self, path: str | Path) -> None:
        """Write the surface as ``.ply``, ``.stl``, ``.vtp``, ``.obj``, ``.gltf`` or ``.glb``.

        All but glTF say that the coordinates are LPS.

        Raises
        ------
        GpError
            Another suffix, or the file cannot be written.
        """
        from gp_labeler.imaging.surface_files import write_mesh

        write_mesh(self.mesh, Path(path))

    def _first_hit(self, start: FloatArray, end: FloatArray) -> SurfaceHit | None:
        self.prepare()
        point, inside = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
        along, part, triangle = _out(0.0), _out(0), _out(0)
        tolerance = _PICK_TOLERANCE * self.voxel_mm  # a ray may pass exactly between two triangles
        found = self.locator.IntersectWithLine(
            triple(start), triple(end), tolerance, along, point, inside, part, triangle
        )
        return self._hit(point, int(triangle)) if found else None

    def _hit(self, point: list[float], triangle: int) -> SurfaceHit:
        corners = vtkIdList()
        self.mesh.GetCellPoints(triangle, corners)
        a, b, c = (np.array(self.mesh.GetPoint(corners.GetId(i))) for i in range(3))
        normal = np.cross(b - a, c - a)
        return SurfaceHit(np.array(point), normal / (np.linalg.norm(normal) or 1.0), triangle, self.stride)


def _subset(mesh: vtkPolyData, kept: NDArray[np.bool_]) -> vtkPolyData:
    """Return a mesh of some triangles, and of the points they use."""
    from gp_labeler.imaging.islands import subset  # numba takes long to import: not at start-up

    points, normals, triangles = subset(*_arrays(mesh), kept)
    part = vtkPolyData()
    part.SetPoints(points_of(points))
    part.SetPolys(cells_of(triangles))
    if mesh.GetPointData().GetNormals() is not None:
        part.GetPointData().SetNormals(to_vtk(normals, share=True))
    return part


def _arrays(mesh: vtkPolyData) -> tuple[NDArray[Any], NDArray[Any], NDArray[np.int64]]:
    """Return (N, 3) points and normals, which may be missing, and (T, 3) triangles, as views."""
    normals = mesh.GetPointData().GetNormals()
    return (
        to_numpy(mesh.GetPoints().GetData()),
        np.empty((0, 3), np.float32) if normals is None else to_numpy(normals),
        triangles_of(mesh),
    )


def _build_without_blocking(locator: vtkStaticCellLocator, mesh: vtkPolyData) -> None:
    searched = vtkPolyData()
    searched.SetPoints(mesh.GetPoints())
    searched.SetPolys(mesh.GetPolys())
    searched.SetCellLocator(locator)
    locator.SetDataSet(searched)
    one_point = vtkPolyData()
    one_point.SetPoints(points_of(np.array([mesh.GetCenter()])))
    probe = vtkProbeFilter()
    probe.SetInputData(one_point)
    probe.SetSourceData(searched)
    probe.Update()
    locator.BuildLocator()  # does nothing where the probe has done it


def _out(value: float) -> Any:
    """Make a number that VTK can write into."""
    return mutable(value)


def _span_in_box(origin: FloatArray, direction: FloatArray, bounds: FloatArray) -> tuple[float, float] | None:
    """Return where a ray enters and leaves a box a little wider, in lengths of `direction`, or None."""
    margin = 1e-3 * (1.0 + float(np.ptp(bounds, axis=0).max()))
    widened = bounds + margin * np.array([[-1.0], [1.0]])
    with np.errstate(divide="ignore", invalid="ignore"):
        crossings = np.sort((widened - origin) / direction, axis=0)
    crossings = np.nan_to_num(crossings, nan=0.0, posinf=np.inf, neginf=-np.inf)
    enters, leaves = max(0.0, float(crossings[0].max())), float(crossings[1].min())
    return (enters, leaves) if enters <= leaves and np.isfinite(leaves) else None
