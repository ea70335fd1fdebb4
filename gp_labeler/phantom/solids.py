"""Solids as signed distances: what the bones of a phantom are built of.

A solid knows a box it lies in and the distance (mm, negative inside) to its surface at any place. The
distance is exact, or true to first order near the surface, which is all that smooth edges of voxels need.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gp_core.validation import FloatArray

__all__ = [
    "Grid",
    "Solid",
    "Values",
    "blend",
    "component",
    "cone",
    "cut",
    "cut_smoothly",
    "ellipsoid",
    "implicit",
    "inset",
    "moved",
    "sheet",
    "squared_length",
    "tip_centre",
    "tube",
    "union",
]

Values = NDArray[np.float32]
Grid = tuple[Values, Values, Values]
"""Coordinates x, y, z of a block in mm, of the shapes (1, 1, nx), (1, ny, 1) and (nz, 1, 1)."""

_FAR = np.float32(1e3)
_NO_AREA = 1e-9
_BLUR_VARIANCE = 0.02
"""Of point spread and voxels of 0.2 mm, mm^2; a little more since air is farther from bone than tissue is."""


@dataclass(frozen=True)
class Solid:
    """A piece of space.

    Parameters
    ----------
    distance : callable
        Of a `Grid`, gives the (nz, ny, nx) signed distances in mm, negative inside.
    low, high : (3,) arrays, mm
        Corners of a box that holds it.
    """

    distance: Callable[[Grid], Values]
    low: FloatArray
    high: FloatArray

    def lower(self, out: Values, grid: Grid, margin: float) -> None:
        """Lower distances `out` on a block to this solid's, within `margin` mm of its box."""
        found = [
            np.searchsorted(axis.ravel(), (low - margin, high + margin))
            for axis, low, high in zip(grid, self.low, self.high, strict=True)
        ]
        (x0, x1), (y0, y1), (z0, z1) = found
        if x0 < x1 and y0 < y1 and z0 < z1:
            here = (grid[0][:, :, x0:x1], grid[1][:, y0:y1], grid[2][z0:z1])
            part = out[z0:z1, y0:y1, x0:x1]
            np.minimum(part, self.distance(here), out=part)


def moved(grid: Grid, origin: FloatArray) -> Grid:
    """Return the coordinates of a block from another origin (3,)."""
    x, y, z = (axis - np.float32(o) for axis, o in zip(grid, origin, strict=True))
    return x, y, z


def component(grid: Grid, direction: FloatArray) -> Values:
    """Return the coordinate of a block's voxels along a direction (3,)."""
    x, y, z = (np.float32(d) * axis for axis, d in zip(grid, direction, strict=True))
    total: Values = x + y + z
    return total


def squared_length(grid: Grid) -> Values:
    """Return the squared distance of a block's voxels from the origin."""
    x, y, z = grid
    squared: Values = x * x + y * y + z * z
    return squared


def cone(start: ArrayLike, end: ArrayLike, radius: float, end_radius: float | None = None) -> Solid:
    """Return a rod from `start` to `end` (3,) with round ends and a radius that changes evenly."""
    a, b = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
    last = radius if end_radius is None else end_radius
    step = (b - a) / max(float((b - a) @ (b - a)), 1e-12)
    thick = max(radius, last)

    def distance(grid: Grid) -> Values:
        x, y, z = moved(grid, a)
        t = np.clip(component((x, y, z), step), 0, 1)
        dx, dy, dz = (np.float32(d) * t for d in b - a)
        radii = np.float32(radius) + np.float32(last - radius) * t
        gone: Values = np.sqrt(squared_length((x - dx, y - dy, z - dz))) - radii
        return gone

    return Solid(distance, np.minimum(a, b) - thick, np.maximum(a, b) + thick)


def tip_centre(tip: FloatArray, outward: FloatArray, radius: float) -> FloatArray:
    """Return the centre (3,) of the round end of a rod whose tip is to be seen at `tip` in the scan.

    A scanner's blur rounds a tip off, by about its variance over the radius; the rod is that much longer.
    """
    return tip - (radius - _BLUR_VARIANCE / radius) * outward


def tube(points: ArrayLike, radii: ArrayLike, *, steps: int = 1) -> Solid:
    """Return a rod along (n, 3) points with one radius, or one for each point.

    With more than one of `steps` between two points it follows a smooth curve through them, which overshoots
    them in no coordinate: a point farthest to one side stays the farthest.
    """
    line, widths = _smooth(points, radii, steps)
    return union(cone(line[i], line[i + 1], widths[i], widths[i + 1]) for i in range(len(line) - 1))


def sheet(first: ArrayLike, second: ArrayLike, radii: ArrayLike, *, steps: int = 1) -> Solid:
    """Return the sheet between two lines of (n, 3) points; half its thickness is given as in `tube`."""
    a, half = _smooth(first, radii, steps)
    b, _ = _smooth(second, radii, steps)
    faces = []
    for i in range(len(a) - 1):
        thickness = float(half[i] + half[i + 1]) / 2
        faces += [_triangle(a[i], b[i], a[i + 1], thickness), _triangle(b[i], b[i + 1], a[i + 1], thickness)]
    return union(faces)


