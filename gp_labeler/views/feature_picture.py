"""Small pictures of the features: where in the ear, or on the head, to look for each.

Ear and head are SVG files in ``resources/pictures`` (`tools/feature-pictures` draws them from the atlas); the
features and their names, which follow the user's text size, are painted over them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np
from qtpy.QtCore import QByteArray, QPointF, QRectF, QSize, Qt, QTimer
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
)
from qtpy.QtSvg import QSvgRenderer
from qtpy.QtWidgets import QWidget

from gp_core.landmarks.features import CODES, Side, feature
from gp_core.resources import resource_path
from gp_core.validation import FloatArray
from gp_labeler.views.fonts import CAPTION, HEADING, base_font, family, text_scale
from gp_labeler.views.painting.strokes import beside, round_pen
from gp_labeler.views.schematic import (
    AXIS,
    EDGE,
    FAR,
    ORBITAL,
    OUTLINE,
    SKULL,
    WINDOW,
    ground_of,
    ground_schematic,
)
from gp_labeler.views.theme import THEMES, Theme, theme_of

__all__ = ["FeaturePicture", "feature_picture", "ground_picture"]

_MARGIN, _BESIDE = 26.0, 24.0
"""Kept free above and below, and for the directions at the sides; logical pixels."""
_ROOMY = 180
"""Logical pixels: in a narrower picture only the feature itself is named."""

_AFTER_MS = 20
"""A picture takes some 10 ms to draw: the views, whose slices move with the feature, are painted first."""

_LIGHT_BONE = "#B9A57E"
"""Bone on a light background."""

_SCHEMATIC = "schematic"
_WORDS = {
    "coronal": "coronal, from the front",
    "axial": "axial, from below",
    "sagittal": "from the side",
    "head": "from the side",
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
    it = _Shown.of(feature(code).code, Side.parse(side), size.width(), size.height())
    pixmap = QPixmap.fromImage(ground_picture(it, theme, ratio))
    painter = QPainter(pixmap)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    _Picture(painter, feature(code).code, it, theme, scale).draw()
    painter.end()
    return pixmap


@dataclass(frozen=True)
class _Shown:
    """Which ear or head a picture shows, and where: the same for many features."""

    ground: str
    side: Side
    width: int
    height: int
    scale: float
    middle: tuple[float, float]

    @classmethod
    def of(cls, code: str, side: Side, width: int, height: int) -> _Shown:
        """Return what the picture of a feature shows at a size in logical pixels."""
        ground = ground_of(code)
        low, high = ground_schematic(ground, side).box_around(code)
        room = np.array([width - 2 * _BESIDE, height - 2 * _MARGIN])
        x, y = (low + high) / 2
        return cls(ground, side, width, height, float((room / (high - low)).min()), (float(x), float(y)))

    @property
    def frame(self) -> QRectF:
        """All of the picture."""
        return QRectF(0, 0, self.width, self.height)

    def at(self, point: FloatArray) -> QPointF:
        """Return where a (2,) point of the schematic comes to."""
        x, y = (point - self.middle) * self.scale
        return self.frame.center() + QPointF(float(x), -float(y))


@lru_cache(16)
def ground_picture(it: _Shown, theme: Theme, ratio: float) -> QImage:
    """Draw the ear, or the head, without any feature; the file shows a left one, in mm with y downwards."""
    image = QImage(
        round(it.width * ratio), round(it.height * ratio), QImage.Format.Format_ARGB32_Premultiplied
    )
    image.setDevicePixelRatio(ratio)
    image.fill(Qt.GlobalColor.transparent)
    painter = QPainter(image)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    _draw_background(painter, it.frame, theme)
    painter.translate(it.at(np.zeros(2)))
    painter.scale(-it.scale if it.side is Side.RIGHT else it.scale, it.scale)
    renderer = _renderer(it.ground, theme.name)
    renderer.render(painter, renderer.viewBoxF())
    painter.end()
    return image


def _draw_background(painter: QPainter, frame: QRectF, theme: Theme) -> None:
    shade = QLinearGradient(frame.topLeft(), frame.bottomLeft())
    shade.setColorAt(0, QColor(theme.scene.top))
    shade.setColorAt(1, QColor(theme.scene.bottom))
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(shade)
    painter.drawRoundedRect(frame, 5, 5)
    painter.setClipRect(frame)


class FeaturePicture(QWidget):
    """Shows the picture of a feature at whatever size there is room for."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._shown: tuple[str, Side] | None = None
        self._drawn = QPixmap()
        self._drawn_for: tuple[object, ...] = ()
        self._draw_timer = QTimer(self, interval=_AFTER_MS, singleShot=True)
        self._draw_timer.timeout.connect(self._draw)
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
        if self._drawn_for != self._wanted and not self._draw_timer.isActive():
            self._draw_timer.start()
        painter = QPainter(self)
        painter.drawPixmap(0, 0, self._drawn)
        painter.end()

    def finish(self) -> None:
        """Draw at once what is otherwise drawn a moment later."""
        if self._drawn_for != self._wanted:
            self._draw_timer.stop()
            self._draw()

    @property
    def _wanted(self) -> tuple[object, ...]:
        """All that the picture depends on."""
        look = theme_of(self).name, self.devicePixelRatioF(), text_scale(self), family()
        return (self._shown, self.size(), *look)

    def _draw(self) -> None:
        if self._shown is None:
            return
        self._drawn_for = self._wanted
        ratio, scale = self.devicePixelRatioF(), text_scale(self)
        self._drawn = feature_picture(*self._shown, self.size(), theme_of(self), ratio=ratio, scale=scale)
        self.update()


