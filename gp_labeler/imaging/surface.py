"""Bone as a triangle mesh: the isosurface of a scan, of all of it coarsely or of a box finely.

Long steps let other threads run: VTK's filters release the interpreter while they update, and so do the
compiled loops.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from vtkmodules.vtkCommonCore import vtkSMPTools
from vtkmodules.vtkCommonDataModel import vtkCellArray

from gp_core.errors import GpError
from gp_core.validation import FloatArray, as_points, check_option
from gp_labeler.imaging.mesh import Surface, SurfaceHit
from gp_labeler.imaging.progress import Progress, Report
from gp_labeler.imaging.threshold import volume_level
from gp_labeler.imaging.volume import GreyArray, Volume
from gp_labeler.imaging.vtk_arrays import narrow_cells, poly_data, to_numpy, to_vtk, triangles_of

if TYPE_CHECKING:
    import pyvista as pv

__all__ = ["METHODS", "Surface", "SurfaceHit", "box_around", "extract_isosurface", "overview_stride"]

OVERVIEW_VOXELS = 256**3
"""For the first look."""

SMALLEST_PART_MM = 1.0
"""Ossicles are larger than this across; specks of noise are smaller."""

_CUT_BY_VTK = ("int8", "uint8", "int16", "uint16", "float32")
"""Flying edges subtracts neighbours in the voxels' own type (VTK 9.7): wider integers wrap around."""

_SLAB_VOXELS = 1 << 26

_UINT16_MAX = 0xFFFF
_FLOAT32_MAX = 1e30
"""Far beyond all grey values, and small enough for a difference of two to be finite."""


def overview_stride(volume: Volume, n_voxels: int = OVERVIEW_VOXELS) -> int:
    """Return the stride at which a first look of a volume takes at most about `n_voxels` voxels."""
    return max(1, int(np.ceil((volume.voxels.size / n_voxels) ** (1 / 3) - 1e-9)))


def box_around(centre: ArrayLike, half_mm: float) -> FloatArray:
    """Return the (2, 3) corners of a cube around a scan position, mm."""
    corners: FloatArray = np.asarray(centre, dtype=np.float64) + half_mm * np.array([[-1.0], [1.0]])
    return corners


def extract_isosurface(
    volume: Volume,
    threshold: float,
    *,
    box: ArrayLike | None = None,
    stride: int = 1,
    smallest_mm: float = SMALLEST_PART_MM,
    largest: int | None = None,
    method: str = "flying-edges",
    progress: Progress | None = None,
    cancel: Callable[[], bool] | None = None,
) -> Surface:
    """Mesh the surface where the grey value crosses a threshold.

    Parameters
    ----------
    volume : Volume
        The scan.
    threshold : float
        Voxels of this value and above are bone (see `surface_level`).
    box : (2, 3) array_like, mm, scan frame, optional
        Opposite corners; only the voxels around this box are meshed.
    stride : int
        Mesh the means of cubes of so many voxels along each edge. Taking single voxels instead would leave
        terraces on slopes.
    smallest_mm : float
        Drop parts smaller than this across; 0 keeps all.
    largest : int, optional
        Keep only so many parts, those of the most triangles.
    method : str
        Of `METHODS`. All three find the same surface, but where a cube may be cut in two ways.
        ``flying-edges`` runs on all cores; ``skimage`` is `skimage.measure.marching_cubes`.
    progress : callable, optional
        Called with the fraction done.
    cancel : callable, optional
        Asked between steps; True stops.

    Returns
    -------
    Surface
        The search structure for picking is made by the first pick, or by `Surface.prepare`.

    Raises
    ------
    GpError
        No surface at this threshold, the box lies outside the volume, or there is no such method.
    Cancelled
        `cancel` said so.

    References
    ----------
    Lorensen and Cline 1987, Marching cubes, doi:10.1145/37402.37422.
    Schroeder, Maynard and Geveci 2015, Flying edges, doi:10.1109/LDAV.2015.7348069.
    """
    check_option(method, "method", METHODS)
    report = Report(progress, cancel)
    report(0.0)
    region = _region(volume, box)
    level = volume_level(volume, threshold)
    mesh = METHODS[method](*_image(volume, region, stride, level, report.part(0.0, 0.5)))
    if volume.is_mirrored:
        _turn_over(mesh)
    surface = Surface(mesh, level, volume.T_voxel_scan, region, stride)
    report(0.6)
    if surface.n_triangles and (smallest_mm > 0 or largest is not None):
        surface.drop_parts(smallest_mm=smallest_mm, largest=largest)
    if surface.n_triangles:
        narrow_cells(surface.mesh)
    report(0.9)
    volume.check()
    if not surface.n_triangles:
        raise _no_surface(volume, threshold, box)
    report(1.0)
    return surface


