"""A triangle mesh of bone: picking on it, projecting to it, and saving it.

Everything is in the scan frame (LPS, mm).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData

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
)

if TYPE_CHECKING:
    import pyvista as pv

    from gp_labeler.imaging.triangle_search import TriangleSearch

__all__ = ["Surface", "SurfaceHit"]


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
    """

    mesh: pv.PolyData
    level: float
    T_voxel_scan: FloatArray
    region: FloatArray
    stride: int = 1

    @property
    def points(self) -> NDArray[np.float32]:
        """(N, 3) float32 corners, mm, scan frame (a view, not a copy)."""
        return to_numpy(self.mesh.GetPoints().GetData())

    @property
    def triangles(self) -> NDArray[np.integer[Any]]:
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

    @cached_property
    def search(self) -> TriangleSearch:
        """Finds triangles along rays and near points; built at the first use, or by `prepare`."""
        from gp_labeler.imaging.triangle_search import TriangleSearch  # numba, as below

        return TriangleSearch.of(self.points, self.triangles)

    def prepare(self) -> Surface:
        """Build the search structure for picking, in a job, before the first click needs it."""
        if self.n_triangles:
            self.project(self.points[0])  # so that the search itself is loaded, too
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
        length = float(np.linalg.norm(direction))
        if not self.n_triangles or not length:
            return None
        beyond = float(np.linalg.norm(self.bounds - origin, axis=1).sum())  # all of it is nearer
        return self._first_hit(origin, direction * (beyond / length))

    def blocks(self, start: ArrayLike, end: ArrayLike) -> bool:
        """Whether bone lies between two scan positions, mm."""
        first, last = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
        return self._first_hit(first, last - first) is not None

    def project(self, point: ArrayLike) -> SurfaceHit:
        """Return the point of the surface nearest to a scan position.

        Raises
        ------
        GeometryError
            The surface is empty.
        """
        if not self.n_triangles:
            raise GeometryError("the surface is empty: nothing can be projected onto it")
        triangle, nearest = self.search.nearest(np.asarray(point, dtype=np.float64))
        return self._hit(nearest, triangle)

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

    def _first_hit(self, start: FloatArray, along: FloatArray) -> SurfaceHit | None:
        found = self.search.first_along(start, along) if self.n_triangles else None
        return None if found is None else self._hit(start + found[1] * along, found[0])

    def _hit(self, point: FloatArray, triangle: int) -> SurfaceHit:
        a, b, c = self.points[self.triangles[triangle]].astype(np.float64)
        normal = np.cross(b - a, c - a)
        return SurfaceHit(point, normal / (np.linalg.norm(normal) or 1.0), triangle, self.stride)


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


def _arrays(mesh: vtkPolyData) -> tuple[NDArray[Any], NDArray[Any], NDArray[np.integer[Any]]]:
    """Return (N, 3) points and normals, which may be missing, and (T, 3) triangles, as views."""
    normals = mesh.GetPointData().GetNormals()
    return (
        to_numpy(mesh.GetPoints().GetData()),
        np.empty((0, 3), np.float32) if normals is None else to_numpy(normals),
        triangles_of(mesh),
    )
