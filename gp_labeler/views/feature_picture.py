"""Small pictures of the features: where in the ear, or on the head, to look for each."""

from __future__ import annotations

from functools import cache, lru_cache

import numpy as np
from qtpy.QtCore import QPointF, QRectF, QSize, Qt
from qtpy.QtGui import (
    QColor,
    QFont,
    QFontMetricsF,
    QImage,
    QLinearGradient,
    QPainter,
    QPainterPath,
    QPen,
    QPixmap,
    QPolygonF,
)
from qtpy.QtWidgets import QWidget

from gp_core.landmarks.features import CODES, Side
from gp_core.validation import FloatArray
from gp_labeler.views.fonts import CAPTION, HEADING, base_font, family, text_scale
from gp_labeler.views.painting.strokes import beside, round_pen, smooth
from gp_labeler.views.schematic import FAR, Schematic, schematic_of
from gp_labeler.views.theme import Theme, theme_of

__all__ = ["FeaturePicture", "feature_picture", "ground_picture"]

_MARGIN = 18.0
_ROOMY = 180
"""Logical pixels: in a narrower picture only the feature itself is named."""

_GROUNDS = 16
"""Pictures of the ear alone that are kept, drawn once for all features that are shown on the same."""

_OSSICLES = (("DTM", "MH"), ("DTM", "LLI"), ("DTM", "DTL"))
_ORBIT = 2
"""Which outline of the head is a hole."""

_SCHEMATIC = "schematic"
_WORDS = {
    "coronal": "coronal, from the front",
    "axial": "axial, from below",
    "sagittal": "from the side",
    "3D": "3D, from the side",
}


def feature_picture(
    code: str, side: Side | str, size: QSize, theme: Theme, *, ratio: float = 2.0, scale: float = 1.0
) -> QPixmap:
    """Draw the picture of a feature: it, among the others, in the view in which it is found best.

    Parameters
    ----------
    code : str
        The feature.
    side : Side or str
        Which ear.
    size : QSize
        Logical pixels.
    theme : Theme
        Its colours.
    ratio : float
        Device pixels for each logical one.
    scale : float
        How much larger than normal text is.
    """
    side, frame = Side.parse(side), QRectF(0, 0, size.width(), size.height())
    ground = ground_picture(_like(code, side), side, size.width(), size.height(), theme, ratio)
    pixmap = QPixmap.fromImage(ground)
    painter = QPainter(pixmap)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    _Picture(painter, schematic_of(code, side), frame, theme, scale).draw_feature()
    painter.end()
    return pixmap


@cache
def _like(code: str, side: Side) -> str:
    """Return the first feature whose picture shows the same ear from the same side, as large."""
    it = schematic_of(code, side)

    def is_alike(other: Schematic) -> bool:
        same_ear = np.array_equal(other.spiral, it.spiral) and np.array_equal(other.box, it.box)
        return same_ear and len(other.head) == len(it.head)

    return next(c for c in CODES if is_alike(schematic_of(c, side)))


@lru_cache(_GROUNDS)
def ground_picture(code: str, side: Side, width: int, height: int, theme: Theme, ratio: float) -> QImage:
    """Draw the ear, and the head where it is shown, without any feature."""
    image = QImage(round(width * ratio), round(height * ratio), QImage.Format.Format_ARGB32_Premultiplied)
    image.setDevicePixelRatio(ratio)
    image.fill(Qt.GlobalColor.transparent)
    painter = QPainter(image)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    _Picture(painter, schematic_of(code, side), QRectF(0, 0, width, height), theme, 1.0).draw_ground()
    painter.end()
    return image


