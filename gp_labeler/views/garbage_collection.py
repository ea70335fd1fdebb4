"""Keeps Python's garbage collector on the thread of the windows.

Python looks for cycles of objects on whichever thread happens to make one object too many. A background job
would destroy a widget that is part of a cycle, such as a dialog that was closed. Qt and VTK allow that on
their own thread only: the program would end with a segmentation fault.
"""

from __future__ import annotations

import gc
import sys

from qtpy.QtCore import QObject, QTimer

__all__ = ["collect_on_this_thread"]

_INTERVAL_MS = 100
"""Short, so that there is little to look through each time."""

_DUE = (700, 10, 10)
"""New objects, or collections of the younger generation, after which one is due: as is usual in Python."""


def collect_on_this_thread(application: QObject) -> None:
    """Stop the collector on all threads, and run it where an application has its event loop.

    Parameters
    ----------
    application : QObject
        The Qt application, which lives on this thread; asked twice, it has one collector.
    """
    gc.disable()
    if application.findChild(_Collector) is None:
        _Collector(application)


class _Collector(QObject):
    """Collects what is due, as Python would: the youngest objects often, all of them seldom.

    What is alive once modules were imported is left out from then on: nearly all of it are the modules'
    own objects, which stay, and to look through them all would take 50 to 100 ms each time. Many modules
    are imported with the first scan.
    """

    def __init__(self, application: QObject) -> None:
        super().__init__(application)
        self._n_modules = len(sys.modules)
        gc.freeze()
        self._timer = QTimer(self, interval=_INTERVAL_MS)
        self._timer.timeout.connect(self._collect)
        self._timer.start()

    def _collect(self) -> None:
        if len(sys.modules) > self._n_modules:
            self._n_modules = len(sys.modules)
            gc.collect()
            gc.freeze()
            return
        counts = enumerate(zip(gc.get_count(), _DUE, strict=True))
        due = [age for age, (count, most) in counts if count > most]
        if due:
            gc.collect(due[-1])