def _no_surface(volume: Volume, threshold: float, box: ArrayLike | None) -> GpError:
    extremes = np.array([(np.nanmin(plane), np.nanmax(plane)) for plane in volume.voxels.planes()])
    low, high = float(np.nanmin(extremes)), float(np.nanmax(extremes))
    where = "in the volume" if box is None else "in the box"
    return GpError(
        f"no surface {where} at threshold {threshold:g}; the volume's values are {low:g} to {high:g}",
        file=volume.path,
        remedy="Choose another threshold or a larger box.",
    )


def _region(volume: Volume, box: ArrayLike | None) -> FloatArray:
    """Return the first and last voxel index around a box, within the volume."""
    last = np.array(volume.size, dtype=np.float64) - 1
    if box is None:
        return np.stack([np.zeros(3), last])
    low, high = as_points(box, "box")
    corners = np.array([[low, high][c[a]][a] for c in np.ndindex(2, 2, 2) for a in range(3)]).reshape(8, 3)
    index = volume.scan_to_voxel(corners)
    region = np.stack([np.floor(index.min(axis=0)).clip(0), np.minimum(np.ceil(index.max(axis=0)), last)])
    if (region[0] >= region[1]).any():
        raise GpError(
            f"the box {np.round(np.asarray(box), 2).tolist()} mm lies outside the volume",
            remedy="Draw it over the head.",
        )
    return region


def _image(
    volume: Volume, region: FloatArray, stride: int, level: float, report: Report
) -> tuple[pv.ImageData, float]:
    """Wrap (a part of) the voxels for VTK, with the level to cut them at.

    Narrow types are not copied at full resolution. Others, and means, become heights above the level.
    """
    import pyvista as pv  # takes 0.6 s: not before the window shows

    (i0, j0, k0), (i1, j1, k1) = region.astype(int)
    k, j, i = slice(k0, k1 + 1), slice(j0, j1 + 1), slice(i0, i1 + 1)
    first = region[:1]
    if stride > 1:
        part, first = _means(volume, (k, j, i), stride, level, report), first + (stride - 1) / 2
        level = 0.0
    elif (part := volume.voxels.read(k, j, i)).dtype.name not in _CUT_BY_VTK:
        part, level = _narrow(part, level)
    image = pv.ImageData(
        dimensions=part.shape[::-1],
        origin=volume.voxel_to_scan(first)[0],
        spacing=np.array(volume.spacing) * stride,
        direction_matrix=volume.direction,
    )
    image.GetPointData().SetScalars(to_vtk(np.ascontiguousarray(part).ravel(), "values", share=True))
    return image, level


