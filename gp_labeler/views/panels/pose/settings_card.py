"""What an estimate is made with: side, method, probe noise, shared error, atlas."""

from __future__ import annotations

from qtpy.QtWidgets import QCheckBox, QLabel, QLayout, QLineEdit, QWidget

from gp_core.constants import METHOD_NAMES
from gp_core.landmarks.features import Side
from gp_labeler.document.specimen_edits import RenameSpecimen
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.fonts import fit, text_width
from gp_labeler.views.layouts import STRETCH, in_row, wide
from gp_labeler.views.panels.action_button import Actions, do_action
from gp_labeler.views.panels.card_parts import Segments, link
from gp_labeler.views.panels.flow import FlowLayout
from gp_labeler.views.panels.number_field import NumberField
from gp_labeler.views.panels.parts import Card, ElidedLabel, breakable, text_label
from gp_labeler.views.signals import attempt, follow

__all__ = ["EstimateSettingsCard"]

_METHODS = {"robust": ("robust",), "jrmpc": ("jrmpc",), "both": ("robust", "jrmpc")}
_NOISE, _SHARED, _EACH = "Probe noise", "Shared error", "Touches per feature"
_MIDLINE = "Mid-plane points"
_APART = (0, 0, 10, 0)
"""Margins of a field that another may follow on its line."""
_HINTS = {
    "robust": "Uses the names of the touches, and down-weights a wrong one",
    "jrmpc": "The published method; needs an atlas fitted here to labelled animals",
    "both": "Both methods, side by side",
}


