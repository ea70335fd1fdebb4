"""Guided touching: one feature at a time, in letters to be read from two metres, for hands in gloves."""

from __future__ import annotations

from collections.abc import Callable, Collection

from qtpy.QtCore import Qt, Signal
from qtpy.QtGui import QCloseEvent, QKeyEvent, QResizeEvent
from qtpy.QtWidgets import (
    QHBoxLayout,
    QProgressBar,
    QPushButton,
    QSizePolicy,
    QVBoxLayout,
    QWidget,
)

from gp_core.landmarks.features import CODES, RECOMMENDED, Side, feature
from gp_core.pose.quality import pose_quality
from gp_labeler.models.pose import ORDER
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.feature_picture import FeaturePicture
from gp_labeler.views.fonts import fit, pixels, styled, text_scale
from gp_labeler.views.formatting import degrees_text, sentence
from gp_labeler.views.layouts import STRETCH, in_column, in_row, wide
from gp_labeler.views.panels.flow import FlowLayout
from gp_labeler.views.panels.parts import scrolled, text_label
from gp_labeler.views.panels.tracker.card import tracker_role, tracker_words
from gp_labeler.views.signals import attempt, follow
from gp_labeler.views.stylesheet import set_role

__all__ = ["GuideWindow"]

_RECORD = (Qt.Key.Key_Space, Qt.Key.Key_Return, Qt.Key.Key_Enter, Qt.Key.Key_PageDown)
_REDO = (Qt.Key.Key_Backspace, Qt.Key.Key_PageUp)
_SKIP = (Qt.Key.Key_S, Qt.Key.Key_Right)
"""Foot pedals for presentations send the page keys."""

_RECORD_HINT = "Space, Page down or a foot pedal"
_DONE_HINT = f"{_RECORD_HINT}: closes the guide"
_TELLS_SIDE = ("IN", "ZL")

_HUGE, _TRUST, _LARGE, _BIG, _BUTTON = 64, 36, 28, 20, 22
"""Heights of the letters in a window of `_ROOM`, logical pixels: they grow and shrink with it."""

_ROOM, _SMALLEST = (1280, 800), 0.6


