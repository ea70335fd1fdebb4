"""Ghosts: where the atlas expects a point that is not placed yet."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np

from gp_core.atlas.atlas import Atlas
from gp_core.atlas.labelling_error import LABELLING_NOISE_MM, LabellingError
from gp_core.constants import CHI2_3_95, DEFINING_FEATURES
from gp_core.errors import GpError
from gp_core.landmarks.features import FEATURES
from gp_core.landmarks.sets import LandmarkSet, Status
from gp_core.landmarks.suggestion import Suggestion
from gp_core.validation import FloatArray

__all__ = ["Expectations", "Ghost", "Predict", "fingerprint", "mirror_ghosts"]

Predict = Callable[[LandmarkSet], Mapping[str, tuple[FloatArray, FloatArray]]]
"""Mean (3,) and covariance (3, 3) of every feature, given some: `gp_core.atlas.prediction.predict`."""

N_FOR_GHOSTS = 3

N_REMEMBERED = 24

MIRROR_ASYMMETRY = 0.9
"""2 (1 - r), where r is the correlation of the deviations of the two ears of an animal from the mean: 0.5 on
average over the features of the authors' eleven animals, 0.6 on drawn ones."""

MIRROR_TILT = 0.04
"""Of the plane between the ears, known from one pair of labels, rad (2.5 degrees). Chosen on drawn animals,
measured on others (benchmarks/suggestions.py)."""


@dataclass(frozen=True)
class Ghost:
    """Where a point is expected.

    Parameters
    ----------
    code : str
        Feature.
    position : (3,) float array
        Expected place, mm, scan frame.
    covariance : (3, 3) float array
        Its uncertainty, mm².
    source : str
        ``atlas``, or ``mirror`` for the other side's point mirrored.
    """

    code: str
    position: FloatArray
    covariance: FloatArray
    source: str = "atlas"

    @property
    def radius_95(self) -> float:
        """Radius that holds the point with 95 %, mm, along the least certain direction."""
        return float(np.sqrt(CHI2_3_95 * max(np.linalg.eigvalsh(self.covariance)[-1], 0.0)))

    @property
    def suggestion(self) -> Suggestion:
        """The same as a suggestion for a person to confirm."""
        x, y, z = self.position.tolist()
        return Suggestion((x, y, z), self.radius_95 or None, self.source)


T = TypeVar("T")


class Expectations:
    """What the atlas expects, remembered for the sets it was asked about last; may be asked from any thread.

    Parameters
    ----------
    predict : callable, optional
        The atlas; None expects nothing.
    error : LabellingError, optional
        Of the labels, for those that are mirrored; the atlas has its own.
    """

    def __init__(self, predict: Predict | None = None, error: LabellingError | None = None) -> None:
        self._predict, self._error = predict, error or LabellingError()
        self._known: dict[tuple[object, ...], Mapping[str, Any]] = {}
        self._lock = threading.Lock()

    def ghosts(self, landmarks: LandmarkSet, other: LandmarkSet) -> Mapping[str, Ghost]:
        """Return where the features that are to do are expected, by code.

        From three placed features on it is the atlas that says so; before, the `other` side, mirrored.
        """
        key = ("ghosts", fingerprint(landmarks), tuple(landmarks.suggested), fingerprint(other))
        return self._remembered(key, lambda: self._ghosts(landmarks, other))

    def _remembered(self, key: tuple[object, ...], make: Callable[[], dict[str, T]]) -> Mapping[str, T]:
        found = self._recalled(key)
        if found is None:
            found = MappingProxyType(make())
            with self._lock:
                self._known[key] = found
                while len(self._known) > N_REMEMBERED:
                    del self._known[next(iter(self._known))]
        return found

    def _recalled(self, key: tuple[object, ...]) -> Mapping[str, Any] | None:
        """Return a remembered result, and mark it as the latest used: an unchanged side stays known."""
        with self._lock:
            found = self._known.pop(key, None)
            if found is not None:
                self._known[key] = found
        return found

    def _ghosts(self, landmarks: LandmarkSet, other: LandmarkSet) -> dict[str, Ghost]:
        to_do = [f.code for f in FEATURES if not f.computed and landmarks.status(f.code) is Status.TO_DO]
        if not to_do:
            return {}
        key = ("expected", fingerprint(landmarks))  # an edit of the other side asks for the same again
        expected = self._remembered(key, lambda: dict(self._expected(_without(landmarks, "CO"))))
        found = mirror_ghosts(landmarks, other, self._error) | {c: Ghost(c, *expected[c]) for c in expected}
        return {code: found[code] for code in to_do if code in found}

    def _expected(self, landmarks: LandmarkSet) -> Mapping[str, tuple[FloatArray, FloatArray]]:
        if self._predict is None or len(landmarks.placed) < N_FOR_GHOSTS:
            return {}
        try:
            return self._predict(landmarks)
        except GpError:  # such as points on a line, which determine nothing
            return {}


