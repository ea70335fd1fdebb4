"""Animals drawn from an atlas: both ears of one head, varying as the atlas describes."""

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
"""Correlation between the two ears of an animal in their deviations from the mean."""

_DEGREES, _MEAN_MOVES = 30, 0.3
"""For `perturbed_atlas`: degrees of freedom of its covariance, and the shift of its mean in SDs."""

_FARTHEST = 3.0
"""Draws are clipped at this many standard deviations."""

_MIDLINE_NORMAL = (0.20, 0.98, 0.0)
"""Outward normal of the mid-sagittal plane in the left CO frame, from skulls touched on both sides."""

_PITCH = np.radians(16.0)
"""Nose-down pitch of a head with level cheek teeth, relative to z of the CO frame, rad."""


def draw_animal(
    atlas: Atlas, *, rng: np.random.Generator, tilt_deg: float = 0.0, name: str = "drawn"
) -> Specimen:
    """Draw an animal from the Gaussian shape of an atlas, its head positioned as in a scanner.

    The mid-sagittal plane is x = 0, the origin lies midway between the ears, the cheek teeth are level. The
    two sides are correlated but not the same; they share IN exactly, and CO is computed from the drawn
    points.

    Parameters
    ----------
    atlas : Atlas
        Holds all 19 placed features.
    rng : numpy Generator
        Source of random numbers.
    tilt_deg : float
        Standard deviation of a further rotation of the head about each axis, degrees.
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
    """Return the symmetric animal with the mean shape of the atlas on both sides; see `draw_animal`.

    Parameters
    ----------
    atlas : Atlas
        Holds all 19 placed features.
    name : str
        Name of the specimen.

    Returns
    -------
    Specimen
        All 20 features on both sides, frame ``scan`` (LPS, mm).
    """
    mean = atlas.rows(_PLACED)
    return _in_head(atlas, mean, mean, name)


def perturbed_atlas(atlas: Atlas, *, rng: np.random.Generator) -> Atlas:
    """Return an atlas that differs from another as that of a different small cohort would.

    The mean moves by 0.3 standard deviations; the covariance is half the old one and half a Wishart draw of
    30 degrees of freedom about it, so that features are correlated, as they are in real animals.

    Parameters
    ----------
    atlas : Atlas
        The atlas to perturb.
    rng : numpy Generator
        Source of random numbers.

    Returns
    -------
    Atlas
        The perturbed atlas.
    """
    size = len(atlas.covariance)
    root = np.linalg.cholesky(atlas.covariance + 1e-9 * np.eye(size))
    drawn = root @ rng.standard_normal((size, _DEGREES))
    covariance = (atlas.covariance + drawn @ drawn.T / _DEGREES) / 2 + 1e-6 * np.eye(size)
    mean = atlas.mean + _MEAN_MOVES * (root @ rng.standard_normal(size)).reshape(-1, 3)
    return replace(atlas, name="perturbed", mean=mean, covariance=covariance, scatter=covariance)


def draw_sides(atlas: Atlas, *, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Draw the two ears of one animal.

    Parameters
    ----------
    atlas : Atlas
        Holds all 19 placed features.
    rng : numpy Generator
        Source of random numbers.

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
    # condition the right ear on the left one's midline feature; this preserves the covariance of each side
    gain = covariance[:, shared] @ np.linalg.pinv(covariance[np.ix_(shared, shared)])
    right = right + gain @ (left[shared] - right[shared])
    right[shared] = left[shared]
    return mean + left.reshape(-1, 3), mean + right.reshape(-1, 3)


def _in_head(atlas: Atlas, left: FloatArray, right: FloatArray, name: str) -> Specimen:
    """Place two ears, given as left ones, at equal distances on both sides of the mid-sagittal plane.

    Each ear is rotated minimally until its midline feature lies in the direction that it has in the mean
    head: that feature is far away, and its scatter in the CO frame is mostly a rotation of the cochlea.
    """
    T_head_ear = _nominal_rotation()
    row = _PLACED.index(_MIDLINE)
    towards = T_head_ear @ atlas[_MIDLINE]
    towards = towards / np.linalg.norm(towards)
    aside = np.array([-np.linalg.norm(left[row]) * towards[0], 0.0, 0.0])
    sides = {}
    for side, shape in ((Side.LEFT, left), (Side.RIGHT, right)):
        points = shape @ (_minimal_rotation(T_head_ear @ shape[row], towards) @ T_head_ear).T + aside
        points[row, 0] = 0.0  # zero but for rounding
        points = mirror_right(points, side)
        named = dict(zip(_PLACED, points, strict=True))
        sides[side] = LandmarkSet.from_mapping(named, side, frame="scan")
    shared = sides[Side.LEFT][_MIDLINE]
    sides[Side.RIGHT] = sides[Side.RIGHT].with_point(
        _MIDLINE, shared
    )  # otherwise it could differ in the last bit
    return Specimen(name, {side: with_cochlea_origin(landmarks) for side, landmarks in sides.items()})


def _nominal_rotation() -> FloatArray:
    """Return the (3, 3) rotation from the left CO frame to LPS for the mean head, cheek teeth level."""
    lateral = np.array(_MIDLINE_NORMAL) / np.linalg.norm(_MIDLINE_NORMAL)
    up = np.array([0.0, 0.0, 1.0])
    back = np.cross(up, lateral)
    cos, sin = np.cos(_PITCH), np.sin(_PITCH)
    return np.stack([lateral, cos * back - sin * up, sin * back + cos * up])


def _minimal_rotation(source: FloatArray, target: FloatArray) -> FloatArray:
    """Return the smallest rotation (3, 3) that maps one direction to another; not for opposite ones."""
    a, b = source / np.linalg.norm(source), target / np.linalg.norm(target)
    axis = np.cross(a, b)
    cross = np.cross(np.eye(3), axis)
    rotation: FloatArray = np.eye(3) + cross + cross @ cross / (1.0 + a @ b)
    return rotation


def _tilted(specimen: Specimen, rotation_vector: FloatArray) -> Specimen:
    """Rotate the whole head about the origin by a (3,) rotation vector, rad."""
    from scipy.spatial.transform import Rotation

    rotation = Rotation.from_rotvec(rotation_vector).as_matrix()
    T_scan_scan = RigidTransform.from_parts(rotation, np.zeros(3), dst="scan", src="scan")
    sides = {side: landmarks.moved(T_scan_scan) for side, landmarks in specimen.sides.items()}
    return Specimen(specimen.name, sides)
