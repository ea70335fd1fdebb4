"""The result of a rigid registration of touched points to a scan, and the error to expect at a target."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gp_core.argument_types import checks_arguments
from gp_core.frames import RigidTransform
from gp_core.stats import NORMAL_95, chi_square_share
from gp_core.validation import FloatArray, as_points, freeze_arrays

__all__ = ["RegistrationResult"]

_FEW = 6


@dataclass(frozen=True)
class RegistrationResult:
    """A rigid registration of touched points to a scan.

    Attributes
    ----------
    T_scan_tracker : RigidTransform
        From the touched points to the scan; its own frames are those that were asked for.
    names : tuple of str
        The registered points.
    residuals_mm : dict of str to float
        Distance between each registered point and its target, mm.
    fre_mm : float
        Fiducial registration error: root mean square of the residuals, without those of the suspects.
    suspects : tuple of str
        Points that contradict the others. Registration by names excludes them from the transform.
    fiducials : (n, 3) array
        The target points that determined the transform, in the scan, mm.
    method : str
        ``names``, ``icp`` or ``surface``.
    """

    T_scan_tracker: RigidTransform
    names: tuple[str, ...]
    residuals_mm: dict[str, float]
    fre_mm: float
    suspects: tuple[str, ...] = ()
    fiducials: FloatArray = field(default_factory=lambda: np.empty((0, 3)), repr=False)
    method: str = "names"

    def __post_init__(self) -> None:
        freeze_arrays(self)

    @property
    def fle_mm(self) -> float:
        """Expected error of one point (fiducial localisation error, root mean square), mm.

        The errors of both lists together. The fit absorbs part of it: FLE^2 = FRE^2 n / (n - 2).
        """
        n = len(self.fiducials)
        return float(self.fre_mm * np.sqrt(n / (n - 2)))

    @property
    def fle_95_mm(self) -> float:
        """Upper 95 % confidence bound of `fle_mm`, mm; far above it where points are few.

        The sum of squared residuals is chi-squared with 3 n - 6 degrees of freedom; the Wilson-Hilferty
        quantile (1931, doi:10.1073/pnas.17.12.684) is slightly conservative for three points.
        """
        freedom = 3 * len(self.fiducials) - 6
        return float(self.fle_mm / chi_square_share(freedom, -NORMAL_95) ** 0.5)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to know before using the registration."""
        found = [f"{name} does not fit the other points: left out" for name in self.suspects]
        n = len(self.fiducials)
        if n < _FEW:
            factor = self.fle_95_mm / self.fle_mm if self.fle_mm else 1.0
            found.append(
                f"only {n} points: a wrong one cannot be detected, and the true error may well be "
                f"{factor:.1f} times the expected one"
                if factor > 1
                else f"only {n} points: a wrong one cannot be detected"
            )
        return tuple(found)

    @checks_arguments
    def tre_mm(self, points: ArrayLike) -> FloatArray:
        """Return the expected target registration error (root mean square) at points of the scan.

        TRE^2(r) = FLE^2 / n (1 + 1/3 sum_k d_k^2 / f_k^2), with d_k the distance of the target from the
        k-th principal axis of the fiducials, and f_k the root mean square distance of the fiducials from it.
        Errors are assumed independent and isotropic.

        Parameters
        ----------
        points : (N, 3) array_like, mm, scan frame
            The targets.

        Returns
        -------
        (N,) array, mm
            TRE at each target.

        Raises
        ------
        GpError
            `points` is not of shape (N, 3), or not finite.

        References
        ----------
        Fitzpatrick, West and Maurer, "Predicting error in rigid-body point-based registration", IEEE TMI
        17(5), 1998. https://doi.org/10.1109/42.736021
        """
        return self.fle_mm * self._tre_over_fle(points)

    @checks_arguments
    def tre_95_mm(self, points: ArrayLike) -> FloatArray:
        """Return `tre_mm` with FLE at its upper 95 % confidence bound, `fle_95_mm`.

        Parameters
        ----------
        points : (N, 3) array_like, mm, scan frame
            The targets.

        Returns
        -------
        (N,) array, mm
            TRE at each target.
        """
        return self.fle_95_mm * self._tre_over_fle(points)

    def _tre_over_fle(self, points: ArrayLike) -> FloatArray:
        """Return TRE / FLE at each point."""
        targets = as_points(points, "targets")
        centre = self.fiducials.mean(axis=0)
        _, _, axes = np.linalg.svd(self.fiducials - centre, full_matrices=False)
        of_fiducials, of_targets = (
            _squared_from_axes(cloud - centre, axes) for cloud in (self.fiducials, targets)
        )
        ratio: FloatArray = np.sqrt(
            (1 + (of_targets / of_fiducials.mean(axis=0)).sum(axis=1) / 3) / len(of_fiducials)
        )
        return ratio

    def as_dict(self) -> dict[str, Any]:
        """Return the registration as the JSON file holds it.

        Returns
        -------
        dict
            Plain values for JSON; lengths in mm.
        """
        transform = self.T_scan_tracker
        return {
            "gpRegistration": 1,
            "destination": transform.dst,
            "source": transform.src,
            "transform": transform.matrix.tolist(),
            "fre_mm": self.fre_mm,
            "fle_mm": self.fle_mm,
            "fle_95_mm": self.fle_95_mm,
            "residuals_mm": self.residuals_mm,
            "suspect": list(self.suspects),
            "warnings": list(self.warnings),
        }


def _squared_from_axes(vectors: FloatArray, axes: FloatArray) -> FloatArray:
    """Return the squared distance (N, 3) of each vector from each of the lines along three unit axes."""
    along = (vectors @ axes.T) ** 2
    squared: FloatArray = along.sum(axis=1, keepdims=True) - along
    return squared