class EstimateSettingsCard(Card):
    """Settings of the estimate.

    Parameters
    ----------
    workspace : Workspace
        Whose estimate it sets.
    actions : mapping of str to QAction
        What its buttons do.
    """

    def __init__(self, workspace: Workspace, actions: Actions, parent: QWidget | None = None) -> None:
        super().__init__("Estimate", parent)
        self._workspace = workspace
        hints = {side.value: f"The {side.word} ear was touched" for side in Side}
        self.specimen, self.new = QLineEdit(), link("New", "Start a new specimen without a scan")
        self.specimen.setAccessibleName("Name of the specimen")
        self.specimen.setToolTip("Its name in reports and exports")
        self.side = Segments({side.value: side.word.capitalize() for side in Side}, hints)
        self.method = Segments({**METHOD_NAMES, "both": "Both"}, _HINTS)
        self.noise = _number(
            _NOISE,
            0.05,
            "automatic",
            "Error of an ordinary touch, mm for each coordinate; if empty, estimated from the touches",
        )
        self.noise.setPlaceholderText("automatic")
        self.found = text_label("", "hint")
        self.shared = _number(
            f"{_SHARED}, mm",
            0.05,
            "0.25",
            "RMS length of an offset that all touches share, from the tip, the reference marker or soft "
            "tissue. Touches cannot show it. It widens the 95 % region, and does not move the estimate",
        )
        self.each = _number(
            _EACH,
            1,
            "9",
            "How often each feature is requested. The estimate uses the mean of its touches: if touches are "
            "rough, three of each reduce the error of CO by about 30 %",
        )
        self._make_ears()
        self.atlas = ElidedLabel()
        self.problem = text_label("", "warning", wrap=True)
        self.problem.setAccessibleName("Why the atlas chosen last time is not in use")
        self.to_atlas = link("Change", "Choose or fit another atlas (step 3)")
        self._lay_out()
        self._connect(actions)

    def _make_ears(self) -> None:
        self.ears = QCheckBox("Combine the axes of both ears")
        self.ears.setToolTip(
            "If both ears were touched in one frame and agree, the axis is estimated from both. CO is not "
            "changed"
        )
        self.midline = QLineEdit()
        self.midline.setAccessibleName(_MIDLINE)
        self.midline.setPlaceholderText("none")
        self.midline.setToolTip(
            "Touched skull features that lie in the mid-plane of the head, such as S1, S4. They help to "
            "determine the plane in which the two ears are compared"
        )

    def _connect(self, actions: Actions) -> None:
        self.side.chosen.connect(lambda side: self._choose(side=Side.parse(side)))
        self.method.chosen.connect(lambda name: self._choose(methods=_METHODS[name]))
        self.noise.value_chosen.connect(lambda mm: self._choose(probe_noise=mm))
        self.noise.textEdited.connect(self._on_edited)
        self.shared.value_chosen.connect(lambda mm: self._choose(shared_error=mm))
        self.each.value_chosen.connect(lambda n: self._choose(touches_each=round(n)))
        self.ears.clicked.connect(lambda on: self._choose(both_ears=on))
        self.midline.editingFinished.connect(self._choose_midline)
        self.specimen.editingFinished.connect(self._rename)
        do_action(self.to_atlas, actions["atlas.show"])
        do_action(self.new, actions["file.new"])
        document, atlas = self._workspace.document, self._workspace.atlas
        for signal in (
            document.details_changed,
            document.reset,
            self._workspace.scan.opened,
            atlas.changed,
            atlas.details_changed,
        ):
            follow(self, signal, self.refresh)

    def refresh(self, *_: object) -> None:
        """Show the settings in effect."""
        settings, estimate = self._workspace.pose.settings, self._workspace.pose.estimate
        self.side.set_value(settings.side.value)
        self.method.set_value(next(name for name, methods in _METHODS.items() if methods == settings.methods))
        self.noise.set_value(settings.probe_noise)
        self.shared.set_value(settings.shared_error)
        pose = None if estimate is None else estimate.poses.get("robust")
        is_found = settings.probe_noise is None and pose is not None and pose.probe_noise is not None
        self.found.setText(f"mm, estimated {pose.probe_noise:.2f}" if is_found and pose is not None else "mm")
        state = self._workspace.document.state
        self._named.setVisible(state.volume is None)
        if not self.specimen.hasFocus() or not self.specimen.isModified():
            self.specimen.setText(state.specimen)
        atlas = self._workspace.atlas.current
        self.each.set_value(settings.touches_each)
        self.ears.setChecked(settings.both_ears)
        compared = self._workspace.pose.ears is not None
        self.ears.setEnabled(settings.both_ears or compared)
        self._in_plane.setVisible(compared or bool(settings.midline))
        if not self.midline.isModified():
            self.midline.setText(", ".join(settings.midline))
        self.atlas.set_words("loading…" if atlas is None else atlas.name)
        problem = self._workspace.atlas.problem
        self.problem.setText(breakable(f"{problem} The published atlas is used.") if problem else "")
        self.problem.setVisible(bool(problem))

    def _lay_out(self) -> None:
        self.heading.hide()
        self._named, self._in_plane = QWidget(), QWidget()
        name = _caption("Specimen"), wide(self.specimen), self.new
        in_row(*name, margins=0, spacing=6, of=self._named)
        in_row(_caption(_MIDLINE), wide(self.midline), margins=0, spacing=6, of=self._in_plane)
        for part in (
            self._named,
            in_row(wide(self.side, 2), wide(self.method, 3), spacing=12),
            in_row(_caption(_NOISE), self.noise, self.found, STRETCH, spacing=6),
            _together(
                in_row(_caption(_SHARED), self.shared, text_label("mm", "hint"), margins=_APART, spacing=6),
                in_row(_caption(_EACH), self.each, margins=0, spacing=6),
            ),
            self.ears,
            self._in_plane,
            in_row(_caption("Atlas"), wide(self.atlas), self.to_atlas, spacing=6),
            self.problem,
        ):
            self.add(part)

    def _rename(self) -> None:
        name = self.specimen.text().strip()
        self.specimen.setModified(False)
        if name != self._workspace.document.state.specimen:
            attempt(self._workspace, lambda: self._workspace.document.do(RenameSpecimen(name)))
            self.refresh()

    def _choose_midline(self) -> None:
        """Take the typed names; where they are none, say so and show the chosen ones again."""
        self.midline.setModified(False)
        names = self.midline.text().upper().replace(",", " ").replace(";", " ").split()
        self._choose(midline=tuple(dict.fromkeys(names)))

    def _on_edited(self, text: str) -> None:
        if not text.strip():
            self._choose(probe_noise=None)

    def _choose(self, **fields: object) -> None:
        attempt(self._workspace, lambda: self._workspace.pose.choose(**fields))
        self.refresh()


def _together(*fields: QLayout) -> FlowLayout:
    """Return fields beside each other, or below each other where there is no room."""
    row = FlowLayout()
    for field in fields:
        holder = QWidget()
        holder.setLayout(field)
        row.addWidget(holder)
    return row


def _number(name: str, step: float, widest: str, hint: str) -> NumberField:
    field = NumberField(name, widest=widest)
    field.step = step
    field.setToolTip(hint)
    return field


def _caption(name: str) -> QLabel:
    """Return what stands before a field: all as wide as the longest."""
    words = text_label(name, "hint")
    fit(words, lambda: words.setFixedWidth(text_width(words, _EACH)))
    return words
