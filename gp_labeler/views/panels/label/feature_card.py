"""The feature card: what is being placed, where to look for it, and the one next thing to do."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from qtpy.QtCore import QEvent, Qt
from qtpy.QtGui import QResizeEvent
from qtpy.QtWidgets import (
    QBoxLayout,
    QLabel,
    QPushButton,
    QSizePolicy,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from gp_core.landmarks.features import Side
from gp_labeler.commands.actions import ACTIONS
from gp_labeler.document.edits import CheckPoint, SwapSides
from gp_labeler.document.state import How
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.chips import SHAPES, chip_pixmap
from gp_labeler.views.feature_picture import FeaturePicture
from gp_labeler.views.fonts import fit, line_height, pixels
from gp_labeler.views.layouts import STRETCH, in_column, in_row, placed, wide
from gp_labeler.views.panels.action_button import Actions, action_button
from gp_labeler.views.panels.card_parts import link
from gp_labeler.views.panels.flow import FlowLayout
from gp_labeler.views.panels.label.annotation_row import AnnotationRow
from gp_labeler.views.panels.label.card_content import CardContent, content_of
from gp_labeler.views.shortcuts_sheet import keys_text
from gp_labeler.views.signals import OncePerTurn, attempt, blocked, follow
from gp_labeler.views.stylesheet import set_role
from gp_labeler.views.theme import theme_of

__all__ = ["FeatureCard"]

_CHIP, _GAP = 14, 4
_DOWN, _UP = "\N{BLACK DOWN-POINTING TRIANGLE}", "\N{BLACK UP-POINTING TRIANGLE}"
_TALL = 350
"""From this height on the picture stands above the words, not beside; at the normal text size."""

_IN_MENUS = {
    "open": "file.open",
    "find": "file.find_scan",
    "export": "file.export",
    "confirm": "point.confirm",
}
"""Next actions that the menus have too."""


class FeatureCard(QWidget):
    """Shows the active feature.

    Parameters
    ----------
    workspace : Workspace
        What it shows and edits.
    actions : mapping of str to QAction
        What its buttons do.
    """

    def __init__(self, workspace: Workspace, actions: Actions, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._workspace, self._actions = workspace, actions
        self._content = CardContent("")
        self._refresh_once = OncePerTurn(self.refresh, self)
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self.setProperty("role", "card")
        self._make_widgets()
        self._lay_out()
        self._listen()
        self.refresh()

    @property
    def content(self) -> CardContent:
        """What it says now."""
        self.flush()
        return self._content

    def flush(self) -> None:
        """Refresh now if anything was announced since."""
        if self._refresh_once.isActive():
            self.refresh()

    def refresh(self, *_: object) -> None:
        """Show the active feature as it stands."""
        self._refresh_once.stop()
        labels = self._workspace.labels
        self._content = now = content_of(
            labels,
            has_scan=self._workspace.scan.volume is not None,
            atlas=self._workspace.atlas.text,
            in_head=self._workspace.head.is_shown,
            turned=self._workspace.view.planes_are_turned,
        )
        self._eyebrow.setText(now.eyebrow)
        self._title.setText(f"{now.code}  {now.name}" if now.code else now.name)
        self._show_mistakes()
        for label, text in ((self._aside, now.aside), (self._where, now.where), (self._status, now.status)):
            label.setText(text)
            label.setVisible(bool(text))
        self._aside.setToolTip(now.aside_hint)
        self._definition.setText(now.definition)
        set_role(self._status, now.status_role)
        self._chip.setVisible(bool(now.status))
        self._show_chip()
        self.picture.show_feature(now.code or None, labels.active.side)
        self.picture.setVisible(bool(now.code))
        self.annotation.refresh()
        self._refresh_buttons(now)
        self.refresh_hidden()

    def _make_widgets(self) -> None:
        self._eyebrow, self._title = _label("eyebrow", wrap=True), _label("title")
        self._aside, self._definition = _label("shared"), _label("", wrap=True)
        self._where, self._status = _label("hint", wrap=True), _label("hint", wrap=True)
        self._mistakes = _label("hint", wrap=True)
        self.mistakes = link("", "What often goes wrong when this feature is placed")
        self.mistakes.setCheckable(True)
        self.mistakes.toggled.connect(self._show_mistakes)
        self._chip = QLabel()
        self.annotation = AnnotationRow(self._workspace)
        self.picture = FeaturePicture()
        self.picture.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.primary = QPushButton()
        self.primary.setProperty("role", "primary")
        self.primary.clicked.connect(self._on_primary)
        self.skip = QPushButton()
        self.skip.setToolTip("Continue with the next feature; skipped features come again after the others")
        self.skip.clicked.connect(lambda: self._do(lambda: self._workspace.labels.skip()))
        self.unseen = QPushButton(_with_key("Unseen", "point.unseen"))
        self.unseen.setAccessibleName("Unseen")
        self.unseen.setToolTip("The feature is not visible in this scan")
        self.unseen.clicked.connect(lambda: self._do(lambda: self._workspace.labels.mark_unseen()))
        self.plane = action_button(self._actions["view.plane_of_feature"], "")
        self.cut_open = action_button(self._actions["view.cut_open"], "Cut open")
        self.sides = {side: self._side_button(side) for side in Side}
        fit(self, self._fit)

    def _fit(self) -> None:
        """Give chip and picture a size that goes with the text."""
        self._chip.setFixedSize(pixels(self, _CHIP), pixels(self, _CHIP))
        for button in self.sides.values():
            button.setMinimumWidth(pixels(self, 28))
        help_height = 5 * line_height(self) + self.plane.sizeHint().height() + 2 * _GAP
        self.picture.setMinimumSize(pixels(self, 96), help_height)  # the buttons below stay where they are
        self._show_chip()

    def _side_button(self, side: Side) -> QToolButton:
        button = QToolButton()
        button.setText(side.value)
        button.setCheckable(True)
        button.setAutoExclusive(True)
        button.setToolTip(f"Label the {side.word} side")
        button.setAccessibleName(f"{side.word} side")
        button.clicked.connect(lambda: self._go_to_side(side))
        return button

    def _lay_out(self) -> None:
        top = in_row(wide(self._eyebrow), self.cut_open, *self.sides.values(), spacing=4)
        status = in_row(placed(self._chip, Qt.AlignmentFlag.AlignTop), wide(self._status), spacing=6)
        words = in_column(
            self._definition,
            self._where,
            self._mistakes,
            placed(self.plane, Qt.AlignmentFlag.AlignLeft),
            STRETCH,
            spacing=_GAP,
        )
        self._body = QBoxLayout(QBoxLayout.Direction.LeftToRight)
        self._body.setSpacing(10)
        self._body.addWidget(self.picture, 2)
        self._body.addLayout(words, 3)
        buttons = in_row(wide(self.primary), self.skip, self.unseen, spacing=6)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(12, 8, 12, 12)
        layout.setSpacing(5)
        heading = FlowLayout()
        for widget in (self._title, self._aside, self.mistakes):
            heading.addWidget(widget)
        layout.addLayout(top)
        layout.addLayout(heading)
        layout.addLayout(self._body, 1)
        layout.addLayout(status)
        layout.addLayout(buttons)
        layout.addWidget(self.annotation)  # last: the buttons stay where they are as it comes and goes

    def _listen(self) -> None:
        workspace = self._workspace
        for signal in (
            workspace.document.reset,
            workspace.labels.active_changed,
            workspace.document.landmarks_changed,
            workspace.labels.ghosts_changed,
            workspace.labels.problems_changed,
            workspace.scan.opened,
            workspace.view.planes_changed,
        ):
            # a point that was placed is active for a moment only: to show it would move the table below
            follow(self, signal, self._refresh_once.soon)

    def refresh_hidden(self) -> None:
        """Offer to cut the bone open where it hides the active feature, or where that is expected."""
        workspace, active = self._workspace, self._workspace.labels.active
        area = workspace.interaction.visible_area
        where = None if active.code is None else workspace.labels.place_of(active.side, active.code)
        self.cut_open.setVisible(
            area is not None and where is not None and bool(workspace.bone.surfaces) and area.hides(where)
        )

    def _refresh_buttons(self, now: CardContent) -> None:
        self.primary.setText(_with_key(now.action_text, _COMMANDS.get(now.action, "")))
        self.primary.setAccessibleName(now.action_text)
        self.skip.setText(_with_key(now.skip_text, "point.skip"))
        self.skip.setAccessibleName(now.skip_text)
        self.skip.setVisible(bool(now.code) and now.can_skip)
        self.plane.setVisible(bool(now.plane_text))
        self.plane.setText(_with_key(now.plane_text, "view.plane_of_feature"))
        self.plane.setAccessibleName(now.plane_text)
        self.unseen.setVisible(bool(now.code))
        self.unseen.setEnabled(now.can_unsee)
        active = self._workspace.labels.active
        for side, button in self.sides.items():
            button.setVisible(bool(now.code))
            with blocked(button):
                button.setChecked(side is active.side)

    def _show_mistakes(self, *_: object) -> None:
        """Show what often goes wrong with the feature, if asked for it; also of those that follow."""
        words, is_open = self._content.mistakes, self.mistakes.isChecked()
        self.mistakes.setText(f"Mistakes {_UP if is_open else _DOWN}")
        self.mistakes.setAccessibleName(f"{'Hide' if is_open else 'Show'} common mistakes")
        self.mistakes.setVisible(bool(words))
        self._mistakes.setText(words)
        self._mistakes.setVisible(bool(words) and is_open)

    def _show_chip(self) -> None:
        state = self._content.state
        if state in SHAPES:
            self._chip.setPixmap(
                chip_pixmap(state, pixels(self, _CHIP), theme_of(self), self.devicePixelRatioF())
            )

    def _on_primary(self) -> None:
        """Do the one next thing."""
        action = self._content.action
        if action in _IN_MENUS:
            self._actions[_IN_MENUS[action]].trigger()
        else:
            self._do(lambda: _EDITS[action](self._workspace))

    def _go_to_side(self, side: Side) -> None:
        code = self._workspace.labels.active.code
        if code is not None:
            self._do(lambda: self._workspace.labels.go_to(side, code))

    def _do(self, edit: Callable[[], object]) -> None:
        attempt(self._workspace, edit)
        self.refresh()

    def changeEvent(self, event: QEvent) -> None:  # noqa: D102, N802 - Qt's name
        super().changeEvent(event)
        if event.type() is QEvent.Type.StyleChange and hasattr(self, "_chip"):
            self._show_chip()
            self.picture.update()

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: D102, N802 - Qt's name
        tall = event.size().height() >= pixels(self, _TALL)
        way = QBoxLayout.Direction.TopToBottom if tall else QBoxLayout.Direction.LeftToRight
        if self._body.direction() is not way:
            self._body.setDirection(way)
            self._body.setStretch(0, 1 if tall else 2)
            self._body.setStretch(1, 0 if tall else 3)
        super().resizeEvent(event)


def _check(workspace: Workspace) -> None:
    document, labels = workspace.document, workspace.labels
    active = labels.active
    if active.code is not None:
        document.do(CheckPoint(active.side, active.code, by=document.author))


def _swap_names(workspace: Workspace) -> None:
    """Exchange the active point with the one that seems to have its name."""
    labels = workspace.labels
    side, code = labels.active.side, labels.active.code
    problem = labels.known_problems(side).get(code or "")
    if problem is not None and problem.kind == "exchanged":
        workspace.labels.swap(side, *problem.landmarks)


def _place_at_crosshair(workspace: Workspace) -> None:
    workspace.labels.place(workspace.view.crosshair, How.SLICE)


_EDITS: Mapping[str, Callable[[Workspace], object]] = {
    "ghost": lambda workspace: workspace.labels.accept_ghost(),
    "crosshair": _place_at_crosshair,
    "check": _check,
    "unlock": lambda workspace: workspace.labels.lock(False),
    "next": lambda workspace: workspace.labels.skip(),
    "swap_sides": lambda workspace: workspace.document.do(SwapSides()),
    "swap_names": _swap_names,
}


_COMMANDS: Mapping[str, str] = {
    "ghost": "point.accept_ghost",
    "confirm": "point.accept_ghost",
    "crosshair": "point.place",
    "check": "point.check",
    "unlock": "point.lock",
    "next": "point.skip",
    "swap_sides": "edit.swap_sides",
    "swap_names": "edit.swap",
}
"""The commands that do the same as the one next action."""


def _with_key(text: str, command: str) -> str:
    """Return the words of a button with the first key of its command."""
    keys = ACTIONS[command].shortcuts if command in ACTIONS else ()
    return f"{text}   {keys_text(keys[0])}" if keys else text


def _label(role: str, *, wrap: bool = False) -> QLabel:
    label = QLabel()
    if role:
        label.setProperty("role", role)
    label.setWordWrap(wrap)
    label.setTextFormat(Qt.TextFormat.PlainText)
    return label
