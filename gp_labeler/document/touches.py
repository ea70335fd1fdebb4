"""Points touched with a probe, as a specimen keeps them: one value for each touch, one set for each side.

Touches of one side share a frame: the tracker's, or the scan's for a dry run on the mesh. They are addressed
by side and name: an external feature, or a skull feature (``S1``, ``S2``, ...) that serves the registration.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from types import MappingProxyType

import numpy as np

from gp_core.errors import FeatureError
from gp_core.landmarks.features import CODES, EXTERNAL, Side
from gp_core.landmarks.labels import tidy_label
from gp_core.landmarks.repeats import combine_repeats
from gp_core.landmarks.sets import LandmarkSet

__all__ = ["Touch", "TouchHow", "TouchKey", "Touches", "frame_of", "touch_name", "touched_set"]

TouchKey = tuple[Side, str]
Touches = Mapping[TouchKey, "Touch"]


class TouchHow(str, Enum):
    """How a touch came to be known."""

    FILE = "file"
    TYPED = "typed"
    TRACKED = "tracked probe"
    SCAN = "placed on the scan"
    SIMULATED = "simulated"


@dataclass(frozen=True)
class Touch:
    """One touched point.

    Parameters
    ----------
    position : (3,) tuple of float
        In the tracker's frame, mm; in the scan's where it was placed on the scan.
    how : TouchHow
    time, by, source : str
        When (ISO 8601, UTC), who, and from which file or device.
    n_samples : int
        Of how many readings of the tracker it is the average.
    spread_mm : float
        Root mean square distance of these from the average, mm.
    left_out : bool
        Whether the estimate does without it.
    earlier : tuple of (3,) tuple of float
        Earlier touches of the same feature that count too, oldest first, in the same frame, mm. The estimate
        takes the mean of all, without outliers.
    """

    position: tuple[float, float, float]
    how: TouchHow = TouchHow.TYPED
    time: str = ""
    by: str = ""
    source: str = ""
    n_samples: int = 1
    spread_mm: float = 0.0
    left_out: bool = False
    earlier: tuple[tuple[float, float, float], ...] = ()

    @property
    def positions(self) -> tuple[tuple[float, float, float], ...]:
        """All touches of the feature, the last one last."""
        return (*self.earlier, self.position)

    @property
    def frame(self) -> str:
        """``scan`` or ``tracker``."""
        return "scan" if self.how is TouchHow.SCAN else "tracker"


def touch_name(name: str) -> str:
    """Return the name of something that can be touched, as it is kept.

    Raises
    ------
    FeatureError
        The feature is inside the bone, or the name is empty.
    """
    text = tidy_label(name)
    if text in CODES and text not in EXTERNAL:
        raise FeatureError(
            f"{text} is inside the bone and cannot be touched",
            landmark=text,
            remedy=f"Touch any of {' '.join(EXTERNAL)}.",
        )
    if not text:
        raise FeatureError("a touch needs the name of a feature", remedy=f"For example {EXTERNAL[0]}.")
    return text


def frame_of(touches: Touches, side: Side) -> str:
    """Return the frame of one side's touches; ``tracker`` where there is none yet."""
    return next((touch.frame for (of, _), touch in touches.items() if of is side), "tracker")


def touched_set(touches: Touches, side: Side) -> LandmarkSet:
    """Return one side's touches that count: features as landmarks, skull features in `extra`."""
    counted = {name: t for (of, name), t in touches.items() if of is side and not t.left_out}
    repeats = combine_repeats({name: t.positions for name, t in counted.items() if t.earlier})
    places = {name: repeats[name].mean if name in repeats else t.position for name, t in counted.items()}
    features = {name: position for name, position in places.items() if name in CODES}
    skull = {name: np.array(position) for name, position in places.items() if name not in CODES}
    landmarks = LandmarkSet.from_mapping(features, side, frame=frame_of(touches, side))
    return replace(landmarks, extra=MappingProxyType(skull), repeats=repeats)
