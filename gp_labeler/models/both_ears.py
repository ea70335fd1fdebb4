"""The two ears of a specimen that were touched in one frame: how they agree, and one axis of both."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gp_core.errors import GpError
from gp_core.landmarks.features import feature
from gp_core.pose.both_ears import FEWEST_PAIRS, EarComparison, compare_ears
from gp_labeler.models.estimate import SideEstimate

__all__ = ["BothEars", "compare_sides"]

_METHOD = "robust"
"""The method that knows names, and its own errors."""


@dataclass(frozen=True, eq=False)
class BothEars:
    """What the two ears of a specimen say of each other.

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

    def joined(self, own: SideEstimate) -> SideEstimate:
        """Return an estimate with the axis of both ears, where they agree; else the estimate itself."""
        if self.comparison is None or not self.comparison.check.agrees:
            return own
        return replace(own, poses={**own.poses, _METHOD: self.comparison.fused(own.side)})


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
    touched = own.touches.extra.keys() | other.touches.extra.keys()
    midline = [name for name in own.settings.midline if name in touched]
    try:
        found = compare_ears(
            own.touches, own.poses[_METHOD], other.touches, other.poses[_METHOD], midline=midline
        )
    except GpError as error:
        return replace(nothing, problem=str(error))
    return replace(nothing, comparison=found)
