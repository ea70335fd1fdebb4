"""An animal drawn from an atlas: both ears of one head, where the atlas alone says how animals differ."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gp_core.atlas.atlas import Atlas
from gp_core.frames import RigidTransform
from gp_core.landmarks.anatomy import mirror_right, with_cochlea_origin
from gp_core.landmarks.features import FEATURES, Side
from gp_core.landmarks.sets import LandmarkSet, Specimen
from gp_core.validation import FloatArray

__all__ = ["draw_animal", "draw_sides", "mean_animal", "perturbed_atlas"]

_PLACED = tuple(f.code for f in FEATURES if not f.computed)
_SHARED = tuple(f.code for f in FEATURES if f.shared)
_MIDLINE = _SHARED[0]

_SIDE_CORRELATION = 0.6
"""How alike the two ears of one animal are in what sets them apart from the mean."""

_DEGREES, _MEAN_MOVES = 30, 0.3
"""Of `perturbed_atlas`: degrees of freedom of its covariance, and how far its mean moves, in SDs."""

_FARTHEST = 3.0
"""Standard deviations: a coordinate drawn beyond is brought back, so that no head is a monster."""

_MIDLINE_NORMAL = (0.20, 0.98, 0.0)
"""Normal of the mid-sagittal plane, outward, in the left CO frame: of skulls touched on both sides."""

_PITCH = np.radians(16.0)
"""How far a head with level cheek teeth is turned nose down from the CO frame's own z."""


def draw_animal(
    atlas: Atlas, *, rng: np.random.Generator, tilt_deg: float = 0.0, name: str = "drawn"
) -> Specimen:
    """Draw an animal from the Gaussian shape of an atlas and hold its head as in a scanner.

    The mid-sagittal plane is x = 0, the origin lies midway between the ears, the cheek teeth are level. The
    two sides are alike but not the same; they share IN exactly, and CO is computed from the drawn points.

    Parameters
    ----------
    atlas : Atlas
        Holds all 19 placed features.
    rng : numpy Generator
        The source of chance.
    tilt_deg : float
        Standard deviation of a further turn of the head about each axis, degrees.
    name : str
        Name of the specimen.

    Returns
    -------
    Specimen
        All 20 features on both sides, frame ``scan`` (LPS, mm).

    Raises
    ------
    FeatureError
        The atlas lacks a feature.
    """
    left, right = draw_sides(atlas, rng=rng)
    specimen = _in_head(atlas, left, right, name)
    return _tilted(specimen, np.radians(tilt_deg) * rng.standard_normal(3))


def mean_animal(atlas: Atlas, *, name: str = "mean") -> Specimen:
    """Return the symmetric animal that has the atlas' mean on both sides; see `draw_animal`."""
    mean = atlas.rows(_PLACED)
    return _in_head(atlas, mean, mean, name)


def perturbed_atlas(atlas: Atlas, *, rng: np.random.Generator) -> Atlas:
    """Return an atlas that differs from another as that of a different small herd would.

    The mean is moved by 0.3 standard deviations; the covariance is half the old one and half a Wishart draw
    of 30 degrees of freedom about it, so that features vary together, as they do in real animals.
    """
    size = len(atlas.covariance)
    root = np.linalg.cholesky(atlas.covariance + 1e-9 * np.eye(size))
    drawn = root @ rng.standard_normal((size, _DEGREES))
    covariance = (atlas.covariance + drawn @ drawn.T / _DEGREES) / 2 + 1e-6 * np.eye(size)
    mean = atlas.mean + _MEAN_MOVES * (root @ rng.standard_normal(size)).reshape(-1, 3)
    return replace(atlas, name="perturbed", mean=mean, covariance=covariance, scatter=covariance)


