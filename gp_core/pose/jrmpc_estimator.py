"""The paper's estimator: the touched points are registered jointly with the labelled animals by JRMPC."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from gp_core.errors import FeatureError, GpError
from gp_core.frames import RigidTransform
from gp_core.landmarks.anatomy import axis_frame, cochlea_frame, round_window_frame, touched_features
from gp_core.landmarks.features import TRAINING, Side, index_of
from gp_core.landmarks.sets import LandmarkSet, Specimen
from gp_core.pose.cochlea_pose import CochleaPose
from gp_core.registration.jrmpc import ESTIMATION, JrmpcResult, JrmpcSettings, jrmpc
from gp_core.validation import FloatArray

__all__ = ["TrainingSide", "estimate_jrmpc", "register_with_training", "training_sides"]


@dataclass(frozen=True)
class TrainingSide:
    """A labelled side in its own CO frame.

    Parameters
    ----------
    name : str
        The specimen.
    landmarks : LandmarkSet
        In the frame ``cochlea``, mm.
    """

    name: str
    landmarks: LandmarkSet


def training_sides(specimens: Sequence[Specimen], side: Side) -> list[TrainingSide]:
    """Return one side of all specimens, each moved into its own CO frame.

    Parameters
    ----------
    specimens : sequence of Specimen
        Labelled animals.
    side : Side
        Which side.

    Returns
    -------
    list of TrainingSide
        One for each specimen that has this side.

    Raises
    ------
    GpError
        Fewer than two specimens have this side.
    """
    labelled = [s for s in specimens if side in s.sides]
    if len(labelled) < 2:
        raise GpError(
            f"JRMPC needs at least two specimens labelled on the {side.word} side, got {len(labelled)}",
            remedy="Give labelled specimens, or use the robust method, which works with the published atlas.",
        )
    return [TrainingSide(s.name, _in_cochlea_frame(s.side(side))) for s in labelled]


def _in_cochlea_frame(landmarks: LandmarkSet) -> LandmarkSet:
    T_frame_cochlea = cochlea_frame(landmarks)
    points = T_frame_cochlea.inverse().apply(landmarks.points)
    return LandmarkSet(points, landmarks.side, "cochlea").with_point("CO", (0, 0, 0))


def register_with_training(
    training: Sequence[TrainingSide],
    probe: FloatArray,
    *,
    features: Iterable[str] = TRAINING,
    settings: JrmpcSettings = ESTIMATION,
) -> JrmpcResult:
    """Register touched points jointly with the training sides.

    Parameters
    ----------
    training : sequence of TrainingSide
        Labelled sides, CO frame, mm.
    probe : (n, 3) array, mm, RW frame
        Touched points; they are the last set of the result.
    features : iterable of str
        Training features.
    settings : JrmpcSettings
        Of the registration.

    Returns
    -------
    JrmpcResult
        Poses of the training sides, then of the probe.
    """
    codes = tuple(features)
    sets = [_labelled(side, codes) for side in training]
    return jrmpc(
        [*sets, probe],
        max_iterations=settings.max_iterations,
        gamma=settings.gamma,
        epsilon=settings.epsilon,
    )


def _labelled(side: TrainingSide, codes: Iterable[str]) -> FloatArray:
    """Return the features (n, 3) of a training side; an error names its specimen."""
    try:
        return side.landmarks.array(codes)
    except FeatureError as error:
        raise FeatureError(
            error.problem, specimen=side.name, landmark=error.landmark, remedy=error.remedy
        ) from None


def estimate_jrmpc(
    touches: LandmarkSet,
    specimens: Sequence[Specimen] | None,
    *,
    features: Iterable[str] = TRAINING,
    settings: JrmpcSettings = ESTIMATION,
) -> CochleaPose:
    """Estimate the pose of a cochlea as the paper does; see `gp_core.pose.estimate.estimate_pose`.

    Parameters
    ----------
    touches : LandmarkSet
        External features, including RWA, RWP and LLI, mm.
    specimens : sequence of Specimen
        Labelled animals.
    features : iterable of str
        Training features.
    settings : JrmpcSettings
        Of the registration.

    Returns
    -------
    CochleaPose
        Its covariance is the scatter of the registered training animals about their mean; JRMPC does not
        model touch errors.

    Raises
    ------
    GpError
        No specimens, too few of this side, or touches that lack RWA, RWP or LLI.

    References
    ----------
    Usevitch et al., "Estimating the pose of a guinea-pig cochlea without medical imaging", 2021.
    Evangelidis and Horaud, "Joint alignment of multiple point sets with batch and incremental
    expectation-maximization", 2018. https://arxiv.org/abs/1609.01466
    """
    if not specimens:
        raise GpError(
            "JRMPC needs labelled specimens",
            remedy="Give --atlas with landmark files, or use --method robust.",
        )
    training = training_sides(specimens, touches.side)
    codes = touched_features(touches)
    T_touches_window = round_window_frame(touches)
    probe = T_touches_window.inverse().apply(touches.array(codes))
    result = register_with_training(training, probe, features=features, settings=settings)
    T_joint_window = RigidTransform.from_parts(
        result.rotations[-1], result.translations[-1], dst="joint", src="window"
    )
    T_touches_joint = T_touches_window @ T_joint_window.inverse()
    moved = [
        T_touches_joint.apply(side.landmarks.points @ rotation.T + translation)
        for side, rotation, translation in zip(training, result.rotations, result.translations, strict=False)
    ]
    frames = [_pose_frame(points, touches.frame) for points in moved]
    mean = np.mean(moved, axis=0)
    return CochleaPose(
        side=touches.side,
        method="jrmpc",
        atlas=f"{len(training)} specimens",
        transform_to_touches=_pose_frame(mean, touches.frame),
        covariance=_scatter(frames, _pose_frame(mean, touches.frame)),
        residuals=_residuals(touches, codes, mean),
        warnings=(
            "the 95 % regions show the scatter of the labelled animals, not the errors of the touches",
        ),
    )


def _pose_frame(points: FloatArray, frame: str) -> RigidTransform:
    """Return ``T_touches_cochlea`` of points (20, 3), x from CB to CA on both sides."""
    origin, apex, base, *window = (points[index_of(code)] for code in ("CO", "CA", "CB", "RWA", "RWP"))
    return axis_frame(origin, apex - base, np.mean(window, axis=0) - origin, dst=frame, src="cochlea")


def _scatter(frames: Sequence[RigidTransform], mean: RigidTransform) -> FloatArray:
    """Return the (6, 6) covariance of the animals' cochlea frames about the mean one."""
    from scipy.spatial.transform import Rotation  # slow to load, and the study needs the rest of this module

    shifts = np.array([frame.translation - mean.translation for frame in frames])
    turns = [Rotation.from_matrix(frame.rotation @ mean.rotation.T).as_rotvec() for frame in frames]
    deviations = np.hstack([shifts, turns])
    covariance: FloatArray = deviations.T @ deviations / (len(frames) - 1)
    return covariance


def _residuals(touches: LandmarkSet, codes: Sequence[str], mean: FloatArray) -> dict[str, float]:
    return {code: float(np.linalg.norm(touches[code] - mean[index_of(code)])) for code in codes}
