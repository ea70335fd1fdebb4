"""The tracked probe in the Pose panel: the state of its link, and the button that records a touch."""

from __future__ import annotations

from qtpy.QtWidgets import QCheckBox, QHBoxLayout, QProgressBar, QPushButton, QWidget

from gp_labeler.models.workspace import Workspace
from gp_labeler.tracker import LinkPhase
from gp_labeler.views.formatting import sentence
from gp_labeler.views.panels.action_button import Actions, do_action
from gp_labeler.views.panels.parts import Card, text_label
from gp_labeler.views.panels.pose.wording import triple
from gp_labeler.views.signals import attempt, blocked, follow
from gp_labeler.views.stylesheet import set_role

__all__ = ["TrackerCard", "tracker_role", "tracker_state", "tracker_words"]


def tracker_role(workspace: Workspace) -> str:
    """Return the style of the tracker's text: good, warning or error."""
    tracker = workspace.tracker
    if tracker.phase is LinkPhase.CONNECTED:
        return "good" if tracker.visible else "warning"
    return "danger" if tracker.phase in (LinkPhase.LOST, LinkPhase.SILENT) else "hint"


def tracker_words(workspace: Workspace) -> str:
    """Return the state of the tracker, and what is wrong with its newest reading."""
    tracker = workspace.tracker
    trouble = tracker.trouble if tracker.phase is LinkPhase.CONNECTED and not tracker.visible else ""
    return sentence(trouble) if trouble else tracker.words


def tracker_state(workspace: Workspace) -> str:
    """Return in two words how the tracker stands; empty where none is asked for."""
    tracker = workspace.tracker
    if tracker.phase in (LinkPhase.LOST, LinkPhase.SILENT):
        return "No tracker"
    if tracker.phase is LinkPhase.CONNECTED:
        return "Tracker on" if tracker.visible else "No probe"
    return ""


class TrackerCard(Card):
    """Shown while a tracker is connected or being sought.

    Parameters
    ----------
    workspace : Workspace
        Whose tracker.
    actions : mapping of str to QAction
        What its buttons do.
    """

    def __init__(self, workspace: Workspace, actions: Actions, parent: QWidget | None = None) -> None:
        super().__init__("Tracked probe", parent)
        self._workspace = workspace
        self.words = text_label(wrap=True)
        self.frame_words = text_label(role="hint", wrap=True)
        self.tip = text_label()
        self.progress = QProgressBar()
        self.progress.setTextVisible(False)
        self.progress.setFixedHeight(6)
        self.record = QPushButton()
        self.record.setProperty("role", "primary")
        self.record.setToolTip("Hold the tip still; samples of half a second are averaged")
        self.record.clicked.connect(lambda: attempt(workspace, workspace.tracker.press))
        self.dwell = QCheckBox("Record when the tip is held still")
        self.dwell.toggled.connect(workspace.tracker.set_dwell)
        settings = QPushButton("Settings…")
        settings.setProperty("role", "link")
        do_action(settings, actions["pose.tracker"])
        self.add_to_heading(settings)
        for widget in (self.words, self.tip, self.progress, self.frame_words):
            self.add(widget)
        row = QHBoxLayout()
        row.addWidget(self.record, 1)
        self.add(row)
        self.add(self.dwell)
        tracker = workspace.tracker
        follow(self, tracker.changed, self.refresh)
        follow(self, tracker.moved, self._on_moved)
        follow(self, workspace.pose.target_changed, self.refresh)
        self.refresh()

    def refresh(self, *_: object) -> None:
        """Show how the tracker stands."""
        tracker, target = self._workspace.tracker, self._workspace.pose.target
        self.setVisible(tracker.on)
        with blocked(self.dwell):
            self.dwell.setChecked(tracker.dwell)
        self.record.setText(f"Record {target}" if target else "All touched")
        self.record.setEnabled(target is not None and tracker.pivot is None)
        words = tracker.frame_words if tracker.on or tracker.sending else ""
        self.frame_words.setText(words)
        self.frame_words.setVisible(bool(words))
        set_role(self.frame_words, "warning" if tracker.doubtful else "hint")
        self._on_moved()

    def _on_moved(self) -> None:
        tracker = self._workspace.tracker
        self.words.setText(tracker_words(self._workspace))
        set_role(self.words, tracker_role(self._workspace))
        tip = tracker.tip
        self.tip.setText("" if tip is None else f"{triple(tip)} mm")
        self.tip.setEnabled(tracker.visible)
        self.progress.setValue(round(100 * tracker.progress))