def draw_sides(atlas: Atlas, *, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Draw the two ears of one animal.

    Returns
    -------
    left, right : (19, 3) arrays, mm, atlas frame
        The placed features in the feature table's order; the right side as its mirror image, a left one.
        The midline feature IN is the same in both.
    """
    mean, covariance = atlas.rows(_PLACED), atlas.cross_covariance(_PLACED, _PLACED)
    values, vectors = np.linalg.eigh(covariance)
    root = vectors * np.sqrt(np.clip(values, 0.0, None))
    z = rng.standard_normal((2, mean.size))
    z[1] = _SIDE_CORRELATION * z[0] + np.sqrt(1 - _SIDE_CORRELATION**2) * z[1]
    left, right = np.clip(z, -_FARTHEST, _FARTHEST) @ root.T
    shared = [3 * _PLACED.index(code) + c for code in _SHARED for c in range(3)]
    # the right ear given that its midline feature is the left one's: keeps the covariance of each side
    gain = covariance[:, shared] @ np.linalg.pinv(covariance[np.ix_(shared, shared)])
    right = right + gain @ (left[shared] - right[shared])
    right[shared] = left[shared]
    return mean + left.reshape(-1, 3), mean + right.reshape(-1, 3)


def _in_head(atlas: Atlas, left: FloatArray, right: FloatArray, name: str) -> Specimen:
    """Put two ears, given as left ones, at equal distances on both sides of the mid-sagittal plane.

    An ear is turned, as little as may be, until its midline feature lies in the direction where the mean
    head has it: that feature is far away, and its spread in the CO frame is mostly a turn of the cochlea.
    """
    T_head_ear = _nominal_rotation()
    row = _PLACED.index(_MIDLINE)
    towards = T_head_ear @ atlas[_MIDLINE]
    towards = towards / np.linalg.norm(towards)
    aside = np.array([-np.linalg.norm(left[row]) * towards[0], 0.0, 0.0])
    sides = {}
    for side, shape in ((Side.LEFT, left), (Side.RIGHT, right)):
        points = shape @ (_turn(T_head_ear @ shape[row], towards) @ T_head_ear).T + aside
        points[row, 0] = 0.0  # so it is, but for rounding
        points = mirror_right(points, side)
        named = dict(zip(_PLACED, points, strict=True))
        sides[side] = LandmarkSet.from_mapping(named, side, frame="scan")
    shared = sides[Side.LEFT][_MIDLINE]
    sides[Side.RIGHT] = sides[Side.RIGHT].with_point(_MIDLINE, shared)  # else it may differ in the last bit
    return Specimen(name, {side: with_cochlea_origin(landmarks) for side, landmarks in sides.items()})


def _nominal_rotation() -> FloatArray:
    """Return the (3, 3) rotation from the left CO frame to LPS for the mean head, cheek teeth level."""
    lateral = np.array(_MIDLINE_NORMAL) / np.linalg.norm(_MIDLINE_NORMAL)
    up = np.array([0.0, 0.0, 1.0])
    back = np.cross(up, lateral)
    cos, sin = np.cos(_PITCH), np.sin(_PITCH)
    return np.stack([lateral, cos * back - sin * up, sin * back + cos * up])


def _turn(source: FloatArray, target: FloatArray) -> FloatArray:
    """Return the smallest rotation (3, 3) that brings one direction to another, not opposite, one."""
    a, b = source / np.linalg.norm(source), target / np.linalg.norm(target)
    axis = np.cross(a, b)
    cross = np.cross(np.eye(3), axis)
    rotation: FloatArray = np.eye(3) + cross + cross @ cross / (1.0 + a @ b)
    return rotation


def _tilted(specimen: Specimen, rotation_vector: FloatArray) -> Specimen:
    """Turn the whole head about the origin by a (3,) rotation vector, radians."""
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_rotvec(rotation_vector).as_matrix()
    T_scan_scan = RigidTransform.from_parts(turn, np.zeros(3), dst="scan", src="scan")
    sides = {side: landmarks.moved(T_scan_scan) for side, landmarks in specimen.sides.items()}
    return Specimen(specimen.name, sides)
