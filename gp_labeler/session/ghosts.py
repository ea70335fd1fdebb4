"""Ghosts and doubts: where the atlas expects a point that is to do, or not where it was placed."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np

from gp_core.atlas.quality import DOUBTFUL_SD
from gp_core.atlas.shape import LABELLING_NOISE_MM
from gp_core.checks import FloatArray
from gp_core.errors import GpError
from gp_core.landmarks.features import FEATURES, Side
from gp_core.landmarks.sets import LandmarkSet, Status

__all__ = ["Departure", "Doubt", "Expectations", "Ghost", "Judging", "Predict", "mirror_ghosts"]

Predict = Callable[[LandmarkSet], Mapping[str, tuple[FloatArray, FloatArray]]]
"""Mean (3,) and covariance (3, 3) of every feature, given some: `gp_core.atlas.shape.predict`."""

N_FOR_GHOSTS = 3
N_FOR_DOUBTS = 5
"""With fewer, a point that is off cannot be told from its neighbours."""

CHI2_95 = 7.815
"""95 % quantile of the squared distance of a point from its mean, in standard deviations, in space."""

HEAD_MM = 40.0
"""No two features of a head are further apart."""

N_REMEMBERED = 24

MIRROR_SD_MM = 0.5
MIRROR_SD_PER_MM = 0.05
"""Ears differ by about half a millimetre, and the plane between them is known to some 3 degrees."""


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
        return float(np.sqrt(CHI2_95 * max(np.linalg.eigvalsh(self.covariance)[-1], 0.0)))


@dataclass(frozen=True)
class Departure:
    """How far a placed point is from where the others make the atlas expect it.

    Parameters
    ----------
    code : str
        Feature.
    distance : float
        From the expected place, mm.
    expected : (3,) float array
        That place, mm, scan frame.
    covariance : (3, 3) float array
        Of that place, mm².
    n_sd : float
        The same in standard deviations.
    """

    code: str
    distance: float
    expected: FloatArray
    covariance: FloatArray
    n_sd: float

    @property
    def is_doubtful(self) -> bool:
        """Whether a person should look at the point again."""
        return self.n_sd > DOUBTFUL_SD

    @property
    def ghost(self) -> Ghost | None:
        """Where the point should be; None where that would mean nothing."""
        return None if self.distance > HEAD_MM else Ghost(self.code, self.expected, self.covariance)

    @property
    def word(self) -> str:
        """Such as ``2.6 mm``, or ``far off`` where a number would mean nothing."""
        if self.distance > HEAD_MM:
            return "far off"
        return f"{self.distance:.{1 if self.distance > 0.995 else 2}f} mm"

    @property
    def text(self) -> str:
        """Such as ``2.6 mm from where the atlas expects it``."""
        if self.distance > HEAD_MM:
            return "nowhere near where the other points put it: check names, side and units"
        return f"{self.word} from where the atlas expects it"


Doubt = Departure
"""A departure that is doubtful."""


T = TypeVar("T")


class Expectations:
    """What the atlas expects, remembered for the sets it was asked about last; may be asked from any thread.

    Parameters
    ----------
    predict : callable, optional
        The atlas; None expects nothing.
    """

    def __init__(self, predict: Predict | None = None) -> None:
        self._predict = predict
        self._known: dict[tuple[object, ...], Mapping[str, Any]] = {}
        self._judged: dict[Side, tuple[LandmarkSet, Mapping[str, Departure]]] = {}
        self._lock = threading.Lock()

    def ghosts(self, landmarks: LandmarkSet, other: LandmarkSet) -> Mapping[str, Ghost]:
        """Return where the features that are to do are expected, by code.

        From three placed features on it is the atlas that says so; before, the `other` side, mirrored.
        """
        key = ("ghosts", _fingerprint(landmarks), _fingerprint(other))
        return self._remembered(key, lambda: self._ghosts(landmarks, other))

    def departures(self, landmarks: LandmarkSet) -> Mapping[str, Departure]:
        """Return how far every placed feature is from where the others make the atlas expect it, by code.

        That takes a while: 20 ms for a good set, 150 ms where one point is off. The atlas must see to it that
        one wrong point does not accuse its neighbours; `gp_core.atlas.shape` does. Empty with fewer than
        `N_FOR_DOUBTS` placed.
        """
        return self._remembered(("departures", _fingerprint(landmarks)), lambda: self._departures(landmarks))

    def known_departures(self, landmarks: LandmarkSet) -> Mapping[str, Departure] | None:
        """Return `departures` where they were found before, else None; at once."""
        return self._recalled(("departures", _fingerprint(landmarks)))

    def doubts(self, landmarks: LandmarkSet) -> Mapping[str, Doubt]:
        """Return those of the `departures` that are doubtful."""
        return _doubtful(self.departures(landmarks))

    def near_doubts(self, landmarks: LandmarkSet) -> Mapping[str, Doubt]:
        """Return `doubts` where they are known, else as the last edit leaves those before it; at once.

        What other points are doubted for waits for the next judgement, lest all doubts blink at every edit;
        a point that was moved is held against the place where the others expect it, which stays.
        """
        known = self.known_departures(landmarks)
        return _doubtful(self._carried(landmarks) if known is None else known)

    def settle(self, landmarks: LandmarkSet, departures: Mapping[str, Departure]) -> None:
        """Take the departures of a side from which those after the next edit follow."""
        with self._lock:
            self._judged[landmarks.side] = landmarks, departures

    def _carried(self, landmarks: LandmarkSet) -> dict[str, Departure]:
        with self._lock:
            before, found = self._judged.get(landmarks.side, (landmarks, {}))
        old, new = before.points, landmarks.points
        stays = ((old == new) | (np.isnan(old) & np.isnan(new))).all(axis=1).tolist()
        moved = {f.code for f, stayed in zip(FEATURES, stays, strict=True) if not (stayed or f.computed)}
        if len(moved) > 1:
            return {}
        return {
            code: _departure(code, landmarks[code], was.expected, was.covariance) if code in moved else was
            for code, was in found.items()
            if code in landmarks
        }

    def known_other_side(self, landmarks: LandmarkSet) -> bool:
        """Return whether a side is known to be labelled under the name of the other; at once."""
        own, other = self.known_departures(landmarks), self.known_departures(_renamed(landmarks))
        return own is not None and other is not None and _doubtful_part(own) > 0.5 > 2 * _doubtful_part(other)

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
        """Return what is remembered, which is then forgotten last: a side at rest stays known."""
        with self._lock:
            found = self._known.pop(key, None)
            if found is not None:
                self._known[key] = found
        return found

    def _ghosts(self, landmarks: LandmarkSet, other: LandmarkSet) -> dict[str, Ghost]:
        to_do = [f.code for f in FEATURES if not f.computed and landmarks.status(f.code) is Status.TO_DO]
        if not to_do:
            return {}
        key = ("expected", _fingerprint(landmarks))  # an edit of the other side asks for the same again
        expected = self._remembered(key, lambda: dict(self._expected(_without(landmarks, "CO"))))
        found = mirror_ghosts(landmarks, other) | {c: Ghost(c, *expected[c]) for c in expected}
        return {code: found[code] for code in to_do if code in found}

    def _expected(self, landmarks: LandmarkSet) -> Mapping[str, tuple[FloatArray, FloatArray]]:
        if self._predict is None or len(landmarks.placed) < N_FOR_GHOSTS:
            return {}
        try:
            return self._predict(landmarks)
        except GpError:  # such as points on a line, which determine nothing
            return {}

    def _departures(self, landmarks: LandmarkSet) -> dict[str, Departure]:
        placed = _without(landmarks, "CO")
        if len(placed.placed) < N_FOR_DOUBTS:
            return {}
        return {code: departure for code in placed.placed if (departure := self._departure(placed, code))}

    def _departure(self, landmarks: LandmarkSet, code: str) -> Departure | None:
        expected = self._expected(_without(landmarks, code))
        if code not in expected:
            return None
        return _departure(code, landmarks[code], *expected[code])


@dataclass(frozen=True)
class Judging:
    """A job (see `jobs`) that finds the departures of one side, so that they are known afterwards."""

    expectations: Expectations
    landmarks: LandmarkSet
    title: str = "Checking labels"

    def run(self, progress: Callable[[float], None]) -> Mapping[str, Departure]:
        """Return the departures; where most are doubtful, find those under the other side's name as well."""
        progress(0.0)
        found = self.expectations.departures(self.landmarks)
        if _doubtful_part(found) > 0.5:
            self.expectations.departures(_renamed(self.landmarks))
        self.expectations.settle(self.landmarks, found)
        return found

    @property
    def known(self) -> Mapping[str, Departure] | None:
        """What it would find, where that was found before, else None; at once."""
        return self.expectations.known_departures(self.landmarks)


