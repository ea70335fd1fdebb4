"""The bar above the views: which specimen this is, the buttons used all the time, and whether it is saved."""

from __future__ import annotations

from collections.abc import Mapping

from PySide6.QtCore import QEvent, QSize, Qt
from PySide6.QtGui import QAction, QResizeEvent
from PySide6.QtWidgets import QHBoxLayout, QLabel, QToolButton, QWidget

from gp_labeler.views.bind import follow, set_role, size_text, spacing_text
from gp_labeler.views.icons import icon
from gp_labeler.views.theme import theme_of
from gp_labeler.workbench import Workbench

__all__ = ["TopBar"]

_LONGEST_UNDO, _GAP = 26, 6
_TOOLS = (
    ("tool.place", "label", "Place"),
    ("tool.look", "axis", "Crosshair"),
    ("tool.grey", "sun", "Contrast"),
)


class TopBar(QWidget):
    """The bar above the views.

    Parameters
    ----------
    workbench : Workbench
        What it tells of.
    actions : mapping of str to QAction
        What its buttons do.
    """

    def __init__(
        self, workbench: Workbench, actions: Mapping[str, QAction], parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self._desk, self._actions = workbench, actions
        self.setFixedHeight(44)
        self.name, self.about, self.saved = QLabel(), QLabel(), QLabel()
        self.name.setProperty("role", "heading")
        self.about.setProperty("role", "hint")
        self._icons: list[tuple[QToolButton, str]] = []
        self._working: list[tuple[QToolButton, str]] = []  # mean nothing before a scan is open
        self._lay_out()
        for signal in (
            workbench.session_replaced,
            workbench.volume_opened,
            workbench.details_changed,
            workbench.dirty_changed,
            workbench.saved,
            workbench.history_changed,
        ):
            follow(self, signal, self.refresh)
        self.refresh()
        self.take_theme()

    def refresh(self, *_: object) -> None:
        """Show the specimen as it stands."""
        session, volume = self._desk.session, self._desk.volume
        self.name.setText(session.state.specimen if self._desk.in_use else "gp-labeler")
        about = (
            "" if volume is None else f"{size_text(volume.size)}  ·  {spacing_text(volume.spacing)}  ·  LPS"
        )
        self.about.setText(about)
        place = self._desk.place if self._desk.in_use else ""
        self.name.setToolTip(place)
        set_role(self.saved, "warning" if session.dirty or session.path is None else "good")
        kept = "● saved" if session.path is not None else "● a copy" if place else ""
        self.saved.setText("● not saved" if session.dirty else kept)
        self.saved.setToolTip("Every edit is kept in a journal at once; Ctrl+S writes the specimen file")
        for button, id in self._working:
            is_edit = id.startswith("edit.") and self._desk.in_use
            button.setVisible(session.state.volume is not None or is_edit)
        undo = session.undo_text or ""
        short = undo if len(undo) <= _LONGEST_UNDO else undo[: _LONGEST_UNDO - 1] + "…"
        self._undo.setText(f"Undo {short}" if undo else "Undo")
        self._fit()

    def take_theme(self) -> None:
        """Draw in the colours of the window's theme."""
        theme = theme_of(self)
        for button, name in self._icons:
            shown = "sun" if name == "moon" and theme.is_dark else name
            button.setIcon(icon(shown, theme.text, disabled=theme.faint))

    def _lay_out(self) -> None:
        row = QHBoxLayout(self)
        row.setContentsMargins(14, 4, 12, 4)
        row.setSpacing(_GAP)
        row.addWidget(self.name)
        row.addSpacing(6)
        row.addWidget(self.about)
        row.addStretch(1)
        for id, picture, word in _TOOLS:
            row.addWidget(self._button(id, picture, word))
        row.addSpacing(10)
        self._undo = self._button("edit.undo", "undo", "Undo")
        row.addWidget(self._undo)
        row.addWidget(self._button("edit.redo", "redo"))
        row.addSpacing(10)
        row.addWidget(self._button("view.four-up", "layout", "Four views"))
        row.addWidget(self._button("view.theme", "moon"))
        row.addSpacing(8)
        row.addWidget(self.saved)

    def _button(self, id: str, picture: str, word: str = "") -> QToolButton:
        action, button = self._actions[id], QToolButton()
        button.setIconSize(QSize(16, 16))
        button.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        button.setText(word)
        style = Qt.ToolButtonStyle
        button.setToolButtonStyle(style.ToolButtonTextBesideIcon if word else style.ToolButtonIconOnly)
        button.setCheckable(action.isCheckable() and id.startswith("tool."))
        button.clicked.connect(action.trigger)

        def follow_action() -> None:
            button.setEnabled(action.isEnabled())
            button.setToolTip(action.toolTip())
            button.setAccessibleName(action.text())
            if button.isCheckable():
                button.setChecked(action.isChecked())

        action.changed.connect(follow_action)
        button.clicked.connect(follow_action)  # a click toggles it, whatever the action says
        follow_action()
        self._icons.append((button, picture))
        if id != "view.theme":
            self._working.append((button, id))
        return button

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: D102, N802
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        """Leave out what the scan is like where there is no room for it.

        It is not hidden to measure the others: that would lay out the bar anew at every edit.
        """
        about, shown = self.about.sizeHint().width(), not self.about.isHidden()
        others = self.sizeHint().width() - (about + _GAP if shown else 0)
        self.about.setVisible(others + about + 2 * _GAP <= self.width())

    def changeEvent(self, event: QEvent) -> None:  # noqa: D102, N802
        if event.type() == QEvent.Type.StyleChange:
            self.take_theme()
        super().changeEvent(event)
