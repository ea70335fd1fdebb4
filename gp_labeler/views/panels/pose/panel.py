"""The panel of the step Pose: touches, the cochlea estimated from them, where it lies, the verdict."""

from __future__ import annotations

from pathlib import Path

from qtpy.QtCore import QEvent, QObject, Qt, QTimer
from qtpy.QtGui import (
    QDragEnterEvent,
    QDragLeaveEvent,
    QDropEvent,
    QHideEvent,
    QResizeEvent,
    QShowEvent,
)
from qtpy.QtWidgets import QBoxLayout, QVBoxLayout, QWidget

from gp_labeler.models.workspace import Workspace
from gp_labeler.views.fonts import fit, pixels
from gp_labeler.views.layouts import in_row, placed, wide
from gp_labeler.views.panels.action_button import Actions, action_button
from gp_labeler.views.panels.parts import Card, lay_out_hidden, scrolled
from gp_labeler.views.panels.pose.overlay_card import OverlayCard
from gp_labeler.views.panels.pose.registration_card import RegistrationCard
from gp_labeler.views.panels.pose.result_card import ResultCard
from gp_labeler.views.panels.pose.settings_card import EstimateSettingsCard
from gp_labeler.views.panels.pose.touches_card import TouchesCard
from gp_labeler.views.panels.pose.verdict_card import VerdictCard
from gp_labeler.views.panels.scan.welcome import dropped_path
from gp_labeler.views.signals import follow

__all__ = ["PosePanel", "holds_touches"]

_TOUCH_FILES = (".dat", ".csv", ".mrk.json", ".fcsv", ".txt")
_WIDEST = 1280
"""How wide two columns become, logical pixels at the normal text size."""


def holds_touches(path: Path) -> bool:
    """Return whether a file may hold touches, by its name."""
    return path.name.lower().endswith(_TOUCH_FILES)


