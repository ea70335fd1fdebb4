"""The table of actions as `QAction`s: menus, shortcuts, and the buttons that follow them."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from qtpy.QtCore import QObject, Qt, Signal
from qtpy.QtGui import QAction, QKeySequence
from qtpy.QtWidgets import QMenu, QMenuBar, QWidget

from gp_labeler.commands.actions import ACTIONS, MENUS, Action, InWindow, run
from gp_labeler.models.view import GREY_WINDOW
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.shortcuts_sheet import keys_text
from gp_labeler.views.signals import OncePerTurn, follow

__all__ = ["Commands"]

_VIEW_KEYS = {"Return", "Enter", "Space", "Delete", "Backspace"}
"""Keys that buttons, tables and text fields need themselves: they act while the pointer is in a view."""

_ONCE = ("point.accept_ghost", "point.confirm", "point.unseen", "point.clear", "point.replace")
"""A key that is held down must not run through points that nobody has looked at."""

_FOLDED = {
    "layout": "Views",
    "step": "Steps",
    "from": "Look from",
    "tool": "Tools",
    "what": "Show",
    "text": "Text size",
    "references": "Compare with",
    "cut": "Cut bone",
    "slab": "Slab and noise",
    "head": "Straighten the head",
    "planes": "Planes of the slices",
    "bone": "Bone in 3D",
    "suggest": "Suggestions",
    "go": "Go to",
    "how": "While placing",
    "certainty": "Certainty",
    "labelling": "Observers and labellings",
    "estimate": "Method",
    "out": "Export and report",
}
"""Groups that have a menu of their own: else the menus are higher than a small screen."""


class Commands(QObject):
    """A `QAction` for each row of the table.

    Parameters
    ----------
    workspace : Workspace
        What they act on.
    in_window : callable
        Returns what the window does for an action that needs one, by its id; see `views.window_commands`.
    window, views : QWidget
        Where keys work: everywhere, or only in the views.
    """

    done = Signal(str)
    """Id of the action that was done."""

    path_chosen = Signal(object)
    """`Path` of a file that was opened before, to be opened again."""

    def __init__(
        self,
        workspace: Workspace,
        in_window: InWindow,
        window: QWidget,
        views: QWidget,
    ) -> None:
        super().__init__(window)
        self._workspace, self._in_window = workspace, in_window
        self._refresh_once = OncePerTurn(self.refresh, self)
        self.actions = {row.id: self._made(row, window, views) for row in ACTIONS.values()}
        for signal in (
            workspace.document.reset,
            workspace.labels.active_changed,
            workspace.labels.ghosts_changed,
            workspace.document.history_changed,  # after every edit
            workspace.view.planes_changed,
            workspace.head.changed,
            workspace.scan.opened,
            workspace.bone.surfaces_changed,
            workspace.interaction.tool_changed,
            workspace.interaction.replacing_changed,
            workspace.atlas.changed,
            workspace.pose.changed,
            workspace.pose.target_changed,
            workspace.pose.overlay_changed,
            workspace.tracker.changed,
            workspace.references.changed,
            workspace.meshes.changed,
            workspace.measure.changed,
            workspace.jobs.started,
            workspace.jobs.done,
            workspace.jobs.failed,
            workspace.jobs.cancelled,
        ):
            follow(self, signal, self._refresh_once.soon)
        follow(self, workspace.view.changed, self._on_view_changed)
        self.refresh()

    def fill(self, bar: QMenuBar) -> None:
        """Make the menus."""
        for name in MENUS:
            shown = menu = bar.addMenu(f"&{name}")
            menu.setToolTipsVisible(True)
            menu.aboutToShow.connect(self.flush)
            group = None
            for row in ACTIONS.values():
                if row.menu != name:
                    continue
                if row.group != group:
                    if group is not None and not {group, row.group} <= _FOLDED.keys():
                        menu.addSeparator()
                    group = row.group
                    shown = menu.addMenu(_FOLDED[group]) if group in _FOLDED else menu
                    shown.setToolTipsVisible(True)
                shown.addAction(self.actions[row.id])
                if row.id == "file.demo" and self._workspace.recent is not None:
                    self._add_recent(menu)

    def _on_view_changed(self, changed: frozenset[str]) -> None:
        if not changed <= GREY_WINDOW:  # no command depends on it, and a drag changes it all the time
            self._refresh_once.soon()

    def flush(self) -> None:
        """Refresh now if anything was announced since: a key or a menu asks what can be done."""
        if self._refresh_once.isActive():
            self.refresh()

    def refresh(self) -> None:
        """Bring what can be done, and what is on, up to date."""
        self._refresh_once.stop()
        for row in ACTIONS.values():
            made = self.actions[row.id]
            made.setEnabled(row.enabled(self._workspace))
            if row.checked is not None:
                made.setChecked(row.checked(self._workspace))
        document = self._workspace.document
        for id, word, what in (
            ("edit.undo", "Undo", document.undo_text),
            ("edit.redo", "Redo", document.redo_text),
        ):
            self.actions[id].setText(f"{word} {what}" if what else word)

    def _made(self, row: Action, window: QWidget, views: QWidget) -> QAction:
        made = QAction(row.title, self)
        made.setObjectName(row.id)
        made.setShortcuts([QKeySequence(keys) for keys in row.shortcuts])
        made.setCheckable(row.checked is not None)
        made.setAutoRepeat(row.id not in _ONCE)
        keys = keys_text(row.shortcuts[0]) if row.shortcuts else ""
        made.setToolTip((row.hint or row.title.rstrip("…")) + (f"  ({keys})" if keys else ""))
        made.triggered.connect(partial(self.run, row.id))
        if _VIEW_KEYS & set(row.shortcuts):
            made.setShortcutContext(Qt.ShortcutContext.WidgetWithChildrenShortcut)
            views.addAction(made)
        else:
            window.addAction(made)
        return made

    def run(self, id: str, *_: object) -> bool:
        """Do an action; return whether it could be done."""
        was_done = run(id, self._workspace, self._in_window)
        self.refresh()
        if was_done:
            self.done.emit(id)
        return was_done

    def _add_recent(self, menu: QMenu) -> None:
        recent = menu.addMenu("Open recent")
        recent.aboutToShow.connect(partial(self._fill_recent, recent))

    def _fill_recent(self, menu: QMenu) -> None:
        menu.clear()
        files = self._workspace.recent.all() if self._workspace.recent is not None else ()
        for path in files:
            entry = menu.addAction(_short(path))
            entry.setEnabled(path.exists())
            entry.setToolTip(str(path))
            entry.triggered.connect(partial(self._on_recent, path))
        if not files:
            menu.addAction("No recent files").setEnabled(False)

    def _on_recent(self, path: Path, *_: object) -> None:
        self.path_chosen.emit(path)


def _short(path: Path) -> str:
    return f"{path.name}   ({path.parent.name})"
