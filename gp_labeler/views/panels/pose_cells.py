"""How the cells of the table of touches are painted."""

from __future__ import annotations

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QPainter

from gp_labeler.views.chips import draw_chip
from gp_labeler.views.icons import draw_icon
from gp_labeler.views.panels.pose_model import CLEAR, MISFIT, NAME, USE, XYZ, TouchRow
from gp_labeler.views.panels.pose_words import name_of
from gp_labeler.views.strokes import round_pen
from gp_labeler.views.theme import Theme

__all__ = ["column_widths", "paint_cell", "paint_ground"]

_ROOMY = 520

_PAD, _CHIP, _CODE = 8, 12, 34
_MISFIT = 36
_MIDDLE = Qt.AlignmentFlag.AlignVCenter
_RIGHT = Qt.AlignmentFlag.AlignRight | _MIDDLE
_MINUS = "\N{MINUS SIGN}"


def column_widths(width: int) -> dict[int, int]:
    """Return the widths of the columns in a table so wide, logical pixels; the name gets the rest."""
    if width < _ROOMY:
        return {XYZ: 174, MISFIT: 66, USE: 32, CLEAR: 16}
    return {XYZ: 196, MISFIT: 100, USE: 40, CLEAR: 20}


def paint_ground(
    painter: QPainter, box: QRectF, row: TouchRow, theme: Theme, *, current: bool, over: bool
) -> None:
    """Paint what lies under a cell: the row to touch next stands out."""
    if row.target:
        painter.fillRect(box, QColor(theme.selected))
    elif current or over:
        painter.fillRect(box, QColor(theme.hover))


def paint_cell(
    painter: QPainter,
    column: int,
    box: QRectF,
    row: TouchRow,
    theme: Theme,
    *,
    longest: float,
    over: bool,
) -> None:
    """Paint one cell; bars are `longest` mm at full length."""
    if column == NAME:
        _paint_name(painter, box, row, theme)
    elif column == XYZ:
        _paint_position(painter, box, row, theme)
    elif column == MISFIT:
        _paint_misfit(painter, box, row, theme, longest)
    elif row.touch is not None and column == USE:
        _paint_use(painter, box, row, theme)
    elif row.touch is not None and column == CLEAR and over:
        side = QRectF(box.center().x() - 6, box.center().y() - 6, 12, 12)
        draw_icon(painter, "close", side, QColor(theme.muted))


def _paint_name(painter: QPainter, box: QRectF, row: TouchRow, theme: Theme) -> None:
    chip = QRectF(box.left() + _PAD - 2, box.center().y() - _CHIP / 2, _CHIP, _CHIP)
    draw_chip(painter, row.state, chip, theme)
    plain = painter.font()
    bold = QFont(plain)
    bold.setBold(True)
    bold.setStrikeOut(_is_out(row))
    painter.setFont(bold)
    painter.setPen(QColor(theme.faint if _is_out(row) else theme.text))
    left = _PAD + _CHIP + 5
    painter.drawText(box.adjusted(left, 0, 0, 0), _MIDDLE, row.name)
    painter.setFont(plain)
    words = box.adjusted(left + _CODE, 0, -4, 0)
    if words.width() > 60:
        painter.setPen(QColor(theme.muted))
        elided = QFontMetricsF(plain).elidedText(
            name_of(row.name), Qt.TextElideMode.ElideRight, words.width()
        )
        painter.drawText(words, _MIDDLE, elided)


def _paint_position(painter: QPainter, box: QRectF, row: TouchRow, theme: Theme) -> None:
    if row.touch is None:
        painter.setPen(QColor(theme.accent_text))
        painter.drawText(box, _RIGHT, "touch, or type x y z" if row.target else "")
        return
    painter.setPen(QColor(theme.faint if _is_out(row) else theme.text))
    font = QFont(painter.font())
    font.setStrikeOut(_is_out(row))
    painter.setFont(font)
    width = box.width() / 3
    for n, value in enumerate(row.touch.position):
        cell = QRectF(box.left() + n * width, box.top(), width, box.height())
        painter.drawText(cell, _RIGHT, f"{value:.2f}".replace("-", _MINUS))


def _paint_misfit(painter: QPainter, box: QRectF, row: TouchRow, theme: Theme, longest: float) -> None:
    if row.misfit is None:
        return
    colour = QColor(theme.danger if row.suspect else theme.accent_text)
    words = QRectF(box.left(), box.top(), _MISFIT, box.height())
    painter.setPen(colour if row.suspect else QColor(theme.text))
    painter.drawText(words, _RIGHT, f"{row.misfit:.2f}")
    full = box.width() - _MISFIT - 8
    track = QRectF(box.left() + _MISFIT + 5, box.center().y() - 2.5, full, 5)
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(QColor(theme.border))
    painter.drawRoundedRect(track, 2.5, 2.5)
    track.setWidth(max(full * min(row.misfit / longest, 1.0), 3.0))
    painter.setBrush(colour)
    painter.drawRoundedRect(track, 2.5, 2.5)


def _paint_use(painter: QPainter, box: QRectF, row: TouchRow, theme: Theme) -> None:
    square = QRectF(box.center().x() - 6.5, box.center().y() - 6.5, 13, 13)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.setPen(round_pen(QColor(theme.border_strong), 1.2))
    painter.setBrush(QColor(theme.field if _is_out(row) else theme.accent))
    painter.drawRoundedRect(square, 3, 3)
    if not _is_out(row):
        painter.setPen(round_pen(QColor(theme.on_accent), 1.7))
        c = square.center()
        painter.drawPolyline([c + QPointF(-3.2, 0.2), c + QPointF(-0.9, 2.6), c + QPointF(3.3, -2.6)])


def _is_out(row: TouchRow) -> bool:
    return row.touch is not None and row.touch.left_out
