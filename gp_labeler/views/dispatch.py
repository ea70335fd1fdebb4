"""Bringing calls from worker threads to the thread that Qt runs on."""

from __future__ import annotations

from collections.abc import Callable

from qtpy.QtCore import QObject, Qt, Signal

__all__ = ["QtDispatcher"]


class QtDispatcher(QObject):
    """A dispatcher for `jobs.runner.Jobs`; make it on the thread that calls are to be made on."""

    _handed_in = Signal(object)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._handed_in.connect(self._make, Qt.ConnectionType.QueuedConnection)

    def __call__(self, call: Callable[[], None]) -> None:
        """Take a call, from any thread."""
        self._handed_in.emit(call)

    def _make(self, call: Callable[[], None]) -> None:
        call()
