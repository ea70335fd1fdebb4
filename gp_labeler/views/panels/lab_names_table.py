"""What the names of another lab stand for: a row for each name that is not known."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QComboBox, QGridLayout, QHBoxLayout, QPushButton, QVBoxLayout, QWidget

from gp_core.landmarks.features import FEATURES
from gp_labeler.views.bind import blocked
from gp_labeler.views.panels.parts import emptied, text_label

__all__ = ["LabNamesTable"]

_UNDECIDED = "Choose a feature…"
_LEFT_OUT = "Leave out"


class LabNamesTable(QWidget):
    """Lets a person choose the feature that each unknown name stands for, or leave the point out."""

    changed = Signal()
    """Something was chosen."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._boxes: dict[str, QComboBox] = {}
        self.leave_rest = QPushButton("Leave out all that are not chosen")
        self.leave_rest.setProperty("role", "link")
        self.leave_rest.clicked.connect(self._leave_rest)
        self._rows = QGridLayout()
        self._rows.setColumnStretch(1, 1)
        self._rows.setHorizontalSpacing(12)
        self._rows.setVerticalSpacing(6)
        foot = QHBoxLayout()
        foot.addWidget(self.leave_rest)
        foot.addStretch(1)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(text_label("What do these names stand for?", "hint"))
        column.addLayout(self._rows)
        column.addLayout(foot)
        self.show_names(())

    @property
    def codes(self) -> dict[str, str]:
        """What was chosen: a code by the lab's name, an empty text for what is left out."""
        return {name: box.currentData() for name, box in self._boxes.items() if box.currentData() is not None}

    @property
    def undecided(self) -> int:
        """For how many names nothing was chosen yet."""
        return len(self._boxes) - len(self.codes)

    def box(self, name: str) -> QComboBox:
        """Return the choice that belongs to a name."""
        return self._boxes[name]

    def show_names(self, names: Sequence[str]) -> None:
        """Show a row for each name; what was chosen for one before stays."""
        self.setVisible(bool(names))
        if tuple(names) == tuple(self._boxes):
            return
        chosen = self.codes
        emptied(self._rows)
        self._boxes = {}
        for row, name in enumerate(names):
            box = self._boxes[name] = _choice(name)
            box.setCurrentIndex(max(box.findData(chosen.get(name)), 0) if name in chosen else 0)
            box.currentIndexChanged.connect(lambda _: self.changed.emit())
            self._rows.addWidget(text_label(name), row, 0)
            self._rows.addWidget(box, row, 1)

    def _leave_rest(self) -> None:
        for box in self._boxes.values():
            if box.currentData() is None:
                with blocked(box):
                    box.setCurrentIndex(box.findData(""))
        self.changed.emit()


def _choice(name: str) -> QComboBox:
    box = QComboBox()
    box.setAccessibleName(f"Feature that {name} stands for")
    box.addItem(_UNDECIDED, None)
    box.addItem(_LEFT_OUT, "")
    for feature in FEATURES:
        if not feature.computed:
            box.addItem(f"{feature.code}  {feature.name}", feature.code)
    return box