def _means(
    volume: Volume, box: tuple[slice, slice, slice], stride: int, level: float, report: Report
) -> GreyArray:
    """Return the means of cubes of a box, read a slab at a time: a mapped scan stays in its file."""
    from gp_labeler.imaging.coarse import means_of_cubes  # numba, as above

    k, j, i = box
    layers = max(stride, _SLAB_VOXELS // ((j.stop - j.start) * (i.stop - i.start)) // stride * stride)
    means = []
    for first in range(k.start, k.stop, layers):
        report((first - k.start) / (k.stop - k.start))
        slab = volume.voxels.read(slice(first, min(first + layers, k.stop)), j, i)
        means.append(means_of_cubes(slab, stride, level))
    return np.concatenate(means)


def _narrow(values: GreyArray, level: float) -> tuple[GreyArray, float]:
    """Return (z, y, x) values in a type that VTK cuts, and the level among them.

    Whole numbers of which none is 2^16 above another, as most scans hold, are counted from the lowest: exact,
    and half of the memory. Others become heights.
    """
    if values.dtype.kind in "iu":
        low, high = int(values.min()), int(values.max())
        if high - low <= _UINT16_MAX:
            counted = np.empty(values.shape, np.uint16)
            for plane, out in zip(values, counted, strict=True):
                np.subtract(plane, values.dtype.type(low), out=out, casting="unsafe")
            return counted, level - low
    return _heights(values, level), 0.0


def _heights(values: GreyArray, level: float) -> NDArray[np.float32]:
    """Return (z, y, x) values above a level as float32, plane by plane; exact where the surface runs."""
    heights = np.empty(values.shape, np.float32)
    for plane, out in zip(values, heights, strict=True):
        np.clip(plane.astype(np.float64) - level, -_FLOAT32_MAX, _FLOAT32_MAX, out=out, casting="same_kind")
    return heights


def _flying_edges(image: pv.ImageData, level: float) -> pv.PolyData:
    """Run flying edges on all cores, with point numbers of 32 bits: less memory, and less to write.

    It is not stopped in the middle: aborted, it goes on with counts that it has not made (VTK 9.7).
    """
    from vtkmodules.vtkFiltersCore import vtkFlyingEdges3D  # not before the window shows

    contour = vtkFlyingEdges3D()
    contour.SetInputData(image)
    contour.SetValue(0, level)
    contour.ComputeScalarsOff()
    vtkSMPTools.SetBackend("STDThread")  # the wheel's default is one thread
    vtkCellArray.SetDefaultStorageIs64Bit(False)  # what other threads make meanwhile is as good
    try:
        contour.Update()
    finally:
        vtkCellArray.SetDefaultStorageIs64Bit(True)
    return poly_data(contour.GetOutput())


def _marching_cubes(image: pv.ImageData, level: float) -> pv.PolyData:
    """Run VTK's marching cubes, which puts images that are mirrored in the wrong place (9.7), in voxels."""
    import pyvista as pv

    low, high = image.get_data_range()
    if not low < level <= high:
        return pv.PolyData()
    plain = pv.ImageData(dimensions=image.dimensions)
    plain.GetPointData().SetScalars(image.GetPointData().GetScalars())
    mesh = plain.contour([level], method="marching_cubes", compute_scalars=False, preference="point")
    return _placed(image, mesh.points, mesh.regular_faces)


def _skimage(image: pv.ImageData, level: float) -> pv.PolyData:
    """Run scikit-image's marching cubes, of Lorensen and Cline as the others are."""
    import pyvista as pv
    from skimage import measure

    find: Any = measure.marching_cubes  # it has no types
    values = np.asarray(image.active_scalars).reshape(image.dimensions[::-1])
    try:
        corners, faces, _, _ = find(values.astype(np.float32), level, method="lorensen")
    except (ValueError, RuntimeError):  # the level lies outside the values, or no cube is cut
        return pv.PolyData()
    return _placed(image, corners[:, ::-1], faces)


def _placed(image: pv.ImageData, voxels: NDArray[Any], faces: NDArray[Any]) -> pv.PolyData:
    """Return the mesh of (N, 3) voxel indices and (T, 3) corners where the image lies, with normals."""
    import pyvista as pv

    axes = np.asarray(image.direction_matrix) * image.spacing
    points: Any = (voxels.astype(np.float64) @ axes.T + image.origin).astype(np.float32)
    mesh = pv.PolyData.from_regular_faces(points, faces)
    smooth: pv.PolyData = mesh.compute_normals(
        cell_normals=False, split_vertices=False, consistent_normals=False
    )
    return smooth


METHODS: Mapping[str, Callable[[pv.ImageData, float], pv.PolyData]] = MappingProxyType(
    {"flying-edges": _flying_edges, "marching-cubes": _marching_cubes, "skimage": _skimage}
)
"""How an isosurface is found, by the names that ``gp-labeler mesh --method`` takes."""


def _turn_over(mesh: pv.PolyData) -> None:
    """Turn triangles and normals outwards: from an image whose axes mirror both come inwards."""
    corners = triangles_of(mesh)
    corners[:, [1, 2]] = corners[:, [2, 1]]
    normals = to_numpy(mesh.GetPointData().GetNormals())
    np.negative(normals, out=normals)
