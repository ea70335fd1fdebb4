"""The line at the bottom: where the pointer is, what the next click does, and what goes on behind."""

from __future__ import annotations

from typing import Any

import numpy as np
from qtpy.QtCore import QEvent, QSize, Qt, QTimer, Signal
from qtpy.QtGui import QResizeEvent
from qtpy.QtWidgets import QHBoxLayout, QLabel, QProgressBar, QSizePolicy, QToolButton, QWidget

from gp_core.validation import FloatArray
from gp_labeler.document.edits import point_text
from gp_labeler.imaging.anatomical_frame import LETTERS
from gp_labeler.jobs.runner import Task
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.announcing import announce
from gp_labeler.views.fonts import fit, line_height, pixels, text_width
from gp_labeler.views.formatting import capitalised
from gp_labeler.views.icons import icon
from gp_labeler.views.layouts import in_row, wide
from gp_labeler.views.panels.parts import breakable
from gp_labeler.views.signals import follow
from gp_labeler.views.theme import theme_of

__all__ = ["StatusLine", "where_text"]

_LEAST_WORDS = 240
"""Room for the words in the middle, below which running work is not shown; at the normal text size."""

_SHOWN_AFTER_MS = 150
"""Work that is done sooner does not flicker by."""

_MARGIN, _ROOM = 12, 8
"""Beside the words, and above and below them, logical pixels."""

_WIDEST_PLACE = "L 00.00  P 00.00  S 00.00 mm  ·  voxel 0000, 0000, 0000  ·  -32768"
_WIDEST_FRAME = "Head frame, turned"
_TOOL_HINTS = {
    "look": "Drag on a slice to move the crosshair",
    "turn": "Drag on a slice to rotate the head about the crosshair · Esc ends this",
    "grey": "Drag on a slice: left or right for contrast, up or down for brightness",
}
_SIGNS = {"info": "", "warning": "Warning: ", "error": "Error: "}
_MESSAGE_MS = {"info": 5000, "warning": 12000, "error": 0}


def where_text(position: FloatArray) -> str:
    """Say a (3,) scan position, such as ``L 4.62  P 9.10  S 12.44 mm``."""
    parts = [f"{LETTERS[axis][int(mm >= 0)]} {abs(mm):.2f}" for axis, mm in enumerate(position)]
    return "  ".join(parts) + " mm"


