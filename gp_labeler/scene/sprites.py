"""Crisp 2D text with a halo, drawn over the 3D scene at whole pixels.

VTK's own text actors have no halo; without one, a label is lost on bone of its own brightness. Texts are
drawn once into one texture, and each frame only moves the quads that show pieces of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPolyData
from vtkmodules.vtkRenderingCore import (
    vtkPolyDataMapper2D,
    vtkRenderer,
    vtkTextProperty,
    vtkTextRenderer,
    vtkTexture,
    vtkTexturedActor2D,
)

from gp_core.validation import FloatArray
from gp_labeler.imaging.vtk_arrays import cells_of, points_of, to_numpy, to_vtk
from gp_labeler.scene.colours import rgb
from gp_labeler.scene.typeface import font_file

__all__ = ["SpriteSheet", "Text", "text_image"]

_HALO_PIXELS = 2.0
_FAINT = 0.45
_FONT_FILE = 4
"""VTK_FONT_FILE of vtkTextProperty.h, which Python does not name."""


@dataclass(frozen=True)
class Text:
    """A piece of text to draw.

    Parameters
    ----------
    text : str
        What it says.
    colour : str
        ``#RRGGBB``.
    bold : bool
        Heavier.
    """

    text: str
    colour: str
    bold: bool = True


def text_image(text: Text, height: float, halo: str) -> NDArray[np.float32]:
    """Draw text with a halo; return (h, w, 4) red, green, blue, opacity from 0 to 1, rows from the top.

    Parameters
    ----------
    text : Text
        What to draw.
    height : float
        Font size, device pixels.
    halo : str
        Colour of the edge, ``#RRGGBB``.
    """
    if not text.text:
        return np.zeros((0, 0, 4), dtype=np.float32)
    from scipy.ndimage import gaussian_filter

    radius = _HALO_PIXELS * height / 13
    ink = np.pad(_ink(text, height), int(np.ceil(2 * radius)))
    glow = np.clip(gaussian_filter(ink, radius / 2) * 2.2, 0, 0.9) * (1 - ink)
    opacity = ink + glow
    image = np.empty((*ink.shape, 4), dtype=np.float32)
    mixed = ink[..., None] * np.array(rgb(text.colour)) + glow[..., None] * np.array(rgb(halo))
    image[..., :3] = mixed / np.maximum(opacity, 1e-6)[..., None]
    image[..., 3] = opacity
    return image


def _ink(text: Text, height: float) -> NDArray[np.float32]:
    """Coverage of the letters alone, from 0 to 1; as high as a line, so that baselines agree."""
    style = vtkTextProperty()
    _set_font(style, bold=text.bold)
    style.SetFontSize(max(6, round(height)))
    image, size = vtkImageData(), [0, 0]
    if not vtkTextRenderer.GetInstance().RenderString(style, text.text, image, size, 72) or not min(size):
        return np.zeros((1, 1), dtype=np.float32)
    width, rows, _ = image.GetDimensions()
    alpha = to_numpy(image.GetPointData().GetScalars()).reshape(rows, width, -1)[::-1, :, 3]
    used = np.flatnonzero(alpha.any(axis=0))
    lines = np.flatnonzero(alpha.any(axis=1))
    if not len(used):
        return np.zeros((1, 1), dtype=np.float32)
    cut = alpha[lines[0] : lines[-1] + 1, used[0] : used[-1] + 1]
    return (cut / 255).astype(np.float32)


def _set_font(style: vtkTextProperty, *, bold: bool) -> None:
    """Write in the program's font; in VTK's own where the package with it is missing."""
    path = font_file("Bold" if bold else "Regular")
    if path is None:
        style.SetFontFamilyToArial()
        style.SetBold(bold)
    else:
        style.SetFontFamily(_FONT_FILE)
        style.SetFontFile(str(path))


class SpriteSheet:
    """Small texts over one renderer.

    Parameters
    ----------
    renderer : vtkRenderer
        Drawn last, over the scene.
    """

    def __init__(self, renderer: vtkRenderer) -> None:
        self._renderer = renderer
        self._quads = vtkPolyData()
        mapper = vtkPolyDataMapper2D()
        mapper.SetInputData(self._quads)
        self._texture = vtkTexture()
        self._texture.InterpolateOff()
        self._texture.RepeatOff()
        self._actor = vtkTexturedActor2D()
        self._actor.SetMapper(mapper)
        self._actor.SetTexture(self._texture)
        self._actor.PickableOff()
        self._actor.VisibilityOff()
        renderer.AddViewProp(self._actor)
        self._boxes = np.empty((0, 4))
        self._shape = (1, 1)
        self._images: dict[tuple[Text, float, str], NDArray[np.float32]] = {}

    def close(self) -> None:
        """Let go of the texture and the actor."""
        self._renderer.RemoveViewProp(self._actor)
        self._texture.ReleaseGraphicsResources(self._renderer.GetRenderWindow())

    @property
    def sizes(self) -> FloatArray:
        """(N, 2) width and height of each text, pixels."""
        return self._boxes[:, 2:] - self._boxes[:, :2]

    def write(self, texts: Sequence[Text], height: float, halo: str) -> None:
        """Draw the texts into the texture, once full and once faint beside it."""
        keys = [(text, height, halo) for text in texts]
        self._images = {key: self._images[key] if key in self._images else text_image(*key) for key in keys}
        self.take([self._images[key] for key in keys])

    def take(self, images: Sequence[NDArray[np.float32]]) -> None:
        """Take (h, w, 4) pictures, from 0 to 1, in place of texts."""
        self._boxes = np.zeros((len(images), 4))
        if not any(image.size for image in images):
            self._actor.VisibilityOff()
            return
        width = max(image.shape[1] for image in images)
        rows = np.cumsum([0, *(image.shape[0] for image in images)])
        sheet = np.zeros((int(rows[-1]), 2 * width, 4), dtype=np.float32)
        for n, image in enumerate(images):
            h, w = image.shape[:2]
            sheet[rows[n] : rows[n] + h, :w] = image
            sheet[rows[n] : rows[n] + h, width : width + w] = image * [1, 1, 1, _FAINT]
            self._boxes[n] = (0, rows[n], w, rows[n] + h)
        self._shape = sheet.shape[:2]
        self._upload(sheet)

    def draw(self, which: ArrayLike, corners: ArrayLike, faint: ArrayLike | bool = False) -> None:
        """Show texts, by number, with their top left corners at pixels.

        Parameters
        ----------
        which : (M,) array_like of int
            Numbers of the texts.
        corners : (M, 2) array_like
            Pixels from the top left of the view.
        faint : (M,) array_like of bool
            Which are drawn faintly.
        """
        number = np.asarray(which, dtype=int)
        if not len(number):
            self._actor.VisibilityOff()
            return
        boxes = self._boxes[number].copy()
        size = boxes[:, 2:] - boxes[:, :2]
        boxes[:, [0, 2]] += np.where(faint, self._shape[1] / 2, 0.0).reshape(-1, 1)
        top_left = np.rint(np.asarray(corners, dtype=np.float64))
        height = self._renderer.GetSize()[1]
        _set_quads(self._quads, top_left, size, boxes / np.array([*self._shape[::-1]] * 2), height)
        self._actor.VisibilityOn()

    def _upload(self, sheet: NDArray[np.float32]) -> None:
        image = vtkImageData()
        image.SetDimensions(sheet.shape[1], sheet.shape[0], 1)
        pixels = np.ascontiguousarray((sheet[::-1] * 255 + 0.5).astype(np.uint8)).reshape(-1, 4)
        image.GetPointData().SetScalars(to_vtk(pixels))
        self._texture.SetInputData(image)


def _set_quads(
    quads: vtkPolyData, top_left: FloatArray, size: FloatArray, texture: FloatArray, height: int
) -> None:
    """Set rectangles in VTK's display coordinates (from the bottom left) and their textures."""
    right_down = np.array([[0, 1], [1, 1], [1, 0], [0, 0]])  # counter-clockwise from the lower left
    xy = top_left[:, None] + right_down * size[:, None]
    corners = np.zeros((4 * len(size), 3))
    corners[:, 0] = xy[..., 0].ravel()
    corners[:, 1] = height - xy[..., 1].ravel()
    uv = texture[:, None, :2] + right_down * (texture[:, None, 2:] - texture[:, None, :2])
    uv[..., 1] = 1 - uv[..., 1]
    quads.SetPoints(points_of(corners))
    quads.SetPolys(cells_of(np.arange(4 * len(size)).reshape(-1, 4)))
    quads.GetPointData().SetTCoords(to_vtk(uv.reshape(-1, 2).astype(np.float32), "texture"))
