"""What a screen reader cannot know by itself: what painted widgets are, and what a list of choices is for."""

from __future__ import annotations

from functools import cache
from typing import Any

from qtpy import QtGui, QtWidgets
from qtpy.compat import isalive
from qtpy.QtWidgets import QComboBox, QWidget

__all__ = ["describe_widgets", "name_choice"]

_ROLES = {
    "FeaturePicture": "Graphic",
    "HistogramSlider": "Slider",
    "SceneView": "Graphic",
    "Scrolled": "Grouping",
    "SliceView": "Graphic",
}
"""Classes of widgets, and their roles of ``QAccessible``; Qt calls each that it does not know a client."""

_interfaces: list[Any] = []
"""Qt deletes them with their widgets. Were Python to free one before, Qt would use freed memory."""


@cache
def describe_widgets() -> None:
    """Tell screen readers what the widgets are that this program paints itself."""
    if hasattr(QtWidgets, "QAccessibleWidget"):  # PyQt6 has none
        QtGui.QAccessible.installFactory(_describe)


def _describe(name: str, widget: QWidget) -> object:
    """Return what a widget is; Qt asks with the name of its class, then with those of its base classes."""
    if name not in _ROLES:
        return None
    interface = QtWidgets.QAccessibleWidget(widget, QtGui.QAccessible.Role[_ROLES[name]])
    _interfaces[:] = [each for each in _interfaces if isalive(each)]  # type: ignore[no-untyped-call]
    _interfaces.append(interface)
    return interface


def name_choice(box: QComboBox, name: str) -> None:
    """Say what is chosen in a list; on Linux, Qt gives the present choice as the name of the list.

    Parameters
    ----------
    box : QComboBox
        The list.
    name : str
        What is chosen in it.
    """
    box.setAccessibleName(name)
    box.setAccessibleDescription(name)
