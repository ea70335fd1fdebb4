"""The rail: the steps of the work, at the left edge of the window."""

from __future__ import annotations

from dataclasses import dataclass

from qtpy.QtCore import QEvent, QRectF, QSize, Qt, Signal
from qtpy.QtGui import QColor, QFontMetricsF, QKeyEvent, QPainter, QPaintEvent, QPen, QResizeEvent
from qtpy.QtWidgets import QAbstractButton, QButtonGroup, QSizePolicy, QVBoxLayout, QWidget

from gp_core.landmarks.features import Side
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.chips import draw_chip
from gp_labeler.views.fonts import fit, font_of, line_height, pixels, text_width
from gp_labeler.views.icons import draw_icon
from gp_labeler.views.layouts import in_column
from gp_labeler.views.panels.action_button import Actions, do_action
from gp_labeler.views.signals import follow
from gp_labeler.views.theme import theme_of

__all__ = ["STEPS", "Rail", "WorkStep"]


@dataclass(frozen=True)
class WorkStep:
    """One step of the work."""

    id: str
    title: str
    icon: str
    hint: str


STEPS = (
    WorkStep("scan", "Scan", "scan", "The scan: properties, grey window, bone threshold"),
    WorkStep("label", "Label", "label", "Place the 20 features on both sides"),
    WorkStep(
        "atlas",
        "Atlas",
        "atlas",
        "The atlas: published, or fitted to your animals",
    ),
    WorkStep("pose", "Pose", "pose", "Estimate the cochlea from touched points"),
)
_PAD = 8
_DISABLED = 0.5
"""Opacity of the icon of a step that cannot be chosen yet; its name stays as legible as all words."""
_LONGEST = 88
"""Room for the name of an added panel, logical pixels at the normal text size; longer ones are shortened."""


class Rail(QWidget):
    """The steps, one of which is the current one.

    Parameters
    ----------
    workspace : Workspace
        Whose progress it shows.
    actions : mapping of str to QAction
        What its buttons do.
    """

    step_chosen = Signal(str)

    def __init__(
        self,
        workspace: Workspace,
        actions: Actions,
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self._workspace = workspace
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self.setProperty("role", "rail")
        self._group = QButtonGroup(self)
        self._needs_scan = {"label"}
        self.buttons = {step.id: self._button(n, step) for n, step in enumerate(STEPS, 1)}
        self.keys_button = _RailButton("keys", "Keys", "?", "info", self)
        self.keys_button.setToolTip("All keyboard shortcuts (?)")
        do_action(self.keys_button, actions["help.shortcuts"])
        self._column = layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 8, 0, 8)
        layout.setSpacing(4)
        self._steps = in_column(*self.buttons.values(), spacing=4)
        layout.addLayout(self._steps)
        layout.addStretch(1)
        layout.addWidget(self.keys_button)
        self.buttons["scan"].setChecked(True)
        fit(self, self._fit_width)
        for signal in (workspace.scan.opened, workspace.document.reset, workspace.document.landmarks_changed):
            follow(self, signal, self._refresh)
        self._refresh()

    @property
    def step(self) -> str:
        """The current step."""
        return next(id for id, button in self.buttons.items() if button.isChecked())

    def set_step(self, step: str) -> None:
        """Make a step the current one; tells `step_chosen` where that is news."""
        button = self.buttons[step]
        if not button.isChecked():
            button.setChecked(True)
            self.step_chosen.emit(step)

    def add_step(self, step: WorkStep) -> None:
        """Add the step of an installed package, below the others; it is enabled once there is a scan."""
        self.buttons[step.id] = self._button(len(self.buttons) + 1, step)
        self._needs_scan.add(step.id)
        self._steps.addWidget(self.buttons[step.id])
        self._fit_width()
        self._refresh()

    def remove_step(self, step: str) -> None:
        """Take a step away; another one must be the current one."""
        self._needs_scan.discard(step)
        button = self.buttons.pop(step)
        button.hide()
        button.deleteLater()
        self._fit_width()

    def _button(self, number: int, step: WorkStep) -> _RailButton:
        button = _RailButton(step.id, step.title, str(number), step.icon, self)
        button.setCheckable(True)
        button.setAutoExclusive(True)  # screen readers call it a radio button
        button.setToolTip(step.hint)
        button.setAccessibleDescription(button.toolTip())
        button.clicked.connect(lambda: self.step_chosen.emit(step.id))
        self._group.addButton(button)
        return button

    def _fit_width(self) -> None:
        """Be as wide as the longest name."""
        self.setFixedWidth(max(button.sizeHint().width() for button in self.buttons.values()))
        self._share_height()

    def _share_height(self) -> None:
        """Show the icons of all steps, or of none where the window is too low."""
        buttons, margins = [*self.buttons.values(), self.keys_button], self._column.contentsMargins()
        needed = sum(button.whole_height + self._column.spacing() for button in buttons)
        for button in buttons:
            button.set_bare(self.height() < needed + margins.top() + margins.bottom())

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: D102, N802 - Qt's name
        super().resizeEvent(event)
        self._share_height()

    def _refresh(self, *_: object) -> None:
        document, labels = self._workspace.document, self._workspace.labels
        done = [labels.progress(side) for side in Side]
        for id in self._needs_scan:
            self.buttons[id].setEnabled(document.state.volume is not None)
        self.buttons["scan"].set_done(self._workspace.scan.volume is not None)
        self.buttons["label"].set_done(all(p.n_placed + p.n_unseen >= p.n_total for p in done))


