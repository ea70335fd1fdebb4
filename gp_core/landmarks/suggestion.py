"""A suggestion: the expected position of a landmark that no person has confirmed yet."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from gp_core.argument_types import checks_arguments
from gp_core.errors import GpError
from gp_core.frames import RigidTransform

__all__ = ["Suggestion"]


@dataclass(frozen=True)
class Suggestion:
    """A suggested position of one landmark; not an observation.

    Parameters
    ----------
    position : (3,) array_like
        In mm, in the frame of the landmark set that holds it; kept as a tuple of three floats.
    radius_95 : float, optional
        Radius in mm that holds the landmark with 95 % probability; None where it is not known.
    source : str
        What suggests it: ``atlas``, ``mirror``, the name of a program, ...
    atlas_distance : float, optional
        Distance in mm from where the atlas expects it; None where the atlas does not disagree.
    doubtful : bool
        Whether what suggests it says that it needs a closer look than the others.

    Raises
    ------
    GpError
        The position is not three finite numbers, or a distance is not a positive number.
    """

    position: tuple[float, float, float]
    radius_95: float | None = None
    source: str = ""
    atlas_distance: float | None = None
    doubtful: bool = False

    def __post_init__(self) -> None:
        try:
            x, y, z = (float(value) for value in self.position)
        except (TypeError, ValueError, OverflowError):
            x = y = z = math.nan
        if not all(map(math.isfinite, (x, y, z))):
            raise GpError(
                f"a suggested position must be three finite numbers in mm, got {self.position!r}",
                remedy="Leave out the suggestion.",
            )
        object.__setattr__(self, "position", (x, y, z))
        if self.radius_95 is not None:
            object.__setattr__(self, "radius_95", _positive(self.radius_95, "95 % radius"))
        if self.atlas_distance is not None:
            distance = _positive(self.atlas_distance, "distance from the atlas")
            object.__setattr__(self, "atlas_distance", distance)
        object.__setattr__(self, "doubtful", bool(self.doubtful))

    @property
    def uncertainty(self) -> tuple[float, float]:
        """What suggestions are sorted by: the radius or the distance from the atlas, the larger one, mm.

        Infinite without a radius; then, how far the atlas disagrees.
        """
        radius, away = self.radius_95, self.atlas_distance or 0.0
        return (math.inf if radius is None else max(radius, away)), away

    @checks_arguments
    def moved(self, T_dst_src: RigidTransform) -> Suggestion:
        """Return the suggestion in another frame.

        Parameters
        ----------
        T_dst_src : RigidTransform
            From the frame of the suggestion.

        Returns
        -------
        Suggestion
            In the frame `dst`.
        """
        x, y, z = T_dst_src.apply(np.array([self.position]))[0].tolist()
        return replace(self, position=(x, y, z))


def _positive(value: object, what: str) -> float:
    try:
        length = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        length = math.nan
    if not (math.isfinite(length) and length > 0):
        raise GpError(
            f"the {what} of a suggestion must be a positive number of mm, got {value!r}",
            remedy="Leave it out where it is not known.",
        )
    return length
