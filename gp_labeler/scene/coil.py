"""Where a slice cuts the outline of an estimated cochlea."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gp_core.validation import FloatArray
from gp_labeler.imaging.slice_plane import SlicePlane
from gp_labeler.imaging.vtk_arrays import to_numpy, triangles_of
from gp_labeler.scene.pose_data import DrawnPose

if TYPE_CHECKING:
    import pyvista as pv

__all__ = ["section"]


def section(tube: pv.PolyData, pose: DrawnPose, plane: SlicePlane, position: float) -> list[FloatArray]:
    """Cut a tube where it lies in the scan by a slice.

    Parameters
    ----------
    tube : pv.PolyData
        A closed surface of triangles in the cochlea frame, mm.
    pose : DrawnPose
        Where it lies.
    plane : SlicePlane
        Which plane.
    position : float
        Of the slice along its normal, mm.

    Returns
    -------
    list of (n, 3) float array
        Closed outlines in the scan, mm; none where the plane misses the tube.
    """
    matrix, corners = pose.T_scan_cochlea, triangles_of(tube)
    points = to_numpy(tube.GetPoints().GetData()).astype(np.float64)  # pyvista's arrays take twice the time
    depth = points @ (plane.normal @ matrix[:3, :3]) + (plane.position_of(matrix[:3, 3]) - position)
    ahead = depth > 0
    cut = corners[ahead[corners].any(axis=1) & ~ahead[corners].all(axis=1)]
    if not len(cut):
        return []
    edges = np.sort(np.stack([cut, np.roll(cut, -1, axis=1)], axis=2), axis=2)  # (T, 3 edges, 2 ends)
    crossing = edges[ahead[edges[..., 0]] != ahead[edges[..., 1]]].reshape(-1, 2)
    keys, number = np.unique(crossing @ [len(depth), 1], return_inverse=True)
    ends = np.stack(np.divmod(keys, len(depth)), axis=1)
    first, last = depth[ends[:, 0]], depth[ends[:, 1]]
    share = (first / (first - last))[:, None]
    scan = pose.at((1 - share) * points[ends[:, 0]] + share * points[ends[:, 1]])
    return [scan[loop] for loop in _loops(number.reshape(-1, 2))]


def _loops(pairs: NDArray[np.int64]) -> list[list[int]]:
    """Join pairs of point numbers, each number in two pairs, into closed loops."""
    beside: dict[int, list[int]] = {}
    for a, b in pairs.tolist():
        beside.setdefault(a, []).append(b)
        beside.setdefault(b, []).append(a)
    loops = []
    while beside:
        start, neighbours = beside.popitem()
        loop, here = [start], neighbours[0]
        while here != start:
            before, (one, other) = loop[-1], beside.pop(here)
            loop.append(here)
            here = other if one == before else one
        loops.append(loop)
    return loops
