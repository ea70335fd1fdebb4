"""How the head lies in its scan: straightening it, automatically or by hand, and which side is left."""

from __future__ import annotations

from qtpy.QtCore import QTimer
from qtpy.QtWidgets import QApplication, QCheckBox, QPushButton, QToolButton, QVBoxLayout, QWidget

from gp_labeler.document.state import Position
from gp_labeler.models.head import FREE_POINTS
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.fonts import fit
from gp_labeler.views.formatting import position_text, sentence
from gp_labeler.views.panels.action_button import Actions, action_button, do_action
from gp_labeler.views.panels.flow import FlowLayout
from gp_labeler.views.panels.parts import Card, Notice, emptied, text_label
from gp_labeler.views.signals import follow

__all__ = ["HeadCard", "head_text"]

_TICK = "\N{CHECK MARK}"


class HeadCard(Card):
    """The head frame.

    Parameters
    ----------
    workspace : Workspace
        Whose head is straightened.
    actions : mapping of str to QAction
        What its buttons do.
    """

    def __init__(self, workspace: Workspace, actions: Actions, parent: QWidget | None = None) -> None:
        super().__init__("Head", parent)
        self._workspace = workspace
        self.state = text_label("", "hint", wrap=True)
        self.add(self.state)
        self._measure_timer = QTimer(self, interval=0, singleShot=True)
        self._measure_timer.timeout.connect(self.updateGeometry)
        self._notices = QVBoxLayout()
        self._notices.setSpacing(6)
        self.add(self._notices)
        self._heads = QVBoxLayout()
        self._heads.setSpacing(6)
        self.add(self._heads)
        self.confirm = action_button(actions["head.confirm_left"], "Left is correct")
        self.exchanged = action_button(actions["head.left_is_right"], "The scan is mirrored…")
        self._answers = _row(self.confirm, self.exchanged)
        self.add(self._answers)
        self.shown = QCheckBox("Views in the head frame")
        do_action(self.shown, actions["view.frame"])
        self.add(self.shown)
        self.straighten = action_button(actions["head.straighten"], "Straighten")
        self.by_landmarks = action_button(actions["head.by_landmarks"], "By landmarks")
        self.by_hand = QToolButton()
        self.by_hand.setText("By hand")
        do_action(self.by_hand, actions["head.by_hand"])
        fit(self, lambda: self.by_hand.setFixedHeight(self.straighten.sizeHint().height()))
        self.stop = QPushButton("Stop")
        self.stop.clicked.connect(workspace.head.cancel)
        self.add(_row(self.straighten, self.stop, self.by_landmarks, self.by_hand))
        self.take_planes = action_button(actions["head.take_planes"], "Use these planes")
        self.mid_plane = action_button(actions["head.take_mid_plane"], "Mid-plane to crosshair")
        self._hand = _row(self.take_planes, self.mid_plane)
        self.add(self._hand)
        self._lay_out_points(actions)
        for signal in (
            workspace.head.changed,
            workspace.view.planes_changed,
            workspace.document.landmarks_changed,
            workspace.interaction.tool_changed,
            workspace.scan.opened,
            workspace.document.reset,
        ):
            follow(self, signal, self.refresh)
        self.refresh()

    def refresh(self, *_: object) -> None:
        """Show how the head lies now; the keyboard stays where the search is begun and stopped."""
        focus = QApplication.focusWidget()
        own = focus if focus is not None and self.isAncestorOf(focus) else None
        self._show_state()
        is_running = self._workspace.head.is_running
        if own is not None and (is_running or not own.isVisible()):
            self.straighten.setEnabled(not is_running)  # as its action will be in the next turn
            (self.stop if is_running else self.straighten).setFocus()

    def _show_state(self) -> None:
        workspace, head = self._workspace, self._workspace.head
        self.setVisible(workspace.scan.volume is not None)
        self.state.setText(head_text(workspace))
        emptied(self._notices)
        self._offer_heads()
        if head.refusal and not head.heads:
            self._notices.addWidget(Notice("warning", sentence(head.refusal)))
        for warning in head.warnings:
            self._notices.addWidget(Notice("warning", sentence(warning)))
        wrong = head.wrong_sides()
        if wrong:
            rest = f", and {len(wrong) - 1} more on the wrong side too" if len(wrong) > 1 else ""
            self._notices.addWidget(Notice("warning", f"{wrong[0]}{rest}. Are left and right exchanged?"))
        is_turning = workspace.interaction.tool == "turn"
        asks_left = head.asks_left and not is_turning  # first the head is turned
        if asks_left:
            self._notices.addWidget(Notice("info", head.left_text))
        self._answers.setVisible(asks_left)
        self.shown.setVisible(head.frame is not None)
        self.stop.setVisible(head.is_running)
        self.straighten.setVisible(not head.is_running)
        self.straighten.setText("Straighten again" if head.frame is not None else "Straighten")
        is_turned = workspace.view.planes_are_turned
        self._hand.setVisible(is_turned or (is_turning and head.frame is not None))
        self.take_planes.setVisible(is_turned)
        self.mid_plane.setVisible(head.frame is not None)
        self.forget_points.setVisible(bool(head.points))
        for name, button in self.points.items():
            button.setText(f"{name.capitalize()} {_TICK}" if name in head.points else name.capitalize())
        self._measure_timer.start()  # what was put in shows a turn later: only then is its room known

    def _offer_heads(self) -> None:
        """Ask which head is meant, in a scan of several."""
        head = self._workspace.head
        emptied(self._heads)
        if not head.heads:
            return
        words = f"The scan contains {len(head.heads)} heads. Which one do you label?"
        self._heads.addWidget(Notice("warning", words))
        named = zip(head.head_names, head.heads, strict=True)
        self._heads.addWidget(_row(*(self._head_button(name, position) for name, position in named)))

    def _head_button(self, name: str, position: Position) -> QPushButton:
        head = self._workspace.head
        button = QPushButton(name)
        button.setToolTip(f"Straightens the head at {position_text(position)}")
        button.clicked.connect(lambda: head.straighten(position))
        return button

    def _lay_out_points(self, actions: Actions) -> None:
        self.points = {n: action_button(actions[f"head.{n}"], n.capitalize()) for n in FREE_POINTS}
        words = "By three points: move the crosshair to each point, then click its name."
        self.add(text_label(words, "hint", wrap=True))
        self.forget_points = action_button(actions["head.forget_points"], "Remove points")
        self.add(_row(*self.points.values(), self.forget_points))


def head_text(workspace: Workspace) -> str:
    """Say how the head was straightened, and what of it is only a proposal."""
    head = workspace.head
    if head.is_running:
        return "Searching for the plane of symmetry…"
    if workspace.interaction.tool == "turn":
        return (
            "Drag over a slice to turn the head about the crosshair: in the sagittal slice its pitch, in the "
            "coronal its roll, in the axial its yaw. Esc ends it."
        )
    frame = head.frame
    if frame is None:
        return "The views lie along the axes of the scan. Straighten them if the head is tilted."
    pitch = f" Pitch: {frame.pitch}." if frame.pitch and frame.found_by != "hand" else ""
    check = " Correct it by hand if necessary." if frame.pitch.startswith("proposed") else ""
    return f"Straightened by {frame.found_by}.{pitch}{check}"


def _row(*buttons: QWidget) -> QWidget:
    holder = QWidget()
    row = FlowLayout(spacing=6)
    holder.setLayout(row)
    for button in buttons:
        row.addWidget(button)
    return holder
