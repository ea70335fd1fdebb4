"""Where the tracker is, what its devices are called, where the tip is, and to whom the pose is sent."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from functools import partial
from typing import Any

from qtpy.QtCore import Qt
from qtpy.QtWidgets import (
    QCheckBox,
    QDialog,
    QFormLayout,
    QHBoxLayout,
    QLineEdit,
    QProgressBar,
    QPushButton,
    QWidget,
)

from gp_core.errors import GpError
from gp_core.pose.gate import PoseGate
from gp_core.validation import FloatArray
from gp_labeler.models.workspace import Workspace
from gp_labeler.system.openigtlink import DEFAULT_PORT
from gp_labeler.tracker import TrackerAddress
from gp_labeler.views.fonts import field_width, fit, text_width
from gp_labeler.views.layouts import STRETCH, in_column, in_row, wide
from gp_labeler.views.panels.number_field import NumberField
from gp_labeler.views.panels.parts import Card, open_at, scrolled, text_label
from gp_labeler.views.panels.tracker.card import tracker_role, tracker_words
from gp_labeler.views.signals import follow
from gp_labeler.views.stylesheet import set_role
from gp_labeler.views.window_state import WindowState

__all__ = ["TrackerDialog"]

_MEMORY = "tracker"
_STILL = "may stand still"
_GATE = "largest region sent"
_SEND_PORT = 18945
_HINTS: Mapping[str, tuple[str, str]] = {
    "host": ("Host", "127.0.0.1, or the name of the computer that runs PLUS or Slicer"),
    "port": ("Port", f"{DEFAULT_PORT} by convention"),
    "probe": ("Probe", "device name of its TRANSFORM, such as StylusToTracker"),
    "reference": ("Head marker", "device name; empty if the head is fixed"),
    "button": ("Foot switch", "device name of STRING messages; empty if there is none"),
    "tip": ("Tip", "x y z in the frame of the marker, mm; 0 0 0 if the tracker reports the tip"),
}


class TrackerDialog(QDialog):
    """Settings of the tracked probe; stays open beside the window while the probe is tried.

    Parameters
    ----------
    workspace : Workspace
        Whose tracker.
    memory : WindowState
        Keeps what was typed from one day to the next.
    """

    def __init__(self, workspace: Workspace, memory: WindowState, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._workspace, self._memory = workspace, memory
        self.setWindowTitle("Tracked probe")
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self._make_fields()
        self._make_buttons()
        self._lay_out()
        tracker = workspace.tracker
        for signal in (tracker.changed, tracker.moved):
            follow(self, signal, self.refresh)
        self._recall()
        self.refresh()
        open_at(self, 560, 710)

    # What it shows

    def refresh(self, *_: object) -> None:
        """Show how tracker, calibration and sending stand."""
        tracker = self._workspace.tracker
        self.words.setText(tracker_words(self._workspace))
        set_role(self.words, tracker_role(self._workspace))
        self.connect_button.setText("Disconnect" if tracker.on else "Connect")
        for set_it in (self.connect_button.setAutoDefault, self.connect_button.setDefault):
            set_it(not tracker.on)  # Return in a field must not end a link
        collecting = tracker.pivot is not None
        self.pivot.setText("Stop" if collecting else "Calibrate the tip…")
        self.pivot.setEnabled(tracker.on)
        self.finish.setVisible(collecting)
        self.turned.setVisible(collecting)
        if tracker.pivot is not None:
            self.finish.setEnabled(tracker.pivot.ready)
            self.turned.setValue(
                round(100 * min(tracker.pivot.turned_deg / tracker.pivot.turn_wanted_deg, 1))
            )
        self.pivot_words.setText(self._pivot_words())
        self.send.setText("Stop sending" if tracker.sending else "Send the pose")
        self.send_words.setText(
            tracker.sending or "Sends T_tracker_cochlea as an OpenIGTLink TRANSFORM to whoever connects here."
        )

    def _pivot_words(self) -> str:
        tracker = self._workspace.tracker
        if tracker.pivot is not None:
            return tracker.pivot.words
        if tracker.calibration is not None:
            found = tracker.calibration
            return f"Tip found from {found.n_frames} poses; residual {found.rms_mm:.2f} mm."
        return "Rest the tip in a small hollow and tilt the probe in all directions."

    # What it does

    def _toggle_link(self) -> None:
        tracker = self._workspace.tracker
        if tracker.on:
            tracker.disconnect()
            return
        try:
            address = self._address()
            tracker.set_tip_offset(self._numbers(self.fields["tip"].text()))
        except GpError as error:
            self._complain(error)
            return
        tracker.set_may_stand_still(self.still.isChecked())
        self._remember()
        self._complain(None)
        tracker.connect(address)

    def _address(self) -> TrackerAddress:
        texts = {name: field.text().strip() for name, field in self.fields.items()}
        port = int(texts["port"]) if texts["port"].isdigit() else texts["port"]
        return TrackerAddress(
            texts["host"],
            port,  # type: ignore[arg-type]  # refused there, by name
            texts["probe"],
            texts["reference"] or None,
            texts["button"] or None,
        )

    def _numbers(self, text: str) -> list[float]:
        try:
            return [float(word) for word in text.replace(",", " ").split()]
        except ValueError:
            raise GpError(f"the tip must be three numbers in mm, got {text!r}") from None

    def _use_tip(self) -> None:
        """Take a tip typed while the probe is tracked; otherwise connecting does."""
        tracker, text = self._workspace.tracker, self.fields["tip"].text()
        if not tracker.on or text == _tip_text(tracker.probe.tip_offset):
            return
        try:
            tracker.set_tip_offset(self._numbers(text))
        except GpError as error:
            self._complain(error)
            return
        self._remember()
        self._complain(None)

    def _use_still(self, may: bool) -> None:
        """Believe what stands still, at once where the probe is tracked; otherwise connecting does."""
        if self._workspace.tracker.on:
            self._workspace.tracker.set_may_stand_still(may)
            self._remember()

    def _toggle_pivot(self) -> None:
        tracker = self._workspace.tracker
        (tracker.start_pivot if tracker.pivot is None else tracker.cancel_pivot)()

    def _finish_pivot(self) -> None:
        try:
            found = self._workspace.tracker.finish_pivot()
        except GpError as error:
            self._complain(error)
            return
        self.fields["tip"].setText(_tip_text(found.tip_offset))
        self._remember()
        self._complain(None)

    def _toggle_sending(self) -> None:
        tracker = self._workspace.tracker
        if tracker.sending:
            tracker.stop_sending()
            return
        port = self.send_port.text().strip()
        try:
            tracker.start_sending(int(port) if port.isdigit() else -1)
        except GpError as error:
            self._complain(error)

    def _use_gate(self, *_: object) -> None:
        """Send poses within the limits typed here from now on."""
        try:
            self._workspace.tracker.set_gate(PoseGate(self.radius.value, self.cone.value))
        except GpError as error:
            self._complain(error)
            self._show_gate()
            return
        self._remember()
        self._complain(None)

    def _limits(self) -> list[float]:
        gate = self._workspace.tracker.gate
        return [gate.max_radius_mm, gate.max_cone_deg]

    def _show_gate(self) -> None:
        gate = self._workspace.tracker.gate
        self.radius.set_value(gate.max_radius_mm)
        self.cone.set_value(gate.max_cone_deg)

    def _complain(self, error: GpError | None) -> None:
        self.problem.setText("" if error is None else str(error))
        self.problem.setVisible(error is not None)

    # What is remembered

    def _recall(self) -> None:
        address = self._workspace.tracker.address or TrackerAddress()
        known: dict[str, Any] = {
            "host": address.host,
            "port": address.port,
            "probe": address.probe,
            "reference": address.reference or "",
            "button": address.button or "",
            "tip": "0 0 0",
        }
        still = self._workspace.tracker.may_stand_still
        if self._workspace.tracker.address is None:
            known |= self._memory.fields(_MEMORY)
            still = known.get(_STILL) is True
        self.still.setChecked(still)
        for name, field in self.fields.items():
            field.setText(str(known.get(name, "")))
        self._recall_gate()
        if self._workspace.tracker.probe.tip_offset.any():
            self.fields["tip"].setText(_tip_text(self._workspace.tracker.probe.tip_offset))

    def _recall_gate(self) -> None:
        limits = self._memory.fields(_MEMORY).get(_GATE)
        if isinstance(limits, list) and len(limits) == 2:
            with contextlib.suppress(GpError, TypeError):  # a memory that was tampered with sets no limit
                self._workspace.tracker.set_gate(PoseGate(*limits))
        self._show_gate()

    def _remember(self) -> None:
        typed: dict[str, Any] = {name: field.text() for name, field in self.fields.items()}
        self._memory.set(**{_MEMORY: typed | {_STILL: self.still.isChecked(), _GATE: self._limits()}})

    # Widgets

    def _make_fields(self) -> None:
        self.fields = {name: QLineEdit() for name in _HINTS}
        for name, (caption, hint) in _HINTS.items():
            self.fields[name].setAccessibleName(caption)
            self.fields[name].setPlaceholderText(hint)
            fit(self.fields[name], partial(_show_hint, self.fields[name], hint))
            self.fields[name].setToolTip(hint)
        self.words, self.pivot_words = text_label(wrap=True), text_label(role="hint", wrap=True)
        self.send_words, self.problem = (
            text_label(role="hint", wrap=True),
            text_label(role="danger", wrap=True),
        )
        self.problem.hide()
        self.turned = QProgressBar()
        self.turned.setTextVisible(False)
        self.send_port = QLineEdit(str(_SEND_PORT))
        self.send_port.setAccessibleName("Port to send the pose from")
        fit(self.send_port, lambda: self.send_port.setFixedWidth(field_width(self.send_port, "65535")))
        self.radius = NumberField("Largest 95 % radius of a pose that is sent, mm", widest="10.00")
        self.cone = NumberField("Largest 95 % cone of a pose that is sent, degrees", widest="10.00")
        for field in (self.radius, self.cone):
            field.value_chosen.connect(self._use_gate)
        self.still = QCheckBox("Allow identical readings: robot arm or simulation")
        self.still.setToolTip(
            "For a device without noise, whose readings repeat to the last digit. Leave it off for a camera: "
            "some\ngo on telling the last position of a covered marker, which would then be recorded."
        )
        self.audible = QCheckBox("Sound for every touch: one beep recorded, two rejected")

    def _make_buttons(self) -> None:
        self.connect_button, self.pivot = QPushButton(), QPushButton()
        self.finish, self.send = QPushButton("Use this tip"), QPushButton()
        for button in (self.connect_button, self.finish):
            button.setProperty("role", "primary")
        self.connect_button.clicked.connect(self._toggle_link)
        self.still.clicked.connect(self._use_still)
        self.fields["tip"].editingFinished.connect(self._use_tip)
        self.pivot.clicked.connect(self._toggle_pivot)
        self.finish.clicked.connect(self._finish_pivot)
        self.send.clicked.connect(self._toggle_sending)
        for button in (self.pivot, self.finish, self.send):
            button.setAutoDefault(False)

    def _lay_out(self) -> None:
        content = QWidget()
        content.setProperty("role", "panel")
        in_column(
            self._link_card(),
            self._tip_card(),
            self._send_card(),
            self.audible,
            STRETCH,
            margins=(16, 16, 16, 8),
            spacing=8,
            of=content,
        )
        close = QPushButton("Close")
        close.setAutoDefault(False)
        close.clicked.connect(self.accept)
        foot = in_row(wide(self.problem), margins=(16, 4, 16, 12))
        foot.addStretch(0)
        foot.addWidget(close, 0, Qt.AlignmentFlag.AlignRight)
        in_column(wide(scrolled(content)), foot, margins=0, of=self)

    def _link_card(self) -> Card:
        card, form = Card("OpenIGTLink server"), _form()
        for name in ("host", "port", "probe", "reference", "button"):
            form.addRow(_HINTS[name][0], self.fields[name])
        card.add(form)
        card.add(self.still)
        card.add(in_row(self.connect_button, wide(self.words), spacing=12))
        return card

    def _tip_card(self) -> Card:
        card, form = Card("Probe tip"), _form()
        caption = text_label(_HINTS["tip"][0])
        fit(caption, lambda: caption.setMinimumWidth(text_width(caption, _HINTS["reference"][0])))
        form.addRow(caption, self.fields["tip"])
        card.add(form)
        card.add(self.pivot_words)
        card.add(self.turned)
        card.add(in_row(self.pivot, self.finish, STRETCH))
        return card

    def _send_card(self) -> Card:
        card = Card("Send the pose")
        row = in_row(self.send, text_label("on port", "hint"), self.send_port, STRETCH, spacing=8)
        card.add(self.send_words)
        card.add(row)
        card.add(
            text_label("Only an accepted pose is sent, while its 95 % region is within", "hint", wrap=True)
        )
        limits = QHBoxLayout()
        limits.setSpacing(8)
        for field, unit in ((self.radius, "mm about the origin"), (self.cone, "degrees about the axis")):
            limits.addWidget(field)
            limits.addWidget(text_label(unit, "hint"))
        limits.addStretch(1)
        card.add(limits)
        return card


def _show_hint(field: QLineEdit, hint: str) -> None:
    field.setMinimumWidth(field_width(field, hint))


def _tip_text(offset: FloatArray) -> str:
    return " ".join(f"{v:.3f}" for v in offset)


def _form() -> QFormLayout:
    form = QFormLayout()
    form.setHorizontalSpacing(12)
    form.setVerticalSpacing(6)
    form.setLabelAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
    return form