class GuideWindow(QWidget):
    """Leads through the features to touch.

    Parameters
    ----------
    workspace : Workspace
        Whose touches; with a tracked probe.
    parent : QWidget
        The main window, whose look it takes.
    """

    settings_asked = Signal()
    closed = Signal()

    def __init__(self, workspace: Workspace, parent: QWidget) -> None:
        super().__init__(parent, Qt.WindowType.Window)
        self._workspace, self._refusal = workspace, ""
        self._last: tuple[Side, str] | None = None
        self._scale, self._text_scale = 0.0, 0.0
        self.setWindowTitle("Guided touching")
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setProperty("role", "panel")
        self._make_widgets()
        self._lay_out()
        fit(self, self._fit)
        self._listen()
        self.refresh()

    def refresh(self, *_: object) -> None:
        """Show what is to be touched, and what is known of the cochlea."""
        pose = self._workspace.pose
        target, touched = pose.target, pose.names_touched
        row = feature(target) if target in CODES else None
        self.counter.setText(f"{pose.side.word.capitalize()} ear · {_progress(touched)}")
        self.code.setText(target or "All touched")
        self.name.setText(row.name if row else "Skull feature" if target else "")
        self.definition.setText(row.definition + _seventh(row.code, touched) if row else "")
        self.picture.show_feature(target if row else None, pose.side)
        self.picture.setVisible(row is not None)
        self.record.setText("Record" if target else "Done")
        self.record.setToolTip(_RECORD_HINT if target else _DONE_HINT)
        self.redo.setEnabled(self._to_redo is not None)
        self.redo.setText(f"Redo {self._to_redo or ''}".rstrip())
        self.skip.setEnabled(target is not None)
        self._show_result()
        self._show_tracker()

    def _show_result(self) -> None:
        pose = self._workspace.pose
        estimate = pose.estimate.pose if pose.estimate is not None else None
        if estimate is None:
            self.result.setText(pose.waiting_text or "No estimate")
            for label in (self.trust, self.reason, self.warning):
                label.hide()
            return
        trust = pose_quality(estimate)
        self.trust.setText(trust.word)
        self.reason.setText(trust.reason)
        set_role(self.trust, f"large-{trust.level}")
        for label in (self.trust, self.reason):
            label.show()
        self.result.setText(f"{estimate.radius_95:.2f} mm · {degrees_text(estimate.cone_95)}")
        self.warning.setText("\n".join(sentence(words) for words in estimate.warnings[:2]))
        self.warning.setVisible(bool(estimate.warnings))

    def _show_tracker(self, *_: object) -> None:
        tracker = self._workspace.tracker
        self.state.setText(tracker_words(self._workspace))
        set_role(self.state, f"large-{tracker_role(self._workspace)}")
        self.connect_button.setVisible(not tracker.on)
        self.record.setEnabled(tracker.on or self._workspace.pose.target is None)
        self.progress.setValue(round(100 * tracker.progress))
        self.told.setText(self._refusal)
        self.told.setVisible(bool(self._refusal))

    # What a person does

    @property
    def _to_redo(self) -> str | None:
        """What was recorded last here; else, or from a touched one, the one before in the order asked for."""
        pose, touched = self._workspace.pose, self._workspace.pose.names_touched
        asked, again = ORDER, pose.target in touched
        if self._last is not None and not again:
            side, name = self._last
            if side is pose.side and name in touched:
                return name
        if again and pose.target in ORDER:
            asked = ORDER[: ORDER.index(pose.target)]
        return next((name for name in reversed(asked) if name in touched), None)

    def _press(self) -> None:
        if self._workspace.pose.target is None:
            self.close()
            return
        self._refusal = ""
        attempt(self._workspace, self._workspace.tracker.press)
        self._show_tracker()

    def _redo(self) -> None:
        if self._to_redo is not None:
            self._workspace.pose.set_target(self._to_redo)

    def _on_recorded(self, name: str) -> None:
        self._last, self._refusal = (self._workspace.pose.side, name), ""
        self.refresh()

    def _on_refused(self, reason: str) -> None:
        self._refusal = reason
        self._show_tracker()

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: D102, N802
        if event.isAutoRepeat():
            return
        for keys, call in ((_RECORD, self._press), (_REDO, self._redo), (_SKIP, self._workspace.pose.skip)):
            if event.key() in keys:
                call()
                return
        if event.key() == Qt.Key.Key_Escape:
            self.close()
        elif event.key() == Qt.Key.Key_F11:
            self.setWindowState(self.windowState() ^ Qt.WindowState.WindowFullScreen)
        else:
            super().keyPressEvent(event)

    def closeEvent(self, event: QCloseEvent) -> None:  # noqa: D102, N802
        self.closed.emit()
        super().closeEvent(event)

    # Widgets

    def _make_widgets(self) -> None:
        self.counter, self.code = text_label(role="large-hint"), text_label(role="huge")
        self.name, self.definition = text_label(role="large", wrap=True), text_label(role="big", wrap=True)
        self.result, self.warning = text_label(role="large"), text_label(role="big-warning", wrap=True)
        self.trust, self.reason = text_label(), text_label(role="big", wrap=True)
        self.state, self.told = text_label(wrap=True), text_label(role="large-danger", wrap=True)
        self.caption = text_label("Cochlea, 95 % within", "large-hint")
        self.picture = FeaturePicture()
        self.picture.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.progress = QProgressBar()
        self.progress.setTextVisible(False)
        self.record = _big("Record", _RECORD_HINT, self._press)
        self.record.setProperty("role", "huge-primary")
        self.redo = _big("Redo", "Backspace or Page up: repeat the previous touch", self._redo)
        self.skip = _big("Skip", "S or Right: skip it; it comes again at the end", self._workspace.pose.skip)
        self.connect_button = _big("Connect…", "Choose the tracker", self.settings_asked.emit)
        self.leave = _big("Close", "Escape", self.close)

    def _fit(self) -> None:
        """Write as large as the window allows."""
        width, height = _ROOM
        scale = max(min(self.width() / width, self.height() / height), _SMALLEST)
        if scale == self._scale and self._text_scale == text_scale(self):
            return
        self._scale, self._text_scale = scale, text_scale(self)
        for size, bold, labels in (
            (_HUGE, True, (self.code,)),
            (_TRUST, True, (self.trust,)),
            (_LARGE, True, (self.name, self.result, self.record)),
            (_BUTTON, False, (self.redo, self.skip, self.connect_button, self.leave)),
            (_BIG, False, (self.counter, self.state, self.definition, self.reason, self.warning, self.told)),
            (_BIG, False, (self.caption,)),
        ):
            for label in labels:
                styled(label, size * scale, bold=bold)
        self.progress.setFixedHeight(pixels(self, _BIG * scale))

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: D102, N802
        super().resizeEvent(event)
        self._fit()

    def _lay_out(self) -> None:
        content = QWidget()
        content.setProperty("role", "panel")
        in_column(scrolled(content), margins=0, of=self)
        whole = QVBoxLayout(content)
        whole.setContentsMargins(32, 24, 32, 24)
        whole.setSpacing(16)
        head = _row(self.counter, self.state, self.connect_button, self.leave)
        head.setStretchFactor(self.state, 1)
        self.state.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        whole.addLayout(head)
        middle = in_row(wide(self.picture, 5), spacing=32)
        words = in_column(self.code, self.name, self.definition, STRETCH, self.told, self.caption, spacing=12)
        estimate = FlowLayout(spacing=16)
        for label in (self.result, self.trust):
            estimate.addWidget(label)
        words.addLayout(estimate)
        words.addWidget(self.reason)
        words.addWidget(self.warning)
        middle.addLayout(words, 6)
        whole.addLayout(middle, 1)
        whole.addWidget(self.progress)
        buttons = QHBoxLayout()
        buttons.setSpacing(16)
        for button, stretch in ((self.redo, 2), (self.skip, 2), (self.record, 5)):
            buttons.addWidget(button, stretch)
        whole.addLayout(buttons)

    def _listen(self) -> None:
        pose, tracker = self._workspace.pose, self._workspace.tracker
        for signal in (pose.changed, pose.target_changed):
            follow(self, signal, self.refresh)
        follow(self, pose.recorded, self._on_recorded)
        follow(self, tracker.refused, self._on_refused)
        for signal in (tracker.changed, tracker.moved):
            follow(self, signal, self._show_tracker)


def _big(words: str, hint: str, call: Callable[[], object]) -> QPushButton:
    button = QPushButton(words)
    button.setProperty("role", "huge")
    button.setToolTip(hint)
    button.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # keys are the window's: Space always records
    button.clicked.connect(lambda: call())
    return button


def _row(*widgets: QWidget) -> QHBoxLayout:
    return in_row(*widgets, spacing=16)


def _progress(touched: Collection[str]) -> str:
    """Return how many are touched, and how many of those to be touched at least are left."""
    missing = sum(code not in touched for code in RECOMMENDED)
    return f"{len(touched)} touched, {missing} to go" if missing else f"{len(touched)} touched"


def _seventh(target: str, touched: Collection[str]) -> str:
    """Return what a feature far from the others is good for, while none such is touched."""
    if target not in _TELLS_SIDE or any(code in touched for code in _TELLS_SIDE):
        return ""
    return "\n\nIt is far from the other points, so it determines the side and reveals a wrong touch of MN."
