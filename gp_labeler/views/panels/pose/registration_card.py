"""The card of how the touches lie in the scan, and how far the estimate is from the labels."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from qtpy.QtCore import Qt
from qtpy.QtWidgets import QGridLayout, QWidget

from gp_core.constants import METHOD_NAMES
from gp_labeler.document import touching
from gp_labeler.models.estimate import SideEstimate
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.fonts import HEADING, styled
from gp_labeler.views.formatting import NONE, position_text, sentence
from gp_labeler.views.layouts import in_row, wide
from gp_labeler.views.panels.action_button import Actions, do_action
from gp_labeler.views.panels.card_parts import Notices, Segments, link, numbers
from gp_labeler.views.panels.parts import Card, text_label
from gp_labeler.views.panels.pose.wording import fine_mm
from gp_labeler.views.signals import attempt, follow

__all__ = ["RegistrationCard"]

_WAYS = {"auto": "Automatic", "features": "Features", "skull": "Skull"}
_NO_SCAN = "No scan is open: the pose stays in the frame of the touches."
_FACTS = ("Registered", "CO", "FRE", "TRE at CO", "From the labels")
_NO_ESTIMATE = "The estimate will be registered to the scan."
_HINTS = {
    "auto": "By skull features if at least three are touched and on the scan, otherwise by labels",
    "features": "By features that are both touched and labelled",
    "skull": "By skull features (S1, S2, …)",
}
_FOUND = {
    "features": "by labelled features",
    "skull": "by skull features",
    "placed": "placed on the scan itself",
    "known": "given with the touches",
}


class RegistrationCard(Card):
    """Registration, and the error against the labels.

    Parameters
    ----------
    workspace : Workspace
        Whose estimate it shows.
    actions : mapping of str to QAction
        What its buttons do.
    """

    def __init__(self, workspace: Workspace, actions: Actions, parent: QWidget | None = None) -> None:
        super().__init__("In the scan", parent)
        self._workspace = workspace
        self.way = Segments(_WAYS, _HINTS)
        self.facts = {name: numbers() for name in _FACTS}
        styled(self.facts["From the labels"], HEADING, bold=True)
        self.notices, self.waiting = Notices(), text_label("", "hint", wrap=True)
        self.skull = text_label("", "hint", wrap=True)
        self.file = link("Load…", "Load the skull features of the scan from a landmark file")
        self.mark = link(
            "Mark skull point S1 at the crosshair", "Set the position of this skull feature to the crosshair"
        )
        self._lay_out()
        self.way.chosen.connect(self._choose)
        do_action(self.file, actions["pose.open_skull"])
        self.mark.clicked.connect(self._mark)
        follow(self, workspace.scan.opened, self.refresh)

    def refresh(self, *_: object) -> None:
        """Show the registration as it stands."""
        estimate, has_scan = self._workspace.pose.estimate, self._workspace.scan.volume is not None
        self.way.set_value(self._workspace.pose.settings.registration)
        known = estimate is not None and (has_scan or estimate.registered is not None)
        self.way.setVisible(known and self._frame() != "scan")
        self._table.setVisible(known)
        self.waiting.setVisible(not known)
        self.waiting.setText(_NO_ESTIMATE if has_scan else _NO_SCAN)
        for name, words in _facts(estimate).items():
            self.facts[name].setText(words)
        if estimate is not None and (placed := estimate.in_scan()) is not None:
            self.facts["CO"].setText(position_text(placed.origin))
        self.notices.show_notices([] if estimate is None else [*_notices(estimate, has_scan)])
        self._show_skull()

    def take_file(self, path: Path) -> bool:
        """Take the skull features of a file; return whether it could be read."""
        return attempt(self._workspace, lambda: touching.load_skull(self._workspace.document, path))

    @property
    def unmarked(self) -> str:
        """The skull feature to mark next: one touched and not marked, else the next number."""
        state = self._workspace.document.state
        touched = [
            name for name in self._workspace.pose.names if (self._workspace.pose.side, name) in state.touches
        ]
        numbered = (f"S{n}" for n in range(1, 100))
        names = [name for name in touched if name.startswith("S")]
        return next(name for name in (*names, *numbered) if name not in state.skull)

    def _lay_out(self) -> None:
        self.add(self.waiting)
        self.add(self.way)
        self._table = QWidget()
        grid = QGridLayout(self._table)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setHorizontalSpacing(10)
        grid.setVerticalSpacing(3)
        grid.setColumnStretch(1, 1)
        for row, (name, label) in enumerate(self.facts.items()):
            label.setWordWrap(True)
            caption = text_label(name, "hint")
            caption.setToolTip(_CAPTIONS.get(name, ""))
            grid.addWidget(caption, row, 0, Qt.AlignmentFlag.AlignTop)
            grid.addWidget(label, row, 1)
        self.add(self._table)
        self.add(self.notices)
        self.add(in_row(wide(self.skull), self.file, self.mark, spacing=2))

    def _show_skull(self) -> None:
        n = len(self._workspace.document.state.skull)
        self.skull.setText(f"Skull features on the scan: {n or 'none'}")
        self.mark.setText(f"Mark skull point {self.unmarked} at the crosshair")
        self.mark.setEnabled(self._workspace.scan.volume is not None)

    def _frame(self) -> str:
        return self._workspace.document.state.touched(self._workspace.pose.side).frame

    def _choose(self, way: str) -> None:
        attempt(self._workspace, lambda: self._workspace.pose.choose(registration=way))

    def _mark(self) -> None:
        document = self._workspace.document
        attempt(
            self._workspace,
            lambda: touching.mark_skull(document, self.unmarked, self._workspace.view.crosshair),
        )


_CAPTIONS = {
    "FRE": "Fiducial registration error: RMS distance between corresponding points",
    "TRE at CO": "Expected target registration error at the cochlea, from the registration alone",
}


def _facts(estimate: SideEstimate | None) -> dict[str, str]:
    registered = None if estimate is None else estimate.registered
    if estimate is None or registered is None:
        return dict.fromkeys(_FACTS, NONE)
    placed, fiducials = estimate.in_scan(), registered.fiducials
    tre = NONE
    if placed is not None and fiducials is not None:
        bound = float(fiducials.tre_95_mm(placed.origin[None])[0])
        tre = f"{fine_mm(registered.tre_mm(placed.origin))}  (95 %: {fine_mm(bound)})"
    n = "" if fiducials is None else f", {len(fiducials.fiducials)} of {len(fiducials.names)}"
    return {
        "Registered": _FOUND[registered.way] + n,
        "CO": NONE,
        "FRE": fine_mm(registered.fre_mm),
        "TRE at CO": tre,
        "From the labels": _errors(estimate),
    }


def _errors(estimate: SideEstimate) -> str:
    if estimate.truth is None:
        return "CA, CB, RWA, RWP are not all labelled"
    lines = []
    for method in estimate.poses:
        found = estimate.errors(method)
        if found is not None:
            name = f"{METHOD_NAMES[method]}: " if len(estimate.poses) > 1 else ""
            lines.append(f"{name}CO {fine_mm(found[0])}, axis {found[1]:.1f}°")
    return "\n".join(lines) or NONE


def _notices(estimate: SideEstimate, has_scan: bool) -> Iterator[tuple[str, ...]]:
    if (problem := estimate.problems.get("registration")) is not None:
        yield ("warning", sentence(problem))
    elif estimate.registered is None and has_scan:
        yield (
            "info",
            "The touches are not registered to this scan yet.",
            "Label features that were touched, or set the skull features.",
        )
    fiducials = None if estimate.registered is None else estimate.registered.fiducials
    for warning in () if fiducials is None else fiducials.warnings:
        words, _, rest = warning.partition(": ")
        yield ("warning", sentence(words), sentence(rest) if rest else "")
