"""Rows and columns of widgets, written as they lie on the screen."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple, TypeVar

from qtpy.QtCore import Qt
from qtpy.QtWidgets import QBoxLayout, QHBoxLayout, QLayout, QVBoxLayout, QWidget

__all__ = ["STRETCH", "Placed", "in_column", "in_row", "placed", "wide"]

Box = TypeVar("Box", bound=QBoxLayout)


class Placed(NamedTuple):
    """A widget or a layout with its share of the room that is left; None is empty room."""

    part: QWidget | QLayout | None
    share: int = 0
    alignment: Qt.AlignmentFlag | None = None


STRETCH = Placed(None, 1)
"""Empty room, as much as there is."""


def wide(part: QWidget | QLayout, share: int = 1) -> Placed:
    """Let a part take the room that is left, or its share of it."""
    return Placed(part, share)


def placed(part: QWidget, alignment: Qt.AlignmentFlag, share: int = 0) -> Placed:
    """Let a part lie at one side of its cell."""
    return Placed(part, share, alignment)


def in_row(
    *parts: QWidget | QLayout | Placed,
    spacing: int | None = None,
    margins: int | tuple[int, int, int, int] | None = None,
    of: QWidget | None = None,
) -> QHBoxLayout:
    """Lay parts beside each other.

    Parameters
    ----------
    *parts : QWidget, QLayout or Placed
        From left to right.
    spacing : int, optional
        Between them, logical pixels; by default as the style has it.
    margins : int or (left, top, right, bottom), optional
        Around them.
    of : QWidget, optional
        Whose layout it becomes.
    """
    return _filled(QHBoxLayout() if of is None else QHBoxLayout(of), parts, spacing, margins)


def in_column(
    *parts: QWidget | QLayout | Placed,
    spacing: int | None = None,
    margins: int | tuple[int, int, int, int] | None = None,
    of: QWidget | None = None,
) -> QVBoxLayout:
    """Lay parts below each other; the arguments are those of `in_row`."""
    return _filled(QVBoxLayout() if of is None else QVBoxLayout(of), parts, spacing, margins)


def _filled(
    layout: Box,
    parts: Iterable[QWidget | QLayout | Placed],
    spacing: int | None,
    margins: int | tuple[int, int, int, int] | None,
) -> Box:
    if spacing is not None:
        layout.setSpacing(spacing)
    if margins is not None:
        layout.setContentsMargins(*((margins,) * 4 if isinstance(margins, int) else margins))
    for part in parts:
        _add(layout, part if isinstance(part, Placed) else Placed(part))
    return layout


def _add(layout: QBoxLayout, placed: Placed) -> None:
    part, share, alignment = placed
    if part is None:
        layout.addStretch(share)
    elif isinstance(part, QLayout):
        layout.addLayout(part, share)
    elif alignment is None:
        layout.addWidget(part, share)
    else:
        layout.addWidget(part, share, alignment)
