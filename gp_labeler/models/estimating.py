"""The estimate that follows the touches: settings, atlas, and the `Estimate` that belongs to them now."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from psygnal import Signal

from gp_core.atlas.atlas import Atlas
from gp_core.errors import GpError
from gp_core.frames import RigidTransform
from gp_core.landmarks.features import Side
from gp_core.landmarks.sets import Specimen
from gp_core.pose.cochlea_pose import METHODS, ROUND_WINDOWS
from gp_core.pose.systematic_error import Systematic
from gp_core.validation import check_option
from gp_labeler.document.specimen_edits import RecordPoseCheck
from gp_labeler.document.state import PoseCheck, SpecimenState
from gp_labeler.document.touch_edits import LeaveOutTouch
from gp_labeler.models.estimate import REGISTRATIONS, Estimate, EstimateSettings, apart, make_estimate
from gp_labeler.models.session import Session

__all__ = ["Estimating"]

FEWEST_TOUCHES = 3


@dataclass(frozen=True, eq=False)
class _Made:
    """The estimate that was made last, and what it was made of."""

    state: SpecimenState
    chosen: EstimateSettings
    side: Side
    key: tuple[Any, ...]
    estimate: Estimate | None

    def is_of(self, state: SpecimenState, chosen: EstimateSettings, side: Side) -> bool:
        """Whether nothing at all changed; asked dozens of times a touch."""
        return self.state is state and self.chosen is chosen and self.side is side


class Estimating:
    """Keeps the estimate of one side in step with a session.

    It is computed when it is asked for, and remembered until something it is made of changes. ``jrmpc`` is
    used only once `joint_ready`: the first one on a machine compiles for seconds, which is a job's work.

    Parameters
    ----------
    session : Session
    """

    changed = Signal()
    """Touches, labels, settings or atlas: ask `current` again."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._settings = EstimateSettings()
        self._atlas: Atlas | None = None
        self._specimens: tuple[Specimen, ...] = ()
        self._known: dict[Side, RigidTransform] = {}
        self._made: _Made | None = None
        self.joint_ready = False
        session.touches_changed.connect(self._tell)
        session.landmarks_changed.connect(self._tell)

    # What it is made of

    @property
    def settings(self) -> EstimateSettings:
        """What the user chose."""
        return self._settings

    @property
    def atlas(self) -> Atlas | None:
        """The atlas in use; None until one is loaded."""
        return self._atlas

    def choose(self, **fields: Any) -> None:
        """Change settings, fields of `EstimateSettings`; raises `GpError` for a value that cannot be."""
        settings = replace(self._settings, **fields)
        noise = settings.probe_noise
        if noise is not None and not 0 < noise < 20:
            raise GpError(f"probe noise must lie between 0 and 20 mm, got {noise!r}")
        Systematic(settings.shared_error)  # refuses what cannot be
        for method in settings.methods:
            check_option(method, "method", METHODS)
        check_option(settings.registration, "registration", REGISTRATIONS)
        check_option(settings.round_window, "round window", ROUND_WINDOWS)
        if settings != self._settings:
            self._settings = settings
            self.changed.emit()

    def use_atlas(self, atlas: Atlas, specimens: Sequence[Specimen] = ()) -> None:
        """Take another atlas, with the labelled animals it was fitted to where they are known."""
        self._atlas, self._specimens = atlas, tuple(specimens)
        self._renew()

    def set_joint_ready(self) -> None:
        """Say that JRMPC is compiled."""
        self.joint_ready = True
        self._renew()

    def know_registration(self, side: Side, T_scan_tracker: RigidTransform | None) -> None:
        """Say how the tracker lies to the scan, where that is known otherwise than from points."""
        if T_scan_tracker is None:
            self._known.pop(side, None)
        else:
            self._known[side] = T_scan_tracker
        self._renew()

    # What comes of it

    @property
    def current(self) -> Estimate | None:
        """The estimate of the chosen side; None without an atlas or with fewer than three touches."""
        return self.of_side(self._settings.side)

    @property
    def waiting_text(self) -> str:
        """What is still wanting for an estimate, in words; empty where there is one."""
        n = len(self._session.state.touched(self._settings.side).placed)
        if n < FEWEST_TOUCHES:
            more = FEWEST_TOUCHES - n
            return f"{more} more touch{'' if more == 1 else 'es'} for an estimate"
        return "Loading the atlas" if self._atlas is None else ""

    def of_side(self, side: Side) -> Estimate | None:
        """Return the estimate of a side, as `current` does for the chosen one."""
        state, chosen, made = self._session.state, self._settings, self._made
        if made is not None and made.is_of(state, chosen, side):
            return made.estimate
        settings = replace(chosen, side=side)
        if not self.joint_ready:
            settings = replace(settings, methods=_without_joint(settings.methods))
        key = (state.touches, state.skull, state.landmarks, settings)
        estimate = made.estimate if made is not None and made.key == key else self._make(state, settings)
        self._made = _Made(state, chosen, side, key, estimate)
        return estimate

    def _make(self, state: SpecimenState, settings: EstimateSettings) -> Estimate | None:
        if self._atlas is None or len(state.touched(settings.side).placed) < FEWEST_TOUCHES:
            return None
        known = self._known.get(settings.side)
        return make_estimate(state, settings, self._atlas, self._specimens, known=known)

    def without(self, name: str) -> tuple[float, float] | None:
        """Return by how much the pose moves, mm and degrees, if a touch is left out, or taken in again."""
        current, touch = self.current, self._session.state.touches.get((self._settings.side, name))
        if current is None or current.pose is None or touch is None or name not in current.atlas.codes:
            return None
        state = LeaveOutTouch(current.side, name, not touch.left_out).apply(self._session.state)
        if len(state.touched(current.side).placed) < FEWEST_TOUCHES:
            return None
        settings = replace(current.settings, methods=(current.pose.method,))
        other = make_estimate(state, settings, current.atlas, self._specimens).pose
        mine = current.pose
        return None if other is None else apart(mine.origin, mine.axis, other.origin, other.axis)

    def judge(self, verdict: str, *, by: str = "", note: str = "") -> PoseCheck:
        """Keep a person's verdict on the estimate, ``accept`` or ``reject``, in the specimen.

        Raises
        ------
        GpError
            There is no estimate, or the verdict is another word.
        """
        current = self.current
        if current is None or current.pose is None:
            raise GpError("there is no estimate to judge", remedy=self.waiting_text or None)
        session = self._session
        check = PoseCheck(current.side, verdict, by or session.author, session.now(), note, current.as_dict())
        session.do(RecordPoseCheck(check))
        return check

    def close(self) -> None:
        """Listen no more."""
        self._session.touches_changed.disconnect(self._tell)
        self._session.landmarks_changed.disconnect(self._tell)

    def _renew(self) -> None:
        self._made = None
        self.changed.emit()

    def _tell(self, *_: object) -> None:
        self.changed.emit()


def _without_joint(methods: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(method for method in methods if method != "jrmpc") or ("robust",)
