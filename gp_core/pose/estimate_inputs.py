"""All that an estimate was made from, kept with the pose, so that it can be run again from its file."""

from __future__ import annotations

import platform
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timezone
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from types import MappingProxyType
from typing import Any

import numpy as np

from gp_core.atlas.atlas import Atlas
from gp_core.landmarks.sets import LandmarkSet, Specimen

__all__ = ["EarInputs", "EstimateInputs", "same_touches", "utc_now", "versions_now"]

_PACKAGES = ("gp-labeler", "numpy", "scipy", "numba")


@dataclass(frozen=True, eq=False)
class EstimateInputs:
    """What `gp_core.estimate_pose` was called with.

    Parameters
    ----------
    touches : LandmarkSet
        The touches, all repeats of a feature among them, mm, in the frame of the pose.
    method, round_window, probe_noise, shared_error, times
        As for `gp_core.estimate_pose`.
    atlas : Atlas or None
        The atlas itself; None where JRMPC had only labelled animals.
    specimens : tuple of Specimen
        The labelled animals of JRMPC; empty for the robust method, whose atlas is all that it needs.
    source : str
        The file of the touches; empty where they came from elsewhere.
    versions : mapping of str to str
        Of the packages and of Python, and the machine's processor and system.
    other_ear : EarInputs or None
        The other ear of the head, with which the estimate was compared or combined.
    """

    touches: LandmarkSet
    method: str
    round_window: str
    probe_noise: float | None
    shared_error: float
    times: Mapping[str, float] | None
    atlas: Atlas | None
    specimens: tuple[Specimen, ...] = ()
    source: str = ""
    versions: Mapping[str, str] = field(default_factory=dict)
    other_ear: EarInputs | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return the inputs as the JSON file of a pose holds them.

        Returns
        -------
        dict
            Plain values for JSON; lengths in mm, times in s.
        """
        touches = self.touches
        return {
            "touches": {
                "frame": touches.frame,
                "points_mm": {**_points(touches), **_extra(touches)},
                "not_seen": sorted(touches.unseen),
                "source": self.source,
            },
            "times_s": None if self.times is None else dict(self.times),
            "settings": {
                "side": touches.side.value,
                "method": self.method,
                "round_window": self.round_window,
                "probe_noise_mm": self.probe_noise,
                "shared_error_mm": self.shared_error,
            },
            "versions": dict(self.versions),
            "atlas": None if self.atlas is None else self.atlas.as_dict(),
            "specimens": [_specimen(animal) for animal in self.specimens],
            "other_ear": None if self.other_ear is None else self._other_ear(self.other_ear),
        }

    def _other_ear(self, ear: EarInputs) -> dict[str, Any]:
        """Return the other ear without its atlas and animals where they are those of this one."""
        content = ear.inputs.as_dict()
        if ear.inputs.atlas is self.atlas:
            del content["atlas"]
        if list(map(id, ear.inputs.specimens)) == list(map(id, self.specimens)):
            del content["specimens"]
        return {
            "inputs": content,
            "midline": list(ear.midline),
            "combined": ear.combined,
            "in_its_frame": ear.in_its_frame,
        }


@dataclass(frozen=True, eq=False)
class EarInputs:
    """The other ear of a head, with which an estimate was compared.

    Parameters
    ----------
    inputs : EstimateInputs
        Of its own estimate.
    midline : tuple of str
        Skull features that lie in the mid-plane; see `gp_core.mirror_plane`.
    combined : bool
        Whether the axis is to be that of both ears, if they agree.
    in_its_frame : bool
        Whether the pose is in the frame of the other ear: that matters where the head moved between them.
    """

    inputs: EstimateInputs
    midline: tuple[str, ...] = ()
    combined: bool = False
    in_its_frame: bool = False


def same_touches(one: LandmarkSet, other: LandmarkSet) -> bool:
    """Whether two sets hold the same touches of the same side, repeats and skull features among them.

    Parameters
    ----------
    one, other : LandmarkSet
        Touches, mm.

    Returns
    -------
    bool
        Equal to the last bit.
    """
    if one is other:
        return True
    here, there = ((each.side, each.frame, _points(each), _extra(each)) for each in (one, other))
    return here == there


def _points(touches: LandmarkSet) -> dict[str, list[list[float]]]:
    """Return all touches of each feature, one row each."""
    return {code: _rows(touches, code, touches[code]) for code in touches.placed}


def _extra(touches: LandmarkSet) -> dict[str, list[list[float]]]:
    return {name: _rows(touches, name, point) for name, point in touches.extra.items()}


def _rows(touches: LandmarkSet, name: str, point: Sequence[float] | np.ndarray) -> list[list[float]]:
    repeated = touches.repeats.get(name)
    rows: list[list[float]] = np.atleast_2d(point if repeated is None else repeated.points).tolist()
    return rows


def _specimen(animal: Specimen) -> dict[str, Any]:
    sides = {
        side.value: {
            "frame": landmarks.frame,
            "points_mm": {code: point.tolist() for code, point in landmarks.as_mapping().items()},
        }
        for side, landmarks in animal.sides.items()
    }
    return {"name": animal.name, "sides": sides}


def utc_now() -> str:
    """Return the time now, ISO 8601 in UTC, with microseconds.

    Returns
    -------
    str
        Such as ``2026-11-30T10:00:00.000000+00:00``.
    """
    return datetime.now(timezone.utc).isoformat(timespec="microseconds")


@cache
def versions_now() -> Mapping[str, str]:
    """Return what this estimate is computed with.

    Returns
    -------
    mapping of str to str
        Versions of packages and of Python; processor and system.
    """
    found = {"python": platform.python_version(), "machine": platform.machine(), "system": sys.platform}
    for name in _PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:  # run from a checkout
            found[name] = "not installed"
    return MappingProxyType(found)
