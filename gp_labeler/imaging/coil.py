"""The curve of a coiled cochlea: one for the phantom's duct and for the outline of an estimated pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gp_core.validation import FloatArray

__all__ = ["CAP_MM", "RISE", "TURNS", "Coil"]

CAP_MM = 0.4
"""Bone above the apex, mm."""

_WALL_MM = 0.34
_FIRST_TURN = 0.08

TURNS = (0.0, 1.0, 2.0, 3.0, 3.6)
RISE = (0.13, 0.41, 0.64, 0.83, 0.915)
"""Height of the middle of the duct after so many turns, as a share of CB-CA."""

_DUCT_MM = (0.5, 0.44, 0.37, 0.31, 0.26)
"""Radius of the duct after so many turns."""


@dataclass(frozen=True)
class Coil:
    """How the duct of one cochlea winds about its axis.

    Parameters
    ----------
    length : float
        CB to CA, mm.
    cc, cl : (2,) tuple of float
        Height above CB and distance from the axis of CC and CL, mm: how wide the capsule is there.
    """

    length: float
    cc: tuple[float, float]
    cl: tuple[float, float]

    def radius(self, heights: FloatArray) -> FloatArray:
        """Return the outer radius of the capsule at heights (n,) above CB, mm."""
        from scipy.interpolate import PchipInterpolator  # not before something is drawn: 0.1 s

        (cc_height, cc_radius), (cl_height, cl_radius), h = self.cc, self.cl, self.length
        knots = [
            (-1.4, 1.2),
            (0.1 * h, 2.15),
            (np.clip(cl_height, 0.25 * h, 0.4 * h), min(2.05, cl_radius - 0.22)),
            (np.clip(cc_height, 0.5 * h, 0.72 * h), np.clip(cc_radius, 1.2, 1.5)),
            (0.94 * h, 0.88),
            (h + CAP_MM, 0.0),
        ]
        s, r = np.array(knots).T
        squared = PchipInterpolator(s, r**2)(np.clip(heights, s[0], s[-1]))
        beyond = np.maximum(heights - s[-1], 0) + np.maximum(s[0] - heights, 0)
        return np.asarray(np.sqrt(np.maximum(squared, 0)) - beyond)

    def duct(self, per_turn: int = 32) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return the middle of the duct from base to apex in cylinder coordinates, and its radius.

        Parameters
        ----------
        per_turn : int
            Points a turn.

        Returns
        -------
        height, rho, angle, thick : (n,) float arrays
            Above CB and from the axis, mm; about it from the round window on, rad; radius of the duct, mm.
        """
        turns = np.arange(_FIRST_TURN, TURNS[-1], 1 / per_turn)
        height = np.interp(turns, TURNS, RISE) * self.length
        thick = np.interp(turns, TURNS, _DUCT_MM)
        rho = np.maximum(self.radius(height) - _WALL_MM - thick, 0.1)
        return height, rho, 2 * np.pi * turns, thick
