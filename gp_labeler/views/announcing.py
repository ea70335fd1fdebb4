"""Messages are told to screen readers, which do not read what merely changes on the screen."""

from __future__ import annotations

from qtpy import QtGui
from qtpy.QtWidgets import QWidget

__all__ = ["announce"]


def announce(widget: QWidget, words: str, *, urgent: bool) -> None:
    """Let a screen reader say something, if one is running.

    Parameters
    ----------
    widget : QWidget
        Where it is shown.
    words : str
        What is said.
    urgent : bool
        Whether it interrupts what is being read.
    """
    event = getattr(QtGui, "QAccessibleAnnouncementEvent", None)  # PyQt6 and Qt before 6.8 have none
    if event is not None:
        said = event(widget, words)
        how = QtGui.QAccessible.AnnouncementPoliteness
        said.setPoliteness(how.Assertive if urgent else how.Polite)
        QtGui.QAccessible.updateAccessibility(said)
