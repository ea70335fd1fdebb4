"""What the names of another lab stand for: a row for each name that is not known."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from qtpy.QtCore import Signal
from qtpy.QtWidgets import (
    QComboBox,
    QGridLayout,
    QPushButton,
    QSizePolicy,
    QWidget,
)

from gp_core.landmarks.features import FEATURES, Side
from gp_core.landmarks.labels import LabelNames, parse_label
from gp_labeler.views.layouts import STRETCH, in_column, in_row
from gp_labeler.views.panels.parts import ElidedLabel, emptied, text_label
from gp_labeler.views.screen_reader import name_choice
from gp_labeler.views.signals import blocked

__all__ = ["LabNamesTable"]

_UNDECIDED = "Choose a feature…"
_LEFT_OUT = "Leave out"
_EITHER_SIDE = "Side as in the file"


class LabNamesTable(QWidget):
    """Lets a person choose the feature, and its side, that each unknown name stands for, or leave it out."""

    changed = Signal()
    """Something was chosen."""

    load_asked = Signal()
    """A file of names is wanted."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._boxes: dict[str, QComboBox] = {}
        self._sides: dict[str, QComboBox] = {}
        self.leave_rest = QPushButton("Leave out all names that are not assigned")
        self.leave_rest.setProperty("role", "link")
        self.leave_rest.clicked.connect(self._leave_rest)
        self.load = QPushButton("Load a table of names…")
        self.load.setToolTip("File with two columns: their name, our code (CA or CA_L)")
        self.load.setProperty("role", "link")
        self.load.clicked.connect(lambda: self.load_asked.emit())
        self._rows = QGridLayout()
        for number, share in enumerate((2, 3)):
            self._rows.setColumnStretch(number, share)
        self._rows.setHorizontalSpacing(12)
        self._rows.setVerticalSpacing(6)
        in_column(
            text_label("What do these names stand for?", "hint"),
            self._rows,
            in_row(self.leave_rest, self.load, STRETCH),
            margins=0,
            of=self,
        )
        self.show_names(())

    @property
    def codes(self) -> dict[str, str]:
        """What was chosen: a code by the lab's name (``CA``, or ``CA_L``), empty for what is left out."""
        return dict(self._chosen())

    def _chosen(self) -> Iterator[tuple[str, str]]:
        for name, box in self._boxes.items():
            code, side = box.currentData(), self._sides[name].currentData()
            if code is not None:
                yield name, f"{code}_{side}" if code and side else code

    @property
    def undecided(self) -> int:
        """For how many names nothing was chosen yet."""
        return len(self._boxes) - len(self.codes)

    def box(self, name: str) -> QComboBox:
        """Return the choice that belongs to a name."""
        return self._boxes[name]

    def side_box(self, name: str) -> QComboBox:
        """Return the choice of the side that belongs to a name."""
        return self._sides[name]

    def choose(self, names: LabelNames) -> None:
        """Choose, for the names that are shown, what a table of names says."""
        for name in self._boxes:
            if name in names or names.leaves_out(name):
                self._set(name, "" if names.leaves_out(name) else names.translate(name))
        self.changed.emit()

    def _set(self, name: str, code: str) -> None:
        parsed = parse_label(code)
        for box, value in (
            (self._boxes[name], parsed.name),
            (self._sides[name], parsed.side and parsed.side.value),
        ):
            with blocked(box):
                box.setCurrentIndex(max(box.findData(value), 0))
        self._allow_side(name)

    def _allow_side(self, name: str) -> None:
        """Offer a side only for a feature that was chosen."""
        self._sides[name].setEnabled(bool(self._boxes[name].currentData()))

    def show_names(self, names: Sequence[str]) -> None:
        """Show a row for each name; what was chosen for one before stays."""
        self.setVisible(bool(names))
        if tuple(names) == tuple(self._boxes):
            return
        chosen = self.codes
        emptied(self._rows)
        self._boxes, self._sides = {}, {}
        for row, name in enumerate(names):
            self._boxes[name], self._sides[name] = _choice(name), _side_choice(name)
            self._allow_side(name)
            if name in chosen:
                self._set(name, chosen[name])
            self._rows.addWidget(ElidedLabel(name), row, 0)
            for column, box in enumerate((self._boxes[name], self._sides[name]), start=1):
                box.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Fixed)  # never squeezed
                box.currentIndexChanged.connect(lambda _, name=name: self._tell(name))
                self._rows.addWidget(box, row, column)

    def _tell(self, name: str) -> None:
        self._allow_side(name)
        self.changed.emit()

    def _leave_rest(self) -> None:
        for box in self._boxes.values():
            if box.currentData() is None:
                with blocked(box):
                    box.setCurrentIndex(box.findData(""))
        for name in self._boxes:
            self._allow_side(name)
        self.changed.emit()


def _choice(name: str) -> QComboBox:
    box = QComboBox()
    name_choice(box, f"Feature that {name} stands for")
    box.addItem(_UNDECIDED, None)
    box.addItem(_LEFT_OUT, "")
    for feature in FEATURES:
        if not feature.computed:
            box.addItem(f"{feature.code}  {feature.name}", feature.code)
    return box


def _side_choice(name: str) -> QComboBox:
    box = QComboBox()
    name_choice(box, f"Side of the head that {name} is on")
    box.addItem(_EITHER_SIDE, None)
    for side in Side:
        box.addItem(side.word, side.value)
    return box
