"""The bar above the views: which specimen this is, the buttons used all the time, and whether it is saved."""

from __future__ import annotations

from collections.abc import Mapping

from qtpy.QtCore import QEvent, QSize, Qt
from qtpy.QtGui import QAction, QResizeEvent
from qtpy.QtWidgets import QHBoxLayout, QLabel, QSizePolicy, QToolButton, QWidget

from gp_labeler.models.workspace import Workspace
from gp_labeler.views.fonts import fit, line_height, pixels, text_width
from gp_labeler.views.formatting import size_text, spacing_text
from gp_labeler.views.icons import icon
from gp_labeler.views.panels.parts import ElidedLabel
from gp_labeler.views.signals import follow
from gp_labeler.views.stylesheet import set_role
from gp_labeler.views.theme import theme_of

__all__ = ["TopBar"]

_GAP = 6
_UNSAVED, _SAVED, _COPY = "\N{BULLET} not saved", "\N{BULLET} saved", "\N{BULLET} a copy"
_SHORTEST_NAME, _FRAME, _AROUND = 60, 14, 76
"""Least width of the name; what a button has around its icon; margins and gaps of the bar."""

_TOOLS = (
    ("tool.place", "label", "Place"),
    ("tool.look", "pose", "Crosshair"),
    ("tool.grey", "sun", "Contrast"),
    ("tool.ruler", "ruler", "Ruler"),
    ("tool.angle", "angle", ""),
)


class TopBar(QWidget):
    """The bar above the views.

    Parameters
    ----------
    workspace : Workspace
        What it tells of.
    actions : mapping of str to QAction
        What its buttons do.
    """

    def __init__(
        self, workspace: Workspace, actions: Mapping[str, QAction], parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self._workspace, self._actions = workspace, actions
        self.name, self.about, self.saved = ElidedLabel("", "heading"), QLabel(), QLabel()
        self.name.setSizePolicy(QSizePolicy.Policy.Maximum, QSizePolicy.Policy.Preferred)
        self.name.setMinimumWidth(_SHORTEST_NAME)
        self.about.setProperty("role", "hint")
        self._icons: list[tuple[QToolButton, str]] = []
        self._widths: dict[QToolButton, int] = {}
        self._working: list[tuple[QToolButton, str]] = []  # mean nothing before a scan is open
        self._lay_out()
        for signal in (
            workspace.document.reset,
            workspace.scan.opened,
            workspace.document.details_changed,
            workspace.document.dirty_changed,
            workspace.document.saved,
            workspace.document.history_changed,
        ):
            follow(self, signal, self.refresh)
        self.refresh()
        self.take_theme()

    def refresh(self, *_: object) -> None:
        """Show the specimen as it stands."""
        volume, document = self._workspace.scan.volume, self._workspace.document
        self.name.set_words(document.state.specimen if self._workspace.document.in_use else "gp-labeler")
        about = (
            "" if volume is None else f"{size_text(volume.size)}  ·  {spacing_text(volume.spacing)}  ·  LPS"
        )
        self.about.setText(about)
        place = self._workspace.document.location if self._workspace.document.in_use else ""
        self.name.setToolTip(place or self.name.toolTip())
        set_role(self.saved, "warning" if document.dirty or document.path is None else "good")
        kept = _SAVED if document.path is not None else _COPY if place else ""
        self.saved.setText(_UNSAVED if document.dirty else kept)
        self.saved.setToolTip("Every edit is written to a journal at once; Ctrl+S writes the specimen file")
        for button, id in self._working:
            is_edit = id.startswith("edit.") and self._workspace.document.in_use
            button.setVisible(document.state.volume is not None or is_edit)
        self._make_room()

    def take_theme(self) -> None:
        """Draw in the colours of the window's theme."""
        theme = theme_of(self)
        for button, name in self._icons:
            shown = "sun" if name == "moon" and theme.is_dark else name
            button.setIcon(icon(shown, theme.text, disabled=theme.faint))

    def _lay_out(self) -> None:
        self._row = row = QHBoxLayout(self)
        row.setContentsMargins(14, 4, 12, 4)
        row.setSpacing(_GAP)
        row.addWidget(self.name)
        row.addSpacing(6)
        row.addWidget(self.about)
        row.addStretch(1)
        row.addWidget(self.saved)
        row.addSpacing(8)
        for id, picture, word in _TOOLS:
            row.addWidget(self._button(id, picture, word))
        row.addSpacing(10)
        self._undo = self._button("edit.undo", "undo", "Undo")
        row.addWidget(self._undo)
        row.addWidget(self._button("edit.redo", "redo"))
        row.addSpacing(10)
        row.addWidget(self._button("view.four-up", "layout", "Four views"))
        row.addWidget(self._button("view.theme", "moon"))
        fit(self, self._fit)

    def _fit(self) -> None:
        """Keep the place of what changes, so that nothing beside it moves."""
        self.setFixedHeight(line_height(self) + pixels(self, 26))
        self.saved.setFixedWidth(text_width(self, _UNSAVED, _SAVED, _COPY))
        self.saved.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        for button, _ in self._icons:
            button.setIconSize(QSize(pixels(self, 16), pixels(self, 16)))
            if button.text():
                button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
            self._widths[button] = button.sizeHint().width()
        self._make_room()

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

    def minimumSizeHint(self) -> QSize:  # noqa: N802
        """Return the room that name, icons and what is saved take, without words on the buttons."""
        icons = len(self._icons) * (pixels(self, 16) + _FRAME + _GAP)
        width = self.name.minimumWidth() + icons + self.saved.minimumWidth() + _AROUND
        return QSize(width, self.minimumHeight())

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: D102, N802
        super().resizeEvent(event)
        self._make_room()

    def _make_room(self) -> None:
        """Leave out what the scan is like where there is no room for it, and then the words of the buttons.

        Nothing is hidden to measure it: that would lay out the bar again at every edit.
        """
        shown = [button for button, _ in self._icons if not button.isHidden()]
        about = self.about.sizeHint().width() + _GAP
        rest = self._row.minimumSize().width() - sum(button.sizeHint().width() for button in shown)
        rest -= 0 if self.about.isHidden() else about
        with_words = rest + sum(self._widths[button] for button in shown)
        longer = max(self.name.sizeHint().width() - self.name.minimumWidth(), 0)
        self.about.setVisible(with_words + longer + about <= self.width())
        style = Qt.ToolButtonStyle
        wanted = style.ToolButtonTextBesideIcon if with_words <= self.width() else style.ToolButtonIconOnly
        for button, _ in self._icons:
            if button.text() and button.toolButtonStyle() is not wanted:
                button.setToolButtonStyle(wanted)

    def changeEvent(self, event: QEvent) -> None:  # noqa: D102, N802
        if event.type() == QEvent.Type.StyleChange:
            self.take_theme()
        super().changeEvent(event)
