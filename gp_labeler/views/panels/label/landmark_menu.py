"""What can be done to one point of the table, as a menu."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from qtpy.QtCore import Qt
from qtpy.QtGui import QGuiApplication
from qtpy.QtWidgets import QMenu, QWidget

from gp_core.landmarks.features import FEATURES, Side, feature
from gp_labeler.document.edits import CheckPoint, ClearPoint, MarkUnseen, point_text
from gp_labeler.document.state import How, Landmark
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.signals import attempt

__all__ = ["landmark_menu"]


def landmark_menu(workspace: Workspace, side: Side, code: str, parent: QWidget) -> QMenu:
    """Return the menu of a point: what can be done to it, and where it is; it is gone once it is closed."""
    menu = QMenu(parent)
    menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    document = workspace.document

    def add(text: str, edit: Callable[[], object], *, enabled: bool = True, to: QMenu = menu) -> None:
        action = to.addAction(text)
        action.setEnabled(enabled)
        action.triggered.connect(lambda: attempt(workspace, edit))

    add(f"Go to {point_text(side, code)}", lambda: workspace.labels.go_to(side, code))
    position = document.landmarks(side).as_mapping().get(code)
    copied = "" if position is None else " ".join(f"{x:.4f}" for x in position)
    if not feature(code).computed:
        _add_edits(add, workspace, side, code)
        _add_swaps(add, menu, workspace, side, code)
    menu.addSeparator()
    clipboard = QGuiApplication.clipboard()
    add("Copy position (LPS, mm)", lambda: clipboard.setText(copied), enabled=position is not None)
    return menu


def _add_edits(add: Callable[..., None], workspace: Workspace, side: Side, code: str) -> None:
    document, labels = workspace.document, workspace.labels
    mark: Landmark = document.state.landmark(side, code)
    placed, free = mark.position is not None, not mark.locked
    ghost, suggested = code in labels.ghosts(side), mark.suggestion is not None
    add("Accept ghost", lambda: labels.accept_ghost(side=side, code=code), enabled=ghost)
    add("Confirm", lambda: workspace.interaction.confirm(side, code), enabled=ghost or suggested)
    add(
        "Re-place with the next click",
        lambda: _arm_replacing(workspace, side, code),
        enabled=(placed or suggested) and free and workspace.scan.volume is not None,
    )
    checked = mark.checked
    add(
        "Remove the check mark" if checked else "Mark as checked",
        lambda: document.do(CheckPoint(side, code, not checked, document.author)),
        enabled=placed,
    )
    unseen = MarkUnseen(side, code, document.provenance(How.UNSEEN))
    add("Cannot be seen", lambda: document.do(unseen), enabled=free and not mark.unseen)
    add("Clear", lambda: document.do(ClearPoint(side, code)), enabled=free and (mark.decided or suggested))
    locked = mark.locked
    add(
        "Unlock" if locked else "Lock",
        lambda: labels.lock(not locked, side=side, code=code),
        enabled=mark.decided,
    )


def _arm_replacing(workspace: Workspace, side: Side, code: str) -> None:
    workspace.labels.go_to(side, code)
    workspace.interaction.arm_replacing()


def _add_swaps(add: Callable[..., None], menu: QMenu, workspace: Workspace, side: Side, code: str) -> None:
    """Offer to exchange with each decided feature of the same side that is not locked."""
    document = workspace.document
    others = menu.addMenu("Exchange with")
    for row in FEATURES:
        if row.computed or row.shared != feature(code).shared or row.code == code:
            continue
        other = document.state.landmark(side, row.code)
        if other.decided and not other.locked:
            swap = partial(workspace.labels.swap, side, code, row.code)
            add(f"{row.code}  {row.name}", swap, to=others)
    others.setEnabled(not others.isEmpty() and not document.state.landmark(side, code).locked)
