"""Simulated touch sessions in which something goes wrong: what the probe reports of one side.

Every session has a random tracker frame, its features are touched in random order, and positions are given in
the frame at the end of the session, in which the robot works.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from gp_core.frames import RigidTransform
from gp_core.landmarks.features import Side
from gp_core.landmarks.sets import LandmarkSet
from gp_core.validation import FloatArray, freeze_arrays

__all__ = [
    "Disturbance",
    "Session",
    "anisotropic",
    "drift",
    "exchanged",
    "knocked_marker",
    "mistouch",
    "other_size",
    "soft_tissue",
    "tip_offset",
    "touch_session",
    "wrong_side",
]

_FAR_MM = 80.0
_LEAN_DEG = 25.0
"""Tilt of the probe from touch to touch, SD about each axis."""

_MARKER_MM = 40.0
"""From the ear to the reference marker on the head."""


@dataclass(frozen=True)
class Session:
    """One side as it is touched, before the noise of the touches.

    Attributes
    ----------
    truth : LandmarkSet
        All points, CO among them, tracker frame, mm.
    side : Side
        The ear that the user says it is.
    codes : tuple of str
        The touched features, in the order of touching.
    points : (n, 3) array
        What would be reported of them, mm.
    noise : (3,) array
        Standard deviation of the noise along the tracker's axes, mm.
    timed : bool
        Whether the touches carry times.
    """

    truth: LandmarkSet
    side: Side
    codes: tuple[str, ...]
    points: FloatArray
    noise: FloatArray
    timed: bool = False

    def __post_init__(self) -> None:
        freeze_arrays(self)

    @property
    def outward(self) -> FloatArray:
        """(3,) unit vector from which a probe comes: from CO to the middle of what is touched."""
        away = self.truth.array(self.codes).mean(axis=0) - self.truth["CO"]
        unit: FloatArray = away / np.linalg.norm(away)
        return unit


Disturbance = Callable[[Session, np.random.Generator], Session]


def touch_session(
    truth: LandmarkSet,
    codes: tuple[str, ...],
    noise: float,
    disturbances: tuple[Disturbance, ...],
    rng: np.random.Generator,
) -> tuple[Session, dict[str, FloatArray]]:
    """Simulate a session.

    Parameters
    ----------
    truth : LandmarkSet
        A labelled side with CO, in any frame, mm.
    codes : tuple of str
        What is touched.
    noise : float
        Standard deviation of each touched coordinate, mm.
    disturbances : tuple of Disturbance
        What goes wrong, applied one after the other.
    rng : numpy Generator
        Source of random numbers.

    Returns
    -------
    session : Session
        The true positions in the tracker frame, mm.
    reported : dict of str to (3,) array, mm
        What the probe reports, tracker frame.
    """
    T_tracker_any = _random_frame(rng, truth.frame)
    moved = truth.moved(T_tracker_any)
    order = tuple(str(code) for code in rng.permutation(codes))
    session = Session(moved, truth.side, order, moved.array(order), np.full(3, noise))
    for disturb in disturbances:
        session = disturb(session, rng)
    reported = session.points + session.noise * rng.standard_normal(session.points.shape)
    return session, dict(zip(session.codes, reported, strict=True))


def tip_offset(length: float) -> Disturbance:
    """Return a disturbance: an error of the tip in the probe's frame, whose tilt varies from touch to touch.

    Parameters
    ----------
    length : float
        Length of the error, mm.

    Returns
    -------
    Disturbance
        To be passed to `touch_session`.
    """
    return partial(_tip_offset, length)


def _tip_offset(length: float, session: Session, rng: np.random.Generator) -> Session:
    offset = length * _direction(rng)
    leant = [_turn(np.radians(_LEAN_DEG) * rng.standard_normal(3)) @ offset for _ in session.codes]
    return replace(session, points=session.points + leant)


def drift(length: float, *, timed: bool = False) -> Disturbance:
    """Return a disturbance: the reference drifts uniformly from the first touch to the last.

    Parameters
    ----------
    length : float
        Total drift, mm.
    timed : bool
        Whether the touches carry times.

    Returns
    -------
    Disturbance
        To be passed to `touch_session`.
    """
    return partial(_drift, length, timed)


def _drift(length: float, timed: bool, session: Session, rng: np.random.Generator) -> Session:
    share = np.linspace(-1.0, 0.0, len(session.codes))  # in the frame at the end of the session
    return replace(session, points=session.points + length * np.outer(share, _direction(rng)), timed=timed)


def soft_tissue(depth: float) -> Disturbance:
    """Return a disturbance: tissue keeps the tip off the bone, along the normal at each touch.

    Parameters
    ----------
    depth : float
        Mean thickness, mm.

    Returns
    -------
    Disturbance
        To be passed to `touch_session`.
    """
    return partial(_soft_tissue, depth)


def _soft_tissue(depth: float, session: Session, rng: np.random.Generator) -> Session:
    normals = session.outward + 0.5 * rng.standard_normal(session.points.shape)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    depths = depth * rng.uniform(0.5, 1.5, (len(session.codes), 1))
    return replace(session, points=session.points + depths * normals)


def knocked_marker(length: float) -> Disturbance:
    """Return a disturbance: the reference marker is knocked between two touches; the ear moves and rotates.

    Parameters
    ----------
    length : float
        Displacement, mm.

    Returns
    -------
    Disturbance
        To be passed to `touch_session`.
    """
    return partial(_knocked_marker, length)


def _knocked_marker(length: float, session: Session, rng: np.random.Generator) -> Session:
    marker = session.truth["CO"] + _MARKER_MM * _direction(rng)
    turn = _turn(length / _MARKER_MM / np.sqrt(2) * _direction(rng))
    shift = length / np.sqrt(2) * _direction(rng)
    before = rng.integers(1, len(session.codes))  # those touched before it was knocked
    points = session.points.copy()
    points[:before] = (points[:before] - marker) @ turn.T + marker + shift
    return replace(session, points=points)


def other_size(factor: float) -> Disturbance:
    """Return a disturbance: the animal has another size.

    Parameters
    ----------
    factor : float
        Its size relative to the atlas.

    Returns
    -------
    Disturbance
        To be passed to `touch_session`.
    """
    return partial(_other_size, factor)


def _other_size(factor: float, session: Session, rng: np.random.Generator) -> Session:
    centre = session.truth["CO"]
    truth = replace(session.truth, points=centre + factor * (session.truth.points - centre))
    return replace(session, truth=truth, points=centre + factor * (session.points - centre))


def mistouch(code: str, length: float) -> Disturbance:
    """Return a disturbance: one feature is touched off its place, in a random direction.

    Parameters
    ----------
    code : str
        The feature.
    length : float
        Distance, mm.

    Returns
    -------
    Disturbance
        To be passed to `touch_session`.
    """
    return partial(_mistouch, code, length)


def _mistouch(code: str, length: float, session: Session, rng: np.random.Generator) -> Session:
    points = session.points.copy()
    points[session.codes.index(code)] += length * _direction(rng)
    return replace(session, points=points)


def exchanged(pair: tuple[str, str]) -> Disturbance:
    """Return a disturbance: the names of two touched features are exchanged.

    Parameters
    ----------
    pair : (str, str)
        The features.

    Returns
    -------
    Disturbance
        To be passed to `touch_session`.
    """
    return partial(_exchanged, pair)


def _exchanged(pair: tuple[str, str], session: Session, _: np.random.Generator) -> Session:
    points = session.points.copy()
    rows = [session.codes.index(code) for code in pair]
    points[rows] = points[rows[::-1]]
    return replace(session, points=points)


def wrong_side(session: Session, _: np.random.Generator) -> Session:
    """Report the ear as the other one; a disturbance.

    Parameters
    ----------
    session : Session
        The session.
    _ : numpy Generator
        Not used.

    Returns
    -------
    Session
        With the other side.
    """
    return replace(session, side=session.side.other)


def anisotropic(along: float) -> Disturbance:
    """Return a disturbance: larger noise along one axis of the tracker, as with a stereo camera.

    Parameters
    ----------
    along : float
        Factor of the noise along that axis.

    Returns
    -------
    Disturbance
        To be passed to `touch_session`.
    """
    return partial(_anisotropic, along)


def _anisotropic(along: float, session: Session, _: np.random.Generator) -> Session:
    return replace(session, noise=session.noise * (1.0, 1.0, along))


def _direction(rng: np.random.Generator) -> FloatArray:
    vector = rng.standard_normal(3)
    unit: FloatArray = vector / np.linalg.norm(vector)
    return unit


def _turn(vector: FloatArray) -> FloatArray:
    """Return the (3, 3) rotation of a rotation vector, rad."""
    from scipy.spatial.transform import Rotation  # slow to load

    rotation: FloatArray = Rotation.from_rotvec(vector).as_matrix()
    return rotation


def _random_frame(rng: np.random.Generator, src: str) -> RigidTransform:
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_quat(rng.standard_normal(4)).as_matrix()
    return RigidTransform.from_parts(turn, _FAR_MM * rng.standard_normal(3), dst="tracker", src=src)