class PosePanel(QWidget):
    """All cards of the step; in two columns where there is room.

    Parameters
    ----------
    workspace : Workspace
        Whose touches and estimate it shows and edits.
    actions : mapping of str to QAction
        What its buttons do.
    """

    def __init__(self, workspace: Workspace, actions: Actions, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._workspace = workspace
        self._stale, self._is_alone = True, False
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self.setProperty("role", "panel")
        self.setAcceptDrops(True)
        self.head, self.touches = EstimateSettingsCard(workspace, actions), TouchesCard(workspace, actions)
        self.result, self.in_scan = ResultCard(workspace), RegistrationCard(workspace, actions)
        self.overlay, self.verdict = OverlayCard(workspace, actions), VerdictCard(workspace)
        self.report = action_button(
            actions["pose.report"], "Report…", "One page with touches, estimate, errors and pictures"
        )
        self.export = action_button(
            actions["pose.export"], "Export…", "The pose as JSON, Slicer transform, 4x4 table or markups"
        )
        self._lay_out()
        self._connect()
        self.set_wide(False)

    def refresh(self, *_: object) -> None:
        """Show everything as it stands; not before somebody looks."""
        self._stale = not self.isVisible()
        if self._stale:
            return
        for card in (self.head, self.touches, self.result, self.in_scan, self.verdict):
            card.refresh()

    def set_wide(self, wide: bool) -> None:
        """Take all the width there is, where there is no scan beside; else that of the other panels."""
        self._is_alone = wide
        self._share_columns()
        self.result.set_large(wide)
        self.touches.table.set_roomy(wide)
        self.overlay.setVisible(not wide)  # there is nothing to draw over
        lay_out_hidden(self)
        self._area.updateGeometry()

    def add_card(self, card: QWidget) -> None:
        """Put a card under the estimate."""
        self.right.insertWidget(self.right.indexOf(self.in_scan), card)

    def take_file(self, path: Path) -> bool:
        """Take the touches of a file; return whether it could be read."""
        return self.touches.take_file(path)

    def _lay_out(self) -> None:
        self.left, self.right = QVBoxLayout(), QVBoxLayout()
        out = Card("Export")
        out.add(in_row(wide(self.report), wide(self.export), spacing=6))
        for column, cards in (
            (self.left, (self.head, self.touches)),
            (self.right, (self.result, self.in_scan, self.overlay, self.verdict, out)),
        ):
            column.setSpacing(6)
            for card in cards:
                column.addWidget(card)
        body = QWidget()
        fit(body, lambda: body.setMaximumWidth(pixels(body, _WIDEST)))
        self._columns = QBoxLayout(QBoxLayout.Direction.TopToBottom, body)
        self._columns.setContentsMargins(4, 8, 8, 8)
        self._columns.setSpacing(6)
        self._columns.addLayout(self.left)
        self._columns.addLayout(self.right)
        self.left.addStretch(1)
        self.right.addStretch(1)
        content = QWidget()
        content.setProperty("role", "panel")
        in_row(placed(body, Qt.AlignmentFlag.AlignTop), margins=0, of=content)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        self._area = scrolled(content)
        body.installEventFilter(self)
        layout.addWidget(self._area)
        self.setFocusProxy(self.touches.table)

    def _connect(self) -> None:
        self._leave_timer = QTimer(self, interval=0, singleShot=True)
        self._leave_timer.timeout.connect(self._leave_name)
        self.head.specimen.returnPressed.connect(self._leave_name)
        pose = self._workspace.pose
        for signal in (pose.changed, pose.target_changed):
            follow(self, signal, self.refresh)

    def showEvent(self, event: QShowEvent) -> None:  # noqa: D102, N802 - Qt's name
        super().showEvent(event)
        if self._stale:
            self.refresh()
        if not event.spontaneous():
            self._leave_timer.start()

    def _leave_name(self) -> None:
        """Take the keys from the specimen's name: J records a touch, and is no letter of it."""
        if self.isVisible() and self.focusWidget() is self.head.specimen:
            self.touches.table.setFocus()

    def hideEvent(self, event: QHideEvent) -> None:  # noqa: D102, N802 - Qt's name
        super().hideEvent(event)
        self._stale = True
        if self._workspace.interaction.tool == "touch" and not event.spontaneous():
            self._workspace.interaction.set_tool("look")

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: D102, N802 - Qt's name
        self._share_columns()
        super().resizeEvent(event)

    @property
    def _two_columns_width(self) -> int:
        """What both columns take beside each other, with the scroll bar."""
        margins, bar = self._columns.contentsMargins(), self._area.verticalScrollBar().sizeHint().width()
        columns = 2 * max(column.minimumSize().width() for column in (self.left, self.right))
        return columns + self._columns.spacing() + margins.left() + margins.right() + bar

    def _share_columns(self) -> None:
        """Put the cards in two columns where they have the whole window, and it is wide."""
        way = QBoxLayout.Direction
        two = self._is_alone and self.width() >= self._two_columns_width
        direction = way.LeftToRight if two else way.TopToBottom
        if direction is self._columns.direction():
            return
        self._columns.setDirection(direction)
        for column in (0, 1):
            self._columns.setStretch(column, int(two))

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:  # noqa: D102, N802 - Qt's name
        if event.type() is QEvent.Type.LayoutRequest:  # a card shows more, or less
            self._share_columns()
        return super().eventFilter(watched, event)

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:  # noqa: D102, N802 - Qt's name
        path = dropped_path(event)
        if path is not None and holds_touches(path):
            event.acceptProposedAction()
            self.touches.offer(path)

    def dragLeaveEvent(self, event: QDragLeaveEvent) -> None:  # noqa: D102, N802 - Qt's name
        self.touches.offer(None)
        super().dragLeaveEvent(event)

    def dropEvent(self, event: QDropEvent) -> None:  # noqa: D102, N802 - Qt's name
        path = dropped_path(event)
        self.touches.offer(None)
        if path is not None:
            event.acceptProposedAction()
            self.take_file(path)
