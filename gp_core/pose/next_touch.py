"""What one more touch would gain: the expected error of the pose after it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from gp_core.argument_types import checks_arguments
from gp_core.atlas.atlas import Atlas
from gp_core.constants import MM_PER_DEGREE
from gp_core.landmarks.anatomy import mirror_right
from gp_core.landmarks.features import EXTERNAL, Side
from gp_core.landmarks.sets import LandmarkSet
from gp_core.pose.both_ears import EarComparison
from gp_core.pose.covariance import cone_95, radius_95
from gp_core.pose.robust import defining_points, pose_covariance, touch_model
from gp_core.pose.systematic_error import DEFAULT_SHARED_ERROR_MM, SystematicError
from gp_core.registration.named_points import NamedFit, TouchModel, fit_named_points

__all__ = ["TouchGain", "gains"]


@dataclass(frozen=True)
class TouchGain:
    """Expected region of the pose once one more feature is touched.

    Attributes
    ----------
    code : str
        The feature.
    radius_95 : float
        95 % radius about the origin with this touch, mm.
    cone_95 : float
        95 % half-angle about the axis with this touch, rad.
    radius_95_now, cone_95_now : float
        The same without it.
    """

    code: str
    radius_95: float
    cone_95: float
    radius_95_now: float
    cone_95_now: float

    @property
    def worth(self) -> float:
        """Expected reduction of the error, mm: of the origin, plus 0.2 mm for each degree of the axis."""
        turn = float(np.degrees(self.cone_95_now - self.cone_95))
        return self.radius_95_now - self.radius_95 + MM_PER_DEGREE * turn


@checks_arguments
def gains(
    touches: LandmarkSet,
    atlas: Atlas,
    *,
    probe_noise: float | None = None,
    shared_error: float = DEFAULT_SHARED_ERROR_MM,
    ears: EarComparison | None = None,
) -> tuple[TouchGain, ...]:
    """Return what each external feature not yet touched would gain, the best first.

    The new touch is assumed to be an ordinary one, where the atlas has the feature; its error and the
    animal's shape propagate linearly through the estimate, as for the region of the pose itself. With an
    atlas of correlated features a touch can do harm, since the estimate weights features independently; its
    worth is then negative.

    Parameters
    ----------
    touches : LandmarkSet
        At least three external features, in any frame, mm.
    atlas : Atlas
        Mean shape and its variation.
    probe_noise : float, optional
        Scale of an ordinary touch error, mm per coordinate; by default estimated from the touches.
    shared_error : float
        As for `gp_core.pose.estimate.estimate_pose`, mm.
    ears : EarComparison, optional
        If the axis is combined with that of the other ear: `gp_core.pose.both_ears.compare_ears` of these
        touches, as the first ear, and of the other one's.

    Returns
    -------
    tuple of TouchGain
        One for each feature.

    Raises
    ------
    FeatureError, GeometryError
        No pose can be estimated from the touches; see `gp_core.pose.robust.estimate_robust`.
    GpError
        The two ears disagree, so that their axes are not combined.

    Examples
    --------
    >>> atlas = Atlas.published()
    >>> touched = {code: atlas[code] for code in ("OS", "RWA", "RWP")}
    >>> gains(LandmarkSet.from_mapping(touched, "L", frame="tracker"), atlas)[0].code
    'IN'
    """
    model = touch_model(touches, atlas, probe_noise)
    fit = fit_named_points(model, mirror_right(touches.array(model.codes), touches.side))
    region = partial(_region, atlas, touches.side, SystematicError(shared_error), ears)
    joined = None if ears is None else ears.fused(touches.side)
    radius, cone = region(model, fit) if joined is None else (joined.plain_radius_95, joined.plain_cone_95)
    found = []
    for code in EXTERNAL:
        if code in atlas.codes and code not in model.codes:
            after = region(*_with_touch(atlas, model, fit, code))
            found.append(TouchGain(code, *after, radius, cone))
    return tuple(sorted(found, key=lambda gain: -gain.worth))


def _region(
    atlas: Atlas,
    side: Side,
    systematic: SystematicError,
    ears: EarComparison | None,
    model: TouchModel,
    fit: NamedFit,
) -> tuple[float, float]:
    """Return radius and cone of the pose of a fit, with the axis of both ears where these are given."""
    defining = defining_points(atlas, model, fit)
    covariance = pose_covariance(atlas, model, fit, defining, side, systematic)
    if ears is not None:
        combined = ears.combined_covariance(side, covariance)
        return radius_95(combined), cone_95(combined, ears.fused(side).axis)
    axis = mirror_right((defining[:1] - defining[1:2]) @ fit.rotation.T, side)[0]
    return radius_95(covariance), cone_95(covariance, axis / np.linalg.norm(axis))


def _with_touch(atlas: Atlas, model: TouchModel, fit: NamedFit, code: str) -> tuple[TouchModel, NamedFit]:
    """Return model and fit with an additional ordinary touch of the feature, at its mean position."""
    point, variance = atlas.rows((code,)), atlas.variances((code,))
    noise = fit.noise**2
    return (
        replace(
            model,
            codes=(*model.codes, code),
            mean=np.vstack([model.mean, point]),
            variances=np.append(model.variances, variance),
            counts=np.append(fit.counts, 1.0),
        ),
        replace(
            fit,
            points=np.vstack([fit.points, point]),
            residual=np.append(fit.residual, np.zeros(3)),
            weights=np.append(fit.weights, 1.0),
            counts=np.append(fit.counts, 1.0),
            precision=np.append(fit.precision, np.repeat(1 / (variance + noise), 3)),
        ),
    )