class StatusLine(QWidget):
    """The line at the bottom.

    Parameters
    ----------
    workspace : Workspace
        What it tells of.
    """

    def __init__(self, workspace: Workspace, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._workspace = workspace
        self._role = "hint"
        self.where, self.next_click, self.frame = QLabel(), QLabel(), QLabel()
        self.frame.setProperty("role", "hint")
        self.frame.setToolTip("Frame of the views; positions are always in the scan frame (LPS)")
        self.next_click.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.next_click.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self.work = _Work(workspace)
        self.work.changed.connect(self._make_room)
        in_row(
            self.frame,
            self.where,
            wide(self.next_click),
            self.work,
            margins=(_MARGIN, 0, _MARGIN, 0),
            spacing=_MARGIN,
            of=self,
        )
        self.without_scan = ""
        self._message_timer = QTimer(self, singleShot=True)
        self._message_timer.timeout.connect(self._say_next)
        self._just_warned = QTimer(self, singleShot=True, interval=0)
        for signal in (
            workspace.document.landmarks_changed,
            workspace.labels.active_changed,
            workspace.document.reset,
            workspace.interaction.tool_changed,
            workspace.scan.opened,
            workspace.interaction.replacing_changed,
            workspace.interaction.dragged,
            workspace.pose.target_changed,
            workspace.measure.changed,
        ):
            follow(self, signal, self._on_changed)
        follow(self, workspace.messages.said, self.say)
        for changed in (workspace.view.planes_changed, workspace.scan.opened, workspace.document.reset):
            follow(self, changed, self._say_frame)
        fit(self, self._make_room)
        self._say_next()

    def show_position(self, position: FloatArray | None) -> None:
        """Tell what lies at a (3,) scan position."""
        volume = self._workspace.scan.volume
        if position is None or volume is None:
            self.where.setText("")
            return
        i, j, k = np.rint(volume.scan_to_voxel(position[None])[0]).astype(int)
        value = volume.value_at(position)
        what = "outside the scan" if value is None else f"voxel {i}, {j}, {k}  ·  {value:.6g}"
        self.where.setText(f"{where_text(position)}  ·  {what}")

    def _say_frame(self, *_: object) -> None:
        if self.frame.text() != self._workspace.view.frame_text:
            self.frame.setText(self._workspace.view.frame_text)
            self._make_room()

    def set_without_scan(self, text: str) -> None:
        """Say what comes next where there is no scan and none is needed; empty where one is."""
        self.without_scan = text
        self._on_changed()

    def say(self, text: str, level: str = "info") -> None:
        """Show a message in the middle for a while, an error until the next edit; and tell screen readers.

        A word says what its colour says, too.
        """
        text = capitalised(f"{_SIGNS[level]}{text}")
        announce(self.next_click, text, urgent=level != "info")
        self._show(breakable(text), {"info": "good"}.get(level, "danger" if level == "error" else level))
        if level == "warning":
            self._just_warned.start()
        if _MESSAGE_MS[level]:
            self._message_timer.start(_MESSAGE_MS[level])
        else:
            self._message_timer.stop()

    def _on_changed(self, *_: object) -> None:
        """Say what comes next, but leave what the same click has just warned of."""
        if self._just_warned.isActive():
            return
        self._message_timer.stop()
        self._say_next()

    def _say_next(self) -> None:
        self._show(*self._next())

    def _next(self) -> tuple[str, str]:
        """Return what the next click does, or what comes next, and in which role it is shown."""
        workspace = self._workspace
        if workspace.interaction.drag is not None:
            point = point_text(workspace.interaction.drag.side, workspace.interaction.drag.code)
            return f"Release to place {point} here, or press Esc to cancel", "next"
        if workspace.scan.volume is None:
            its_own = "Locate the scan with File > Find scan" if workspace.document.volume_is_lost else ""
            return self.without_scan or its_own or "Open a scan, or try the demo", "hint"
        if workspace.interaction.replacing and workspace.labels.active.code is not None:
            point = point_text(workspace.labels.active.side, workspace.labels.active.code)
            return f"Click the new position of {point} · Esc cancels", "next"
        if workspace.measure.dragged is not None:
            name = workspace.measure.dragged[0]
            return f"Release to place the end of {name}, or press Esc to cancel", "next"
        if workspace.measure.kind is not None:
            return workspace.measure.click_text, "next"
        if workspace.interaction.tool == "touch":
            return self._touch_text(), "next"
        if workspace.interaction.tool in _TOOL_HINTS:
            return _TOOL_HINTS[workspace.interaction.tool], "hint"
        return workspace.labels.click_text, "next"

    def _touch_text(self) -> str:
        pose = self._workspace.pose
        if not pose.target:
            return "All features are touched"
        return f"Click on bone or a slice where {point_text(pose.side, pose.target)} is"

    def _show(self, text: str, role: str) -> None:
        self.next_click.setText(text)
        self.next_click.setToolTip(text)
        theme = theme_of(self)
        colours = {
            "next": theme.states["placed"],
            "hint": theme.muted,
            "good": theme.good,
            "warning": theme.warning,
            "danger": theme.danger,
        }
        look = f"color: {colours[role]}"
        if self.next_click.styleSheet() != look:  # Qt polishes the label again even for the same one
            self.next_click.setStyleSheet(look)
        self._role = role
        self._make_room()

    def _make_room(self) -> None:
        """Show the words in the middle whole: at need without the place, over several lines, without work."""
        text, whole = self.next_click, self.width() - 2 * _MARGIN
        need = text_width(self, text.text()) + 4
        place, work = text_width(self, _WIDEST_PLACE), self.work.needed_width
        beside = work + _MARGIN if self.work.is_busy else 0
        has_place = self._workspace.scan.volume is not None and whole - beside - place - _MARGIN >= need
        self.where.setVisible(has_place)
        self.where.setFixedWidth(place)
        frame = text_width(self, _WIDEST_FRAME) + _MARGIN
        has_frame = has_place and whole - beside - place - _MARGIN - frame >= need
        self.frame.setVisible(has_frame)
        self.frame.setFixedWidth(frame - _MARGIN)
        if self.work.is_busy and whole - beside < min(need, pixels(self, _LEAST_WORDS)):
            beside = 0
        self.work.setVisible(beside > 0)
        self.work.setFixedWidth(max(work, 1))
        room = max(whole - beside, 1)
        text.setWordWrap(need > room)
        lines = text.heightForWidth(room) if need > room else line_height(self)
        self.setFixedHeight(max(lines, line_height(self)) + 2 * _ROOM)

    def minimumSizeHint(self) -> QSize:  # noqa: D102, N802
        return QSize(pixels(self, _LEAST_WORDS), self.minimumHeight())

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: D102, N802
        super().resizeEvent(event)
        if event.size().width() != event.oldSize().width():
            self._make_room()

    def changeEvent(self, event: QEvent) -> None:  # noqa: D102, N802
        if event.type() == QEvent.Type.StyleChange:
            self._show(self.next_click.text(), self._role)
        super().changeEvent(event)


class _Work(QWidget):
    """The oldest running task that matters to the user, how far it is, and a button that stops it."""

    changed = Signal()
    """There is work to show, other work, or none any more."""

    def __init__(self, workspace: Workspace) -> None:
        super().__init__()
        self._workspace, self._was_busy = workspace, False
        self.text, self.bar, self.stop = QLabel(), QProgressBar(), QToolButton()
        self.text.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        self.bar.setTextVisible(False)
        self.stop.setProperty("role", "quiet")
        self.stop.setToolTip("Stop this task")
        self.stop.setAccessibleName("Stop the background task")
        self._row = row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(8)
        row.addStretch(1)
        for widget in (self.text, self.bar, self.stop):
            row.addWidget(widget)
        fit(self, self._fit)
        self._timer = QTimer(self, interval=_SHOWN_AFTER_MS, singleShot=True)
        self._timer.timeout.connect(self._refresh)
        self.stop.clicked.connect(self._stop)
        jobs = workspace.jobs
        for signal in (jobs.started, jobs.progressed, jobs.done, jobs.failed, jobs.cancelled):
            follow(self, signal, self._on_task)
        self.take_theme()
        self._refresh()

    def take_theme(self) -> None:
        """Draw the button in the colours of the theme that is in effect."""
        self.stop.setIcon(icon("close", theme_of(self).text, size=pixels(self, 12)))

    def changeEvent(self, event: QEvent) -> None:  # noqa: N802 - Qt's name
        super().changeEvent(event)
        if event.type() is QEvent.Type.StyleChange:
            self.take_theme()

    def _fit(self) -> None:
        self.bar.setFixedWidth(pixels(self, 110))
        self.stop.setFixedSize(pixels(self, 22), pixels(self, 22))

    @property
    def needed_width(self) -> int:
        """What it takes to show all of it, logical pixels; 0 where there is no work."""
        return self._row.minimumSize().width() if self.is_busy else 0

    @property
    def is_busy(self) -> bool:
        """Whether there is work to show."""
        return self._task is not None

    @property
    def _task(self) -> Task[Any] | None:
        shown = [
            t for t in self._workspace.jobs.running if not t.progress.cancelled() and "judging" not in t.key
        ]
        return shown[0] if shown else None

    def _on_task(self, _: Task[Any]) -> None:
        if self._task is None or self.bar.isVisible():
            self._refresh()
        elif not self._timer.isActive():
            self._timer.start()

    def _refresh(self) -> None:
        task = self._task
        for widget in (self.text, self.bar, self.stop):
            widget.setVisible(task is not None)
        if self._was_busy != self.is_busy:
            self._was_busy = self.is_busy
            self.changed.emit()
        if task is not None:
            self.bar.setRange(0, 100 if task.fraction > 0 else 0)
            self.bar.setValue(round(100 * task.fraction))
            if (words := task.text or task.job.title) != self.text.text():
                self.text.setText(words)
                self.changed.emit()

    def _stop(self) -> None:
        if self._task is not None:
            self._task.cancel()
        self._refresh()