def _smooth(points: ArrayLike, radii: ArrayLike, steps: int) -> tuple[FloatArray, FloatArray]:
    from scipy.interpolate import PchipInterpolator

    line = np.asarray(points, dtype=np.float64)
    widths = np.broadcast_to(np.asarray(radii, dtype=np.float64), len(line))
    if steps == 1:
        return line, widths
    chords = np.linalg.norm(np.diff(line, axis=0), axis=1)
    knots = np.concatenate([[0.0], np.cumsum(np.maximum(chords, 1e-3))])
    fine = np.interp(np.arange(steps * (len(line) - 1) + 1) / steps, np.arange(len(line)), knots)
    curve = PchipInterpolator(knots, np.column_stack([line, widths]))(fine)
    return curve[:, :3], curve[:, 3]


def _triangle(a: FloatArray, b: FloatArray, c: FloatArray, half: float) -> Solid:
    """Return a triangle thickened by `half` mm on all sides."""
    edges = (b - a, c - b, a - c)
    normal = np.cross(edges[0], c - a)
    area = float(np.linalg.norm(normal))
    rods = union(cone(p, q, half) for p, q in ((a, b), (b, c), (c, a)))
    if area < _NO_AREA:
        return rods
    normal = normal / area
    inward = [np.cross(normal, edge) for edge in edges]

    def distance(grid: Grid) -> Values:
        beside = [
            component(grid, direction) - np.float32(corner @ direction)
            for corner, direction in zip((a, b, c), inward, strict=True)
        ]
        plane = np.abs(component(grid, normal) - np.float32(a @ normal)) - np.float32(half)
        return np.where(reduce(np.minimum, beside) >= 0, plane, rods.distance(grid))

    return Solid(distance, rods.low, rods.high)


def ellipsoid(centre: ArrayLike, semi_axes: ArrayLike) -> Solid:
    """Return the ellipsoid around `centre` (3,); its orthogonal semi-axes (mm) are the rows of (3, 3)."""
    middle, axes = np.asarray(centre, dtype=np.float64), np.asarray(semi_axes, dtype=np.float64)
    scaled = axes / np.sum(axes**2, axis=1, keepdims=True)
    reach = np.sqrt(np.sum(axes**2, axis=0))

    def distance(grid: Grid) -> Values:
        here = moved(grid, middle)
        x, y, z = (component(here, row) for row in scaled)
        k = np.sqrt(squared_length((x, y, z)))
        p, q, r = (np.float32(row @ row) for row in scaled)
        slope = np.sqrt(p * x * x + q * y * y + r * z * z)
        gone: Values = k * (k - 1) / np.maximum(slope, np.float32(1e-6))
        return gone

    return Solid(distance, middle - reach, middle + reach)


def implicit(value: Callable[[Grid], Values], low: ArrayLike, high: ArrayLike) -> Solid:
    """Return the solid where a smooth function is negative; its distance is the value over its slope."""

    def distance(grid: Grid) -> Values:
        f = value(grid)
        steps = [float(axis.ravel()[1] - axis.ravel()[0]) if axis.size > 1 else 1.0 for axis in grid]
        square: Values = np.zeros(f.shape, np.float32)
        for axis, step in zip((2, 1, 0), steps, strict=True):
            if f.shape[axis] > 1:
                slope = np.gradient(f, step, axis=axis)
                np.add(square, slope * slope, out=square)
        steepness: Values = np.sqrt(np.maximum(square, np.float32(1e-6)))
        return f / steepness

    return Solid(distance, np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64))


def union(solids: Iterable[Solid]) -> Solid:
    """Return all of the solids; each is evaluated in its own box only."""
    parts: Sequence[Solid] = list(solids)
    low = np.min([part.low for part in parts], axis=0)
    high = np.max([part.high for part in parts], axis=0)

    def distance(grid: Grid) -> Values:
        step = max(float(np.ptp(axis)) / max(axis.size - 1, 1) for axis in grid)
        out = np.full(np.broadcast_shapes(*(axis.shape for axis in grid)), _FAR, np.float32)
        for part in parts:
            part.lower(out, grid, 3 * step)
        return out

    return Solid(distance, low, high)


def blend(solids: Sequence[Solid], width: float) -> Solid:
    """Return the union of solids with fillets about `width` mm wide where they meet."""
    low = np.min([part.low for part in solids], axis=0) - width
    high = np.max([part.high for part in solids], axis=0) + width

    def smooth(a: Values, b: Values) -> Values:
        h = np.maximum(np.float32(width) - np.abs(a - b), 0) / np.float32(width)
        joined: Values = np.minimum(a, b) - h * h * np.float32(width / 4)
        return joined

    return Solid(lambda grid: reduce(smooth, (part.distance(grid) for part in solids)), low, high)


def cut(solid: Solid, *others: Solid) -> Solid:
    """Return a solid without what lies in the others."""

    def distance(grid: Grid) -> Values:
        return reduce(lambda d, other: np.maximum(d, -other.distance(grid)), others, solid.distance(grid))

    return Solid(distance, solid.low, solid.high)


def cut_smoothly(solid: Solid, other: Solid, width: float) -> Solid:
    """Return a solid without the other, with edges rounded over about `width` mm."""

    def distance(grid: Grid) -> Values:
        a = solid.distance(grid)
        b = np.full(a.shape, _FAR)
        other.lower(b, grid, 2 * width)
        b = -b
        h = np.maximum(np.float32(width) - np.abs(a - b), 0) / np.float32(width)
        rounded: Values = np.maximum(a, b) + h * h * np.float32(width / 4)
        return rounded

    return Solid(distance, solid.low, solid.high)


def inset(solid: Solid, depth: float) -> Solid:
    """Return a solid shrunk by `depth` mm on all sides; grown where it is negative."""
    return Solid(lambda grid: solid.distance(grid) + np.float32(depth), solid.low + depth, solid.high - depth)
