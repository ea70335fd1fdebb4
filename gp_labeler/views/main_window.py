"""The main window: rail, views and panels docked together; everything else happens elsewhere."""

from __future__ import annotations

from dataclasses import fields
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import TypeVar

from qtpy.QtCore import QByteArray, QEvent, QSize, Qt
from qtpy.QtGui import QCloseEvent, QDragEnterEvent, QDropEvent, QKeyEvent, QResizeEvent
from qtpy.QtWidgets import (
    QApplication,
    QLineEdit,
    QMainWindow,
    QStackedWidget,
    QWidget,
)

from gp_core.atlas.label_check import Finding
from gp_core.errors import GpError
from gp_core.settings import setting
from gp_core.study.reliability import Disagreement
from gp_labeler.document.animals import may_hold_labels
from gp_labeler.document.specimen_document import VolumeChangedError
from gp_labeler.imaging.readers import ImportPlan
from gp_labeler.imaging.volume import Volume
from gp_labeler.models.view import ViewModel as SessionView
from gp_labeler.models.view import ViewState
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.commands import Commands
from gp_labeler.views.fonts import desktop_scale, nearest_text_size
from gp_labeler.views.layouts import in_column, in_row, wide
from gp_labeler.views.memory_return import MemoryReturn
from gp_labeler.views.painting.measure_layer import MeasureLayer
from gp_labeler.views.painting.reference_layer import ReferenceLayer
from gp_labeler.views.panels.atlas.panel import AtlasPanel
from gp_labeler.views.panels.label.panel import LabelPanel
from gp_labeler.views.panels.panel_stack import PanelStack
from gp_labeler.views.panels.parts import scrolled
from gp_labeler.views.panels.pose.panel import PosePanel, holds_touches
from gp_labeler.views.panels.rail import Rail, WorkStep
from gp_labeler.views.panels.scan.welcome import Welcome
from gp_labeler.views.panels.table import PANELS, added_panels
from gp_labeler.views.panels.tracker.card import TrackerCard
from gp_labeler.views.pose_display import PoseDisplay
from gp_labeler.views.prompts import Prompts
from gp_labeler.views.questions import ask_how_to_read, offer_other_scan
from gp_labeler.views.signals import OncePerTurn, follow
from gp_labeler.views.status_line import StatusLine
from gp_labeler.views.theme import THEMES, apply_theme
from gp_labeler.views.top_bar import TopBar
from gp_labeler.views.tracker_display import TrackerDisplay
from gp_labeler.views.view_grid import ViewGrid
from gp_labeler.views.window_commands.atlas import show_disagreement, show_finding
from gp_labeler.views.window_commands.file import open_path, resolve_unsaved
from gp_labeler.views.window_commands.table import command_of
from gp_labeler.views.window_state import WindowState

__all__ = ["MainWindow"]

Panel = TypeVar("Panel", bound=QWidget)

_ALONE = MappingProxyType(
    {
        "atlas": "Drop an atlas, or a folder of labelled animals",
        "pose": "Touch features, or drop a file of touches",
    }
)
"""Steps that need no scan, and what the line at the bottom says then."""

_GAP = 6
"""Between rail, views and panel, logical pixels."""

_LIKED = (
    "outline_visible",
    "labels_visible",
    "ghosts_visible",
    "axis_visible",
    "auto_advance",
    "follow_ghost",
)
"""How the user likes to look at things, kept from one day to the next."""


