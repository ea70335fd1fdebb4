"""What can be done to one ruler or angle, as a menu."""

from __future__ import annotations

from collections.abc import Callable

from qtpy.QtCore import Qt
from qtpy.QtGui import QGuiApplication
from qtpy.QtWidgets import QInputDialog, QMenu, QWidget

from gp_labeler.models.workspace import Workspace
from gp_labeler.views.signals import attempt

__all__ = ["measurement_menu"]


def measurement_menu(workspace: Workspace, name: str, index: int, parent: QWidget) -> QMenu:
    """Return the menu of a measurement, opened on one of its points; it is gone once it is closed."""
    menu, measure = QMenu(parent), workspace.measure
    menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    measurement = workspace.document.state.measurement(name)

    def add(text: str, call: Callable[[], object]) -> None:
        menu.addAction(text).triggered.connect(lambda: attempt(workspace, call))

    def rename() -> None:
        new_name, ok = QInputDialog.getText(parent, "Rename", "Name", text=name)
        if ok:
            measure.rename(name, new_name)

    add(f"Go to {name}", lambda: measure.go_to(name, index))
    add("Rename…", rename)
    add("Remove", lambda: measure.remove(name))
    menu.addSeparator()
    add(f"Copy {measurement.value_text}", lambda: QGuiApplication.clipboard().setText(measurement.value_text))
    return menu
