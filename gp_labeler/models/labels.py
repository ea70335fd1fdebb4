"""The labels of the specimen: the active point, where points are expected, what is wrong, and edits."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from gp_core.atlas.label_check import Deviation, Finding, SideCheck
from gp_core.errors import GpError
from gp_core.landmarks.features import CODES, FEATURES, Side, feature
from gp_core.landmarks.suggestion import Suggestion
from gp_core.validation import FloatArray
from gp_labeler.document.edits import (
    AnnotatePoint,
    ClearPoint,
    ConfirmPoint,
    LockPoints,
    MarkUnseen,
    PlacePoint,
    SuggestPoints,
    SwapPoints,
    as_position,
    point_text,
)
from gp_labeler.document.signals import Signal
from gp_labeler.document.specimen_document import SpecimenDocument
from gp_labeler.document.state import How, point_key
from gp_labeler.jobs.runner import Jobs
from gp_labeler.models.atlas import AtlasModel
from gp_labeler.models.ghosts import Expectations, Ghost, Predict
from gp_labeler.models.label_checks import Check, CheckLabels, LabelChecks
from gp_labeler.models.messages import Messages
from gp_labeler.models.scan import ScanModel
from gp_labeler.models.view import ViewModel
from gp_labeler.models.workflow import (
    Active,
    LabellingProgress,
    PointState,
    click_text,
    next_point,
    point_state,
    progress,
)

__all__ = ["LabelsModel"]

_DRAWN_FIRST_S = 0.1
"""Checking takes the interpreter away from drawing; a click that comes sooner spares it altogether."""


class LabelsModel:
    """Labels the specimen, point by point; what clicks, keys and scripts do with landmarks.

    A method takes the point that is active unless another is named by `side` and `code`, and raises `GpError`
    where none is, or where the edit cannot be made.

    Parameters
    ----------
    document : SpecimenDocument
        Holds the landmarks.
    view : ViewModel
        Its crosshair follows the point in work.
    scan : ScanModel
        Labels are checked against its bone.
    atlas : AtlasModel
        Says where features are expected, and what is wrong.
    jobs : Jobs
        Where labels are checked.
    messages : Messages
        What the user is told by.
    """

    active_changed = Signal(object)
    """The `Active` point."""
    ghosts_changed = Signal()
    """Another atlas is behind ghosts and problems; they also follow the landmarks, without this signal."""
    checked = Signal()
    """Labels were checked: ask for `deviations` again."""
    problems_changed = Signal()
    """Some of them are doubtful: ask `point_states(side, wait=False)` again."""

    def __init__(
        self,
        document: SpecimenDocument,
        view: ViewModel,
        scan: ScanModel,
        atlas: AtlasModel,
        jobs: Jobs,
        messages: Messages,
    ) -> None:
        self.document, self._view, self._scan, self._atlas = document, view, scan, atlas
        self._jobs, self._messages = jobs, messages
        self._expectations = Expectations(atlas.predict, atlas.labelling_error_in_use)
        self._checks = LabelChecks(atlas.check)
        self._active = Active(Side.LEFT)
        self._last: Active | None = None
        self._begin()
        document.reset.connect(self._on_reset)
        document.landmarks_changed.connect(self._on_landmarks)
        document.labelling_changed.connect(self._on_labelling)
        document.focus_restored.connect(self._on_focus)
        atlas.expectations_changed.connect(self._on_expectations)
        for signal in (scan.opened, scan.threshold_changed):
            signal.connect(self._on_scan)

    # The point in work

    @property
    def active(self) -> Active:
        """What the next click places."""
        return self._active

    @property
    def click_text(self) -> str:
        """What the next click does, in words."""
        return click_text(self.document.state, self._active)

    def set_active(self, active: Active) -> None:
        """Choose what the next click places; raises `FeatureError` for CO, which nobody places."""
        if active.code is not None:
            active = Active(Side.parse(active.side), point_key(active.side, active.code)[1])
        if active != self._active:
            self._active = self.document.focus = active
            self.active_changed.emit(active)

    # What is known of the points

    def ghosts(self, side: Side) -> Mapping[str, Ghost]:
        """Return where the points to do of one side are expected."""
        return self._expectations.ghosts(self.document.landmarks(side), self.document.landmarks(side.other))

    def problems(self, side: Side) -> Mapping[str, Finding]:
        """Return the problems of the points of one side, by feature; this may take some 50 ms."""
        return self._checks.found(self.document.landmarks(side)).problems

    def known_problems(self, side: Side) -> Mapping[str, Finding]:
        """Return `problems` as far as they can be told at once."""
        return self._checks.known_problems(self.document.landmarks(side))

    def is_other_side(self, side: Side) -> bool:
        """Whether one side is known to be labelled under the name of the other; at once, see `checking`."""
        return any(problem.kind == "other side" for problem in self.known_problems(side).values())

    def deviations(self, side: Side) -> Mapping[str, Deviation] | None:
        """Return how far the labels of one side are from where the atlas expects them; None while unknown."""
        known = self.checking(side).known
        return None if known is None else known.deviations

    def checking(self, side: Side) -> CheckLabels:
        """Return the job that checks one side as it stands, after which `point_states` knows its problems."""
        return CheckLabels(self._checks, self.document.landmarks(side))

    def point_states(self, side: Side, *, wait: bool = True) -> dict[str, PointState]:
        """Return how far every feature of one side is, in the table's order.

        Without `wait`, problems are `known_problems`: run `checking`, then ask again.
        """
        ghosts, state = self.ghosts(side), self.document.state
        problems = self.problems(side) if wait else self.known_problems(side)
        return {code: point_state(state, side, code, ghosts=ghosts, problems=problems) for code in CODES}

    def progress(self, side: Side) -> LabellingProgress:
        """Return how many of the 20 points of one side are done."""
        return progress(self.document.state, side)

    def expect(self, predict: Predict | None, check: Check | None = None) -> None:
        """Take another atlas for ghosts and problems, or none."""
        self._expectations = Expectations(predict, self._atlas.labelling_error_in_use)
        self._checks = LabelChecks(check, self._checks.measure)
        self.ghosts_changed.emit()

    def release(self) -> None:
        """Release the scan, which checks ask."""
        self._checks = LabelChecks(self._checks.check)

    # Edits

    def place(
        self,
        position: ArrayLike,
        how: How = How.MESH,
        *,
        source: str = "",
        side: Side | str | None = None,
        code: str | None = None,
    ) -> bool:
        """Put a point at `position`, (3,) mm in the scan frame; a new one makes the next point active.

        ``How.GHOST`` only suggests it: nobody has looked. `source` says what had suggested another place.

        Returns
        -------
        bool
            Whether anything changed.
        """
        side, code = self._target(side, code)
        if how is How.GHOST:  # as scripts of earlier versions have it
            return self.suggest(position, source="atlas", side=side, code=code)
        is_new = self.document.state.landmark(side, code).position is None
        where, about = as_position(position, code), self.document.provenance(how, source=source)
        edit = PlacePoint(side, code, where, about, verb="place" if is_new else "move")
        changed = self.document.do(edit)
        self._last = Active(side, code)
        if is_new:
            self._go_on(side, code)
        return changed

    def accept_ghost(self, *, side: Side | str | None = None, code: str | None = None) -> bool:
        """Suggest a point where it is expected, and go on to the next; nobody has looked at it yet."""
        side, code = self._target(side, code)
        ghost = self.ghosts(side).get(code)
        if ghost is None:
            raise GpError(
                f"the position of {point_text(side, code)} cannot be predicted yet",
                landmark=code,
                remedy="Place three features of this side first.",
            )
        return self._suggest(side, {code: ghost.suggestion})

    def accept_all_ghosts(self, *, side: Side | str | None = None) -> bool:
        """Suggest every point of a side (by default the active one) that is to do and expected somewhere."""
        side = self.active.side if side is None else Side.parse(side)
        ghosts = {
            code: ghost.suggestion
            for code, ghost in self.ghosts(side).items()
            if not self.document.state.landmark(side, code).locked
        }
        if not ghosts:
            raise GpError(
                f"no feature of the {side.word} side has a ghost to accept",
                remedy="Place three features of this side first.",
            )
        return self._suggest(side, ghosts)

    def suggest(
        self,
        position: ArrayLike,
        *,
        radius_95: float | None = None,
        source: str = "",
        side: Side | str | None = None,
        code: str | None = None,
    ) -> bool:
        """Suggest a point at `position`, (3,) mm in the scan frame, for a person to confirm.

        Parameters
        ----------
        radius_95 : float, optional
            Radius that holds the feature with 95 % probability, mm.
        source : str
            What suggests it.
        """
        side, code = self._target(side, code)
        suggestion = Suggestion(as_position(position, code), radius_95, source)
        return self._suggest(side, {code: suggestion})

    def confirm(self, *, side: Side | str | None = None, code: str | None = None) -> bool:
        """Make an observation of a suggested point, as someone who has looked at it, and go on to the next.

        The window asks for it only where the point can be judged: in view, a voxel at least two pixels wide.
        """
        side, code = self._target(side, code)
        suggestion = self.document.state.landmark(side, code).suggestion
        source = "" if suggestion is None else suggestion.source
        changed = self.document.do(
            ConfirmPoint(side, code, self.document.provenance(How.CONFIRMED, source=source))
        )
        self._last = Active(side, code)
        self._go_on(side, code)
        return changed

    def nudge(self, offset: ArrayLike, *, side: Side | str | None = None, code: str | None = None) -> bool:
        """Move a point by a (3,) offset, mm in the scan frame; nudges in a row are one undo.

        A suggested point becomes an observation by that: a person has corrected it.
        """
        side, code = self._target(side, code)
        landmark = self.document.state.landmark(side, code)
        if landmark.shown_position is None:
            raise GpError(
                f"{point_text(side, code)} is not placed yet", landmark=code, remedy="Place it first."
            )
        how = landmark.provenance.how if landmark.provenance else How.TYPED
        how = How.NUDGED if landmark.suggestion is not None else how
        where = as_position(np.add(landmark.shown_position, as_position(offset, code)), code)
        return self.document.do(
            PlacePoint(side, code, where, self.document.provenance(how), verb="nudge"), merge=True
        )

    def clear(self, *, side: Side | str | None = None, code: str | None = None) -> bool:
        """Make a point one that is to do, and the active one."""
        side, code = self._target(side, code)
        changed = self.document.do(ClearPoint(side, code))
        self.set_active(Active(side, code))
        return changed

    def mark_unseen(self, *, side: Side | str | None = None, code: str | None = None) -> bool:
        """Say that a feature cannot be seen, and go on to the next."""
        side, code = self._target(side, code)
        changed = self.document.do(MarkUnseen(side, code, self.document.provenance(How.UNSEEN)))
        self._last = Active(side, code)
        self._go_on(side, code)
        return changed

    @property
    def annotated(self) -> Active | None:
        """The point that `annotate` takes: the active one, or while that is to do the one placed last."""
        state = self.document.state
        for point in (self._active, self._last):
            if point is not None and point.code and state.landmark(point.side, point.code).decided:
                return point
        return None

    def annotate(
        self,
        certainty: str | None = None,
        note: str | None = None,
        *,
        side: Side | str | None = None,
        code: str | None = None,
    ) -> bool:
        """Say how certain a point is, or note what was seen; None leaves it, empty text removes it.

        Without `code`, it is the point of `annotated`.
        """
        if code is None and (point := self.annotated) is not None:
            side, code = point.side, point.code
        side, code = self._target(side, code)
        return self.document.do(AnnotatePoint(side, code, certainty, note))

    def skip(self) -> None:
        """Leave the active point for later; it comes again after the others."""
        self._go_to_next(self.active)

    def choose(self, side: Side | str, code: str) -> None:
        """Make a point active and move the crosshair to it, or to where it is expected; CO only shows."""
        side = Side.parse(side)
        if not feature(code).computed:
            self.set_active(Active(side, code))
        where = self.place_of(side, code)
        if where is not None:
            self._view.set_crosshair(where)

    def go_to(self, side: Side | str, code: str) -> None:
        """Choose a point, and bring it, or where it is suggested or expected, into view in every view."""
        self.choose(side, code)
        if self.place_of(Side.parse(side), code) is not None:
            self._view.show_point(self._view.crosshair)

    def look_closely(self, side: Side | str, code: str) -> None:
        """Choose a point, and show it, or where it is suggested or expected, closely enough to judge it."""
        self.choose(side, code)
        if self.place_of(Side.parse(side), code) is not None:
            self._view.look_closely(self._view.crosshair)

    def swap(self, side: Side, code: str, other: str) -> None:
        """Exchange two points of a side, and say which suggestions that drops."""
        swap = SwapPoints(side, code, other)
        told = swap.dropped_text(self.document.state)
        if self.document.do(swap) and told:
            self._messages.say(told, "warning")

    def lock(self, locked: bool = True, *, side: Side | str | None = None, code: str | None = None) -> bool:
        """Lock a point against change, or unlock it."""
        return self.document.do(LockPoints((self._target(side, code),), locked))

    def lock_all(self, locked: bool = True) -> bool:
        """Lock every point that is placed or not seen, or unlock all."""
        codes = [f.code for f in FEATURES if not f.computed]
        placed_or_unseen = [
            (side, code)
            for side in Side
            for code in codes
            if self.document.state.landmark(side, code).decided
        ]
        points = [
            (side, code)
            for side, code in placed_or_unseen
            if not (feature(code).shared and side is Side.RIGHT)
        ]
        return bool(points) and self.document.do(LockPoints(tuple(points), locked))

    def place_of(self, side: Side, code: str) -> FloatArray | None:
        """Return where a point is to be looked at, (3,) mm: where it is placed, suggested or expected."""
        landmarks, ghosts = self.document.landmarks(side), self.ghosts(side)
        if code in landmarks:
            return landmarks[code]
        if code in landmarks.suggested:
            return np.array(landmarks.suggested[code].position)
        return ghosts[code].position if code in ghosts else None

    # Inside

    def _suggest(self, side: Side, suggestions: Mapping[str, Suggestion]) -> bool:
        changed = self.document.do(SuggestPoints(side, suggestions, self.document.provenance(How.GHOST)))
        active = self.active
        if active.side is side and active.code is not None and active.code in suggestions:
            self._go_on(side, active.code)
        return changed

    def _target(self, side: Side | str | None, code: str | None) -> tuple[Side, str]:
        side = self.active.side if side is None else Side.parse(side)
        if code is None:
            code = self.active.code
        if code is None:
            raise GpError("no feature is chosen", remedy="Choose one in the table.")
        return side, feature(code).code

    def _go_on(self, side: Side, code: str) -> None:
        """After an edit of the active point, make the next one active, if the user wants that."""
        if self._view.state.auto_advance and self.active == Active(side, code):
            self._go_to_next(self.active)

    def _go_to_next(self, after: Active) -> None:
        """Make the next point active, and show where it is expected: a suggestion from close by."""
        upcoming = next_point(self.document.state, after, self.ghosts)
        self.set_active(upcoming)
        where = None if upcoming.code is None else self.place_of(upcoming.side, upcoming.code)
        if where is None or not self._view.state.follow_ghost:
            return
        if upcoming.code in self.document.landmarks(upcoming.side).suggested:
            self._view.look_closely(where)
        else:
            self._view.set_crosshair(where)

    def _begin(self) -> None:
        self._active = next_point(self.document.state, Active(Side.LEFT), self.ghosts)
        self.document.focus = self._active

    def _on_reset(self) -> None:
        self._last = None
        self.release()
        self._begin()
        self._check_again()

    def _on_labelling(self) -> None:
        """Begin at the first feature, and forget the problems of the labelling before."""
        self._checks = LabelChecks(self._checks.check, self._checks.measure)
        self._last = None
        self._begin()
        self.active_changed.emit(self._active)
        self._check_again()

    def _on_expectations(self) -> None:
        self.expect(self._atlas.predict, self._atlas.check)
        self._check_again()

    def _on_scan(self, _: object) -> None:
        """Check the labels by this scan, and by its bone as it is now."""
        self._checks = LabelChecks(self._checks.check, self._scan.evidence)
        self._check_again()

    def _on_landmarks(self, changed: frozenset[tuple[Side, str]]) -> None:
        self._check({side for side, _ in changed}, after=_DRAWN_FIRST_S)

    def _on_focus(self, focus: object) -> None:
        if isinstance(focus, Active):
            self.set_active(focus)

    def _check_again(self) -> None:
        """Check all labels, unless an atlas that will be asked instead is being fitted."""
        if not self._atlas.is_refitting:
            self._check(Side, after=0.0)

    def _check(self, sides: Iterable[Side], *, after: float) -> None:
        """Find the problems of some sides in the background."""
        for side in sides:
            done = partial(self._take_checked, bool(self.known_problems(side)))
            self._jobs.submit(self.checking(side), done, key=f"checking {side.value}", after=after)

    def _take_checked(self, showed_problems: bool, found: SideCheck) -> None:
        self.checked.emit()
        if showed_problems or found.problems:
            self.problems_changed.emit()  # else all points look as they did
