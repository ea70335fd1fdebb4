"""Estimate the pose of a cochlea: the one function for both methods."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from numpy.typing import ArrayLike

from gp_core.argument_types import checks_arguments, checks_arguments_but
from gp_core.atlas.atlas import Atlas
from gp_core.atlas.fitting import fit_atlas
from gp_core.constants import METHODS
from gp_core.errors import GpError
from gp_core.extensions import Extensions
from gp_core.landmarks.features import Side
from gp_core.landmarks.plausible_size import check_plausible_size
from gp_core.landmarks.repeats import repeat_warnings
from gp_core.landmarks.sets import LandmarkSet, Specimen
from gp_core.pose.both_ears import compared_as, not_comparable
from gp_core.pose.cochlea_pose import ROUND_WINDOWS, CochleaPose
from gp_core.pose.estimate_inputs import EarInputs, EstimateInputs, utc_now, versions_now
from gp_core.pose.hypothesis_check import hypothesis_warnings
from gp_core.pose.jrmpc_estimator import estimate_jrmpc
from gp_core.pose.robust import estimate_robust
from gp_core.pose.systematic_error import DEFAULT_SHARED_ERROR_MM
from gp_core.pose.touched_window import towards_touched_window
from gp_core.validation import check_option

__all__ = [
    "ESTIMATORS",
    "EstimatorInput",
    "compare_with_other_ear",
    "estimate_again",
    "estimate_from",
    "estimate_pose",
]


@checks_arguments_but("touches")
def estimate_pose(
    touches: Mapping[str, ArrayLike] | LandmarkSet,
    side: Side | str,
    atlas: Atlas | None = None,
    *,
    method: str = "robust",
    specimens: Sequence[Specimen] | None = None,
    probe_noise: float | None = None,
    round_window: str = "touched",
    shared_error: float = DEFAULT_SHARED_ERROR_MM,
    times: Mapping[str, float] | None = None,
) -> CochleaPose:
    """Estimate the pose of a cochlea from a few touched features, with no CT.

    Parameters
    ----------
    touches : mapping of str to (3,) or (n, 3) array_like, or LandmarkSet
        Position of each touched feature in the tracker's frame, mm; three or more, not collinear. A feature
        that was touched n times may have all its touches: their mean is used, without outliers, and the error
        of the mean is 1 / sqrt(n) of that of a touch. Skull features (``S1``, ...) may be among them; no pose
        is estimated from these.
    side : {"L", "R"}
        Side of the head.
    atlas : Atlas, optional
        By default fitted to `specimens`, or else the published one. With ``jrmpc`` it judges side and names
        only, which JRMPC cannot.
    method : {"robust", "jrmpc"}, or one that an installed package adds
        ``robust`` uses the names of the points; ``jrmpc`` is the paper's method and needs `specimens`.
    specimens : sequence of Specimen, optional
        Labelled animals.
    probe_noise : float, optional
        Scale of an ordinary touch error, mm per coordinate; by default estimated from the touches.
    round_window : {"touched", "expected"}
        What y of the frame points to: the middle of the touched RWA and RWP, as for the authors' robot, where
        both are touched and fit; or that of the fitted atlas, which is more accurate where touches are rough.
        Origin and axis are the same.
    shared_error : float
        RMS length of one offset common to all touches of the session, mm, in the frame of the touches: from
        the covariance of the pivot calibration, the tracker's data sheet, soft tissue under the tip. It
        widens the regions and does not change the estimate. With 0, touch errors are assumed independent, and
        animals like those of the atlas.
    times : mapping of str to float, optional
        When each feature was touched, s. Where all have a time, a drift over the session is estimated.

    Returns
    -------
    CochleaPose
        In the frame of the touches.

    Raises
    ------
    GpError
        No pose can be estimated from the touches, or the method lacks what it needs.

    Examples
    --------
    >>> atlas = Atlas.published()
    >>> touched = {code: atlas[code] for code in ("CL", "LLI", "MN", "OS", "RWA", "RWP")}
    >>> pose = estimate_pose(touched, "L")
    >>> pose.suspects, bool(abs(pose.origin).max() < 1e-6)
    ((), True)
    """
    if method not in METHODS:
        check_option(method, "method", ESTIMATORS.names())
    check_option(round_window, "round window", ROUND_WINDOWS)
    landmarks = touches if isinstance(touches, LandmarkSet) else _as_landmarks(touches, side)
    if landmarks.side is not Side.parse(side):
        raise GpError(f"the touches are of the {landmarks.side.word} side, not the {Side.parse(side).word}")
    check_plausible_size(landmarks, strict=True)
    if method != "jrmpc":
        atlas, specimens = atlas or _default_atlas(specimens), None
    given = EstimatorInput(landmarks, atlas, specimens, probe_noise, shared_error, times)
    pose = _estimated(method, given)
    repeats = {name: one for name, one in landmarks.repeats.items() if name in pose.residuals}
    if repeats:
        pose = replace(pose, repeats=repeats, warnings=(*pose.warnings, *repeat_warnings(repeats)))
    inputs = EstimateInputs(
        touches=landmarks,
        method=method,
        round_window=round_window,
        probe_noise=probe_noise,
        shared_error=shared_error,
        times=times,
        atlas=atlas,
        specimens=tuple(specimens or ()),
        versions=dict(versions_now()),
    )
    pose = replace(pose, stamp=utc_now(), inputs=inputs)
    return pose if round_window == "expected" else towards_touched_window(pose, landmarks)


@checks_arguments
def estimate_again(pose: CochleaPose) -> CochleaPose:
    """Estimate a pose again from all that it was made from, as its file holds it.

    Parameters
    ----------
    pose : CochleaPose
        Of this session, or from `gp_core.read_pose`.

    Returns
    -------
    CochleaPose
        Equal to the last bit on the same machine, and to 1e-9 on another; its stamp is the time now.

    Raises
    ------
    GpError
        The pose does not hold what it was made from: its file is of an earlier version.

    Examples
    --------
    >>> atlas = Atlas.published()
    >>> pose = estimate_pose({code: atlas[code] for code in ("CL", "MN", "OS", "RWA", "RWP")}, "L")
    >>> bool((estimate_again(pose).transform == pose.transform).all())
    True
    """
    made = pose.inputs
    if made is None:
        raise GpError(
            "the pose does not contain the touches and the atlas from which it was estimated",
            remedy="Its file is of an earlier version: estimate it from the file of touches.",
        )
    return estimate_from(made)


def estimate_from(inputs: EstimateInputs) -> CochleaPose:
    """Estimate the pose of a cochlea from all that a pose file holds.

    Parameters
    ----------
    inputs : EstimateInputs
        Touches, atlas and settings.

    Returns
    -------
    CochleaPose
        As `estimate_pose`, with the same source; compared or combined with the other ear, where the inputs
        hold one.

    Raises
    ------
    GpError
        As `estimate_pose`.
    """
    pose = estimate_pose(
        inputs.touches,
        inputs.touches.side,
        inputs.atlas,
        method=inputs.method,
        specimens=inputs.specimens or None,
        probe_noise=inputs.probe_noise,
        round_window=inputs.round_window,
        shared_error=inputs.shared_error,
        times=inputs.times,
    )
    assert pose.inputs is not None
    pose = replace(pose, inputs=replace(pose.inputs, source=inputs.source))
    if inputs.other_ear is None:
        return pose
    try:
        return compare_with_other_ear(pose, inputs.other_ear)
    except GpError as problem:
        return not_comparable(pose, inputs.other_ear, problem)


def compare_with_other_ear(
    pose: CochleaPose, ear: EarInputs, other: CochleaPose | None = None
) -> CochleaPose:
    """Return a pose compared with the other ear, and combined with it where that is asked and the two agree.

    The ears of a JRMPC pose are compared by the robust method, as its side and names are: the regions of
    JRMPC do not cover the errors of touches.

    Parameters
    ----------
    pose : CochleaPose
        An estimate, with what it was made from.
    ear : EarInputs
        The other ear, and how the two are compared.
    other : CochleaPose, optional
        The estimate of the other ear; by default it is made.

    Returns
    -------
    CochleaPose
        With the finding as its `other_ear`.

    Raises
    ------
    GpError
        The ears cannot be compared, see `gp_core.compare_ears`, or axes of JRMPC are to be combined.
    """
    assert pose.inputs is not None
    if pose.method == "jrmpc" and ear.combined:
        raise GpError("axes of both ears are combined by the robust method only", remedy="Choose robust.")
    own = pose if pose.method != "jrmpc" else estimate_from(_by_names(pose.inputs))
    told = compared_as(own, other or estimate_from(_by_names(ear.inputs)), ear)
    if own is pose:
        return told
    return replace(pose, other_ear=told.other_ear, inputs=replace(pose.inputs, other_ear=ear))


def _by_names(inputs: EstimateInputs) -> EstimateInputs:
    """Return the inputs of the same touches for the method that knows names."""
    return replace(inputs, method="robust" if inputs.method == "jrmpc" else inputs.method, other_ear=None)


@dataclass(frozen=True)
class EstimatorInput:
    """What an estimator gets.

    Parameters
    ----------
    touches : LandmarkSet
        The touches, mm, in their own frame.
    atlas : Atlas or None
        The atlas; None only for ``jrmpc``.
    specimens : sequence of Specimen or None
        Labelled animals, for ``jrmpc`` alone: the others get an atlas that was fitted to them.
    probe_noise : float or None
        Scale of an ordinary touch error, mm per coordinate, where it is known.
    shared_error : float
        RMS length of the offset common to all touches, mm.
    times : mapping of str to float, or None
        When each feature was touched, s.
    """

    touches: LandmarkSet
    atlas: Atlas | None = None
    specimens: Sequence[Specimen] | None = None
    probe_noise: float | None = None
    shared_error: float = DEFAULT_SHARED_ERROR_MM
    times: Mapping[str, float] | None = None


def _robust(given: EstimatorInput) -> CochleaPose:
    assert given.atlas is not None
    return estimate_robust(
        given.touches,
        given.atlas,
        probe_noise=given.probe_noise,
        shared_error=given.shared_error,
        times=given.times,
    )


def _jrmpc(given: EstimatorInput) -> CochleaPose:
    pose = estimate_jrmpc(given.touches, given.specimens)
    return _with_hypotheses(pose, given.touches, given.atlas, given.specimens)


ESTIMATORS: Extensions[Callable[[EstimatorInput], CochleaPose]] = Extensions(
    "gp_labeler.estimators", {"robust": _robust, "jrmpc": _jrmpc}
)
"""The methods, those of installed packages among them."""


def _estimated(method: str, given: EstimatorInput) -> CochleaPose:
    if not ESTIMATORS.is_added(method):
        return ESTIMATORS.get(method)(given)
    try:
        pose = ESTIMATORS.get(method)(given)
    except Exception as error:
        raise ESTIMATORS.failure(method, error) from error
    if not isinstance(pose, CochleaPose):
        raise GpError(
            f"{ESTIMATORS.described(method)} gave no CochleaPose", remedy="Report this to its authors."
        )
    return replace(pose, method=method)


def _as_landmarks(touches: Mapping[str, ArrayLike], side: Side | str) -> LandmarkSet:
    if not isinstance(touches, Mapping):
        raise GpError(
            f"touches must be a mapping of names to points, or a LandmarkSet, got {type(touches).__name__}",
            remedy="Read a file of touches with read_touches.",
        )
    return LandmarkSet.from_touches(touches, side, frame="tracker")


def _with_hypotheses(
    pose: CochleaPose, touches: LandmarkSet, atlas: Atlas | None, specimens: Sequence[Specimen] | None
) -> CochleaPose:
    """Return JRMPC's pose with what the robust method finds of side and names, which JRMPC cannot judge."""
    try:
        named = estimate_robust(touches, atlas or _atlas_of_names(specimens))
    except GpError:  # they stay unchecked, so this pose is not for a robot
        return pose
    return replace(
        pose,
        side_state=named.side_state,
        names_state=named.names_state,
        swapped=named.swapped,
        probability=named.probability,
        hypotheses=named.hypotheses,
        warnings=(*hypothesis_warnings(named), *pose.warnings),
    )


def _atlas_of_names(specimens: Sequence[Specimen] | None) -> Atlas:
    try:
        return _default_atlas(specimens)
    except GpError:  # too few animals for an atlas, though enough for JRMPC
        return Atlas.published()


def _default_atlas(specimens: Sequence[Specimen] | None) -> Atlas:
    return _fitted(tuple(specimens)) if specimens else Atlas.published()


def _fitted(specimens: tuple[Specimen, ...]) -> Atlas:
    """Fit an atlas once to the same animals, in a row: each touch of a session asks for it again."""
    for animals, atlas in _LAST_FITTED:
        if len(animals) == len(specimens) and all(map(operator.is_, animals, specimens)):
            return atlas
    atlas = fit_atlas(specimens)
    _LAST_FITTED[:] = [(specimens, atlas)]
    return atlas


_LAST_FITTED: list[tuple[tuple[Specimen, ...], Atlas]] = []
