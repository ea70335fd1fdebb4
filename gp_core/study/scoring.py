"""Errors of an estimated cochlea, as the paper defines them, for both methods."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gp_core.atlas.atlas import Atlas
from gp_core.constants import MM_PER_DEGREE
from gp_core.frames import angle_between_deg
from gp_core.landmarks.features import index_of
from gp_core.landmarks.sets import LandmarkSet
from gp_core.pose.robust import locate_robust
from gp_core.registration.jrmpc import JrmpcSettings, jrmpc_batch
from gp_core.validation import FloatArray, freeze_arrays

__all__ = ["PoseErrors", "angle_between_deg", "jrmpc_errors", "robust_errors", "touched"]

_CO, _CA = index_of("CO"), index_of("CA")


@dataclass(frozen=True)
class PoseErrors:
    """Errors of B estimates.

    Attributes
    ----------
    e_co_mm : (B,) array
        Distance between the estimated and the true cochlea origin.
    e_ma_deg : (B,) array
        Angle between the estimated and the true modiolar axis.
    """

    e_co_mm: FloatArray
    e_ma_deg: FloatArray

    def __post_init__(self) -> None:
        freeze_arrays(self)

    @property
    def e_t(self) -> float:
        """Total error E_T, the sum of 0.2 E_MA (degrees) + E_CO (mm)."""
        return float(np.sum(MM_PER_DEGREE * self.e_ma_deg + self.e_co_mm))

    @classmethod
    def joined(cls, parts: Sequence[PoseErrors]) -> PoseErrors:
        """Concatenate the errors of several lists of estimates.

        Parameters
        ----------
        parts : sequence of PoseErrors
            The lists.

        Returns
        -------
        PoseErrors
            In the same order.
        """
        return cls(
            np.concatenate([part.e_co_mm for part in parts]),
            np.concatenate([part.e_ma_deg for part in parts]),
        )


def jrmpc_errors(
    training: FloatArray,
    touches: FloatArray,
    truth: FloatArray,
    features: Sequence[str],
    settings: JrmpcSettings,
) -> PoseErrors:
    """Register touches with training sides by JRMPC and measure the errors in the joint frame.

    The estimate is the mean CO of the training sides after registration, and the direction from it to their
    mean CA.

    Parameters
    ----------
    training : (B, M, 20, 3) array, mm
        All points of the M training sides, each in its own CO frame, CO at the origin.
    touches : (B, p, 3) array, mm
        The p points that the probe reports, in the RW frame built on them.
    truth : (B, 20, 3) array, mm
        The true points of the same sides, in the same frame.
    features : sequence of str
        Which of the training points take part.
    settings : JrmpcSettings
        Of the registration.

    Returns
    -------
    PoseErrors
        B errors, mm and degrees.
    """
    rows = [index_of(code) for code in features]
    n_problems, n_sets = training.shape[:2]
    known = training[:, :, rows].reshape(n_problems, -1, 3)
    problems = np.concatenate([known, touches], axis=1)
    result = jrmpc_batch(problems, [len(rows)] * n_sets + [touches.shape[1]], settings)
    ends = np.concatenate([training[:, :, [_CO, _CA]], truth[:, None, [_CO, _CA]]], axis=1)
    moved = np.einsum("bmij,bmkj->bmki", result.rotations, ends) + result.translations[:, :, None]
    origin, apex = moved[:, :-1].mean(axis=1).swapaxes(0, 1)
    true_origin, true_apex = moved[:, -1].swapaxes(0, 1)
    return PoseErrors(
        np.linalg.norm(true_origin - origin, axis=1),
        angle_between_deg(true_apex - true_origin, apex - origin),
    )


def robust_errors(
    atlases: Sequence[Atlas], touches: Sequence[LandmarkSet], truths: Sequence[LandmarkSet]
) -> PoseErrors:
    """Estimate poses with the robust method, and compare them with the labelled cochleae.

    Parameters
    ----------
    atlases : sequence of Atlas
        One for each estimate; it must not contain the animal in question.
    touches : sequence of LandmarkSet
        The touched features and no others; see `touched`.
    truths : sequence of LandmarkSet
        The same sides with CO and CA, in the same frame.

    Returns
    -------
    PoseErrors
        One for each estimate, mm and degrees.
    """
    origins, axes = [], []
    for atlas, touch, truth in zip(atlases, touches, truths, strict=True):
        T_touches_cochlea = locate_robust(touch, atlas)
        origins.append(T_touches_cochlea.translation - truth["CO"])
        axes.append((T_touches_cochlea.rotation[:, 0], truth["CA"] - truth["CO"]))
    estimated, true = np.array(axes).swapaxes(0, 1)
    return PoseErrors(np.linalg.norm(origins, axis=1), angle_between_deg(estimated, true))


def touched(landmarks: LandmarkSet, probe: Sequence[str]) -> LandmarkSet:
    """Return a set with the probe features only.

    Parameters
    ----------
    landmarks : LandmarkSet
        One side, mm.
    probe : sequence of str
        The touched features.

    Returns
    -------
    LandmarkSet
        In the same frame.
    """
    return LandmarkSet.from_mapping(landmarks.as_mapping(probe), landmarks.side, frame=landmarks.frame)