def mirror_ghosts(landmarks: LandmarkSet, other: LandmarkSet) -> dict[str, Ghost]:
    """Expect the points of the other side, mirrored in the plane between the features placed on both.

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
    found = {}
    for code, point in other.as_mapping().items():
        position = point - 2 * np.dot(point - middle, normal) * normal
        reach = float(np.linalg.norm(position - here, axis=1).min())
        variance = MIRROR_SD_MM**2 + (MIRROR_SD_PER_MM * reach) ** 2
        found[code] = Ghost(code, position, variance * np.eye(3), "mirror")
    return found


def _departure(code: str, position: FloatArray, mean: FloatArray, covariance: FloatArray) -> Departure:
    off = position - mean
    spread = covariance + LABELLING_NOISE_MM**2 * np.eye(3)
    n_sd = float(np.sqrt(off @ np.linalg.solve(spread, off)))
    return Departure(code, float(np.linalg.norm(off)), mean, covariance, n_sd)


def _doubtful(departures: Mapping[str, Departure]) -> Mapping[str, Doubt]:
    return {code: departure for code, departure in departures.items() if departure.is_doubtful}


def _doubtful_part(departures: Mapping[str, Departure]) -> float:
    return len(_doubtful(departures)) / max(len(departures), 1)


def _renamed(landmarks: LandmarkSet) -> LandmarkSet:
    return replace(landmarks, side=landmarks.side.other)


def _without(landmarks: LandmarkSet, code: str) -> LandmarkSet:
    return landmarks.with_point(code, None) if code in landmarks else replace(landmarks)


def _fingerprint(landmarks: LandmarkSet) -> tuple[object, ...]:
    return (landmarks.side, landmarks.points.tobytes(), landmarks.unseen)
