"""How the cells of the table of touches are painted."""

from __future__ import annotations

from collections.abc import Mapping

from qtpy.QtCore import QPointF, QRectF, Qt
from qtpy.QtGui import QColor, QFont, QPainter
from qtpy.QtWidgets import QAbstractItemView, QWidget

from gp_core.landmarks.features import FEATURES
from gp_labeler.views.chips import draw_chip
from gp_labeler.views.fonts import heading_width, pixels, text_width
from gp_labeler.views.formatting import number_text
from gp_labeler.views.icons import draw_icon
from gp_labeler.views.painting.strokes import round_pen
from gp_labeler.views.panels.pose.touch_table_model import CLEAR, NAME, RESIDUAL, USE, XYZ, TouchRow
from gp_labeler.views.panels.pose.wording import name_of
from gp_labeler.views.theme import Theme

__all__ = ["column_widths", "names_width", "paint_cell", "paint_ground"]

_PAD, _CHIP, _BAR, _WIDE_BAR, _GAP = 8, 12, 20, 50, 6
_WIDEST_NUMBER, _WIDEST_RESIDUAL = "\N{MINUS SIGN}1000.00", "10.00"
_WIDEST_CODE, _WIDEST_REPEATED = "RWM", "RWM \N{MULTIPLICATION SIGN}9"
_ASKED = "touch, or type x y z"
_MIDDLE = Qt.AlignmentFlag.AlignVCenter
_RIGHT = Qt.AlignmentFlag.AlignRight | _MIDDLE


def column_widths(view: QWidget, headings: Mapping[int, str], width: int = 0) -> dict[int, int]:
    """Return the widths of the columns in a table so wide, logical pixels; `NAME` gets the rest.

    Parameters
    ----------
    view : QWidget
        The table.
    headings : mapping of int to str
        What stands above each column.
    width : int
        Of the table; 0 for the least that it needs.
    """
    heads = {column: heading_width(view, words) for column, words in headings.items()}
    number = text_width(view, _WIDEST_NUMBER) + _GAP
    residual = _residual_width(view) + pixels(view, _BAR) + 2 * _GAP
    columns = {
        NAME: _left(view) + _code_width(view) + _GAP,
        XYZ: max(3 * number, text_width(view, _ASKED) + _GAP),
        RESIDUAL: residual,
        USE: pixels(view, 13) + 2 * _PAD,
        CLEAR: pixels(view, 16),
    }
    columns = {column: max(least, heads.get(column, 0)) for column, least in columns.items()}
    free = width - sum(columns.values())
    beside_names = free - names_width(view)
    spare = beside_names if beside_names >= 0 else free  # where names have no room, bars may have it
    columns[RESIDUAL] += min(max(spare, 0), pixels(view, _WIDE_BAR))
    return columns


def names_width(view: QWidget) -> int:
    """Return what the longest name of a feature takes behind its code, logical pixels."""
    return text_width(view, *(row.name for row in FEATURES if row.external)) + _GAP


def _code_width(view: QWidget) -> int:
    """Return what the longest code takes, with the number of touches where there are several of one."""
    rows = getattr(view.model(), "rows", ()) if isinstance(view, QAbstractItemView) else ()
    repeated = any(row.n_touches > 1 for row in rows)
    return text_width(view, _WIDEST_REPEATED if repeated else _WIDEST_CODE, bold=True)


def _left(view: QWidget) -> int:
    """Return where the code begins: behind the chip."""
    return _PAD + pixels(view, _CHIP) + 5


def _residual_width(view: QWidget) -> int:
    return text_width(view, _WIDEST_RESIDUAL)


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
    view: QWidget,
    column: int,
    box: QRectF,
    row: TouchRow,
    theme: Theme,
    *,
    longest: float,
    over: bool,
) -> None:
    """Paint one cell of the table `view`; bars are `longest` mm at full length."""
    if column == NAME:
        _paint_name(painter, view, box, row, theme)
    elif column == XYZ:
        _paint_position(painter, box, row, theme)
    elif column == RESIDUAL:
        _paint_residual(painter, view, box, row, theme, longest)
    elif row.touch is not None and column == USE:
        _paint_use(painter, view, box, row, theme)
    elif row.touch is not None and column == CLEAR and over:
        half = pixels(view, 6)
        side = QRectF(box.center().x() - half, box.center().y() - half, 2 * half, 2 * half)
        draw_icon(painter, "close", side, QColor(theme.muted))