def mirror_ghosts(
    landmarks: LandmarkSet, other: LandmarkSet, error: LabellingError | None = None
) -> dict[str, Ghost]:
    """Expect the points of the other side, mirrored in the plane between the features placed on both.

    Each is known as well as two labels are, as the feature is alike on both sides of an animal, and as the
    plane is known so far from the nearest feature that is placed on both.

    Parameters
    ----------
    landmarks, other : LandmarkSet
        The side, and the one that is mirrored, in one frame.
    error : LabellingError, optional
        Of the labels; by default the one that is assumed where nothing was measured.

    Returns
    -------
    dict of str to Ghost
        Every feature that the other side has; empty where no feature (but IN) is placed on both.
    """
    paired = [
        f.code for f in FEATURES if not (f.shared or f.computed) and f.code in landmarks and f.code in other
    ]
    if not paired:
        return {}
    here, there = landmarks.array(paired), other.array(paired)
    across = (here - there).mean(axis=0)
    if np.linalg.norm(across) < 1.0:  # two ears are not within a millimetre
        return {}
    normal = across / np.linalg.norm(across)
    middle = (here + there).mean(axis=0) / 2
    of_pairs = float(np.mean([_side_variance(code) for code in paired])) / len(paired)
    errors = error or LabellingError()
    # the plane lies between labels; MIRROR_TILT was chosen with those of the assumed error
    beyond = max(float(np.mean(errors.of(paired) ** 2)) - LABELLING_NOISE_MM**2, 0.0)
    of_labels, turned = 2 * beyond / len(paired), 8 * beyond / float(across @ across)
    found = {}
    for code, point in other.as_mapping().items():
        position = point - 2 * np.dot(point - middle, normal) * normal
        reach = float(np.linalg.norm(position - here, axis=1).min())
        tilt = (MIRROR_TILT**2 + turned) * reach**2 / len(paired)
        of_two_labels = 2 * float(errors.of([code])[0]) ** 2
        variance = of_two_labels + _side_variance(code) + of_pairs + of_labels + tilt
        found[code] = Ghost(code, position, variance * np.eye(3), "mirror")
    return found


@cache
def _side_variance(code: str) -> float:
    """Return how much a feature differs between the two ears of an animal, mm^2 per coordinate."""
    published = Atlas.published()
    codes = (code,) if code in published.codes else DEFINING_FEATURES  # CO is computed from these
    return MIRROR_ASYMMETRY * float(published.variances(codes).mean())


def _without(landmarks: LandmarkSet, code: str) -> LandmarkSet:
    return landmarks.with_point(code, None) if code in landmarks else replace(landmarks)


def fingerprint(landmarks: LandmarkSet) -> tuple[object, ...]:
    """Return what tells the observations of a side from others."""
    return (landmarks.side, landmarks.points.tobytes(), landmarks.unseen)
