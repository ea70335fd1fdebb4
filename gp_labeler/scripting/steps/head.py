"""Steps that straighten the head, and turn it by hand."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from gp_core.errors import GpError
from gp_labeler.models.head import FREE_POINTS
from gp_labeler.scripting.step import Step, Triple
from gp_labeler.scripting.window_driver import WindowDriver

__all__ = ["StraightenHead", "TurnHead"]

_WAYS = ("symmetry", "landmarks", "points")


@dataclass(frozen=True)
class StraightenHead(Step):
    """Find how the head lies in its scan, and turn the views into its frame. Positions stay the scan's.

    Parameters
    ----------
    by : str
        ``symmetry`` of the bone, placed ``landmarks`` of both sides, or three ``points``.
    midline, left, right : three numbers, optional
        The points, scan mm: one of the midline, and the same place on both sides.
    near : three numbers, optional
        In a scan of several heads, a point in the one that is meant, scan mm; for ``symmetry``.
    like : str, optional
        Specimen file of a straightened head, which says which way is front and up, and the pitch; for
        ``symmetry``. By default the synthetic guinea pig does.
    left_confirmed : bool
        Whether left is known to be left as the file says; nothing in a scan can prove it.
    """

    do: ClassVar[str] = "straighten"
    says: ClassVar[tuple[str, ...]] = ("by",)
    by: str = "symmetry"
    midline: Triple | None = None
    left: Triple | None = None
    right: Triple | None = None
    near: Triple | None = None
    like: str | None = None
    left_confirmed: bool = False

    def __post_init__(self) -> None:
        """Refuse another way, and points that are missing or not asked for, before any step runs."""
        if self.by not in _WAYS:
            raise GpError(f"straighten: by must be one of {', '.join(_WAYS)}, got {self.by!r}")
        given = [name for name in FREE_POINTS if getattr(self, name) is not None]
        if self.by == "points" and len(given) < len(FREE_POINTS):
            raise GpError("straighten: by = 'points' needs midline, left and right")
        if self.by != "points" and given:
            raise GpError(f"straighten: {given[0]} is for by = 'points'")
        for name in ("near", "like"):
            if self.by != "symmetry" and getattr(self, name) is not None:
                raise GpError(f"straighten: {name} is for by = 'symmetry'")

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        head = driver.workspace.head
        before = head.frame
        if self.by == "symmetry":
            head.straighten(self.near, like=None if self.like is None else driver.to_read(self.like))
        elif self.by == "landmarks":
            head.straighten_by_landmarks()
        else:
            for name in FREE_POINTS:
                head.mark_point(name, getattr(self, name))
        driver.wait_until_idle()
        if head.frame is None or (head.refusal and head.frame is before):
            raise GpError(head.refusal or "the head was not straightened")
        if self.left_confirmed and head.asks_left:
            head.confirm_left()
        return f"found by {head.frame.found_by}; pitch: {head.frame.pitch}"


@dataclass(frozen=True)
class TurnHead(Step):
    """Turn the head's frame by hand about its own axes, through the crosshair.

    Parameters
    ----------
    pitch, roll, yaw : float
        Degrees, right-handed about left, posterior and superior; done in this order.
    """

    do: ClassVar[str] = "turn_head"
    pitch: float = 0.0
    roll: float = 0.0
    yaw: float = 0.0

    def run(self, driver: WindowDriver) -> None:  # noqa: D102
        for name in ("pitch", "roll", "yaw"):
            angle = getattr(self, name)
            if angle:
                driver.workspace.head.turn(name, math.radians(angle))
        driver.wait_until_idle(in_passing=False)
