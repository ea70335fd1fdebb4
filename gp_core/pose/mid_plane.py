"""The mid-sagittal plane of a head, from touches of both ears in one frame."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from gp_core.argument_types import check_fields, checks_arguments
from gp_core.errors import GpError
from gp_core.landmarks.features import CODES, EXTERNAL, Side, feature
from gp_core.landmarks.sets import LandmarkSet
from gp_core.validation import FloatArray, as_points, as_vectors, freeze_arrays

__all__ = ["FEWEST_PAIRS", "MirrorPlane", "mirror_plane"]

FEWEST_PAIRS = 3
"""So many features must be touched on both sides for a mid-plane."""

_PAIR_SD_MM = 0.5
"""Standard deviation by which the two sides of a head differ in a touched feature, mm per coordinate."""


@dataclass(frozen=True)
class MirrorPlane:
    """The mid-sagittal plane of a head, from touches of both ears.

    Attributes
    ----------
    normal : (3,) array
        Unit normal, towards the left ear, in the frame of the touches.
    offset : float
        The plane is ``normal @ x = offset``, mm.
    residual_mm : float
        RMS distance of the pairs from being mirror images.
    codes : tuple of str
        Features that it is made from.
    normal_sd_deg, offset_sd_mm : float
        Standard deviation of its direction, and of its place at the middle of the pairs.
    pairs_mm : mapping of str to float
        By feature, how far its two touches are from being mirror images in the plane of all *other* features;
        empty where too few are left for that.
    rest_mm : mapping of str to float
        By feature, the RMS distance of those others.
    """

    normal: FloatArray
    offset: float
    residual_mm: float
    codes: tuple[str, ...]
    normal_sd_deg: float
    offset_sd_mm: float
    pairs_mm: Mapping[str, float] = field(default_factory=dict)
    rest_mm: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_fields(self)
        freeze_arrays(self)
        for name in ("pairs_mm", "rest_mm"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    def mirror(self, points: ArrayLike) -> FloatArray:
        """Return points mirrored in the plane.

        Parameters
        ----------
        points : (N, 3) array_like
            In the frame of the touches, mm.

        Returns
        -------
        (N, 3) array
            Their mirror images, mm.
        """
        rows = as_points(points, "points", missing_allowed=True)
        mirrored: FloatArray = rows - 2 * np.outer(rows @ self.normal - self.offset, self.normal)
        return mirrored

    def mirror_direction(self, vector: ArrayLike) -> FloatArray:
        """Return a direction mirrored in the plane.

        Parameters
        ----------
        vector : (..., 3) array_like
            In the frame of the touches.

        Returns
        -------
        (..., 3) array
            Of the same length.
        """
        given = as_vectors(vector, "a direction")
        mirrored: FloatArray = given - 2 * (given @ self.normal)[..., None] * self.normal
        return mirrored


@checks_arguments
def mirror_plane(left: LandmarkSet, right: LandmarkSet, *, midline: Iterable[str] = ()) -> MirrorPlane:
    """Return the mid-sagittal plane of a head from touches of both ears, in one frame.

    Parameters
    ----------
    left, right : LandmarkSet
        Touches of the two sides, mm.
    midline : iterable of str
        Skull features (``S1``, ...) that lie in the plane, touched with either ear.

    Returns
    -------
    MirrorPlane
        In the frame of the touches.

    Raises
    ------
    GpError
        The frames differ, fewer than three features were touched on both sides, a feature of the midline was
        not touched, or the pairs do not lie about one plane.

    Examples
    --------
    >>> from gp_core import Atlas
    >>> atlas = Atlas.published()
    >>> points = {code: atlas[code] + [0, 20, 0] for code in ("CL", "MN", "OS", "RWA")}
    >>> left = LandmarkSet.from_mapping(points, "L", frame="tracker")
    >>> mirrored = {code: point * [1, -1, 1] for code, point in points.items()}
    >>> right = LandmarkSet.from_mapping(mirrored, "R", frame="tracker")
    >>> bool(mirror_plane(left, right).normal[1] > 0.999)
    True
    """
    _check_sides(left, right)
    codes = tuple(c for c in EXTERNAL if c in left and c in right and not feature(c).shared)
    if len(codes) < FEWEST_PAIRS:
        raise GpError(
            f"the mid-plane needs {FEWEST_PAIRS} features that are touched on both sides, got {len(codes)}",
            remedy="Touch the same features on both ears.",
        )
    shared = [c for c in EXTERNAL if feature(c).shared and (c in left or c in right)]
    middle = {name: _shared_point(left, right, name) for name in (*shared, *midline)}
    plane = _plane_of(left, right, codes, middle)
    pairs_mm, rest_mm = {}, {}
    if len(codes) > FEWEST_PAIRS:
        for code in codes:
            others = _plane_of(left, right, tuple(c for c in codes if c != code), middle)
            image = others.mirror(right[code][None])[0]
            pairs_mm[code] = float(np.linalg.norm(image - left[code]))
            rest_mm[code] = others.residual_mm
    return replace(plane, pairs_mm=pairs_mm, rest_mm=rest_mm)


def _plane_of(
    left: LandmarkSet, right: LandmarkSet, codes: tuple[str, ...], middle: Mapping[str, FloatArray]
) -> MirrorPlane:
    """Return the plane of some pairs, and of points that lie in it."""
    one, other = left.array(codes), right.array(codes)
    half = (one - other) / 2
    on_plane = np.vstack([(one + other) / 2, *middle.values()])
    normal = _normal(half, on_plane)
    offset = float((on_plane @ normal).mean())
    plane = MirrorPlane(normal, offset, 0.0, (*codes, *middle), 0.0, 0.0)
    residual = float(np.sqrt(((plane.mirror(other) - one) ** 2).sum(axis=1).mean()))
    # each pair turns the normal by its error over its width, as a lever
    levers = float(np.sqrt((half**2).sum() + ((on_plane - on_plane.mean(axis=0)) ** 2).sum()))
    spread = max(_PAIR_SD_MM, residual / np.sqrt(3)) / np.sqrt(2)
    return replace(
        plane,
        residual_mm=residual,
        normal_sd_deg=float(np.degrees(spread / levers)),
        offset_sd_mm=float(spread / np.sqrt(len(on_plane))),
    )


def _normal(half: FloatArray, on_plane: FloatArray) -> FloatArray:
    """Return the direction that half distances of pairs have, and that points of the plane do not."""
    about = on_plane - on_plane.mean(axis=0)
    values, vectors = np.linalg.eigh(half.T @ half - about.T @ about)
    normal: FloatArray = vectors[:, -1]
    along = half @ normal
    if values[-1] <= 0 or np.abs(along).min() <= 0 or abs(np.sign(along).sum()) < len(along):
        raise GpError(
            "the touches of the two ears do not lie about one plane",
            remedy="Check sides and names; touch both ears without moving the head.",
        )
    return normal if along[0] > 0 else -normal


def _shared_point(left: LandmarkSet, right: LandmarkSet, name: str) -> FloatArray:
    """Return a point of the plane: the mean of its touches with both ears."""
    found = [point for one in (left, right) if (point := one.extra.get(name)) is not None]
    found += [one[name] for one in (left, right) if name in CODES and name in one]
    if not found:
        raise GpError(
            f"{name} is to lie in the mid-plane, and was touched with neither ear",
            remedy="Name skull features that were touched, such as S1.",
        )
    points: FloatArray = np.mean(found, axis=0)
    return points


def _check_sides(left: LandmarkSet, right: LandmarkSet) -> None:
    if (left.side, right.side) != (Side.LEFT, Side.RIGHT):
        raise GpError(f"the touches must be of the left and of the right, got {left.side} and {right.side}")
    if left.frame != right.frame:
        raise GpError(f"the ears were touched in different frames, {left.frame} and {right.frame}")
