"""The slices as pictures standing in the 3D view, each framed in its colour."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkFiltersCore import vtkFeatureEdges
from vtkmodules.vtkFiltersSources import vtkPlaneSource
from vtkmodules.vtkRenderingCore import vtkActor, vtkTexture

from gp_labeler.imaging.vtk_arrays import to_vtk, triple
from gp_labeler.scene.slices import SliceImage
from gp_labeler.scene.stage import Stage, release, solid_actor
from gp_labeler.scene.window_level import WindowLevel

__all__ = ["SlicePlaneActor"]


class SlicePlaneActor:
    """Draws slices in 3D.

    Parameters
    ----------
    stage : Stage
        Where to draw.
    """

    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        self._actors: list[vtkActor] = []

    def show(self, images: Sequence[SliceImage], window: WindowLevel) -> None:
        """Draw these slices in place of those before."""
        self.close()
        for image in images:
            plane = _rectangle(image)
            picture = solid_actor(plane.GetOutput(), "#FFFFFF")
            picture.SetTexture(_texture(image, window))
            picture.GetProperty().LightingOff()
            edges = vtkFeatureEdges()
            edges.SetInputData(plane.GetOutput())
            edges.Update()
            frame = solid_actor(edges.GetOutput(), image.plane.colour)
            frame.GetProperty().LightingOff()
            frame.GetProperty().SetLineWidth(1.5 * self._stage.scale)
            for actor in (picture, frame):
                self._stage.base.AddActor(actor)
                self._actors.append(actor)

    def close(self) -> None:
        """Let go of the pictures."""
        for actor in self._actors:
            release(self._stage.base, actor)
        self._actors = []


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
