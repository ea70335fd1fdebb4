"""What can be done to one point of the table, as a menu."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from qtpy.QtGui import QGuiApplication
from qtpy.QtWidgets import QMenu, QWidget

from gp_core.landmarks.features import FEATURES, Side, feature
from gp_labeler.document.edits import CheckPoint, ClearPoint, MarkUnseen, point_text
from gp_labeler.document.state import How, Landmark
from gp_labeler.models import labelling
from gp_labeler.models.workspace import Workbench
from gp_labeler.views.bind import attempt

__all__ = ["landmark_menu"]


def landmark_menu(workbench: Workbench, side: Side, code: str, parent: QWidget) -> QMenu:
    """Return the menu of a point: what can be done to it, and where it is."""
    menu = QMenu(parent)
    session = workbench.session

    def add(text: str, edit: Callable[[], object], *, enabled: bool = True, to: QMenu = menu) -> None:
        action = to.addAction(text)
        action.setEnabled(enabled)
        action.triggered.connect(lambda: attempt(workbench, edit))

    add(f"Go to {point_text(side, code)}", lambda: workbench.go_to(side, code))
    position = session.landmarks(side).as_mapping().get(code)
    copied = "" if position is None else " ".join(f"{x:.4f}" for x in position)
    if not feature(code).computed:
        _add_edits(add, workbench, side, code)
        _add_swaps(add, menu, workbench, side, code)
    menu.addSeparator()
    clipboard = QGuiApplication.clipboard()
    add("Copy position (LPS, mm)", lambda: clipboard.setText(copied), enabled=position is not None)
    return menu


def _add_edits(add: Callable[..., None], workbench: Workbench, side: Side, code: str) -> None:
    session = workbench.session
    mark: Landmark = session.state.landmark(side, code)
    placed, free = mark.position is not None, not mark.locked
    ghost, suggested = code in session.ghosts(side), mark.suggestion is not None
    add("Accept ghost", lambda: labelling.accept_ghost(session, side=side, code=code), enabled=ghost)
    add("Confirm", lambda: workbench.confirm(side, code), enabled=ghost or suggested)
    add(
        "Re-place with the next click",
        lambda: _arm_replacing(workbench, side, code),
        enabled=(placed or suggested) and free and workbench.volume is not None,
    )
    checked = mark.checked
    add(
        "Take back the check" if checked else "Mark as checked",
        lambda: session.do(CheckPoint(side, code, not checked, session.author)),
        enabled=placed,
    )
    unseen = MarkUnseen(side, code, labelling.provenance(session, How.UNSEEN))
    add("Cannot be seen", lambda: session.do(unseen), enabled=free and not mark.unseen)
    add("Clear", lambda: session.do(ClearPoint(side, code)), enabled=free and (mark.settled or suggested))
    locked = mark.locked
    add(
        "Unlock" if locked else "Lock",
        lambda: labelling.lock(session, not locked, side=side, code=code),
        enabled=mark.settled,
    )


def _arm_replacing(workbench: Workbench, side: Side, code: str) -> None:
    workbench.go_to(side, code)
    workbench.arm_replacing()


def _add_swaps(add: Callable[..., None], menu: QMenu, workbench: Workbench, side: Side, code: str) -> None:
    """Offer to exchange with each settled feature of the same side that is not locked."""
    session = workbench.session
    others = menu.addMenu("Exchange with")
    for row in FEATURES:
        if row.computed or row.shared != feature(code).shared or row.code == code:
            continue
        other = session.state.landmark(side, row.code)
        if other.settled and not other.locked:
            swap = partial(workbench.swap, side, code, row.code)
            add(f"{row.code}  {row.name}", swap, to=others)
    others.setEnabled(not others.isEmpty() and not session.state.landmark(side, code).locked)
