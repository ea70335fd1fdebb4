"""Keeps Python's garbage collector on the thread of the windows.

Python looks for cycles of objects on whichever thread happens to make one object too many. A background job
would destroy a widget that is part of a cycle, such as a dialog that was closed. Qt and VTK allow that on
their own thread only: the program would end with a segmentation fault.
"""

from __future__ import annotations

import gc
import sys
import time

from qtpy.QtCore import QObject, QTimer

__all__ = ["collect_on_this_thread"]

_INTERVAL_MS = 100
"""Short, so that there is little to look through each time."""

_AT_REST = 0.05
"""Part of the time that a thread at rest works, at most: its own timers take some."""

_DUE = (700, 10, 10)
"""New objects, or collections of the younger generation, after which one is due: as is usual in Python."""


def collect_on_this_thread(application: QObject, *, rest_s: float = 20.0) -> None:
    """Stop the collector on all threads, and run it where an application has its event loop.

    Parameters
    ----------
    application : QObject
        The Qt application, which lives on this thread; asked twice, it has one collector.
    rest_s : float
        Seconds without work on this thread after which all objects are looked through.
    """
    gc.disable()
    if application.findChild(_Collector) is None:
        _Collector(application, round(1000 * rest_s / _INTERVAL_MS))


class _Collector(QObject):
    """Collects what is due, as Python would: the youngest objects often, all of them seldom.

    What is alive once modules were imported is left out from then on, until the window rests: nearly all of
    it are the modules' own objects, which stay, and to look through them all takes 50 to 100 ms. Many modules
    are imported with the first scan.
    """

    def __init__(self, application: QObject, rest: int) -> None:
        super().__init__(application)
        self._n_modules = len(sys.modules)
        self._rest, self._n_at_rest, self._worked = rest, 0, time.thread_time()
        gc.freeze()
        self._timer = QTimer(self, interval=_INTERVAL_MS)
        self._timer.timeout.connect(self._collect)
        self._timer.start()

    def _collect(self) -> None:
        if len(sys.modules) > self._n_modules:
            self._n_modules = len(sys.modules)
            gc.collect()
            gc.freeze()
        elif self._has_rested():
            gc.unfreeze()
            gc.collect()
            gc.freeze()
            self._worked = time.thread_time()
        else:
            counts = enumerate(zip(gc.get_count(), _DUE, strict=True))
            due = [age for age, (count, most) in counts if count > most]
            if due:
                gc.collect(due[-1])

    def _has_rested(self) -> bool:
        """Whether this thread has just rested for as long as was asked; once in each rest."""
        before, self._worked = self._worked, time.thread_time()
        is_at_rest = self._worked - before < _AT_REST * _INTERVAL_MS / 1000
        self._n_at_rest = self._n_at_rest + 1 if is_at_rest else 0
        return self._n_at_rest == self._rest
