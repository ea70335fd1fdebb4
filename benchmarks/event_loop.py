"""Waiting in a benchmark that opens the window."""

from __future__ import annotations

from qtpy.QtCore import QEventLoop, QTimer


def wait(ms: int) -> None:
    """Let the event loop run; `QTest.qWait` keeps Python's lock, and jobs would take many times as long."""
    loop = QEventLoop()
    QTimer.singleShot(ms, loop.quit)
    loop.exec()
