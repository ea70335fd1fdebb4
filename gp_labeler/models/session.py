"""The one holder of changing state, which the window, the offscreen script and plain Python all drive."""

from __future__ import annotations

import getpass
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike
from psygnal import Signal

from gp_core.atlas.label_check import Finding
from gp_core.landmarks.features import CODES, Side
from gp_core.validation import FloatArray
from gp_labeler.document.edits import as_position
from gp_labeler.document.history import History
from gp_labeler.document.specimen_document import EditedSpecimen, utc_now
from gp_labeler.document.state import SpecimenState, measured, point_key
from gp_labeler.document.store import Keeper
from gp_labeler.models.ghosts import Expectations, Ghost, Predict
from gp_labeler.models.label_checks import Check, CheckLabels, LabelChecks, Measure
from gp_labeler.models.view import View
from gp_labeler.models.workflow import (
    Active,
    PointState,
    Progress,
    click_text,
    next_point,
    point_state,
    progress,
)

__all__ = ["Session"]


class Session(EditedSpecimen):
    """What one user does with one specimen: the specimen itself, and what the user attends to.

    Make one with `opening.new_session`, `open_session` or `recover_session`; with this constructor where
    nothing need be kept on disk. `labelling` has what clicks and keys do.

    Parameters
    ----------
    state : SpecimenState or History, optional
        To begin with; an empty specimen by default.
    keeper : Keeper, optional
        What keeps it safe on disk.
    saved : SpecimenState, optional
        What is saved, where that is not where it stands.
    predict : callable, optional
        The atlas, for ghosts; see `ghosts.Predict`.
    check : callable, optional
        The checker, for doubts; see `label_checks.Check`.
    author : str, optional
        Who labels; by default the name the user is logged in with.
    clock : callable
        Returns the time as ISO 8601 text.
    """

    active_changed = Signal(Active)
    crosshair_changed = Signal(object)
    """The crosshair, (3,) mm in the scan frame."""
    ghosts_changed = Signal()
    """The atlas behind ghosts and doubts; they also follow the landmarks, without this signal."""

    def __init__(
        self,
        state: SpecimenState | History[SpecimenState] | None = None,
        *,
        keeper: Keeper | None = None,
        saved: SpecimenState | None = None,
        predict: Predict | None = None,
        check: Check | None = None,
        author: str | None = None,
        clock: Callable[[], str] = utc_now,
    ) -> None:
        history = state if isinstance(state, History) else History(state or SpecimenState())
        super().__init__(history, keeper or Keeper(), saved=saved, clock=clock)
        self.author = _user() if author is None else author
        self.view = View()
        self.notices: tuple[str, ...] = ()
        """What the user should be told once, now that this session is open."""
        self._expectations, self._checks = Expectations(predict), LabelChecks(check)
        self._crosshair: FloatArray = _read_only([0.0, 0.0, 0.0])
        self._active = next_point(self.state, Active(Side.LEFT), self.ghosts)

    @property
    def active(self) -> Active:
        """What the next click places."""
        return self._active

    @property
    def crosshair(self) -> FloatArray:
        """(3,) mm, scan frame."""
        return self._crosshair

    @property
    def click_text(self) -> str:
        """What the next click does, in words."""
        return click_text(self.state, self.active)

    def ghosts(self, side: Side) -> Mapping[str, Ghost]:
        """Return where the points to do of one side are expected."""
        return self._expectations.ghosts(self.landmarks(side), self.landmarks(side.other))

    def doubts(self, side: Side) -> Mapping[str, Finding]:
        """Return what is doubted of the points of one side, by feature; this may take some 50 ms."""
        return self._checks.found(self.landmarks(side)).doubts

    def is_other_side(self, side: Side) -> bool:
        """Whether one side is known to be labelled under the name of the other; at once, see `judging`."""
        return any(doubt.kind == "other side" for doubt in self.near_doubts(side).values())

    def near_doubts(self, side: Side) -> Mapping[str, Finding]:
        """Return `doubts` as far as they can be told at once."""
        return self._checks.near_doubts(self.landmarks(side))

    def judging(self, side: Side) -> CheckLabels:
        """Return the job that checks one side as it stands, for `point_states` to know its doubts."""
        return CheckLabels(self._checks, self.landmarks(side))

    def point_states(self, side: Side, *, wait: bool = True) -> dict[str, PointState]:
        """Return how far every feature of one side is, in the table's order.

        Without `wait`, doubts are `near_doubts`: run `judging`, then ask again.
        """
        ghosts = self.ghosts(side)
        doubts = self.doubts(side) if wait else self.near_doubts(side)
        return {code: point_state(self.state, side, code, ghosts=ghosts, doubts=doubts) for code in CODES}

    def progress(self, side: Side) -> Progress:
        """Return how many of the 20 points of one side are done."""
        return progress(self.state, side)

    def set_active(self, active: Active) -> None:
        """Choose what the next click places; raises `FeatureError` for CO, which nobody places."""
        if active.code is not None:
            active = Active(Side.parse(active.side), point_key(active.side, active.code)[1])
        if active != self._active:
            self._active = active
            self.active_changed.emit(active)

    def set_crosshair(self, position: ArrayLike) -> None:
        """Move the crosshair to a (3,) position, mm, scan frame."""
        crosshair = _read_only(as_position(position, "crosshair"))
        if not np.array_equal(crosshair, self._crosshair):
            self._crosshair = crosshair
            self.crosshair_changed.emit(crosshair)

    def set_predict(self, predict: Predict | None, check: Check | None = None) -> None:
        """Take another atlas for ghosts and doubts, or none."""
        self._expectations, self._checks = Expectations(predict), LabelChecks(check, self._checks.measure)
        self.ghosts_changed.emit()

    def set_measure(self, measure: Measure | None) -> None:
        """Ask another scan whether labels lie on bone, or none."""
        self._checks = LabelChecks(self._checks.check, measure)

    @property
    def measured_state(self) -> SpecimenState:
        """The state as it is saved and exported: with distances from bone, where there is a scan."""
        return measured(self.state, self._checks.measure)

    def close(self, *, discard: bool = False) -> None:
        """Let go of journal, locks and scan; see `EditedSpecimen.close`."""
        super().close(discard=discard)
        self.set_measure(None)  # it asks the scan, and holds it

    def _focus(self) -> object:
        return self._active

    def _return_to(self, focus: object) -> None:
        if isinstance(focus, Active):
            self.set_active(focus)


def _read_only(position: ArrayLike) -> FloatArray:
    array = np.array(position, dtype=np.float64)
    array.setflags(write=False)
    return array


def _user() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError, ImportError):
        return ""
