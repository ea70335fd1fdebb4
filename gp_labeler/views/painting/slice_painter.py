"""What a slice view paints, in device pixels."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from qtpy.QtCore import QPointF, QRectF
from qtpy.QtGui import QColor, QImage, QPainter, QPen, QPixmap

from gp_core.validation import FloatArray
from gp_labeler.imaging.anatomical_frame import AnatomicalFrame
from gp_labeler.imaging.slab import denoised
from gp_labeler.imaging.slice_plane import SlicePlane
from gp_labeler.models.workspace import Workspace
from gp_labeler.scene.colours import DARK
from gp_labeler.scene.crosshair_arms import HANDLE_PIXELS
from gp_labeler.scene.ghosts import GhostEllipsoid, ellipse
from gp_labeler.scene.marks import Mark, growth_of
from gp_labeler.scene.planes import Plane
from gp_labeler.scene.segments import Segment
from gp_labeler.scene.slice_viewport import SliceViewport
from gp_labeler.scene.slices import SliceImage, VolumeSlicer
from gp_labeler.views.drawn import drawn_ghosts, drawn_marks, drawn_segments
from gp_labeler.views.filter_words import filter_words
from gp_labeler.views.fonts import TEXT, text_scale
from gp_labeler.views.painting.marks import paint_mark
from gp_labeler.views.painting.name_tags import NameTag, paint_words, place_names
from gp_labeler.views.painting.qt_paths import draw_segments, polygon
from gp_labeler.views.painting.scale_bar import paint_scale_bar
from gp_labeler.views.painting.slice_lines import paint_lines
from gp_labeler.views.painting.word_pictures import word_picture
from gp_labeler.views.signals import follow
from gp_labeler.views.theme import Theme, theme_of

if TYPE_CHECKING:
    from gp_labeler.views.slice_view import SliceView

__all__ = ["SlicePainter", "SlicePoints", "reach_of"]

_Where = tuple[VolumeSlicer, SlicePlane, float, float]
"""What a picture of a slice is of: scan, plane, position and step of sampling, mm."""

_COARSER = 3.0
"""Times, of a slab or a denoised slice while its plane is turned: a slab has so many fewer layers as well."""

_REACH_MM = 1.0
_CLOSE_PIXELS = 12.0
"""From so many logical pixels a millimetre on, points beside the slice are named too."""

_BAR_PIXELS, _BAR_SHARE = 90.0, 0.3
"""Of the width of a small view: there the scale bar leaves the letter at the lower edge alone."""


def reach_of(source: VolumeSlicer, plane: SlicePlane) -> float:
    """Return how far off a slice points are still drawn on it, mm."""
    return max(_REACH_MM, 1.5 * source.step(plane))


class SlicePoints(NamedTuple):
    """What of the labels is painted, as it was when one of them changed last."""

    marks: list[Mark]
    positions: FloatArray
    ghosts: list[GhostEllipsoid]
    lines: list[Segment]

    @classmethod
    def of(cls, workspace: Workspace) -> SlicePoints:
        """Ask for them."""
        marks = drawn_marks(workspace)
        positions = np.array([mark.position for mark in marks]).reshape(-1, 3)
        return cls(marks, positions, drawn_ghosts(workspace), drawn_segments(workspace, DARK))


class SlicePainter:
    """Paints one slice view; remembers the picture of the slice while only what lies over it changes.

    Parameters
    ----------
    workspace : Workspace
        What is shown.
    view : SliceView
        Where.
    """

    def __init__(self, workspace: Workspace, view: SliceView) -> None:
        self._workspace, self._view = workspace, view
        self._preview: float | None = None
        self._slice: SliceImage | None = None
        self._where: _Where | None = None
        self._filtered: tuple[object, SliceImage] | None = None
        self._picture: tuple[object, QImage] | None = None
        self._outline: tuple[object, FloatArray] | None = None
        self._ground: tuple[SliceViewport, VolumeSlicer, object, QPixmap] | None = None
        self._points: SlicePoints | None = None
        follow(view, workspace.scan.threshold_previewed, self._on_preview)
        follow(view, workspace.scan.slice_read, self._on_slice_read)

    @property
    def points(self) -> SlicePoints:
        """The points, ghosts and lines that are painted."""
        if self._points is None:
            self._points = SlicePoints.of(self._workspace)
        return self._points

    @property
    def outline_length(self) -> float:
        """How long the edge of bone is that was painted last, mm; 0 where none is."""
        if self._outline is None:
            return 0.0
        start, end = self._outline[1].swapaxes(0, 1)
        return float(np.linalg.norm(end - start, axis=1).sum())

    def forget(self) -> None:
        """Let go of the pictures."""
        self._slice, self._picture, self._outline, self._ground = None, None, None, None
        self._filtered = None
        self._where = None
        self.forget_points()

    def forget_points(self) -> None:
        """Ask for points, ghosts and lines again when they are painted next."""
        self._points = None

    def paint(self, painter: QPainter) -> None:
        """Paint everything."""
        theme, view = theme_of(self._view), self._view
        painter.fillRect(view.rect(), QColor("#000000" if view.source else theme.window))
        if view.source is None or view.shown is None:
            return
        ratio = view.devicePixelRatioF()
        painter.setRenderHints(
            QPainter.RenderHint.Antialiasing | QPainter.RenderHint.SmoothPixmapTransform, True
        )
        painter.scale(1 / ratio, 1 / ratio)
        self._paint_ground(painter, view.source, view.shown, ratio)
        self._paint_crosshair(painter, view.shown, theme, ratio)
        self._paint_letters(painter, view.shown, ratio)
        self._paint_filters(painter, view.source, view.shown, ratio)
        paint_scale_bar(
            painter,
            view.shown.mm_per_pixel,
            view.shown.size,
            DARK,
            ratio=ratio,
            text=self._text,
            longest=_BAR_PIXELS,
            share=_BAR_SHARE,
        )
        points, reach = self.points, reach_of(view.source, view.shown.plane)
        paint_lines(painter, points.lines, view.shown, reach=reach, colour=_on_black("computed"), ratio=ratio)
        for layer in view.layers:
            layer.paint(painter, view.shown, ratio)
        names = self._paint_ghosts(painter, points.ghosts, view.shown, ratio)
        names += self._paint_marks(painter, points, view.source, view.shown, ratio)
        if self._workspace.view.state.labels_visible:
            names += [name for layer in view.layers for name in layer.names(view.shown, ratio)]
            size = view.shown.size
            free = 1.6 * self._text
            names += [NameTag("", place, DARK.text, free) for place in self._letter_places(size, ratio)]
            paint_words(painter, place_names(names, size, ratio=ratio, text=self._text, halo=DARK.halo))

    @property
    def _text(self) -> float:
        """Size of words, logical pixels."""
        return TEXT * text_scale(self._view)

    def _on_preview(self, threshold: float | None) -> None:
        self._preview = threshold

    def _on_slice_read(self) -> None:
        """Cut a slice again that is shown coarsely."""
        if self._slice is not None and self._slice.unread is not None:
            self._slice = self._where = self._ground = None
            self._view.update()

    def _paint_ground(
        self, painter: QPainter, source: VolumeSlicer, shown: SliceViewport, ratio: float
    ) -> None:
        """Paint the slice and the edge of bone, from what is kept while nothing of them changes."""
        view, workspace = self._view.window_level(), self._workspace
        state = workspace.view.state
        filters = (state.slab, state.denoise)
        coarsely = self._coarseness > 1
        looks = (view, self._preview, workspace.scan.threshold, state.outline_visible, filters, coarsely)
        kept = self._ground
        if kept is None or kept[1] is not source or kept[2] != looks or not _alike(kept[0], shown, source):
            picture = QPixmap(*shown.size)
            picture.fill(QColor("#000000"))
            below = QPainter(picture)
            below.setRenderHints(painter.renderHints())
            self._paint_image(below, source, shown)
            self._paint_outline(below, shown, ratio)
            below.end()
            kept = self._ground = (shown, source, looks, picture)
        painter.drawPixmap(QPointF(0, 0), kept[3])

    def _paint_image(self, painter: QPainter, source: VolumeSlicer, shown: SliceViewport) -> None:
        position = source.snap(shown.plane, shown.position)
        step = self._coarseness * source.sampling_step(shown.plane, shown.mm_per_pixel)
        where = (source, shown.plane, position, step)
        if self._slice is None or self._slice_is_old(where):
            self._slice = source.image(*where[1:], at_once=True)
            self._where = where
            if self._slice.unread is not None:
                self._workspace.scan.read_slice(self._slice.unread)
            self._picture = self._outline = self._filtered = None
        window, state = self._view.window_level(), self._workspace.view.state
        wanted = (window, self._preview, state.slab, state.denoise)
        if self._picture is None or self._picture[0] != wanted:
            self._picture = (wanted, _picture(self._to_show(where), window, self._preview))
        (left, top), (right, bottom) = shown.image_corners(self._slice)
        painter.drawImage(QRectF(left, top, right - left, bottom - top), self._picture[1])

    @property
    def _coarseness(self) -> float:
        """How many times coarser an oblique slice is sampled: what takes long, while a hand turns it."""
        state = self._workspace.view.state
        is_slow = state.slab is not None or state.denoise is not None
        return _COARSER if is_slow and self._view.draws_coarsely else 1.0

    def _to_show(self, where: _Where) -> SliceImage:
        """Return what is seen of the slice: a slab, or less noise; while a threshold is chosen, itself."""
        state = self._workspace.view.state
        wanted = (state.slab, state.denoise)
        assert self._slice is not None
        if state.slab is None:
            where[0].forget_slabs()
        if wanted == (None, None) or self._preview is not None or self._slice.unread is not None:
            return self._slice
        if self._filtered is None or self._filtered[0] != wanted:
            source, plane, position, step = where
            shown = self._slice if state.slab is None else source.image(plane, position, step, state.slab)
            if state.denoise is not None:
                shown = replace(shown, values=denoised(shown.values, state.denoise))
            self._filtered = (wanted, shown)
        return self._filtered[1]

    def _slice_is_old(self, where: _Where) -> bool:
        kept = self._where
        return kept is None or kept[0] is not where[0] or kept[1] is not where[1] or kept[2:] != where[2:]

    def _paint_outline(self, painter: QPainter, shown: SliceViewport, ratio: float) -> None:
        threshold = self._workspace.scan.threshold if self._preview is None else self._preview
        if threshold is None or self._slice is None or not self._workspace.view.state.outline_visible:
            return
        if self._slice.unread is not None:  # so few voxels have no edge that is worth showing
            self._outline = None
            return
        if self._outline is None or self._outline[0] != threshold:
            self._outline = (threshold, self._slice.outline(threshold))
        pen = QPen(QColor(246, 190, 110, 190), max(1.0, ratio))
        pen.setCosmetic(True)
        painter.save()
        corner = shown.flat_to_pixel(np.zeros(2)) + 0.5
        painter.translate(*corner.tolist())
        painter.scale(1 / shown.mm_per_pixel, 1 / shown.mm_per_pixel)
        painter.setPen(pen)
        draw_segments(painter, self._outline[1])
        painter.restore()

    def _paint_crosshair(self, painter: QPainter, shown: SliceViewport, theme: Theme, ratio: float) -> None:
        """Paint the other two slices as dashed lines in their colours, and the handles that turn them."""
        arms = self._view.turning.arms(shown, ratio)
        middle = arms.middle + 0.5
        reach = float(np.linalg.norm(shown.size) + np.abs(middle).max())
        colours = {
            plane.value: QColor(theme.views[plane.value] if theme.is_dark else plane.colour)
            for plane in Plane
        }
        for name, along in arms.directions.items():
            pen = QPen(colours[name], 1.0 * ratio)
            pen.setDashPattern([4, 3])
            painter.setPen(pen)
            painter.drawLine(QPointF(*(middle - reach * along)), QPointF(*(middle + reach * along)))
        if not self._view.handles_visible:
            return
        painter.setBrush(QColor("#000000"))
        for name, pixel in arms.handles:
            painter.setPen(QPen(colours[name], 1.5 * ratio))
            painter.drawEllipse(QPointF(*(pixel + 0.5)), HANDLE_PIXELS * ratio, HANDLE_PIXELS * ratio)

    def _paint_letters(self, painter: QPainter, shown: SliceViewport, ratio: float) -> None:
        letters = _edge_letters(self._workspace.view.frame, shown.plane)
        for letter, (x, y) in zip(letters, self._letter_places(shown.size, ratio), strict=True):
            word_picture(letter, self._text, DARK.text, ratio).draw_about(painter, x, y)

    def _letter_places(self, size: tuple[int, int], ratio: float) -> FloatArray:
        """(4, 2) device pixels of the directions at the left, right, upper and lower edge."""
        (width, height), inset = size, self._text * ratio
        return np.array(
            [
                [inset, height / 2],
                [width - inset, height / 2],
                [width / 2, inset],
                [width / 2, height - inset],
            ]
        )

    def _paint_filters(
        self, painter: QPainter, source: VolumeSlicer, shown: SliceViewport, ratio: float
    ) -> None:
        """Say in the lower left corner that not the slice itself is shown: pictures have no headers."""
        state = self._workspace.view.state
        step = source.sampling_step(shown.plane, shown.mm_per_pixel)
        mm = 0.0 if state.slab is None else source.thickness(shown.plane, state.slab, step)
        if words := filter_words(state, mm):
            colour = DARK.states["placed"]
            pictures = [word_picture(text, 0.9 * self._text, colour, ratio) for text in words]
            room = 0.5 * shown.size[0] - self._text * ratio
            said = next((each for each in pictures if each.box.width() <= room), pictures[-1])
            said.draw(painter, 6 * ratio, shown.size[1] - 0.6 * self._text * ratio)

    def _paint_ghosts(
        self, painter: QPainter, ghosts: list[GhostEllipsoid], shown: SliceViewport, ratio: float
    ) -> list[NameTag]:
        """Paint where points are expected; return their names."""
        names: list[NameTag] = []
        axes = np.stack([shown.plane.right, shown.plane.down])
        colour = QColor(_on_black("ghost"))
        for ghost in ghosts:
            centre = shown.scan_to_pixel(ghost.mean[None])[0] + 0.5
            covariance = axes @ ghost.covariance @ axes.T / shown.mm_per_pixel**2
            corners = ellipse(centre, covariance)
            ring = polygon(corners)
            painter.setBrush(QColor(colour.red(), colour.green(), colour.blue(), 26))
            painter.setPen(QPen(colour, 1.8 * ratio))
            painter.drawPolygon(ring)
            in_view = ring.boundingRect().intersects(QRectF(0, 0, *shown.size))  # it may be larger
            if ghost.label and in_view:
                upper_right = corners[int((corners[:, 0] - corners[:, 1]).argmax())]
                beside = np.clip(upper_right, 1.0, np.array(shown.size) - 1.0)
                names.append(NameTag(ghost.label, beside, DARK.word("ghost"), 4.0, 3.0))
        return names

    def _paint_marks(
        self, painter: QPainter, points: SlicePoints, source: VolumeSlicer, shown: SliceViewport, ratio: float
    ) -> list[NameTag]:
        """Paint the points on the slice and close to it; return the names of those to be named."""
        marks, positions = points.marks, points.positions
        pixels, off = shown.scan_to_pixel(positions) + 0.5, np.abs(shown.off_slice(positions))
        near = off <= reach_of(source, shown.plane)
        in_slice = off <= 0.75 * source.step(shown.plane)
        for n in np.flatnonzero(near):
            fade = 1.0 if in_slice[n] else 1.0 - 0.65 * off[n] / reach_of(source, shown.plane)
            radius = _radius(marks[n], self._workspace.view.state.glyph_mm, shown, ratio)
            paint_mark(
                painter,
                marks[n],
                pixels[n],
                radius,
                DARK,
                ratio=ratio,
                opacity=float(fade),
                full=bool(in_slice[n]),  # an outline where it lies behind or before the slice
            )
        close = shown.mm_per_pixel * _CLOSE_PIXELS * ratio < 1.0
        named = [n for n in np.flatnonzero(near) if close or in_slice[n] or marks[n].active]
        return [_name(marks[n], pixels[n]) for n in named]


def _picture(image: SliceImage, window: object, preview: float | None) -> QImage:
    if preview is None:
        grey = image.grey(window)  # type: ignore[arg-type]
        height, width = grey.shape
        return QImage(grey.data, width, height, width, QImage.Format.Format_Grayscale8).copy()
    rgb = np.ascontiguousarray(image.rgb(window, threshold=preview))  # type: ignore[arg-type]
    height, width, _ = rgb.shape
    return QImage(rgb.data, width, height, 3 * width, QImage.Format.Format_RGB888).copy()


@lru_cache(maxsize=8)
def _edge_letters(frame: AnatomicalFrame, plane: SlicePlane) -> tuple[str, str, str, str]:
    return frame.edge_letters(plane)


def _alike(one: SliceViewport, other: SliceViewport, source: VolumeSlicer) -> bool:
    """Whether two views show the same slice in the same place: the crosshair moved along others only."""
    return one is other or (
        (one.plane, one.mm_per_pixel, one.size) == (other.plane, other.mm_per_pixel, other.size)
        and source.snap(one.plane, one.position) == source.snap(other.plane, other.position)
        and np.array_equal(one.centre, other.centre)
    )


def _on_black(state: str) -> str:
    return DARK.states[state]


def _radius(mark: Mark, glyph_mm: float | None, shown: SliceViewport, ratio: float) -> float:
    """Return how large a point is drawn, device pixels."""
    radius = 4.0 * ratio if glyph_mm is None else 0.5 * glyph_mm / shown.mm_per_pixel
    return radius * growth_of(mark)


def _name(mark: Mark, pixel: FloatArray) -> NameTag:
    gap, rank = (12.0, 2.0) if mark.active else (8.0, 0.0)
    return NameTag(mark.label, pixel, DARK.word(mark.state), gap, rank)