class FeaturePicture(QWidget):
    """Shows the picture of a feature at whatever size there is room for."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._shown: tuple[str, Side] | None = None
        self._drawn = QPixmap()
        self._drawn_for: tuple[object, ...] = ()
        self.setMinimumSize(96, 72)

    def show_feature(self, code: str | None, side: Side) -> None:
        """Show another feature, or none."""
        shown = None if code is None else (code, side)
        if shown == self._shown:
            return
        self._shown = shown
        self.setAccessibleName("" if code is None else f"Picture of {code}, {side.word} ear")
        self.update()

    def sizeHint(self) -> QSize:  # noqa: D102, N802 - Qt's name
        return QSize(200, 110)

    def paintEvent(self, event: object) -> None:  # noqa: D102, N802 - Qt's name
        if self._shown is None:
            return
        ratio, theme = self.devicePixelRatioF(), theme_of(self)
        scale = text_scale(self)
        key = (self._shown, self.size(), theme.name, ratio, scale, family())
        if key != self._drawn_for:  # it is drawn again only where it changes: that takes some 10 ms
            self._drawn_for = key
            self._drawn = feature_picture(*self._shown, self.size(), theme, ratio=ratio, scale=scale)
        painter = QPainter(self)
        painter.drawPixmap(0, 0, self._drawn)
        painter.end()


class _Picture:
    """One drawing under way."""

    def __init__(
        self, painter: QPainter, schematic: Schematic, frame: QRectF, theme: Theme, text_scale: float
    ) -> None:
        self._painter, self._it, self._frame, self._theme = painter, schematic, frame, theme
        self._text_scale = text_scale
        low, high = schematic.box
        room = frame.adjusted(_MARGIN, _MARGIN, -_MARGIN, -_MARGIN)
        self._scale = float(min(room.width() / (high - low)[0], room.height() / (high - low)[1]))
        self._middle = (low + high) / 2
        self._taken: list[QRectF] = []

    def draw_ground(self) -> None:
        self._ground()
        if self._it.head:
            self._head()
        self._ear()

    def draw_feature(self) -> None:
        self._painter.setClipRect(self._frame)
        self._taken += self._edges()
        self._points()
        self._words()

    def _at(self, point: FloatArray) -> QPointF:
        x, y = (point - self._middle) * self._scale
        return self._frame.center() + QPointF(float(x), -float(y))

    def _of(self, code: str) -> QPointF:
        return self._at(self._it.points[code])

    def _tint(self, colour: str, opacity: float) -> QColor:
        tinted = QColor(colour)
        tinted.setAlphaF(opacity)
        return tinted

    def _ground(self) -> None:
        ground = QLinearGradient(self._frame.topLeft(), self._frame.bottomLeft())
        ground.setColorAt(0, QColor(self._theme.scene.top))
        ground.setColorAt(1, QColor(self._theme.scene.bottom))
        self._painter.setPen(Qt.PenStyle.NoPen)
        self._painter.setBrush(ground)
        self._painter.drawRoundedRect(self._frame, 5, 5)
        self._painter.setClipRect(self._frame)

    def _head(self) -> None:
        dark, bone = self._theme.is_dark, QColor(self._theme.scene.bone)
        edge = QPen(bone if dark else bone.darker(170), 1.3)
        for n, outline in enumerate(self._it.head):
            fill = (
                self._tint(self._theme.scene.halo, 0.35) if n == _ORBIT else bone.darker(210 if dark else 100)
            )
            self._painter.setPen(edge)
            self._painter.setBrush(fill)
            self._painter.drawPath(smooth([self._at(p) for p in outline]))

    def _ear(self) -> None:
        bone = self._theme.scene.bone if self._theme.is_dark else "#B9A57E"
        self._tube(bone)
        self._painter.setBrush(Qt.BrushStyle.NoBrush)
        self._canal(bone)
        width = max(1.5, 0.5 * self._scale)
        self._painter.setPen(round_pen(self._tint(bone, 0.35), width))
        for a, b in _OSSICLES:
            self._painter.drawLine(self._of(a), self._of(b))
        self._painter.setPen(round_pen(self._tint(bone, 0.55), max(1.2, 0.35 * self._scale)))
        self._painter.drawLine(self._of("FPA"), self._of("FPP"))
        self._window()
        self._axis()

    def _tube(self, bone: str) -> None:
        """Draw the coil from the base to the apex, each part over those before, thinner towards the apex."""
        line = [self._at(p) for p in self._it.spiral]
        n = len(line)
        for i in range(1, n - 1):
            edge = round_pen(QColor(bone).darker(230), self._tube_width(i / n) + 1.8)
            edge.setCapStyle(Qt.PenCapStyle.FlatCap)  # so it does not stain the part before
            self._painter.setPen(edge)
            self._painter.drawLine(line[i], line[i + 1])
            self._painter.setPen(
                round_pen(QColor(bone).darker(round(150 - 40 * i / n)), self._tube_width(i / n))
            )
            self._painter.drawPolyline(QPolygonF(line[i - 1 : i + 2]))

    def _tube_width(self, t: float) -> float:
        return max(1.0, self._scale * (0.88 - 0.4 * t))

    def _canal(self, bone: str) -> None:
        """Draw the opening of the ear canal, whose lower and upper edge are OI and OS."""
        low, high = self._of("OI"), self._of("OS")
        across = high - low
        length = float(np.hypot(across.x(), across.y()))
        self._painter.save()
        self._painter.translate((low + high) / 2)
        self._painter.rotate(float(np.degrees(np.arctan2(across.y(), across.x()))))
        self._painter.setPen(QPen(self._tint(bone, 0.6), 1.3, Qt.PenStyle.DashLine))
        self._painter.drawEllipse(QPointF(), length / 2, length * 0.38)
        self._painter.restore()

    def _window(self) -> None:
        rim = [self._of(code) for code in ("RWA", "RWL", "RWP", "RWM")]
        self._painter.setPen(QPen(QColor(self._theme.accent_text), 1.3))
        self._painter.setBrush(self._tint(self._theme.accent_text, 0.25))
        self._painter.drawPath(smooth(rim))
        self._painter.setBrush(Qt.BrushStyle.NoBrush)

    def _axis(self) -> None:
        """Draw the modiolar axis, with an arrow at the apex, and the line to the round window."""
        points, colour = self._it.points, QColor(self._theme.states["computed"])
        along = points["CA"] - points["CB"]
        start, end = self._at(points["CB"] - 0.25 * along), self._at(points["CA"] + 0.35 * along)
        self._painter.setPen(QPen(colour, 1.3, Qt.PenStyle.DashLine))
        self._painter.drawLine(start, end)
        self._painter.drawLine(self._of("CO"), (self._of("RWA") + self._of("RWP")) / 2)
        ahead = end - start
        length = float(np.hypot(ahead.x(), ahead.y()))
        if length > 14:
            unit, side = ahead / length, QPointF(-ahead.y(), ahead.x()) / length
            self._painter.setPen(Qt.PenStyle.NoPen)
            self._painter.setBrush(colour)
            heel = end - unit * 5.0
            self._painter.drawPolygon(QPolygonF([end + unit * 3.0, heel + side * 3.0, heel - side * 3.0]))

    def _points(self) -> None:
        order = sorted(CODES, key=lambda code: self._it.depths[code])
        near = [c for c in order if c != self._it.code and (c not in FAR or self._it.head)]
        self._painter.setPen(QPen(QColor(self._theme.scene.halo), 1))
        self._painter.setBrush(QColor(self._theme.muted))
        for code in near:
            self._painter.drawEllipse(self._of(code), 2.4, 2.4)
        self._target()
        for code in near if self._frame.width() >= _ROOMY and not self._it.head else ():
            self._label(code, self._font(CAPTION - 1), QColor(self._theme.muted), 4.0, must=False)

    def _target(self) -> None:
        colour, where = QColor(self._theme.states["placed"]), self._of(self._it.code)
        self._painter.setBrush(Qt.BrushStyle.NoBrush)
        for width, shade in ((4.0, QColor(self._theme.scene.halo)), (1.8, colour)):
            self._painter.setPen(QPen(shade, width))
            self._painter.drawEllipse(where, 9, 9)
        self._painter.setPen(QPen(QColor(self._theme.scene.halo), 1.2))
        self._painter.setBrush(colour)
        self._painter.drawEllipse(where, 4.6, 4.6)
        self._taken.append(QRectF(where.x() - 10, where.y() - 10, 20, 20))
        self._label(self._it.code, self._font(HEADING, bold=True), colour, 12.0, must=True)

    def _label(self, code: str, font: QFont, colour: QColor, gap: float, *, must: bool) -> None:
        """Write a feature's code beside it, where there is room."""
        size = QFontMetricsF(font).size(0, code)
        boxes = list(beside(self._of(code), size.width(), size.height(), gap))
        frame = self._frame.adjusted(2, 2, -2, -2)
        free = [b for b in boxes if frame.contains(b) and not any(b.intersects(t) for t in self._taken)]
        if not free and not must:
            return
        box = free[0] if free else boxes[0]
        self._taken.append(box)
        path = QPainterPath()
        path.addText(box.left(), box.top() + QFontMetricsF(font).ascent(), font, code)
        self._painter.setPen(round_pen(QColor(self._theme.scene.halo), 3))
        self._painter.setBrush(Qt.BrushStyle.NoBrush)
        self._painter.drawPath(path)
        self._painter.setPen(Qt.PenStyle.NoPen)
        self._painter.setBrush(colour)
        self._painter.drawPath(path)

    def _edges(self) -> list[QRectF]:
        """Return the boxes of the directions and of the words at the lower edge."""
        frame, high = self._frame, QFontMetricsF(self._font(CAPTION, bold=True)).height() + 3
        middle = frame.center()
        return [
            QRectF(frame.left(), frame.bottom() - high, frame.width(), high),
            QRectF(frame.left(), middle.y() - high / 2, high, high),
            QRectF(frame.right() - high, middle.y() - high / 2, high, high),
            QRectF(middle.x() - high / 2, frame.top(), high, high),
        ]

    def _words(self) -> None:
        """Write the directions at the edges, and from where it is seen."""
        self._painter.setFont(self._font(CAPTION, bold=True))
        self._painter.setPen(QColor(self._theme.muted))
        inner, flag = self._frame.adjusted(5, 3, -5, -3), Qt.AlignmentFlag
        left, right, below, above = tuple(self._it.letters)
        for letter, where in (
            (left, flag.AlignLeft | flag.AlignVCenter),
            (right, flag.AlignRight | flag.AlignVCenter),
            (above, flag.AlignHCenter | flag.AlignTop),
        ):
            self._painter.drawText(inner, where, letter)
        if self._frame.width() >= _ROOMY:
            font = self._font(CAPTION)
            self._painter.setFont(font)
            text = "from the side" if self._it.head else _WORDS[self._it.view]
            self._painter.drawText(inner, flag.AlignLeft | flag.AlignBottom, text)
            if QFontMetricsF(font).horizontalAdvance(f"{text}  {_SCHEMATIC}") <= inner.width():
                self._painter.drawText(inner, flag.AlignRight | flag.AlignBottom, _SCHEMATIC)
        else:
            self._painter.drawText(inner, flag.AlignHCenter | flag.AlignBottom, below)

    def _font(self, pixels: int, *, bold: bool = False) -> QFont:
        font = base_font()
        font.setPixelSize(round(pixels * self._text_scale))
        font.setBold(bold)
        return font
