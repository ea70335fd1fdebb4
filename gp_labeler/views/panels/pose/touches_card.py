"""The card of what was touched: how touches come in, the table of them, and what each of them does."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from qtpy.QtCore import QPoint, Qt, QTimer
from qtpy.QtWidgets import QMenu, QSizePolicy, QToolButton, QWidget

from gp_core.errors import GpError
from gp_labeler.document import touching
from gp_labeler.document.touches import Touch
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.layouts import STRETCH, in_row, wide
from gp_labeler.views.panels.action_button import Actions, do_action
from gp_labeler.views.panels.card_parts import Notices, link
from gp_labeler.views.panels.parts import Card, ElidedLabel
from gp_labeler.views.panels.pose.touch_table import TouchTable
from gp_labeler.views.panels.pose.touch_table_model import TouchTableModel
from gp_labeler.views.panels.pose.wording import change_text
from gp_labeler.views.panels.tracker.card import tracker_state
from gp_labeler.views.signals import blocked, follow
from gp_labeler.views.stylesheet import set_role

__all__ = ["TouchesCard"]

_DELETE = Qt.WidgetAttribute.WA_DeleteOnClose
_DOWN, _UP = "\N{BLACK DOWN-POINTING TRIANGLE}", "\N{BLACK UP-POINTING TRIANGLE}"
_LOOK_MS = 90
"""The pointer may pass over rows; only one it rests on is worth an estimate without it."""

_WAYS = {
    "file": ("File…", "Read touches from a file (.dat, .csv, .mrk.json, .fcsv), or drop one here"),
    "type": ("Type", "Type or paste x y z, one point after the other"),
    "scan": ("On the scan", "Dry run: click each feature on bone or on a slice"),
    "tracker": ("Tracker…", "Touch with a tracked probe (OpenIGTLink)"),
}


class TouchesCard(Card):
    """Touches of the side in work.

    Parameters
    ----------
    workspace : Workspace
        Whose touches it shows and edits.
    actions : mapping of str to QAction
        What its buttons do.
    """

    def __init__(self, workspace: Workspace, actions: Actions, parent: QWidget | None = None) -> None:
        super().__init__("Touches", parent)
        self._workspace = workspace
        self._looked_at = ""
        self.model = TouchTableModel(workspace, self.tell, self)
        self.table = TouchTable(self.model)
        self.notices, self.change = Notices(), ElidedLabel("", "hint")
        self.change.setAccessibleName("Effect of leaving the point out")
        self.skull = link("+ skull point S1", "Touch a skull feature, for the registration to the scan")
        self.more = link("", "Show or hide the skull features; those that do not fit are always shown")
        self.guide = link("Guide…", "One feature at a time in large type, with its picture")
        self.clear = link("Clear all", "Remove all touches of this side; undo restores them")
        self.ways = {name: self._way(name) for name in _WAYS}
        self._timer = QTimer(self, interval=_LOOK_MS, singleShot=True)
        self._timer.timeout.connect(self._show_change)
        self._lay_out()
        self._connect(actions)

    def refresh(self, *_: object) -> None:
        """Show the touches as they stand."""
        self.model.refresh()
        side = self._workspace.pose.side
        touched = [touch for (of, _), touch in self._workspace.document.state.touches.items() if of is side]
        out = sum(touch.left_out for touch in touched)
        words = f"Touches  {len(touched)}" + (f", {out} left out" if out else "")
        self.heading.setText(words if touched else "Touches")
        self.clear.setEnabled(bool(touched))
        n, shown = self.model.n_skull, self.model.skull_shown
        self.more.setText(f"Skull {n} {_UP if shown else _DOWN}")
        self.more.setAccessibleName(f"{'Hide' if shown else 'Show'} {n} skull features")
        self.more.setVisible(n > 0)
        self._timer.start()
        self.skull.setText(f"+ skull point {self._workspace.pose.next_skull}")

    def tell(self, error: GpError | None) -> None:
        """Say what could not be done, until something can; None takes it away."""
        notices: list[tuple[str, ...]] = []
        if error is not None:
            self._workspace.say(str(error), "error")
            plain = str(error).removesuffix(error.remedy or "").rstrip()
            notices = [("error", _short_path(plain, error.file), error.remedy or "")]
        self.notices.show_notices(notices)

    def offer(self, path: Path | None) -> None:
        """Say that a file that is dragged over the panel would be taken; None: it went away."""
        set_role(self.change, "hint" if path is None else "good")
        if path is None:
            self._show_change()
        else:
            self.change.set_words(f"Release to read the touches of {path.name}")

    def take_file(self, path: Path) -> bool:
        """Take the touches of a file; return whether it could be read."""
        return self._do(lambda: self._workspace.pose.load(path))

    def _way(self, name: str) -> QToolButton:
        button = QToolButton()
        button.setText(_WAYS[name][0])
        button.setToolTip(_WAYS[name][1])
        button.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        return button

    def _lay_out(self) -> None:
        self.add_to_heading(self.guide)
        self.add_to_heading(self.clear)
        row = in_row(*map(wide, self.ways.values()), spacing=4)
        self.ways["scan"].setCheckable(True)
        self.add(row)
        self.add(self.notices)
        self._layout.setContentsMargins(1, 6, 1, 6)
        for item in (self._top, row):
            item.setContentsMargins(11, 0, 11, 0)
        self.notices.setContentsMargins(11, 0, 11, 0)
        self.table.setStyleSheet("QTableView { border: none; border-radius: 0 }")
        self.add(self.table)
        foot = in_row(self.more, self.skull, STRETCH, margins=(11, 0, 8, 0))
        self.add(in_row(self.change, margins=(11, 0, 11, 0)))
        self.add(foot)

    def _connect(self, actions: Actions) -> None:
        table, pose = self.table, self._workspace.pose
        do_action(self.ways["file"], actions["pose.open_touches"])
        do_action(self.ways["tracker"], actions["pose.tracker"])
        do_action(self.guide, actions["pose.guide"])
        self.ways["type"].clicked.connect(self._type_next)
        self.ways["scan"].clicked.connect(
            lambda on: self._workspace.interaction.set_tool("touch" if on else "look")
        )
        self.clear.clicked.connect(lambda: self._do(lambda: self._clear(None)))
        self.more.clicked.connect(self._toggle_skull)
        self.skull.clicked.connect(lambda: pose.set_target(pose.next_skull))
        table.clear_asked.connect(lambda name: self._do(lambda: self._clear(name)))
        table.use_asked.connect(self._toggle_use)
        table.chosen.connect(self._on_chosen)
        table.looked_at.connect(self._on_looked_at)
        table.menu_asked.connect(self._open_menu)
        self._type_timer = QTimer(self, interval=0, singleShot=True)
        self._type_timer.timeout.connect(self._type_next)
        table.typed.connect(lambda _: self._type_timer.start())
        table.pasted.connect(self._on_pasted)
        follow(self, self._workspace.interaction.tool_changed, self._show_tool)
        follow(self, self._workspace.scan.opened, self._show_tool)
        follow(self, self._workspace.document.reset, self._show_tool)
        self._show_tool()
        for signal in (self._workspace.tracker.changed, self._workspace.tracker.moved):
            follow(self, signal, self._show_tracker)

    def _show_tool(self, *_: object) -> None:
        button = self.ways["scan"]
        button.setEnabled(self._workspace.scan.volume is not None)
        with blocked(button):
            button.setChecked(self._workspace.interaction.tool == "touch")

    def _show_tracker(self) -> None:
        state = tracker_state(self._workspace) or _WAYS["tracker"][0]
        if state != self.ways["tracker"].text():
            self.ways["tracker"].setText(state)

    def _toggle_skull(self) -> None:
        self.model.show_skull(not self.model.skull_shown)
        self.refresh()

    def _type_next(self) -> None:
        target = self._workspace.pose.target
        if target is not None:
            self.table.setFocus()
            self.table.edit_position(target)

    def _on_chosen(self, name: str) -> None:
        """Aim at what is not touched yet; show what is."""
        if self._touch(name) is None:
            self._workspace.pose.set_target(name)
        else:
            self._do(lambda: self._workspace.pose.show(name))

    def _on_pasted(self, name: str, text: str) -> None:
        """Take a position for the row; of several lines, each names its point."""
        lines = [line.strip() for line in text.splitlines() if line.strip()]
        if len(lines) == 1 and not lines[0][0].isalpha():
            self.model.record(name or self._workspace.pose.target or "", lines[0])
            return
        for n, line in enumerate(lines):
            code, *rest = line.replace(",", " ").replace("\t", " ").replace(";", " ").split()
            is_heading = n == 0 and not any(character.isdigit() for character in "".join(rest))
            if not is_heading and not self.model.record(code, " ".join(rest)):
                return

    def _toggle_use(self, name: str) -> None:
        touch = self._touch(name)
        if touch is not None:
            pose = self._workspace.pose
            self._do(
                lambda: touching.leave_out(self._workspace.document, pose.side, name, not touch.left_out)
            )

    def _clear(self, name: str | None) -> None:
        touching.clear_touches(self._workspace.document, self._workspace.pose.side, name)
        if name is not None:
            self._workspace.pose.set_target(name)

    def _open_menu(self, name: str, where: QPoint) -> None:
        pose, touch, menu = self._workspace.pose, self._touch(name), QMenu(self)
        menu.setAttribute(_DELETE)
        menu.addAction("Touch next" if touch is None else "Touch again", lambda: pose.set_target(name))
        menu.addAction("Type position…", lambda: self.table.edit_position(name))
        if touch is not None:
            word = "Include again" if touch.left_out else "Leave out"
            menu.addAction(word, lambda: self._toggle_use(name))
            menu.addAction("Clear", lambda: self._do(lambda: self._clear(name)))
        menu.popup(where)

    def _on_looked_at(self, name: str) -> None:
        if name != self._looked_at:
            self._looked_at = name
            self._timer.start()

    def _show_change(self) -> None:
        name, touch = self._looked_at, self._touch(self._looked_at)
        words = "" if self._any_touch() else "Drop a file of touches here"
        if touch is not None and self._workspace.pose.estimate is not None:
            words = change_text(name, touch, self._workspace.pose.without(name))
        self.change.set_words(words)

    def _any_touch(self) -> bool:
        return any(side is self._workspace.pose.side for side, _ in self._workspace.document.state.touches)

    def _touch(self, name: str) -> Touch | None:
        return self._workspace.document.state.touches.get((self._workspace.pose.side, name))

    def _do(self, edit: Callable[[], object]) -> bool:
        try:
            edit()
        except GpError as error:
            self.tell(error)
            return False
        self.tell(None)
        return True


def _short_path(text: str, file: str | None) -> str:
    return text if file is None else text.replace(file, Path(file).name)