def _paint_name(painter: QPainter, view: QWidget, box: QRectF, row: TouchRow, theme: Theme) -> None:
    """Paint chip and code, and the name where there is room for the longest: all rows alike."""
    side = pixels(view, _CHIP)
    chip = QRectF(box.left() + _PAD - 2, box.center().y() - side / 2, side, side)
    draw_chip(painter, row.state, chip, theme)
    plain = painter.font()
    bold = QFont(plain)
    bold.setBold(True)
    bold.setStrikeOut(_is_out(row))
    painter.setFont(bold)
    painter.setPen(QColor(theme.faint if _is_out(row) else theme.text))
    left = _left(view)
    painter.drawText(box.adjusted(left, 0, 0, 0), _MIDDLE, row.label)
    painter.setFont(plain)
    words = box.adjusted(left + _code_width(view) + _GAP, 0, 0, 0)
    if words.width() >= names_width(view):
        painter.setPen(QColor(theme.muted))
        painter.drawText(words, _MIDDLE, name_of(row.name))


def _paint_position(painter: QPainter, box: QRectF, row: TouchRow, theme: Theme) -> None:
    if row.position is None:
        painter.setPen(QColor(theme.accent_text))
        painter.drawText(box, _RIGHT, _ASKED if row.target else "")
        return
    painter.setPen(QColor(theme.faint if _is_out(row) else theme.text))
    font = QFont(painter.font())
    font.setStrikeOut(_is_out(row))
    painter.setFont(font)
    width = box.width() / 3
    for n, value in enumerate(row.position):
        cell = QRectF(box.left() + n * width, box.top(), width, box.height())
        painter.drawText(cell, _RIGHT, number_text(value, 2))


def _paint_residual(
    painter: QPainter, view: QWidget, box: QRectF, row: TouchRow, theme: Theme, longest: float
) -> None:
    if row.residual is None:
        return
    colour = QColor(theme.danger if row.suspect else theme.accent_text)
    left = _residual_width(view) + _GAP
    words = QRectF(box.left(), box.top(), left, box.height())
    painter.setPen(colour if row.suspect else QColor(theme.text))
    painter.drawText(words, _RIGHT, f"{row.residual:.2f}")
    full = box.width() - left - 2 * _GAP
    track = QRectF(box.left() + left + _GAP, box.center().y() - 2.5, full, 5)
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(QColor(theme.border))
    painter.drawRoundedRect(track, 2.5, 2.5)
    track.setWidth(max(full * min(row.residual / longest, 1.0), 3.0))
    painter.setBrush(colour)
    painter.drawRoundedRect(track, 2.5, 2.5)


def _paint_use(painter: QPainter, view: QWidget, box: QRectF, row: TouchRow, theme: Theme) -> None:
    side = pixels(view, 13)
    square = QRectF(box.center().x() - side / 2, box.center().y() - side / 2, side, side)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.setPen(round_pen(QColor(theme.border_strong), 1.2))
    painter.setBrush(QColor(theme.field if _is_out(row) else theme.accent))
    painter.drawRoundedRect(square, 3, 3)
    if not _is_out(row):
        painter.setPen(round_pen(QColor(theme.on_accent), 1.7))
        c, u = square.center(), side / 13
        tick = (QPointF(-3.2, 0.2), QPointF(-0.9, 2.6), QPointF(3.3, -2.6))
        painter.drawPolyline([c + corner * u for corner in tick])


def _is_out(row: TouchRow) -> bool:
    return row.touch is not None and row.touch.left_out
