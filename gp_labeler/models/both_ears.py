"""The two ears of a specimen that were touched in one frame: how they agree, and one axis of both."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gp_core.errors import GpError
from gp_core.landmarks.features import feature
from gp_core.pose.both_ears import EarComparison, compare_ears, not_comparable
from gp_core.pose.cochlea_pose import CochleaPose
from gp_core.pose.estimate import compare_with_other_ear
from gp_core.pose.estimate_inputs import EarInputs
from gp_core.pose.mid_plane import FEWEST_PAIRS
from gp_labeler.models.estimate import SideEstimate

__all__ = ["BothEars", "compare_sides"]

_METHOD = "robust"
"""The method that knows names, and its own errors."""


@dataclass(frozen=True, eq=False)
class BothEars:
    """How the estimates of the two ears of a specimen agree.

    Parameters
    ----------
    own, other : SideEstimate, optional
        Of the side in work, and of the other one.
    comparison : EarComparison, optional
        In the frame of the side in work.
    problem : str
        Why there is none although both were touched.
    """

    own: SideEstimate | None = None
    other: SideEstimate | None = None
    comparison: EarComparison | None = None
    problem: str = ""

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing to say: too little was touched on both sides."""
        return self.comparison is None and not self.problem

    @property
    def is_doubtful(self) -> bool:
        """Whether to look again: the ears contradict each other, or the head moved between them."""
        if self.comparison is None:
            return bool(self.problem)
        link = self.comparison.link
        return not self.comparison.check.agrees or (link is not None and link.has_moved)

    def is_of(self, own: SideEstimate, other: SideEstimate | None) -> bool:
        """Whether it was made of these very estimates."""
        return self.own is own and self.other is other

    def told(self, own: SideEstimate, *, combined: bool) -> SideEstimate:
        """Return an estimate whose poses say how the ears agree, so that none is sent where they do not.

        Parameters
        ----------
        own : SideEstimate
            Of the side in work.
        combined : bool
            Whether the axis is to be that of both ears, where they agree.
        """
        if self.is_empty or self.other is None:
            return own
        other = self.other.poses[_METHOD]
        assert other.inputs is not None
        midline = _midline(own, self.other)
        poses = {
            method: _compared(pose, other, EarInputs(other.inputs, midline, combined and method == _METHOD))
            for method, pose in own.poses.items()
        }
        return replace(own, poses=poses)


def compare_sides(own: SideEstimate, other: SideEstimate | None) -> BothEars:
    """Compare the estimates of two sides of a specimen.

    Parameters
    ----------
    own, other : SideEstimate
        Of the side in work, and of the other one; None where that has too few touches.
    """
    nothing = BothEars(own, other)
    if other is None or _METHOD not in own.poses or _METHOD not in other.poses:
        return nothing
    paired = [code for code in own.touches.placed if code in other.touches and not feature(code).shared]
    if len(paired) < FEWEST_PAIRS or own.touches.frame != other.touches.frame:
        return nothing
    try:
        found = compare_ears(
            own.touches,
            own.poses[_METHOD],
            other.touches,
            other.poses[_METHOD],
            midline=_midline(own, other),
        )
    except GpError as error:
        return replace(nothing, problem=str(error))
    return replace(nothing, comparison=found)


def _midline(own: SideEstimate, other: SideEstimate) -> tuple[str, ...]:
    """Return the chosen skull features of the mid-plane that were touched with either ear."""
    touched = own.touches.extra.keys() | other.touches.extra.keys()
    return tuple(name for name in own.settings.midline if name in touched)


def _compared(pose: CochleaPose, other: CochleaPose, ear: EarInputs) -> CochleaPose:
    try:
        return compare_with_other_ear(pose, ear, other)
    except GpError as problem:
        return not_comparable(pose, ear, problem)
