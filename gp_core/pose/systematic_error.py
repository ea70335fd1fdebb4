"""Systematic errors: errors that all touches share, and animals unlike the atlas; they widen the region.

Independent touch errors average out and show in the residuals; an error that all touches share does neither.
A tip that was calibrated wrongly, soft tissue under the tip, a reference marker that drifted or was knocked:
each moves all touches of a session by nearly the same offset. Its size cannot be estimated from the touches;
the user gives it as the *shared error*, the RMS length of that offset. It moves the whole pose. The part of
such an error that differs from touch to touch shows as noise, which the fit estimates.

Likewise for an animal of unusual size: an atlas of a few adult animals hardly knows how much the size of
guinea pigs varies. A scale factor with a wide prior is therefore estimated, and what the touches show of it
beyond chance widens the region. Where touches carry times, a linear drift is treated in the same way.

With a shared error of 0 nothing of this is added: animals are then assumed to be like those of the atlas, and
touch errors to be independent.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gp_core.atlas.atlas import Atlas
from gp_core.constants import CHI2_3_95
from gp_core.errors import GpError
from gp_core.registration.named_points import NamedFit
from gp_core.validation import FloatArray

__all__ = ["DEFAULT_SHARED_ERROR_MM", "OUTLIER_SQUARED_SHARED", "SystematicError"]

DEFAULT_SHARED_ERROR_MM = 0.2
"""RMS length of the offset of a well calibrated probe on a well fixed reference, mm."""

_LARGEST_MM = 20.0

_SIZE_SCATTER = 0.06
"""Standard deviation of the size of animals beyond the variation in an atlas, as a factor."""

_CHANCE = 3.0
"""Squared Mahalanobis distance of the size that animals of an atlas ordinarily reach."""

OUTLIER_SQUARED_SHARED = 5.0

_DRIFT_SQUARED = 11.344866730144373
"""Chi-squared with 3 degrees of freedom that 1 of 100 ordinary sessions exceeds."""

_ENOUGH_FOR_DRIFT = 5
"""Number of touches from which on a drift can be distinguished from an unusual animal."""

_FLOOR_MM = {3: 0.2, 4: 0.15}
"""Smallest noise assumed, mm per coordinate: so few touches leave too few residuals to estimate it."""


@dataclass(frozen=True)
class SystematicError:
    """What is added to the region of a pose beyond independent touch errors.

    Parameters
    ----------
    shared_error : float
        RMS length of one offset that all touches of a session share, mm, in the frame of the touches. 0
        switches off everything in this module.
    elapsed : sequence of float, optional
        When each touch was made, s, in the order of the model's features.

    Raises
    ------
    GpError
        The shared error is not a number from 0 to 20 mm, or a time is not a number.
    """

    shared_error: float = DEFAULT_SHARED_ERROR_MM
    elapsed: Sequence[float] | None = None

    def __post_init__(self) -> None:
        if not 0 <= self.shared_error <= _LARGEST_MM:
            raise GpError(f"the shared error must be from 0 to {_LARGEST_MM:g} mm, got {self.shared_error!r}")
        if self.elapsed is not None and not all(map(math.isfinite, self.elapsed)):
            raise GpError("the times of touches must be numbers of seconds")

    def noise_floor(self, n_touches: int) -> float:
        """Return the smallest noise that the region is computed with.

        Parameters
        ----------
        n_touches : int
            Number of touches.

        Returns
        -------
        float
            Noise, mm per coordinate.
        """
        return _FLOOR_MM.get(n_touches, 0.0) if self.shared_error > 0 else 0.0

    @property
    def outlier_squared(self) -> float:
        """Squared Mahalanobis distance from which on a touch gets the variance that its deviation shows.

        For ordinary touches it is chi-squared with 3 degrees of freedom: 1 of 20 exceeds the larger value, 1
        of 6 the smaller one, which catches more of the outliers that pull the pose towards themselves.
        """
        return CHI2_3_95 if self.shared_error == 0 else OUTLIER_SQUARED_SHARED

    def covariance(
        self, atlas: Atlas, fit: NamedFit, of_touches: FloatArray, of_shape: FloatArray
    ) -> FloatArray:
        """Return the covariance to be added.

        Parameters
        ----------
        atlas : Atlas
            Mean shape and its variation.
        fit : NamedFit
            Of the touches.
        of_touches : (6, 3 n) array
            Derivative of the pose with respect to the touches.
        of_shape : (6, m) array
            Derivative of the pose error with respect to the animal's shape, for all coordinates of the atlas.

        Returns
        -------
        (6, 6) array
            Of the origin (mm) and of a rotation vector (rad).
        """
        if self.shared_error == 0:
            return np.zeros((6, 6))
        each = self.shared_error**2 / 3
        added = np.zeros((6, 6))
        added[:3, :3] = each * np.eye(3)
        return added + self._nuisances(atlas, fit, of_touches, of_shape)

    def drift(self, fit: NamedFit) -> float | None:
        """Return the drift of the touches from the first to the last, if it exceeds chance.

        It is tested against independent errors and the shape of the animal, with a free pose; 1 of 100
        ordinary sessions exceeds the limit.

        Parameters
        ----------
        fit : NamedFit
            Of the touches.

        Returns
        -------
        float or None
            Length of the drift, mm; None where it may be chance.
        """
        ramp = self._ramp()
        if ramp is None or len(fit.weights) < _ENOUGH_FOR_DRIFT:
            return None
        moved = (ramp[:, None, None] * np.eye(3)).reshape(-1, 3)
        columns = _without_pose(fit, moved)
        weighted = fit.precision[:, None] * columns
        information, score = weighted.T @ columns, weighted.T @ fit.residual
        step = np.linalg.lstsq(information, score, rcond=1e-6)[0]
        return float(np.linalg.norm(step)) if float(score @ step) > _DRIFT_SQUARED else None

    def _nuisances(
        self, atlas: Atlas, fit: NamedFit, of_touches: FloatArray, of_shape: FloatArray
    ) -> FloatArray:
        """Return the effect of the animal's size and of a drift on the pose, as the touches show it."""
        larger = fit.points.ravel() - fit.residual  # displacement of the touched features as the animal grows
        touched, moved = [larger], [of_shape @ atlas.mean.ravel()]
        prior = [_SIZE_SCATTER**2]
        ramp = self._ramp()
        if ramp is not None:
            for axis in np.eye(3):
                touched.append(np.outer(ramp, axis).ravel())
                moved.append(-of_touches @ touched[-1])
                prior.append(self.shared_error**2 / 3)
        columns, effect = np.array(touched).T, np.array(moved).T
        columns = _without_pose(fit, columns)
        spread = np.linalg.inv((fit.precision[:, None] * columns).T @ columns + np.diag(1 / np.array(prior)))
        mean = spread @ (columns.T @ (fit.precision * fit.residual))
        shown = np.zeros((6, 6))
        for block, chance in ((slice(0, 1), _CHANCE), (slice(1, None), 1.0)):
            part = mean[block]
            squared = float(part @ np.linalg.solve(spread[block, block], part)) if part.size else 0.0
            if squared > chance * part.size:  # beyond chance: positive-part James-Stein estimate
                moved_by = effect[:, block] @ part
                shown += (1 - chance * part.size / squared) * np.outer(moved_by, moved_by)
        return shown

    def _ramp(self) -> FloatArray | None:
        """Return the elapsed fraction of the session at each touch, about the mean; None without times."""
        if self.elapsed is None:
            return None
        times = np.array(self.elapsed, dtype=np.float64)
        length = np.ptp(times)
        return None if length == 0 else (times - times.mean()) / length


def _without_pose(fit: NamedFit, columns: FloatArray) -> FloatArray:
    """Return displacements (3 n, m) of the touches with the effect of a pose change projected out."""
    weighted = fit.precision[:, None] * fit.jacobian
    solved = np.linalg.solve(weighted.T @ fit.jacobian, weighted.T @ columns)
    left: FloatArray = columns - fit.jacobian @ solved
    return left
