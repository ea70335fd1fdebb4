"""Lines drawn over the scene in pixels: rings, outlines, the scale bar."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkRenderingCore import vtkActor2D, vtkPolyDataMapper2D, vtkRenderer

from gp_core.checks import FloatArray
from gp_labeler.imaging.vtk_arrays import cells_of, points_of, to_vtk
from gp_labeler.scene.colours import rgb
from gp_labeler.scene.stage import release

__all__ = ["PixelLines"]


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
        ribbons = [_ribbon(line, width) for line, width in zip(lines, widths, strict=True)]
        starts = np.cumsum([0, *(len(ribbon) for ribbon in ribbons[:-1])])
        flat = np.concatenate(ribbons)
        corners = np.column_stack([flat[:, 0] + 0.5, height - flat[:, 1] - 0.5, np.zeros(len(flat))])
        quads = np.concatenate(
            [start + _quads(len(ribbon)) for start, ribbon in zip(starts, ribbons, strict=True)]
        )
        paint = np.concatenate(
            [_paint(colour, len(ribbon)) for colour, ribbon in zip(colours, ribbons, strict=True)]
        )
        self._data.SetPoints(points_of(corners))
        self._data.SetPolys(cells_of(quads))
        self._data.GetPointData().SetScalars(to_vtk(paint))

    def close(self) -> None:
        """Let go of the actor."""
        release(self._renderer, self._actor)


def _ribbon(line: FloatArray, width: float) -> FloatArray:
    """Return (4 N, 2) corners: of each point of a line four across, the outer two a soft edge."""
    along = np.gradient(line, axis=0)
    if len(line) > 2 and np.allclose(line[0], line[-1]):
        along[[0, -1]] = line[1] - line[-2]
    length = np.linalg.norm(along, axis=1, keepdims=True)
    across = along[:, ::-1] * np.array([-1.0, 1.0]) / np.maximum(length, 1e-9)
    inner, outer = max(width - 1, 0.0) / 2, (width + 1) / 2
    return np.stack([line + across * offset for offset in (-outer, -inner, inner, outer)], axis=1).reshape(
        -1, 2
    )


def _quads(n_corners: int) -> NDArray[np.int64]:
    """Return (M, 4) corner numbers of the quads between the points of a ribbon."""
    first = np.arange(0, n_corners - 4, 4)[:, None] + np.arange(3)
    quads: NDArray[np.int64] = first.reshape(-1, 1) + np.array([0, 1, 5, 4], dtype=np.int64)
    return quads


def _paint(colour: str, n_corners: int) -> NDArray[np.uint8]:
    """Return (n, 4) red, green, blue and opacity of the corners of a ribbon."""
    paint = np.full((n_corners, 4), 255, dtype=np.uint8)
    paint[:, :3] = np.rint(np.array(rgb(colour)) * 255)
    paint[0::4, 3] = paint[3::4, 3] = 0
    return paint
