"""Returns the memory of a scan or its meshes to the system soon after they are released."""

from __future__ import annotations

from threading import Thread

from qtpy.QtCore import QObject, QTimer

from gp_labeler.imaging.memory import return_freed_memory
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.signals import follow

__all__ = ["MemoryReturn"]

_AFTER_MS = 1500
"""By then the views have let go of what is gone, too."""


class MemoryReturn(QObject):
    """Returns freed memory after each change of scan or meshes, in a thread of its own.

    Parameters
    ----------
    workspace : Workspace
        Whose scan and meshes come and go.
    parent : QObject
        Qt's parent, such as the window.
    """

    def __init__(self, workspace: Workspace, parent: QObject) -> None:
        super().__init__(parent)
        self._timer = QTimer(self, interval=_AFTER_MS, singleShot=True)
        self._timer.timeout.connect(self._start)
        for signal in (workspace.document.reset, workspace.scan.opened, workspace.bone.surfaces_changed):
            follow(self, signal, self._soon)

    def _soon(self, *_: object) -> None:
        self._timer.start()

    def _start(self) -> None:
        Thread(target=return_freed_memory, name="gp-memory", daemon=True).start()
