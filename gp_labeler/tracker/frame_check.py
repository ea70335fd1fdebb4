"""Whether touches still lie in one frame: a reference knocked between two of them moves all later ones.

That cannot be seen in one touch. A feature that is touched again tells it, and so does a jump of the marker.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

__all__ = ["FrameCheck", "RepeatedTouch"]

Place = tuple[float, float, float]
"""Position of a touch, mm: it stays the same where the touch is given another name or side."""

Segment = tuple[int, int]
"""A connection, and a segment of its samples (`Sample.segment`)."""


@dataclass(frozen=True)
class RepeatedTouch:
    """A feature that was touched again.

    Parameters
    ----------
    name : str
        What was touched.
    distance_mm : float
        How far from where it was touched before.
    agrees : bool
        Whether that is near enough to say that nothing has moved.
    time : str
        When it was touched again.
    """

    name: str
    distance_mm: float
    agrees: bool
    time: str


class FrameCheck:
    """Knows which touches are in one frame beyond doubt.

    Touches of one segment are. Those of two are once a feature of the one is touched again in the other, at
    the same place. All this is known for one sitting: until the next the reference may have been moved, so
    the touches of a specimen that is opened again are in doubt until they are touched again.

    Parameters
    ----------
    limit_mm : float
        How far apart two touches of one feature may be.
    """

    def __init__(self, limit_mm: float = 1.0) -> None:
        self.limit_mm = limit_mm
        self.last: RepeatedTouch | None = None
        """The last repeated touch, for telling since when the reference is verified."""
        self._segments: dict[Place, Segment] = {}
        self._joined: dict[Segment, Segment] = {}
        self._broken = 0
        self._now: Segment | None = None

    def follow(self, segment: Segment) -> None:
        """Say in which segment the newest good sample is."""
        self._now = self._with_break(segment)

    def record(
        self, name: str, position: ArrayLike, segment: Segment, before: ArrayLike | None, time: str
    ) -> RepeatedTouch | None:
        """Take a touch, and compare it with the one that it replaces.

        Parameters
        ----------
        name : str
        position, before : (3,) array_like, mm
            This touch, and the one before; None where there was none.
        segment : Segment
        time : str
        """
        mine = self._with_break(segment)
        repeated = None
        if before is not None:
            mm = float(np.linalg.norm(np.asarray(position, float) - np.asarray(before, float)))
            repeated = self.last = RepeatedTouch(name, mm, mm <= self.limit_mm, time)
            earlier = self._segments.get(_place(before))
            if repeated.agrees and earlier is not None:
                self._joined[self._root(earlier)] = self._root(mine)
            elif not repeated.agrees and (earlier is None or self._root(earlier) == self._root(mine)):
                self._broken += 1  # in one frame, and yet elsewhere: something moved that no jump told of
                mine = self._with_break(segment)
        self._segments[_place(position)] = self._now = mine
        return repeated

    def is_doubtful(self, position: ArrayLike) -> bool:
        """Whether a touch may lie in another frame than the newest sample."""
        segment = self._segments.get(_place(position))
        if segment is None:
            return True
        return self._now is not None and self._root(segment) != self._root(self._now)

    def is_unknown(self, position: ArrayLike) -> bool:
        """Whether a touch was not made in this sitting: read from a specimen's file."""
        return _place(position) not in self._segments

    def forget(self) -> None:
        """Begin again: there are no touches any more."""
        self.last = None
        self._segments.clear()
        self._joined.clear()

    def _with_break(self, segment: Segment) -> Segment:
        """Return the segment's name since the last repeated touch that disagreed."""
        return (segment[0] + 1_000_000 * self._broken, segment[1])

    def _root(self, segment: Segment) -> Segment:
        while (parent := self._joined.get(segment, segment)) != segment:
            segment = parent
        return segment


def _place(position: ArrayLike) -> Place:
    x, y, z = np.asarray(position, dtype=np.float64).tolist()
    return x, y, z
