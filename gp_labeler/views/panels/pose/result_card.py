"""The card of the estimated cochlea: where it is, how it is turned, and how sure that is."""

from __future__ import annotations

import math
from collections.abc import Iterator

from qtpy.QtCore import Qt
from qtpy.QtWidgets import QGridLayout, QWidget

from gp_core.constants import METHOD_NAMES
from gp_core.pose.cochlea_pose import CochleaPose
from gp_core.pose.quality import PoseQuality, pose_quality
from gp_labeler.models.both_ears import BothEars
from gp_labeler.models.estimate import SideEstimate
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.fonts import HEADING, TITLE, styled
from gp_labeler.views.formatting import sentence
from gp_labeler.views.panels.card_parts import Notices, QualityBadge, link, numbers
from gp_labeler.views.panels.flow import FlowLayout
from gp_labeler.views.panels.parts import Card, text_label
from gp_labeler.views.panels.pose.wording import (
    allowance_text,
    ear_notices,
    fine_mm,
    gain_text,
    likely_text,
    region_text,
    triple,
    unit_triple,
)
from gp_labeler.views.signals import attempt

__all__ = ["ResultCard"]

_FRAMES = {"tracker": "tracker frame", "scan": "in the scan, LPS"}


class ResultCard(Card):
    """The estimate, or what is missing for one.

    Parameters
    ----------
    workspace : Workspace
        Whose estimate it shows.
    """

    def __init__(self, workspace: Workspace, parent: QWidget | None = None) -> None:
        super().__init__("Cochlea", parent)
        self._workspace = workspace
        self.verdict, self.notices = QualityBadge(), Notices()
        self.waiting = text_label("", "title", wrap=True)
        self.one, self.two = _OnePose(), _TwoPoses()
        self.next = link("", "Request this feature next")
        self.swap = link("", "Exchange the names of the two touches; undo restores them")
        self.this_side = link("", "The file name indicates the other side; confirm this side")
        self.other_side = link("", "Move all touches to the other side; undo restores them")
        self.add_to_heading(self.verdict)
        for what in (self.waiting, self.one, self.two, self.notices):
            self.add(what)
        row = FlowLayout(spacing=4)
        for button in (self.other_side, self.this_side, self.swap, self.next):
            row.addWidget(button)
        self.add(row)
        self.next.clicked.connect(self._aim)
        self.swap.clicked.connect(lambda: attempt(workspace, workspace.pose.swap_names))
        self.this_side.clicked.connect(workspace.pose.confirm_side)
        self.other_side.clicked.connect(lambda: attempt(workspace, workspace.pose.change_side))

    def refresh(self, *_: object) -> None:
        """Show the estimate as it stands."""
        model = self._workspace.pose
        estimate, pose = model.estimate, None if model.estimate is None else model.estimate.pose
        self.heading.setText(_heading(estimate))
        self.waiting.setVisible(pose is None)
        self.waiting.setText("" if estimate is not None and pose is None else _waiting(model.waiting_text))
        both = estimate is not None and len(estimate.poses) > 1
        self.one.setVisible(pose is not None and not both)
        self.two.setVisible(both)
        if pose is not None and not both:
            self.one.show_pose(pose)
        if estimate is not None and both:
            self.two.show_poses(estimate)
        self.verdict.setVisible(pose is not None)
        if pose is not None:
            trust = _quality(pose, model.ears)
            self.verdict.show_verdict(trust.level, trust.word, trust.reason)
        wrong = pose is not None and (pose.side_state == "wrong" or bool(self._workspace.pose.misnamed))
        self._offer_readings(pose, wrong=wrong)
        self.notices.show_notices([] if estimate is None else [*_notices(self._workspace, estimate)])
        self._show_gain(pose, wanted=not wrong and model.swapped is None)

    def set_large(self, large: bool) -> None:
        """Show the estimate in large type, where there is room."""
        self.one.set_large(large)

    def _offer_readings(self, pose: CochleaPose | None, *, wrong: bool) -> None:
        """Offer the other side and the exchange of two names, where they are not ruled out."""
        model = self._workspace.pose
        undecided = pose is not None and pose.side_state == "undecided"
        self.other_side.setVisible(wrong or undecided)
        self.this_side.setVisible(bool(model.misnamed))
        self.this_side.setText(f"Keep the {model.side.word} side")
        side = f"the {model.side.other.word} side"
        likely = _likely(pose, model.swapped)
        self.other_side.setText(f"Use {side}" if wrong else f"Use {side}  ({likely[0]})")
        self.swap.setVisible(model.swapped is not None)
        names = f"Exchange {' and '.join(model.swapped or ())}"
        sure = pose is None or pose.names_state != "undecided"
        self.swap.setText(names if sure else f"{names}  ({likely[1]})")

    def _show_gain(self, pose: CochleaPose | None, *, wanted: bool) -> None:
        gains = self._workspace.pose.gains() if wanted else ()
        self.next.setVisible(bool(gains))
        if gains:
            self.next.setText(gain_text(gains[0], as_named=pose is not None and pose.is_multimodal))

    def _aim(self) -> None:
        gains = self._workspace.pose.gains()
        if gains:
            self._workspace.pose.set_target(gains[0].code)


