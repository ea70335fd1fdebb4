"""Lines drawn over the scene in pixels: rings, outlines, the scale bar."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkRenderingCore import vtkActor2D, vtkPolyDataMapper2D, vtkRenderer

from gp_core.validation import FloatArray
from gp_labeler.imaging.vtk_arrays import cells_of, points_of, to_vtk
from gp_labeler.scene.colours import rgb
from gp_labeler.scene.stage import release

__all__ = ["PixelLines"]

_CLOSED = 1e-3
"""Distance of the ends, pixels, below which a line runs round."""


class PixelLines:
    """Ribbons of a few pixels' width in one renderer.

    They are drawn as quads with soft edges, since wide or smooth lines are not to be had everywhere.

    Parameters
    ----------
    renderer : vtkRenderer
        Drawn over its scene.
    """

    def __init__(self, renderer: vtkRenderer) -> None:
        self._renderer = renderer
        self._data = vtkPolyData()
        mapper = vtkPolyDataMapper2D()
        mapper.SetInputData(self._data)
        mapper.SetScalarModeToUsePointData()
        self._actor = vtkActor2D()
        self._actor.SetMapper(mapper)
        self._actor.PickableOff()
        self._actor.VisibilityOff()
        renderer.AddViewProp(self._actor)

    def draw(
        self,
        lines: Sequence[FloatArray],
        colours: Sequence[str],
        widths: Sequence[float],
        opacity: float = 1.0,
    ) -> None:
        """Draw open lines of (N, 2) pixels (repeat the first point to close one)."""
        self._actor.SetVisibility(bool(lines))
        self._actor.GetProperty().SetOpacity(opacity)
        if not lines:
            return
        height = self._renderer.GetSize()[1]
        counts = np.array([len(line) for line in lines])
        ends = np.cumsum(counts) - 1
        points = np.concatenate(lines)
        across = _across(points, ends - counts + 1, ends)
        flat = _corners(points, across, np.repeat(widths, counts))
        corners = np.column_stack([flat[:, 0] + 0.5, height - flat[:, 1] - 0.5, np.zeros(len(flat))])
        self._data.SetPoints(points_of(corners))
        self._data.SetPolys(cells_of(_quads(np.delete(np.arange(len(points)), ends))))
        self._data.GetPointData().SetScalars(to_vtk(_paint(colours, counts)))

    def close(self) -> None:
        """Let go of the actor."""
        release(self._renderer, self._actor)


def _across(points: FloatArray, first: NDArray[np.int_], last: NDArray[np.int_]) -> FloatArray:
    """Return (N, 2) unit vectors across lines that begin and end at these numbers."""
    steps = np.diff(points, axis=0)
    along = np.empty_like(points)
    along[1:-1] = steps[:-1] + steps[1:]
    along[first], along[last] = steps[first], steps[last - 1]
    is_closed = (np.abs(points[first] - points[last]).max(axis=1) < _CLOSED) & (last - first > 1)
    first, last = first[is_closed], last[is_closed]
    along[first] = along[last] = steps[first] + steps[last - 1]
    length = np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    across: FloatArray = along[:, ::-1] * np.array([-1.0, 1.0]) / length
    return across


def _corners(points: FloatArray, across: FloatArray, widths: FloatArray) -> FloatArray:
    """Return (4 N, 2) corners: of each point of a line four across, the outer two a soft edge."""
    inner, outer = np.maximum(widths - 1, 0.0) / 2, (widths + 1) / 2
    offsets = np.stack([-outer, -inner, inner, outer], axis=1)
    return (points[:, None] + across[:, None] * offsets[:, :, None]).reshape(-1, 2)


def _quads(begins: NDArray[np.int_]) -> NDArray[np.int64]:
    """Return (M, 4) corner numbers of the quads that run from these points to the next."""
    first = 4 * begins[:, None] + np.arange(3)
    quads: NDArray[np.int64] = first.reshape(-1, 1) + np.array([0, 1, 5, 4], dtype=np.int64)
    return quads


def _paint(colours: Sequence[str], counts: NDArray[np.int_]) -> NDArray[np.uint8]:
    """Return (4 N, 4) red, green, blue and opacity of the corners of so many points of each line."""
    paint = np.full((counts.sum(), 4, 4), 255, dtype=np.uint8)
    shades = np.rint(np.array([rgb(colour) for colour in colours]) * 255)
    paint[:, :, :3] = np.repeat(shades, counts, axis=0)[:, None]
    paint[:, [0, 3], 3] = 0
    return paint.reshape(-1, 4)
