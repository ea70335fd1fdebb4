"""Rulers and angles: named distances and angles between free points of a scan."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from gp_core.errors import GpError

__all__ = ["ANGLE", "KINDS", "LINE", "Measurement", "free_name"]

LINE, ANGLE = "line", "angle"
KINDS = {LINE: 2, ANGLE: 3}
"""Kinds of measurement, and how many points each has."""

_WORDS = {LINE: "Ruler", ANGLE: "Angle"}
_LONGEST_NAME = 60
_SAME_PLACE_MM = 1e-9


@dataclass(frozen=True)
class Measurement:
    """A distance between two points, or the angle at the second of three points.

    Parameters
    ----------
    name : str
        Names it in lists and files; one line of text.
    points : sequence of (3,) positions
        Two (a line) or three (an angle, its vertex in the middle), in mm, in the frame of the scan (LPS).

    Raises
    ------
    GpError
        The name is empty or too long, the points are not two or three finite positions, or an arm has no
        length.
    """

    name: str
    points: tuple[tuple[float, float, float], ...]

    def __post_init__(self) -> None:
        name = " ".join(str(self.name).split())
        if not name or len(name) > _LONGEST_NAME or not name.isprintable():
            raise GpError(
                f"a measurement needs a name of 1 to {_LONGEST_NAME} characters, got {self.name!r:.80}",
                remedy="Such as Ruler 1.",
            )
        object.__setattr__(self, "name", name)
        try:
            points = tuple(self.points)
        except TypeError:
            raise GpError(f"the points of {name} must be positions, got {self.points!r:.60}") from None
        object.__setattr__(self, "points", tuple(_position(point, name) for point in points))
        if len(self.points) not in KINDS.values():
            raise GpError(
                f"{name} must have two points (a ruler) or three (an angle), got {len(self.points)}"
            )
        if min(self.arms_mm) < _SAME_PLACE_MM:
            raise GpError(f"two points of {name} are at the same place", remedy="Choose two places.")

    @property
    def kind(self) -> str:
        """``line`` or ``angle``."""
        return LINE if len(self.points) == KINDS[LINE] else ANGLE

    @property
    def arms_mm(self) -> tuple[float, ...]:
        """Distances from each point to the next, mm."""
        arms = np.linalg.norm(np.diff(np.array(self.points), axis=0), axis=1)
        return tuple(arms.tolist())

    @property
    def length_mm(self) -> float:
        """Distance from the first point to the second, mm."""
        return self.arms_mm[0]

    @property
    def angle(self) -> float | None:
        """Angle at the second point, rad, 0 to pi; None for a line."""
        if self.kind == LINE:
            return None
        first, vertex, last = np.array(self.points)
        one, other = first - vertex, last - vertex  # exact also near 0 and pi, where the arc cosine is not
        return math.atan2(float(np.linalg.norm(np.cross(one, other))), float(one @ other))

    @property
    def value_text(self) -> str:
        """The value with its unit, such as ``4.31 mm`` or ``87.2°``."""
        angle = self.angle
        return f"{self.length_mm:.2f} mm" if angle is None else f"{math.degrees(angle):.1f}°"


def free_name(kind: str, taken: Iterable[str]) -> str:
    """Return the first of ``Ruler 1``, ``Ruler 2``, … (or ``Angle 1``, …) that is not taken.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    taken : iterable of str
        Names in use.

    Returns
    -------
    str
        A name that is not among them.
    """
    names = set(taken)
    return next(name for n in range(1, len(names) + 2) if (name := f"{_WORDS[kind]} {n}") not in names)


def _position(point: object, name: str) -> tuple[float, float, float]:
    try:
        x, y, z = (float(value) for value in point)  # type: ignore[attr-defined]
    except (TypeError, ValueError, OverflowError):
        x = y = z = math.nan
    if not all(map(math.isfinite, (x, y, z))):
        raise GpError(f"each point of {name} must be three finite numbers in mm, got {point!r:.60}")
    return x, y, z