class MainWindow(QMainWindow):
    """One window on one workspace, which it closes with itself.

    Parameters
    ----------
    workspace : Workspace
        What it shows and edits.
    memory : WindowState, optional
        What it remembers; by default nothing.
    prompts : Prompts, optional
        Who asks the user; dialogs by default.
    """

    def __init__(
        self, workspace: Workspace, memory: WindowState | None = None, prompts: Prompts | None = None
    ) -> None:
        super().__init__()
        self.workspace: Workspace = workspace
        self.memory: WindowState = memory or WindowState()
        self.prompts: Prompts = prompts or Prompts(self, self.memory)
        self.setAcceptDrops(True)
        self._recall_view(workspace.view)
        self.theme_name = self.memory.get("theme", str, setting("theme") or "dark")
        self.text_size = nearest_text_size(self.memory.get("text_size", int, setting("text_size") or 100))
        self._restyle()
        self.grid = ViewGrid(workspace)
        self.pose_display = PoseDisplay(workspace, self.grid)
        for view in self.grid.slice_views.values():
            ReferenceLayer(workspace, view)
            MeasureLayer(workspace, view)
        self.tracker_display = TrackerDisplay(workspace, self.pose_display)
        self.tracker_display.audible = self.memory.get("audible", bool, False)
        self.commands = Commands(workspace, partial(command_of, self), self, self.grid)
        self.commands.fill(self.menuBar())
        self.rail, self.panels = Rail(workspace, self.commands.actions), PanelStack()
        self.pages, self.welcome = QStackedWidget(), Welcome(workspace, self.commands.actions)
        self.status = StatusLine(workspace)
        self._memory_return = MemoryReturn(workspace, self)
        self._show_page_once = OncePerTurn(self._show_page, self)
        self._show_views_once = OncePerTurn(self._show_views, self)
        self._dock()
        self._listen()
        self._recall_place()
        self._show_title()
        self._add_panels()
        app = QApplication.instance()
        if isinstance(app, QApplication):
            app.fontChanged.connect(self._restyle)  # the desktop's text became larger or smaller
        self.welcome.open_scan.setFocus()  # else the first button there is, that of the theme

    def set_theme(self, name: str) -> None:
        """Look dark or light."""
        self.theme_name = name
        self.memory.set(theme=name)
        self._restyle()

    def set_text_size(self, percent: int) -> None:
        """Draw text so much larger or smaller than the desktop's, percent, in one of `TEXT_SIZES`."""
        self.text_size = nearest_text_size(percent)
        self.memory.set(text_size=self.text_size)
        self._restyle()

    def _restyle(self, *_: object) -> None:
        """Take the theme and the text size, the user's and the desktop's."""
        theme = THEMES.get(self.theme_name, THEMES["dark"])
        apply_theme(self, theme, text_scale=desktop_scale() * self.text_size / 100)

    def set_step(self, step: str) -> None:
        """Show the panel of a step: ``scan``, ``label``, ``atlas`` or ``pose``."""
        self.rail.set_step(step)
        if step == "label":
            self.workspace.begin_labelling()
        elif step == "pose":
            self.workspace.begin_judging()
        else:
            self.workspace.begin_looking()
        self.panels.setCurrentWidget(self.steps[step])
        self._arrange()

    def take_touches(self, path: Path) -> bool:
        """Take the touches of a file; return whether it could be read."""
        return self._pose.take_file(path)

    def judge_pose(self, verdict: str) -> bool:
        """Keep a verdict on the estimate with the initials and the note from the panel."""
        return self._pose.verdict.judge(verdict)

    def _dock(self) -> None:
        workspace, actions = self.workspace, self.commands.actions
        self.steps = {name: make(workspace, actions) for name, make in PANELS.builtin.items()}
        self._label, self._atlas = self._panel(LabelPanel), self._panel(AtlasPanel)
        self._pose = self._panel(PosePanel)
        self.grid.scene_view.frame_drawn.connect(self._label.card.refresh_hidden)
        self._pose.add_card(TrackerCard(workspace, actions))
        for panel in self.steps.values():
            self.panels.addWidget(panel)
        work = QWidget()
        in_row(wide(self.grid), self.panels, margins=0, spacing=_GAP, of=work)
        self.pages.addWidget(self.welcome)
        self.pages.addWidget(work)
        centre, bar = QWidget(), TopBar(self.workspace, self.commands.actions)
        sides = in_row(self.rail, wide(self.pages), margins=0, spacing=_GAP)
        in_column(bar, wide(sides), self.status, margins=0, spacing=0, of=centre)
        self.setCentralWidget(centre)
        self._show_page()

    def _panel(self, kind: type[Panel]) -> Panel:
        return next(panel for panel in self.steps.values() if isinstance(panel, kind))

    def _add_panels(self) -> None:
        """Add the panels of installed packages; name those that fail, and go on without them."""
        for name, panel in added_panels(self.workspace, self.commands.actions):
            if isinstance(panel, GpError):
                self.workspace.say(str(panel), "warning")
                continue
            self.steps[name] = scrolled(panel)
            self.panels.addWidget(self.steps[name])
            self.rail.add_step(WorkStep(name, name.capitalize(), "layout", PANELS.described(name)))
        for text in PANELS.left_out:
            self.workspace.say(text, "warning")

    def leave_out_panel(self, name: str, error: BaseException) -> None:
        """Take away the panel of an installed package that failed, and name it, once."""
        panel = self.steps.pop(name, None)
        if panel is None:  # it fails again before it is gone
            return
        if self.rail.step == name:
            self.set_step("label" if self.workspace.scan.volume is not None else "scan")
        self.rail.remove_step(name)
        self.panels.removeWidget(panel)
        panel.deleteLater()
        reason = f"{PANELS.described(name)} is left out ({type(error).__name__}: {error})"
        self.workspace.say(f"{reason[0].upper()}{reason[1:]}. Your labels are kept.", "error")

    def _listen(self) -> None:
        workspace = self.workspace
        self.grid.hovered.connect(self.status.show_position)
        self.rail.step_chosen.connect(self.set_step)
        self.welcome.path_chosen.connect(self.open_path)
        self.commands.path_chosen.connect(self.open_path)
        for id in ("point.accept_ghost", "point.confirm"):
            self._label.addAction(self.commands.actions[id])  # Enter means it there too
        self._atlas.animal_asked.connect(self._on_finding_asked)
        self._atlas.repeatability.disagreement_asked.connect(self._on_disagreement_asked)
        follow(self, workspace.scan.opened, self._show_page_once.soon)
        follow(self, workspace.document.reset, self._show_page_once.soon)
        follow(self, workspace.scan.import_asked, self._on_import_asked)
        follow(self, workspace.scan.differs, self._on_scan_differs)
        for signal in (
            *(
                workspace.document.reset,
                workspace.document.details_changed,
                workspace.document.dirty_changed,
                workspace.document.touches_changed,
            ),
            workspace.document.saved,
        ):
            follow(self, signal, self._show_title)

    def _show_page(self, *_: object) -> None:
        """Show the first page until there is something to work on."""
        state = self.workspace.document.state
        is_open = state.volume is not None
        if is_open and self.pages.currentIndex() == 0:
            self.grid.setUpdatesEnabled(False)
            self._show_views_once.soon()
            self.set_step("label")
            self.grid.scene_view.setFocus()
        if not is_open and self.rail.step not in _ALONE:
            self.set_step("pose" if state.touches else "scan")
            self.welcome.refresh()
        self._arrange()

    def _show_views(self) -> None:
        """Paint the views in a turn after the panel beside them: the window answers in between."""
        self.grid.setUpdatesEnabled(True)

    def _arrange(self) -> None:
        """Show the views beside a scan, a panel alone where its step needs none, else the first page."""
        is_open, step = self.workspace.document.state.volume is not None, self.rail.step
        alone = not is_open and step in _ALONE
        self.grid.setVisible(not alone)
        for panel in (self._atlas, self._pose):
            panel.set_wide(alone)
        self.panels.set_alone(alone)
        self.pages.setCurrentIndex(int(is_open or alone))
        self.status.set_without_scan(_ALONE[step] if alone else "")

    def open_path(self, path: str | Path) -> None:
        """Open a scan, specimen or atlas; asks first what becomes of unsaved edits."""
        open_path(self.workspace, self.prompts, Path(path))

    def _on_finding_asked(self, finding: Finding) -> None:
        show_finding(self, finding)

    def _on_disagreement_asked(self, row: Disagreement) -> None:
        show_disagreement(self, row)

    def _on_import_asked(self, plan: ImportPlan) -> None:
        ask_how_to_read(self.workspace, self.prompts, plan, self)

    def _on_scan_differs(self, error: VolumeChangedError, volume: Volume) -> None:
        offer_other_scan(self.workspace, self.prompts, error, volume)

    def _show_title(self, *_: object) -> None:
        workspace, document = self.workspace, self.workspace.document
        named = (
            (document.state.specimen, workspace.document.location, "gp-labeler")
            if workspace.document.in_use
            else ("gp-labeler",)
        )
        self.setWindowTitle(" – ".join((f"{named[0]}[*]", *filter(None, named[1:]))))  # noqa: RUF001
        self.setWindowModified(document.dirty)

    # What is remembered

    def _recall_view(self, view: SessionView) -> None:
        known = {field.name for field in fields(ViewState)} & set(_LIKED)
        liked = self.memory.fields("view")
        view.update(**{name: liked[name] for name in known if isinstance(liked.get(name), bool)})

    def _recall_place(self) -> None:
        geometry = QByteArray.fromBase64(self.memory.get("geometry", str, "").encode())
        if geometry.isEmpty() or not self.restoreGeometry(geometry):
            self.resize(QSize(1440, 900).boundedTo(self.screen().availableSize()))

    def _remember(self) -> None:
        view = self.workspace.view.state
        self.memory.set(
            geometry=bytes(self.saveGeometry().toBase64().data()).decode(),
            theme=self.theme_name,
            text_size=self.text_size,
            view={name: getattr(view, name) for name in _LIKED},
        )
        self.memory.save()

    # Qt's events

    def event(self, event: QEvent) -> bool:  # noqa: D102
        if event.type() == QEvent.Type.ShortcutOverride:  # comes before a key is looked up
            self.commands.flush()
            if self._ends_typing(event):
                event.accept()
                return True
        return super().event(event)

    def _ends_typing(self, event: QEvent) -> bool:
        """Whether a key is the Enter of a text field, and no command."""
        if not isinstance(event, QKeyEvent) or not isinstance(self.focusWidget(), QLineEdit):
            return False
        plain = (Qt.KeyboardModifier.NoModifier, Qt.KeyboardModifier.KeypadModifier)
        return event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter) and event.modifiers() in plain

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: D102, N802
        super().resizeEvent(event)
        self.panels.updateGeometry()  # what they ask for depends on the width of the window
        beside = self.panels.parentWidget()
        if beside is not None and (layout := beside.layout()) is not None:
            layout.activate()  # now, so that views are seen at their size by whoever resized the window

    def closeEvent(self, event: QCloseEvent) -> None:  # noqa: D102, N802
        if not resolve_unsaved(self.workspace, self.prompts):
            event.ignore()
            return
        self._remember()
        self.workspace.close()
        self.grid.release()
        event.accept()

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:  # noqa: D102, N802
        if event.mimeData().hasUrls():
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:  # noqa: D102, N802
        paths = [Path(url.toLocalFile()) for url in event.mimeData().urls() if url.isLocalFile()]
        if not paths:
            return
        if self.rail.step == "atlas" and all(map(may_hold_labels, paths)):
            self.workspace.atlas.fit(paths)
        elif self.rail.step == "pose" and holds_touches(paths[0]):
            self.take_touches(paths[0])
        else:
            self.open_path(paths[0])
