"""Errors that touches share, and what else an atlas cannot know: how they widen the region of a pose.

Independent errors of touches average out and show in their residuals; what all touches share does neither.
A tip that was calibrated wrongly, tissue under the tip, a reference marker that drifts or was knocked: each
moves all touches of a session by nearly the same offset. Its size is not found from the touches, it is given,
as the *shared error*: the RMS length of that offset. It carries the whole pose with it; and as no such error
is the same at every touch, part of its variance is taken as different from touch to touch.

The same goes for an animal of unusual size: an atlas of some grown animals hardly says how much the size of
guinea pigs differs. A factor of size with a wide prior is therefore weighed against the touches, and what
they show of it beyond chance widens the region. Where touches carry times, an offset that grows with time is
looked for alike.

With a shared error of 0 none of this is added: then animals are like those behind the atlas, and touches err
independently.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gp_core.atlas.atlas import Atlas
from gp_core.errors import GpError
from gp_core.registration.named_points import NamedFit
from gp_core.validation import FloatArray

__all__ = ["DEFAULT_SHARED_ERROR_MM", "Systematic"]

DEFAULT_SHARED_ERROR_MM = 0.2
"""RMS length of the offset of a well calibrated probe on a well fixed reference, mm."""

_LARGEST_MM = 20.0

_WITHIN = 0.04
"""Part of the variance of the shared error that differs from touch to touch and does not show as noise."""

_SIZE_SCATTER = 0.06
"""Standard deviation of the size of animals beyond those of an atlas, as a factor."""

_CHANCE = 3.0
"""Squared deviations, over their variance, that ordinary animals of an atlas show in their size."""

_ODD_SQUARED, _ODD_SQUARED_SHARED = 7.814727903251179, 5.0

_FLOOR_MM = {3: 0.2, 4: 0.15}
"""Noise, mm a coordinate, that so few touches cannot show: their fit leaves too little over."""


@dataclass(frozen=True)
class Systematic:
    """What is added to the region of a pose beyond independent errors of touches.

    Parameters
    ----------
    shared_error : float
        RMS length of one offset that all touches of a session share, mm, in the frame of the touches. 0:
        none, and nothing else of this module either.
    elapsed : sequence of float, optional
        When each touch was made, s, in the order of the model's features.

    Raises
    ------
    GpError
        The shared error is no number from 0 to 20 mm, or a time is no number.
    """

    shared_error: float = DEFAULT_SHARED_ERROR_MM
    elapsed: Sequence[float] | None = None

    def __post_init__(self) -> None:
        if not 0 <= self.shared_error <= _LARGEST_MM:
            raise GpError(f"the shared error must be from 0 to {_LARGEST_MM:g} mm, got {self.shared_error!r}")
        if self.elapsed is not None and not all(map(math.isfinite, self.elapsed)):
            raise GpError("the times of touches must be numbers of seconds")

    def noise_floor(self, n_touches: int) -> float:
        """Return the least noise, mm a coordinate, that the region of so many touches is made with."""
        return _FLOOR_MM.get(n_touches, 0.0) if self.shared_error > 0 else 0.0

    @property
    def odd_squared(self) -> float:
        """From where on a touch counts as uncertain as it looks: its squared deviation over its variance.

        Of ordinary touches that is chi-square of 3 degrees: 1 of 20 is above the larger value, 1 of 6 above
        the smaller one, which holds more of the mistouches that pull the pose after them.
        """
        return _ODD_SQUARED if self.shared_error == 0 else _ODD_SQUARED_SHARED

    def covariance(
        self, atlas: Atlas, fit: NamedFit, of_touches: FloatArray, of_shape: FloatArray
    ) -> FloatArray:
        """Return the (6, 6) covariance to be added: origin (mm), rotation vector (rad).

        Parameters
        ----------
        atlas : Atlas
        fit : NamedFit
        of_touches : (6, 3 n) array
            How the pose follows the touches.
        of_shape : (6, m) array
            How far a pose is off, by the shape of the animal, all coordinates of the atlas.
        """
        if self.shared_error == 0:
            return np.zeros((6, 6))
        each = self.shared_error**2 / 3
        added = _WITHIN * each * of_touches @ of_touches.T
        added[:3, :3] += each * np.eye(3)
        return added + self._nuisances(atlas, fit, of_touches, of_shape)

    def _nuisances(
        self, atlas: Atlas, fit: NamedFit, of_touches: FloatArray, of_shape: FloatArray
    ) -> FloatArray:
        """Return what the size of the animal and a drift do to the pose, as far as the touches show them."""
        larger = fit.points.ravel() - fit.residual  # how the touched features move as the animal grows
        touched, moved = [larger], [of_shape @ atlas.mean.ravel()]
        prior = [_SIZE_SCATTER**2]
        ramp = self._ramp()
        if ramp is not None:
            for axis in np.eye(3):
                touched.append(np.outer(ramp, axis).ravel())
                moved.append(-of_touches @ touched[-1])
                prior.append(self.shared_error**2 / 3)
        columns, effect = np.array(touched).T, np.array(moved).T
        weighted = fit.precision[:, None] * fit.jacobian
        columns = columns - fit.jacobian @ np.linalg.solve(weighted.T @ fit.jacobian, weighted.T @ columns)
        spread = np.linalg.inv((fit.precision[:, None] * columns).T @ columns + np.diag(1 / np.array(prior)))
        mean = spread @ (columns.T @ (fit.precision * fit.residual))
        shown = np.zeros((6, 6))
        for block, chance in ((slice(0, 1), _CHANCE), (slice(1, None), 1.0)):
            part = mean[block]
            squared = float(part @ np.linalg.solve(spread[block, block], part)) if part.size else 0.0
            if squared > chance * part.size:  # beyond chance: James and Stein's estimate, positive part
                moved_by = effect[:, block] @ part
                shown += (1 - chance * part.size / squared) * np.outer(moved_by, moved_by)
        return shown

    def _ramp(self) -> FloatArray | None:
        """Return how far along its way a drift is at each touch, about the mean; None without times."""
        if self.elapsed is None:
            return None
        times = np.array(self.elapsed, dtype=np.float64)
        length = np.ptp(times)
        return None if length == 0 else (times - times.mean()) / length
