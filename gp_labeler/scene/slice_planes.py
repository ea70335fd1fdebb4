"""The slices as pictures standing in the 3D view, each framed in its colour."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkFiltersCore import vtkFeatureEdges
from vtkmodules.vtkFiltersSources import vtkPlaneSource
from vtkmodules.vtkRenderingCore import vtkActor, vtkTexture

from gp_core.validation import FloatArray
from gp_labeler.imaging.vtk_arrays import to_vtk, triple
from gp_labeler.scene.render_layers import RenderLayers, release, solid_actor
from gp_labeler.scene.slices import SliceImage
from gp_labeler.scene.window_level import WindowLevel

__all__ = ["SlicePlaneActor"]


class SlicePlaneActor:
    """Draws slices in 3D.

    Parameters
    ----------
    layers : RenderLayers
        Where to draw.
    """

    def __init__(self, layers: RenderLayers) -> None:
        self._layers = layers
        self._actors: list[vtkActor] = []
        self._images: tuple[SliceImage, ...] = ()

    def show(self, images: Sequence[SliceImage], window: WindowLevel, colours: Sequence[str]) -> None:
        """Draw these slices in place of those before, each framed in its colour."""
        self.close()
        self._images = tuple(images)
        for image, colour in zip(images, colours, strict=True):
            plane = _rectangle(image)
            picture = solid_actor(plane.GetOutput(), "#FFFFFF")
            picture.SetTexture(_texture(image, window))
            picture.GetProperty().LightingOff()
            edges = vtkFeatureEdges()
            edges.SetInputData(plane.GetOutput())
            edges.Update()
            frame = solid_actor(edges.GetOutput(), colour)
            frame.GetProperty().LightingOff()
            frame.GetProperty().SetLineWidth(1.5 * self._layers.scale)
            for actor in (picture, frame):
                self._layers.base.AddActor(actor)
                self._actors.append(actor)

    @property
    def images(self) -> tuple[SliceImage, ...]:
        """What is drawn."""
        return self._images

    def pick(self, origin: ArrayLike, direction: ArrayLike) -> FloatArray | None:
        """Return the first (3,) point of the pictures along a ray, or None."""
        start, along = np.asarray(origin, dtype=np.float64), np.asarray(direction, dtype=np.float64)
        reached = [_crossing(image, start, along) for image in self._images]
        nearest = min((r for r in reached if r is not None), default=None)
        return None if nearest is None else start + nearest * along

    def blocks(self, start: ArrayLike, end: ArrayLike) -> bool:
        """Whether a picture lies between two scan positions."""
        first, last = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
        reached = [_crossing(image, first, last - first) for image in self._images]
        return any(r is not None and r < 1 for r in reached)

    def close(self) -> None:
        """Let go of the pictures."""
        self._images = ()
        for actor in self._actors:
            release(self._layers.base, actor)
        self._actors = []


def _crossing(image: SliceImage, start: FloatArray, along: FloatArray) -> float | None:
    """Return where a ray meets a picture, in lengths of its direction, or None where it passes by."""
    across = float(along @ image.plane.normal)
    if not across:
        return None
    there = (image.position - image.plane.position_of(start)) / across
    low, high = image.edges
    at = image.plane.flat((start + there * along)[None])[0]
    return there if there >= 0 and bool(((at >= low) & (at <= high)).all()) else None


def _rectangle(image: SliceImage) -> vtkPlaneSource:
    (left, top), (right, bottom) = image.edges
    corner, along, up = image.plane.scan(
        np.array([[left, bottom], [right, bottom], [left, top]]), image.position
    )
    rectangle = vtkPlaneSource()
    rectangle.SetOrigin(*triple(corner))
    rectangle.SetPoint1(*triple(along))
    rectangle.SetPoint2(*triple(up))
    rectangle.Update()
    return rectangle


def _texture(image: SliceImage, window: WindowLevel) -> vtkTexture:
    grey = image.grey(window)[::-1]  # VTK's textures start at the bottom
    data = vtkImageData()
    data.SetDimensions(grey.shape[1], grey.shape[0], 1)
    data.GetPointData().SetScalars(to_vtk(np.repeat(grey.reshape(-1, 1), 3, axis=1)))
    texture = vtkTexture()
    texture.SetInputData(data)
    texture.InterpolateOn()
    return texture