class _Picture:
    """One drawing under way."""

    def __init__(self, painter: QPainter, code: str, shown: _Shown, theme: Theme, text_scale: float) -> None:
        self._painter, self._code, self._theme = painter, code, theme
        self._shown, self._frame, self._text_scale = shown, shown.frame, text_scale
        self._it = ground_schematic(shown.ground, shown.side)
        self._taken: list[QRectF] = []

    def draw(self) -> None:
        self._painter.setClipRect(self._frame)
        self._taken += self._edges()
        self._points()
        self._words()

    def _of(self, code: str) -> QPointF:
        return self._shown.at(self._it.points[code])

    def _points(self) -> None:
        order = sorted(CODES, key=lambda code: self._it.depths[code])
        near = [c for c in order if c != self._code and (c not in FAR or self._it.head)]
        self._painter.setPen(QPen(QColor(self._theme.scene.halo), 1))
        self._painter.setBrush(QColor(self._theme.muted))
        for code in near:
            self._painter.drawEllipse(self._of(code), 2.4, 2.4)
        self._target()
        for code in near if self._frame.width() >= _ROOMY and not self._it.head else ():
            self._label(code, self._font(CAPTION - 1), QColor(self._theme.muted), 4.0, must=False)

    def _target(self) -> None:
        colour, where = QColor(self._theme.states["placed"]), self._of(self._code)
        self._painter.setBrush(Qt.BrushStyle.NoBrush)
        for width, shade in ((4.0, QColor(self._theme.scene.halo)), (1.8, colour)):
            self._painter.setPen(QPen(shade, width))
            self._painter.drawEllipse(where, 9, 9)
        self._painter.setPen(QPen(QColor(self._theme.scene.halo), 1.2))
        self._painter.setBrush(colour)
        self._painter.drawEllipse(where, 4.6, 4.6)
        self._taken.append(QRectF(where.x() - 10, where.y() - 10, 20, 20))
        self._label(self._code, self._font(HEADING, bold=True), colour, 12.0, must=True)

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
            text = _WORDS[self._it.ground]
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


@cache
def _renderer(ground: str, theme: str) -> QSvgRenderer:
    """Return the ear or head in the colours of a theme."""
    text = resource_path(f"pictures/{ground}.svg").read_text(encoding="utf-8")
    for drawn, shown in _colours(THEMES[theme]).items():
        text = text.replace(drawn, shown)
    return QSvgRenderer(QByteArray(text.encode()))


def _colours(theme: Theme) -> dict[str, str]:
    """Return what a theme shows for each colour in the files."""
    skull = QColor(theme.scene.bone)
    bone = theme.scene.bone if theme.is_dark else _LIGHT_BONE
    return {
        "currentColor": bone,
        EDGE: QColor(bone).darker(230).name(),
        SKULL: skull.darker(210 if theme.is_dark else 100).name(),
        OUTLINE: (skull if theme.is_dark else skull.darker(170)).name(),
        ORBITAL: theme.scene.halo,
        WINDOW: theme.accent_text,
        AXIS: theme.states["computed"],
    }
