"""How a phantom's head lies in its scan: an asymmetry, a turn, an edge of the scan that cuts it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gp_core.validation import FloatArray
from gp_labeler.phantom import grey
from gp_labeler.phantom.canvas import VoxelCanvas
from gp_labeler.phantom.layout import HeadLayout
from gp_labeler.phantom.solids import Values
from gp_labeler.phantom.variation import HeadVariation, generator_of

__all__ = ["HeadPlacement", "cropped", "placement_of"]

_BETWEEN_MM, _WIDTH_MM = 8.0, 6.0
"""Distance of the random displacements from each other, and the reach of each (standard deviation)."""

_COARSE_MM = 1.5
_REGION = ((-16.0, 16.0), (-14.0, 52.0), (-20.0, 16.0))
"""Left, anterior and up, mm of the mean head: where its bone lies."""

_AIR_MM = 1.5
_SLAB = 2_000_000
_HALF_BONE, _N_PLACES = 22_000.0, 5000


@dataclass(frozen=True, eq=False)
class Displacement:
    """A smooth displacement that says where a place came from: ``source = p + u(p)``.

    Parameters
    ----------
    origin : (3,) array, mm
        Place of the first value.
    values : (3, nz, ny, nx) array, mm
        x, y and z of u on a grid of 1.5 mm; beyond it the last value holds.
    """

    origin: FloatArray
    values: FloatArray

    def at(self, points: FloatArray) -> FloatArray:
        """Return u (N, 3) at places (N, 3)."""
        from scipy.ndimage import map_coordinates

        index = ((points - self.origin) / _COARSE_MM)[:, ::-1].T
        return np.stack([map_coordinates(v, index, order=1, mode="nearest") for v in self.values], axis=1)

    def forward(self, sources: FloatArray) -> FloatArray:
        """Return where places (N, 3) come to: the p with p + u(p) equal to each."""
        p = sources.copy()
        for _ in range(30):  # u changes by a few per cent of a step only, so this converges at once
            p = sources - self.at(p)
        return p


@dataclass(frozen=True, eq=False)
class HeadPlacement:
    """Where the painted head comes to in its scan.

    Parameters
    ----------
    rotation : (3, 3) array
        Turn about `centre`.
    centre : (3,) array, mm
    displacement : Displacement, optional
        Asymmetry, before the turn.
    """

    rotation: FloatArray
    centre: FloatArray
    displacement: Displacement | None

    def points(self, points: FloatArray) -> FloatArray:
        """Return where painted places (N, 3) come to."""
        moved = points if self.displacement is None else self.displacement.forward(points)
        return (moved - self.centre) @ self.rotation.T + self.centre

    def rigidly(self, point: FloatArray) -> FloatArray:
        """Return where a place (3,) comes to by the turn alone."""
        moved: FloatArray = self.rotation @ (point - self.centre) + self.centre
        return moved

    def sources(self, points: FloatArray) -> FloatArray:
        """Return where places (N, 3) of the scan were painted."""
        back = (points - self.centre) @ self.rotation + self.centre
        return back if self.displacement is None else back + self.displacement.at(back)

    def canvas(self, painted: VoxelCanvas) -> VoxelCanvas:
        """Return the painted voxels, moved: a canvas around all that is not air."""
        low, high = self._box(painted)
        moved = VoxelCanvas(low, high, painted.spacing, grey.AIR)
        for layers, places in _slabs(moved):
            moved.grey[layers] = _values_at(painted, self.sources(places)).reshape(moved.grey[layers].shape)
        return moved

    def _box(self, painted: VoxelCanvas) -> FloatArray:
        """Return the (2, 3) corners of a box around what was painted, once it is moved."""
        step = max(1, round(1.0 / painted.spacing))
        there = np.argwhere(painted.grey[::step, ::step, ::step] > grey.AIR + 500)[:, ::-1]
        places = self.points(painted.origin + there * (step * painted.spacing))
        return np.stack([places.min(axis=0) - _AIR_MM, places.max(axis=0) + _AIR_MM])


def placement_of(
    canvas: VoxelCanvas, head: HeadLayout, variation: HeadVariation, seed: int
) -> HeadPlacement | None:
    """Return how a variation moves a head; None where it leaves it as it was painted."""
    from scipy.spatial.transform import Rotation

    if not variation.asymmetry and not any(variation.turn):
        return None
    displacement = _displacement(canvas, head, variation.asymmetry, seed) if variation.asymmetry else None
    rotation = Rotation.from_rotvec(variation.turn, degrees=True).as_matrix()
    return HeadPlacement(rotation, head.roughly(np.array([[0.0, -15.0, 0.0]]))[0], displacement)


def _displacement(canvas: VoxelCanvas, head: HeadLayout, rms: float, seed: int) -> Displacement:
    """Draw a displacement of random bumps that neither moves nor turns the bone as a whole."""
    rng = generator_of(seed, "asymmetry")
    knots = head.roughly(_region(_BETWEEN_MM))
    weights = rng.standard_normal(knots.shape)
    low, high = knots.min(axis=0) - 12.0, knots.max(axis=0) + 12.0
    axes = [np.arange(a, b + _COARSE_MM, _COARSE_MM) for a, b in zip(low, high, strict=True)]
    z, y, x = np.meshgrid(axes[2], axes[1], axes[0], indexing="ij")
    places = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    where = _bone_of(canvas)
    bumps = _bumps(where, knots, weights)
    rigid = _rigid_part(where, bumps)
    off = np.linalg.norm(bumps - _motion(where, rigid), axis=1)
    factor = rms / float(np.sqrt(np.mean(off**2)))
    field: FloatArray = factor * (_bumps(places, knots, weights) - _motion(places, rigid))
    return Displacement(low, field.T.reshape(3, *x.shape))


def _bone_of(canvas: VoxelCanvas) -> FloatArray:
    """Return places (N, 3) all over the painted bone."""
    voxels = np.argwhere(canvas.grey > _HALF_BONE)[:, ::-1]
    chosen = voxels[:: max(1, len(voxels) // _N_PLACES)]
    return canvas.origin + canvas.spacing * chosen


def _region(step: float) -> FloatArray:
    """Return LPS places (N, 3) of the mean head all over its bone."""
    left, anterior, up = (np.arange(a, b + 0.5 * step, step) for a, b in _REGION)
    x, y, z = np.meshgrid(left, -anterior, up, indexing="ij")
    return np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)


def _bumps(places: FloatArray, knots: FloatArray, weights: FloatArray) -> FloatArray:
    out = np.zeros(places.shape)
    for knot, weight in zip(knots, weights, strict=True):
        reach = np.exp(-np.sum((places - knot) ** 2, axis=1) / (2 * _WIDTH_MM**2))
        out += reach[:, None] * weight
    return out


def _motions(places: FloatArray) -> FloatArray:
    """Return the small motions of a rigid body at places (N, 3), as (N, 3, 6)."""
    axes = np.broadcast_to(np.eye(3), (len(places), 3, 3))
    turns = np.cross(np.eye(3)[None], places[:, None]).transpose(0, 2, 1)
    return np.concatenate([axes, turns], axis=2)


def _rigid_part(places: FloatArray, u: FloatArray) -> FloatArray:
    """Return the six numbers of the small motion nearest to a displacement (N, 3)."""
    found = np.linalg.lstsq(_motions(places).reshape(-1, 6), u.ravel(), rcond=None)[0]
    return np.asarray(found, dtype=np.float64)


def _motion(places: FloatArray, rigid: FloatArray) -> FloatArray:
    moved: FloatArray = _motions(places) @ rigid
    return moved


def _slabs(canvas: VoxelCanvas) -> Iterator[tuple[slice, FloatArray]]:
    """Yield the layers of a canvas, some at a time, with the places (N, 3) of their voxels."""
    xs, ys, zs = canvas.axes
    at_once = max(1, _SLAB // (len(xs) * len(ys)))
    for k in range(0, len(zs), at_once):
        z, y, x = np.meshgrid(zs[k : k + at_once], ys, xs, indexing="ij")
        yield slice(k, k + at_once), np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)


def _values_at(canvas: VoxelCanvas, places: FloatArray) -> Values:
    from scipy.ndimage import map_coordinates

    index = ((places - canvas.origin) / canvas.spacing)[:, ::-1].T
    found: Values = map_coordinates(canvas.grey, index, order=1, mode="constant", cval=grey.AIR)
    return found


def cropped(canvas: VoxelCanvas, crop: tuple[float, str]) -> VoxelCanvas:
    """Return the canvas without the part at one face that holds a fraction of the bone."""
    fraction, face = crop
    axis, positive = {"L": (0, True), "R": (0, False), "P": (1, True), "A": (1, False)}.get(
        face, (2, face == "S")
    )
    others = tuple(a for a in range(3) if a != 2 - axis)
    bone = np.cumsum(np.count_nonzero(canvas.grey > _HALF_BONE, axis=others))
    share = bone / max(int(bone[-1]), 1)
    cut = int(np.searchsorted(share, 1 - fraction if positive else fraction))
    kept = slice(0, cut + 1) if positive else slice(cut, None)
    return canvas.part(axis, kept)
