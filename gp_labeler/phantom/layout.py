"""Where things lie in one animal's head: its landmarks, and places of the mean head carried over to it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from gp_core.atlas.atlas import Atlas
from gp_core.atlas.sampling import mean_animal
from gp_core.landmarks.features import CODES, Side
from gp_core.landmarks.sets import Specimen
from gp_core.registration.procrustes import fit_rigid
from gp_core.validation import FloatArray

__all__ = ["Ear", "HeadLayout", "unit"]

_REACH_MM = 8.0
"""How far around a landmark the animal's own deviation from the mean head is felt."""


def unit(vector: ArrayLike) -> FloatArray:
    """Return a vector (3,) of length 1."""
    v = np.asarray(vector, dtype=np.float64)
    return np.asarray(v / np.linalg.norm(v))


class HeadLayout:
    """Carries places from the mean head to one animal's.

    Places in the mean head are (left, anterior, up) in mm from the middle between the two cochlea origins,
    cheek teeth level: the numbers in which the anatomy of the phantom is written down.

    Parameters
    ----------
    specimen : Specimen
        All 20 features on both sides, frame ``scan``.
    atlas : Atlas
        The atlas that the mean head is made of.
    """

    def __init__(self, specimen: Specimen, atlas: Atlas) -> None:
        self.specimen = specimen
        mean = _all_points(mean_animal(atlas))
        own = _all_points(specimen)
        self.scale = _spread(own) / _spread(mean)
        fit = fit_rigid(self.scale * mean, own, dst="scan", src="scan")
        self.rotation, self.shift = fit.transform.rotation, fit.transform.translation
        self._anchors = mean
        kernel = _kernel(mean, mean)
        self._weights = np.linalg.solve(kernel, own - self.roughly(mean))

    def roughly(self, points: FloatArray) -> FloatArray:
        """Carry (n, 3) LPS places of the mean head over by size and pose alone."""
        return self.scale * points @ self.rotation.T + self.shift

    def at(self, places: ArrayLike) -> FloatArray:
        """Carry (..., 3) places (left, anterior, up) over; the mean landmarks come to the animal's own."""
        points = np.asarray(places, dtype=np.float64) * (1.0, -1.0, 1.0)
        flat = points.reshape(-1, 3)
        moved = self.roughly(flat) + _kernel(flat, self._anchors) @ self._weights
        return moved.reshape(points.shape)

    def mean_place(self, point: FloatArray) -> FloatArray:
        """Return where in the mean head a (3,) scan position lies by size and pose: left, anterior, up."""
        place: FloatArray = (point - self.shift) @ self.rotation / self.scale * (1.0, -1.0, 1.0)
        return place

    @cached_property
    def snout_shift(self) -> FloatArray:
        """(3,) mm of the mean head: how far this animal's IN is from the mean one after size and pose."""
        own = self.mean_place(self.specimen.side(Side.LEFT)["IN"])
        shift: FloatArray = own - self._anchors[-1] * (1.0, -1.0, 1.0)
        return shift

    def semi_axes(self, lateral: float, anterior: float, up: float) -> FloatArray:
        """Return the rows of three semi-axes (3, 3) along the axes of the head, mm of the mean head."""
        lengths = self.scale * np.array([lateral, anterior, up])
        axes: FloatArray = lengths[:, None] * self.rotation.T
        return axes

    @cached_property
    def ears(self) -> tuple[Ear, Ear]:
        """The left and the right side."""
        return Ear(self, Side.LEFT), Ear(self, Side.RIGHT)


@dataclass(frozen=True)
class Ear:
    """One side of the head, in which places are written as on a left side."""

    head: HeadLayout
    side: Side

    def __getitem__(self, code: str) -> FloatArray:
        """Return the (3,) position of a landmark, scan frame."""
        return self.head.specimen.side(self.side)[code]

    @property
    def sign(self) -> float:
        """1 on the left, -1 on the right."""
        return 1.0 if self.side is Side.LEFT else -1.0

    def at(self, *places: ArrayLike) -> FloatArray:
        """Carry places (lateral, anterior, up) of the mean head over: (3,) for one, (n, 3) for several."""
        points = np.array(places, dtype=np.float64) * (self.sign, 1.0, 1.0)
        moved = self.head.at(points)
        return moved[0] if len(places) == 1 else moved

    def towards(self, lateral: float, anterior: float, up: float) -> FloatArray:
        """Return a unit direction (3,) in the axes of the scan."""
        return unit([self.sign * lateral, -anterior, up])


def _all_points(specimen: Specimen) -> FloatArray:
    """Return the points of both sides, IN and the computed CO once or not at all."""
    placed = [code for code in CODES if code not in ("CO", "IN")]
    left, right = specimen.side(Side.LEFT), specimen.side(Side.RIGHT)
    return np.concatenate([left.array(placed), right.array(placed), left.array(["IN"])])


def _spread(points: FloatArray) -> float:
    return float(np.linalg.norm(points - points.mean(axis=0)))


def _kernel(points: FloatArray, others: FloatArray) -> FloatArray:
    kernel: FloatArray = np.exp(-np.linalg.norm(points[:, None] - others, axis=2) / _REACH_MM)
    return kernel
