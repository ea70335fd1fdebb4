"""Evidence from the scan on labels: their distance from bone. It is measured by `gp_labeler`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from gp_core.argument_types import checks_arguments
from gp_core.errors import GpError
from gp_core.frames import RigidTransform
from gp_core.validation import FloatArray

__all__ = ["ScanEvidence"]

_SAME_PLACE_MM = 1e-6

Position = tuple[float, float, float]


@dataclass(frozen=True)
class ScanEvidence:
    """Evidence from the scan on the labels of one side.

    Attributes
    ----------
    bone_distances : mapping of str to float
        Distance of each placed feature from the nearest bone, mm; 0 in bone, infinite where there is none.
    tolerance : float
        Permitted distance of a bony feature from bone, mm: a voxel, or 0.3 mm.
    outside : frozenset of str
        Features that lie outside the scan.
    positions : mapping of str to (3,) tuple
        Position of each feature when it was measured, mm, in the frame of the labels.
    threshold : float or None
        Grey value of the bone surface.
    """

    bone_distances: Mapping[str, float]
    tolerance: float
    outside: frozenset[str] = frozenset()
    positions: Mapping[str, Position] = field(default_factory=dict)
    threshold: float | None = None

    @checks_arguments
    def of(self, points: Mapping[str, FloatArray]) -> ScanEvidence | None:
        """Return the evidence that still holds: of points that are where they were measured.

        Parameters
        ----------
        points : mapping of str to (3,) array
            Present positions, mm, in the frame of the labels.

        Returns
        -------
        ScanEvidence or None
            None where nothing holds.
        """
        kept = {
            code
            for code, place in self.positions.items()
            if code in points and code in self.bone_distances
            if np.abs(points[code] - place).max() < _SAME_PLACE_MM
        }
        if not kept:
            return None
        distances = {code: away for code, away in self.bone_distances.items() if code in kept}
        positions = {code: place for code, place in self.positions.items() if code in kept}
        return replace(self, bone_distances=distances, positions=positions, outside=self.outside & kept)

    @checks_arguments
    def measured_at(self, points: Mapping[str, FloatArray]) -> ScanEvidence:
        """Return the evidence as one that was measured at some positions.

        Parameters
        ----------
        points : mapping of str to (3,) array
            Where the features were then, mm, in the frame of the labels.

        Returns
        -------
        ScanEvidence
            The same distances, with these positions.
        """
        measured = {code: place for code, place in points.items() if code in self.bone_distances}
        return replace(self, positions={code: _position(at.tolist()) for code, at in measured.items()})

    @checks_arguments
    def moved(self, T_dst_src: RigidTransform) -> ScanEvidence:
        """Return the evidence for labels that were moved as a whole into another frame.

        Parameters
        ----------
        T_dst_src : RigidTransform
            From the frame of the labels.

        Returns
        -------
        ScanEvidence
            In the frame `dst`.
        """
        places = {code: T_dst_src.apply(np.array([place]))[0] for code, place in self.positions.items()}
        return replace(self, positions={code: _position(place.tolist()) for code, place in places.items()})

    def as_json(self) -> dict[str, Any]:
        """Return the evidence as a file holds it; a distance is null where no bone was found.

        Returns
        -------
        dict
            Plain values for JSON, mm.
        """
        points = {
            code: {
                "distance": self.bone_distances[code] if math.isfinite(self.bone_distances[code]) else None,
                "outsideScan": code in self.outside,
                "position": list(place),
            }
            for code, place in self.positions.items()
        }
        return {"limit": self.tolerance, "threshold": self.threshold, "points": points}

    @classmethod
    def from_json(cls, content: Any) -> ScanEvidence:
        """Build the evidence from the content of a file.

        Parameters
        ----------
        content : object
            As `as_json` returns it.

        Returns
        -------
        ScanEvidence
            In the frame of the file.

        Raises
        ------
        GpError
            The content has another form.
        """
        try:
            points = content["points"]
            return cls(
                {code: _distance(point["distance"]) for code, point in points.items()},
                _distance(content["limit"]),
                frozenset(code for code, point in points.items() if point.get("outsideScan", False)),
                {code: _position(point["position"]) for code, point in points.items()},
                None if content.get("threshold") is None else _number(content["threshold"]),
            )
        except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
            raise GpError(f"no distances from bone: {error}") from None


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) < math.inf:
        raise ValueError(f"not a finite number: {value!r:.40}")
    try:
        return float(value)
    except OverflowError:
        raise ValueError("a number too large") from None


def _distance(value: object) -> float:
    distance = math.inf if value is None else _number(value)
    if distance < 0:
        raise ValueError(f"a negative distance: {distance:g}")
    return distance


def _position(value: object) -> Position:
    x, y, z = (_number(number) for number in value)  # type: ignore[attr-defined]
    return x, y, z
