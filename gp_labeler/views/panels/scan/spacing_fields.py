"""Fields for a voxel size: empty until somebody knows it, in mm or µm."""

from __future__ import annotations

from qtpy.QtCore import Signal
from qtpy.QtWidgets import QCheckBox, QComboBox, QHBoxLayout, QLineEdit, QPushButton, QWidget

from gp_core.errors import GpError
from gp_labeler.imaging.readers.options import Spacing
from gp_labeler.imaging.typed_spacing import UNITS, spacing_in, typed_spacing
from gp_labeler.views.fonts import field_width, fit
from gp_labeler.views.formatting import spacing_text
from gp_labeler.views.layouts import in_column
from gp_labeler.views.panels.flow import FlowLayout
from gp_labeler.views.panels.parts import text_label
from gp_labeler.views.screen_reader import name_choice
from gp_labeler.views.signals import blocked

__all__ = ["SpacingFields"]


_WIDEST = "1000.00"


class SpacingFields(QWidget):
    """x, y and z, one unit, and whether all are the same."""

    changed = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._suggested: Spacing | None = None
        self.fields = [self._field(name) for name in "xyz"]
        self.unit = QComboBox()
        self.unit.addItems(list(UNITS))
        name_choice(self.unit, "Unit of the voxel size")
        self.unit.currentTextChanged.connect(self._on_unit)
        self.same = QCheckBox("Isotropic (the same along all axes)")
        self.same.setChecked(True)
        self.same.toggled.connect(self._on_same)
        self.suggestion = QPushButton()
        self.suggestion.setProperty("role", "link")
        self.suggestion.clicked.connect(self._take_suggestion)
        row = QHBoxLayout()
        row.setSpacing(6)
        for name, field in zip("xyz", self.fields, strict=True):
            row.addWidget(text_label(name, "hint"))
            row.addWidget(field, 1)
        row.addWidget(self.unit)
        below = FlowLayout()
        below.addWidget(self.same)
        below.addWidget(self.suggestion)
        in_column(row, below, margins=0, spacing=4, of=self)
        self._on_same(True)

    def offer(self, suggested: Spacing | None, *, from_file: bool) -> None:
        """Say what the file has or hints at; the fields stay empty.

        Parameters
        ----------
        suggested : (3,) float, mm, optional
            Voxel size to propose.
        from_file : bool
            Whether that is what counts while nothing is typed.
        """
        self._suggested = suggested
        if suggested is not None and len(set(suggested)) > 1:
            self.same.setChecked(False)
        texts = spacing_in(suggested, self.unit.currentText()) if suggested and from_file else ("", "", "")
        for field, text in zip(self.fields, texts, strict=True):
            field.setPlaceholderText(text)
        self.suggestion.setVisible(suggested is not None and not from_file)
        if suggested is not None:
            self.suggestion.setText(f"Use {spacing_text(suggested)} instead")

    def spacing(self) -> Spacing | None:
        """Return what was typed, mm; None where nothing was; raises `GpError` where it makes no sense."""
        return typed_spacing([field.text() for field in self.fields], self.unit.currentText())

    def show_wrong(self, wrong: bool) -> None:
        """Mark the fields as wrong, or not."""
        for field in self.fields:
            if field.property("wrong") != wrong:
                field.setProperty("wrong", wrong)
                field.style().unpolish(field)
                field.style().polish(field)

    def _field(self, name: str) -> QLineEdit:
        field = QLineEdit()
        field.setAccessibleName(f"Voxel size along {name}")
        fit(field, lambda: field.setMinimumWidth(field_width(field, _WIDEST)))
        field.textEdited.connect(self._on_typed)
        return field

    def _on_typed(self, text: str) -> None:
        if self.same.isChecked():
            for field in self.fields[1:]:
                field.setText(self.fields[0].text())
        self.changed.emit()

    def _on_same(self, same: bool) -> None:
        for field in self.fields[1:]:
            field.setEnabled(not same)
            if same:
                field.setText(self.fields[0].text())
        self.changed.emit()

    def _on_unit(self, unit: str) -> None:
        texts = [field.placeholderText() for field in self.fields]
        if self._suggested is not None and any(texts):
            for field, text in zip(self.fields, spacing_in(self._suggested, unit), strict=True):
                field.setPlaceholderText(text)
        self.changed.emit()

    def _take_suggestion(self) -> None:
        if self._suggested is None:
            return
        with blocked(*self.fields):
            texts = spacing_in(self._suggested, self.unit.currentText())
            for field, text in zip(self.fields, texts, strict=True):
                field.setText(text)
        self.changed.emit()

    def error(self) -> str:
        """Return what is wrong with what was typed; empty where nothing is."""
        try:
            self.spacing()
        except GpError as problem:
            return str(problem)
        return ""