class _RailButton(QAbstractButton):
    """One step: a picture, its number and its name."""

    def __init__(self, id: str, title: str, number: str, icon: str, parent: QWidget) -> None:
        super().__init__(parent)
        self.setObjectName(f"rail-{id}")
        self.setText(title)
        self.setAccessibleName(title)
        self._number, self._icon, self._done, self._is_bare = number, icon, False, False
        self.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Maximum)
        self.setCursor(Qt.CursorShape.PointingHandCursor)
        self.setAttribute(Qt.WidgetAttribute.WA_Hover)

    def set_done(self, done: bool) -> None:
        """Mark the step as finished, or not."""
        if done != self._done:
            self._done = done
            self.setAccessibleDescription(self.toolTip() + (" · done" if done else ""))
            self.update()

    def set_bare(self, bare: bool) -> None:
        """Leave out the icon, or show it."""
        if bare != self._is_bare:
            self._is_bare = bare
            self.updateGeometry()
            self.update()

    @property
    def whole_height(self) -> int:
        """The height with its icon, logical pixels."""
        return self._icon_height + line_height(self) + 10

    def sizeHint(self) -> QSize:  # noqa: N802 - Qt's name
        words = text_width(self, *(f"{n} {step.title}" for n, step in enumerate(STEPS, 1)), bold=True)
        own = text_width(self, f"{self._number} {self.text()}", bold=True) + pixels(self, 8)
        added = min(own, pixels(self, _LONGEST))
        width = max(max(words, added) + 2 * _PAD, pixels(self, 72))
        return QSize(width, line_height(self) + 8 if self._is_bare else self.whole_height)

    def minimumSizeHint(self) -> QSize:  # noqa: N802 - Qt's name
        """Return the room for the words alone."""
        return QSize(self.sizeHint().width(), line_height(self) + 8)

    @property
    def _icon_height(self) -> int:
        return pixels(self, 36)

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: N802 - Qt's name
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            self.click()
        else:
            super().keyPressEvent(event)

    def changeEvent(self, event: QEvent) -> None:  # noqa: N802 - Qt's name
        self.update()
        super().changeEvent(event)

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: N802 - Qt's name
        theme = theme_of(self)
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        box = QRectF(self.rect()).adjusted(4, 1, -4, -1)
        if self.isChecked() or (self.underMouse() and self.isEnabled()):
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(QColor(theme.selected if self.isChecked() else theme.hover))
            painter.drawRoundedRect(box, 8, 8)
        if self.isChecked():
            painter.fillRect(QRectF(0, 10, 3, self.height() - 20), QColor(theme.accent_text))
        if self.hasFocus():
            painter.setPen(QPen(QColor(theme.focus), 2))
            painter.setBrush(Qt.BrushStyle.NoBrush)
            painter.drawRoundedRect(box.adjusted(0.5, 0.5, -0.5, -0.5), 8, 8)
        colour = theme.text if self.isChecked() else theme.muted if self.isEnabled() else theme.faint
        has_icon = not self._is_bare
        if has_icon:
            side = pixels(self, 22)
            painter.setOpacity(1.0 if self.isEnabled() else _DISABLED)
            draw_icon(painter, self._icon, QRectF((self.width() - side) / 2, 10, side, side), QColor(colour))
            painter.setOpacity(1.0)
        if self._done:
            side = pixels(self, 13)
            left = self.width() / 2 + pixels(self, 9) if has_icon else box.right() - side
            draw_chip(painter, "checked", QRectF(left, 5 if has_icon else 1, side, side), theme)
        painter.setFont(font_of(self, bold=self.isChecked()))
        painter.setPen(QColor(colour))
        room = self.width() - _PAD
        words = f"{self._number} {self.text()}"
        words = QFontMetricsF(painter.font()).elidedText(words, Qt.TextElideMode.ElideRight, room)
        top = self._icon_height - 2 if has_icon else 0
        painter.drawText(box.adjusted(0, top, 0, -2 if has_icon else 0), Qt.AlignmentFlag.AlignCenter, words)
        painter.end()
