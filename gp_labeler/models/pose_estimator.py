"""The estimate of a side from its touches: settings, atlas, and the `SideEstimate` that follows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from gp_core.atlas.atlas import Atlas
from gp_core.constants import METHODS
from gp_core.errors import GpError
from gp_core.frames import RigidTransform
from gp_core.landmarks.features import Side
from gp_core.landmarks.labels import is_skull_feature
from gp_core.landmarks.sets import Specimen
from gp_core.pose.cochlea_pose import ROUND_WINDOWS
from gp_core.pose.systematic_error import SystematicError
from gp_core.validation import check_option
from gp_labeler.document.state import SpecimenState
from gp_labeler.document.touch_edits import LeaveOutTouch
from gp_labeler.models.both_ears import BothEars, compare_sides
from gp_labeler.models.estimate import REGISTRATIONS, EstimateSettings, SideEstimate, apart, make_estimate

__all__ = ["PoseEstimator"]

FEWEST_TOUCHES = 3
MOST_TOUCHES_EACH = 9


@dataclass(frozen=True, eq=False)
class _Made:
    """The estimate that was made last, and what it was made of."""

    state: SpecimenState
    chosen: EstimateSettings
    side: Side
    key: tuple[Any, ...]
    estimate: SideEstimate | None

    def is_of(self, state: SpecimenState, chosen: EstimateSettings, side: Side) -> bool:
        """Whether nothing has changed; asked dozens of times for each touch."""
        return self.state is state and self.chosen is chosen and self.side is side


class PoseEstimator:
    """Estimates the cochlea of a side when asked, and remembers it until something it is made of changes.

    ``jrmpc`` is used only once `joint_ready`: the first one on a machine compiles for seconds, which is a
    job's work.
    """

    def __init__(self) -> None:
        self.settings = EstimateSettings()
        self.joint_ready = False
        self._atlas: Atlas | None = None
        self._specimens: tuple[Specimen, ...] = ()
        self._known: dict[Side, RigidTransform] = {}
        self._made: dict[tuple[Side, bool], _Made] = {}
        self._ears: dict[Side, BothEars] = {}
        self._told: dict[Side, tuple[BothEars, SideEstimate]] = {}

    def choose(self, **fields: Any) -> bool:
        """Change settings, fields of `EstimateSettings`; return whether they differ.

        Raises
        ------
        GpError
            A value is not allowed.
        """
        settings = replace(self.settings, **fields)
        noise = settings.probe_noise
        if noise is not None and not 0 < noise < 20:
            raise GpError(f"probe noise must lie between 0 and 20 mm, got {noise!r}")
        SystematicError(settings.shared_error)  # refuses what is not allowed
        if settings.touches_each not in range(1, MOST_TOUCHES_EACH + 1):
            raise GpError(
                f"touches of each feature must be 1 to {MOST_TOUCHES_EACH}, got {settings.touches_each!r}"
            )
        for method in settings.methods:
            check_option(method, "method", METHODS)
        check_option(settings.registration, "registration", REGISTRATIONS)
        check_option(settings.round_window, "round window", ROUND_WINDOWS)
        for name in settings.midline:
            if not is_skull_feature(name):
                raise GpError(
                    f"{name} is no skull feature", remedy="Name touched skull features, such as S1, S4."
                )
        differs = settings != self.settings
        if differs:
            self.settings = settings
        return differs

    def use_atlas(self, atlas: Atlas, specimens: Sequence[Specimen] = ()) -> None:
        """Take another atlas, with the labelled animals it was fitted to where they are known."""
        self._atlas, self._specimens, self._made = atlas, tuple(specimens), {}

    def set_joint_ready(self) -> None:
        """Say that JRMPC is compiled."""
        self.joint_ready, self._made = True, {}

    def set_registration(self, side: Side, T_scan_tracker: RigidTransform | None) -> None:
        """Set the registration of a side, where it is known otherwise than from points; None removes it."""
        self._known.pop(side, None)
        if T_scan_tracker is not None:
            self._known[side] = T_scan_tracker
        self._made = {}

    def forget_registrations(self) -> None:
        """Forget all registrations: another scan was opened."""
        self._known.clear()
        self._made = {}

    def waiting_text(self, state: SpecimenState) -> str:
        """Return what is missing for an estimate, in words; empty where there is one."""
        n = len(state.touched(self.settings.side).placed)
        if n < FEWEST_TOUCHES:
            more = FEWEST_TOUCHES - n
            return f"{more} more touch{'' if more == 1 else 'es'} for an estimate"
        return "Loading the atlas" if self._atlas is None else ""

    def of_side(self, state: SpecimenState, side: Side) -> SideEstimate | None:
        """Return the estimate of a side; None without an atlas or with fewer than three touches.

        Where both ears were touched, its poses say how the two agree; where that is chosen and they do, its
        axis is that of both.
        """
        own = self._own(state, side)
        if own is None:
            return None
        compared, combined = self._compared(state, side, own), self.settings.both_ears
        if compared.is_empty:
            return own
        made = self._told.get(side)
        if made is None or made[0] is not compared:
            made = self._told[side] = compared, compared.told(own, combined=combined)
        return made[1]

    def ears(self, state: SpecimenState, side: Side) -> BothEars | None:
        """Return how the estimates of a side and of the other ear agree; None where that cannot be said."""
        own = self._own(state, side)
        found = None if own is None else self._compared(state, side, own)
        return None if found is None or found.is_empty else found

    def _compared(self, state: SpecimenState, side: Side, own: SideEstimate) -> BothEars:
        other = self._own(state, side.other, plain=True)
        found = self._ears.get(side)
        if found is None or not found.is_of(own, other):
            found = self._ears[side] = compare_sides(own, other)
        return found

    def _own(self, state: SpecimenState, side: Side, *, plain: bool = False) -> SideEstimate | None:
        """Return what a side's own touches say; `plain`, by the robust method alone."""
        chosen, made = self.settings, self._made.get((side, plain))
        if made is not None and made.is_of(state, chosen, side):
            return made.estimate
        settings = replace(chosen, side=side)
        if plain:
            settings = replace(settings, methods=("robust",))
        elif not self.joint_ready:
            settings = replace(settings, methods=_without_joint(settings.methods))
        key = (state.touches, state.skull, state.landmarks, settings)
        estimate = made.estimate if made is not None and made.key == key else self._make(state, settings)
        self._made[side, plain] = _Made(state, chosen, side, key, estimate)
        return estimate

    def without(self, state: SpecimenState, name: str) -> tuple[float, float] | None:
        """Return by how much the pose moves, mm and degrees, if a touch is left out, or taken in again."""
        current = self._own(state, self.settings.side)
        touch = state.touches.get((self.settings.side, name))
        if current is None or current.pose is None or touch is None or name not in current.atlas.codes:
            return None
        state = LeaveOutTouch(current.side, name, not touch.left_out).apply(state)
        if len(state.touched(current.side).placed) < FEWEST_TOUCHES:
            return None
        settings = replace(current.settings, methods=(current.pose.method,))
        other = make_estimate(state, settings, current.atlas, self._specimens).pose
        mine = current.pose
        return None if other is None else apart(mine.origin, mine.axis, other.origin, other.axis)

    def _make(self, state: SpecimenState, settings: EstimateSettings) -> SideEstimate | None:
        if self._atlas is None or len(state.touched(settings.side).placed) < FEWEST_TOUCHES:
            return None
        known = self._known.get(settings.side)
        return make_estimate(state, settings, self._atlas, self._specimens, known=known)


def _without_joint(methods: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(method for method in methods if method != "jrmpc") or ("robust",)