class _OnePose(QWidget):
    """Origin, axis and region of one pose, large."""

    def __init__(self) -> None:
        super().__init__()
        grid = QGridLayout(self)
        grid.setContentsMargins(0, 2, 0, 2)
        grid.setHorizontalSpacing(10)
        grid.setVerticalSpacing(3)
        self.origin, self.axis, self.region = numbers(), numbers(), numbers()
        self.allowance = text_label("", "hint", wrap=True)
        self.set_large(False)
        for row, (caption, label) in enumerate((("CO", self.origin), ("Axis", self.axis))):
            grid.addWidget(text_label(caption, "hint"), row, 0, Qt.AlignmentFlag.AlignBaseline)
            grid.addWidget(label, row, 1, Qt.AlignmentFlag.AlignBaseline)
        grid.addWidget(self.region, 2, 0, 1, 2)
        grid.addWidget(self.allowance, 3, 0, 1, 2)
        grid.setColumnStretch(1, 1)

    def set_large(self, large: bool) -> None:
        """Show it in type that is read from further away."""
        for label, size, bold in (
            (self.origin, TITLE, True),
            (self.axis, HEADING, False),
            (self.region, HEADING + 1, True),
        ):
            styled(label, size * (1.5 if large else 1), bold=bold)

    def show_pose(self, pose: CochleaPose) -> None:
        self.origin.setText(f"{triple(pose.origin)}  mm")
        self.axis.setText(unit_triple(pose.axis))
        self.axis.setToolTip("Unit vector along the modiolar axis, from the base CB to the apex CA")
        self.region.setText(region_text(pose))
        self.allowance.setText(allowance_text(pose))
        self.allowance.setVisible(bool(self.allowance.text()))
        self.region.setToolTip("Sphere and cone that contain the true origin and axis with 95 % probability")


class _TwoPoses(QWidget):
    """Two poses side by side, one coordinate in each row."""

    def __init__(self) -> None:
        super().__init__()
        self._grid = QGridLayout(self)
        self._grid.setContentsMargins(0, 2, 0, 2)
        self._grid.setHorizontalSpacing(12)
        self._grid.setVerticalSpacing(2)
        self._grid.setColumnStretch(3, 1)
        self.apart = numbers(HEADING, bold=True)
        self.cells = [[numbers(HEADING, bold=row > 6) for _ in range(3)] for row in range(9)]
        for row, cells in enumerate(self.cells):
            for column, cell in enumerate(cells):
                side = Qt.AlignmentFlag.AlignRight if column else Qt.AlignmentFlag.AlignLeft
                cell.setAlignment(side | Qt.AlignmentFlag.AlignVCenter)
                self._grid.addWidget(cell, row, column)
        self._grid.addWidget(self.apart, len(self.cells), 0, 1, 4)

    def show_poses(self, estimate: SideEstimate) -> None:
        methods = [method for method in estimate.settings.methods if method in estimate.poses]
        columns = [_column(METHOD_NAMES[method], estimate.poses[method]) for method in methods]
        names = ("", "CO x", "y", "z", "Axis x", "y", "z", "95 % within", "Cone")
        for cells, name, *values in zip(self.cells, names, *columns, strict=True):
            for cell, value in zip(cells, (name, *values), strict=True):
                cell.setText(value)
        apart = estimate.apart()
        if apart is not None:
            self.apart.setText(f"They differ by {fine_mm(apart[0])} and {apart[1]:.1f}°")


def _column(word: str, pose: CochleaPose) -> tuple[str, ...]:
    cone = f"{math.degrees(pose.cone_95):.1f}°"
    origin, axis = triple(pose.origin).split(), unit_triple(pose.axis).split()
    return (word, *origin, *axis, fine_mm(pose.radius_95), cone)


def _likely(pose: CochleaPose | None, pair: tuple[str, str] | None) -> tuple[str, str]:
    """Return how likely the other side is, and the exchange of a pair."""
    readings = () if pose is None else pose.hypotheses
    side = sum(reading.probability for reading in readings if reading.exchanged is None)
    swap = sum(reading.probability for reading in readings if reading.exchanged == pair)
    return likely_text(side), likely_text(swap)


def _quality(pose: CochleaPose, ears: BothEars | None) -> PoseQuality:
    """Return the rating of a pose: none is good while a warning about the two ears stands below it."""
    rated = pose_quality(pose)
    if ears is None or not ears.is_doubtful or rated.word not in ("Good", "Fair"):
        return rated
    return PoseQuality("warning", "Check first", "Use this pose only if none of the warnings below applies.")


def _heading(estimate: SideEstimate | None) -> str:
    if estimate is None or estimate.pose is None:
        return "Cochlea"
    return f"Cochlea  ·  {_FRAMES.get(estimate.touches.frame, estimate.touches.frame)}"


def _waiting(text: str) -> str:
    return text[:1].upper() + text[1:]


def _notices(workspace: Workspace, estimate: SideEstimate) -> Iterator[tuple[str, ...]]:
    for method in estimate.settings.methods:
        if method in estimate.problems:
            yield ("error", f"{METHOD_NAMES[method]}: {estimate.problems[method]}")
    if "jrmpc" in workspace.pose.settings.methods and not workspace.pose.joint_ready:
        yield ("info", "Preparing JRMPC; this takes a few seconds, once.")
    for reason in workspace.pose.file_warnings:
        yield ("warning", sentence(reason.text), "Nothing is sent to a robot until you confirm the side.")
    said: set[str] = set()
    for pose in estimate.poses.values():
        for warning in pose.warnings:
            if warning not in said:
                said.add(warning)
                words, _, remedy = warning.partition(": ")
                yield ("warning", sentence(words), sentence(remedy) if remedy else "")
    yield from ear_notices(workspace.pose.ears, wanted=workspace.pose.settings.both_ears)
