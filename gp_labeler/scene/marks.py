"""Landmarks in the 3D view: solid where they are seen, faint where bone hides them, each with its label."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gp_core.validation import FloatArray
from gp_labeler.scene.camera import Viewpoint
from gp_labeler.scene.labels import Label
from gp_labeler.scene.lines2d import PixelLines
from gp_labeler.scene.mark_images import mark_image
from gp_labeler.scene.sprites import SpriteSheet, Text
from gp_labeler.scene.stage import Stage

__all__ = ["REFERENCE", "GlyphSize", "Mark", "MarkActor"]

REFERENCE = "reference"
"""The state of a mark that is only looked at: smaller, hollow, and never picked."""

_SHAPES = {"computed": "diamond", "doubtful": "triangle", "suggested": "frame", REFERENCE: "inverted"}
"""A state shows by shape as well as by colour; others are balls."""

_FAINT = 0.30
_ACTIVE_GROWS = 1.35
_REFERENCE_SHRINKS = 0.8
_RING_PIXELS = 5.0


@dataclass(frozen=True)
class GlyphSize:
    """How large marks are drawn.

    Parameters
    ----------
    diameter : float
        In mm, or in logical pixels.
    unit : str
        ``mm`` or ``px``.
    """

    diameter: float = 10.0
    unit: str = "px"


@dataclass(frozen=True, eq=False)
class Mark:
    """A landmark to draw.

    Parameters
    ----------
    key : str
        Its name among all marks, such as ``"L:CA"``.
    position : (3,) float array
        Scan frame, mm.
    label : str
        What stands beside it; empty for none.
    state : str
        ``placed``, ``suggested``, ``computed``, ``doubtful``, ``other`` (the other side), `REFERENCE` or
        any other state of the theme.
    active : bool
        Whether it is the one being worked on: larger, and its label is never left out.
    """

    key: str
    position: FloatArray
    label: str = ""
    state: str = "placed"
    active: bool = False


class MarkActor:
    """Draws landmarks.

    Parameters
    ----------
    stage : Stage
        Where to draw.
    """

    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        self._marks: tuple[Mark, ...] = ()
        self.size = GlyphSize()
        self.show_hidden = True
        self._sheet = SpriteSheet(stage.overlay)
        self._images: list[NDArray[np.float32]] = []
        self._rings = PixelLines(stage.overlay)
        self._drawn: tuple[object, ...] = ()
        self._labels: list[Label] = []

    def show(self, marks: Sequence[Mark]) -> None:
        """Draw these marks in place of those before."""
        self._marks = tuple(mark for mark in marks if np.isfinite(mark.position).all())

    @property
    def marks(self) -> tuple[Mark, ...]:
        """What is drawn."""
        return self._marks

    @property
    def positions(self) -> FloatArray:
        """(N, 3) scan positions of the marks, mm."""
        return np.array([mark.position for mark in self._marks], dtype=np.float64).reshape(-1, 3)

    def diameters(self, view: Viewpoint) -> FloatArray:
        """Return how large the marks are now, (N,) mm."""
        if self.size.unit == "mm":
            sizes = np.full(len(self._marks), self.size.diameter)
        else:
            sizes = self.size.diameter * self._stage.scale * view.pixel_sizes(self.positions)
        grown: FloatArray = sizes * [_growth(mark) for mark in self._marks]
        return grown

    def refresh(
        self, view: Viewpoint, hidden: NDArray[np.bool_], *, bone_opacity: float = 1.0
    ) -> list[Label]:
        """Bring sizes and faintness up to date with the camera, and return the labels to draw.

        Parameters
        ----------
        view : Viewpoint
            The projection of this frame.
        hidden : (N,) bool array
            Which marks lie behind bone.
        bone_opacity : float
            From 0 to 1; the fainter bone is, the clearer what lies behind it.
        """
        looks = (bone_opacity, self.size, self.show_hidden, self._stage.scale, self._stage.colours)
        now = (self._marks, view.matrix.tobytes(), view.size, hidden.tobytes(), looks)
        if now != self._drawn:
            self._drawn, self._labels = now, self._laid_out(view, hidden, bone_opacity)
        return self._labels

    def _laid_out(self, view: Viewpoint, hidden: NDArray[np.bool_], bone_opacity: float) -> list[Label]:
        display = view.display(self.positions)
        sizes, pixels = self.diameters(view), display[:, :2]
        radii = 0.5 * sizes / view.pixel_sizes(self.positions)
        through = 1.0 - (1.0 - _FAINT) * bone_opacity
        clear = np.where(hidden, through * self.show_hidden, 1.0)
        self._draw(pixels, radii, clear, np.argsort(-display[:, 2]))
        self._ring_active(pixels, radii)
        return [
            self._label(mark, pixel, float(radius), bool(behind))
            for mark, pixel, radius, behind in zip(self._marks, pixels, radii, hidden, strict=True)
            if mark.label and (self.show_hidden or not behind or mark.active)
        ]

    def _draw(
        self, pixels: FloatArray, radii: FloatArray, clear: FloatArray, order: NDArray[np.int_]
    ) -> None:
        """Draw the marks, the farthest first."""
        drawn = [n for n in order.tolist() if clear[n] > 0]
        images = [self._image(self._marks[n], float(radii[n]), float(clear[n])) for n in drawn]
        if [id(image) for image in images] != [id(image) for image in self._images]:
            self._sheet.take(images)
            self._images = images
        halves = np.array([image.shape[0] // 2 for image in images]).reshape(-1, 1)
        self._sheet.draw(np.arange(len(drawn)), np.rint(pixels[drawn]) - halves)

    def _image(self, mark: Mark, radius: float, clear: float) -> NDArray[np.float32]:
        diameter = round(4 * radius) / 2
        return mark_image(_SHAPES.get(mark.state, "ball"), self._colour(mark), diameter, round(clear, 2))

    def _colour(self, mark: Mark) -> str:
        colours = self._stage.colours
        return colours.states.get(mark.state, colours.text)

    def _label(self, mark: Mark, pixel: FloatArray, radius: float, hidden: bool) -> Label:
        gap = (
            max(radius, 4.0)
            + 2.0 * self._stage.scale
            + (_RING_PIXELS * self._stage.scale if mark.active else 0.0)
        )
        rank = 2.0 if mark.active else -float(hidden) - 2.0 * (mark.state == REFERENCE)
        return Label(
            Text(mark.label, self._stage.colours.word(mark.state)),
            pixel,
            gap,
            rank,
            hidden and not mark.active,
        )

    def _ring_active(self, pixels: FloatArray, radii: FloatArray) -> None:
        scale, turn = self._stage.scale, np.linspace(0, 2 * np.pi, 49)
        circle = np.stack([np.cos(turn), np.sin(turn)], axis=1)
        rings = [
            pixel + (radius + _RING_PIXELS * scale) * circle
            for mark, pixel, radius in zip(self._marks, pixels, radii, strict=True)
            if mark.active
        ]
        self._rings.draw(
            rings, [self._stage.colours.states["active"]] * len(rings), [2.0 * scale] * len(rings)
        )

    def close(self) -> None:
        """Let go of the glyphs."""
        self._marks = ()
        self._sheet.close()
        self._rings.close()


def _growth(mark: Mark) -> float:
    if mark.state == REFERENCE:
        return _REFERENCE_SHRINKS
    return _ACTIVE_GROWS if mark.active else 1.0
