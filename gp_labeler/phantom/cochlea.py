"""The cochlea of a phantom: bony capsule, coiled duct, modiolus, and its two windows."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gp_core.validation import FloatArray
from gp_labeler.imaging.coil import CAP_MM, RISE, TURNS, Coil
from gp_labeler.phantom import grey
from gp_labeler.phantom.canvas import VoxelCanvas
from gp_labeler.phantom.layout import Ear, unit
from gp_labeler.phantom.rim import Rim
from gp_labeler.phantom.solids import (
    Grid,
    Solid,
    Values,
    blend,
    component,
    cone,
    ellipsoid,
    implicit,
    moved,
    sheet,
    squared_length,
    tip_centre,
    tube,
    union,
)

__all__ = ["Cochlea"]

_LIP = 0.2
_BRIDGE = 0.4
"""Bone to leave between the two windows, mm."""

_DENT_MM = 0.5
_FILLET = 0.3
_BULGE = 0.07
"""How far each turn stands out from the capsule's surface, mm."""


@dataclass(frozen=True)
class Cochlea:
    """The cochlea of one ear, built on CA, CB, CC, CL and the rims of both windows."""

    ear: Ear

    @cached_property
    def axis(self) -> FloatArray:
        """(3,) unit vector from CB to CA."""
        return unit(self.ear["CA"] - self.ear["CB"])

    @cached_property
    def length(self) -> float:
        """CB to CA, mm."""
        return float(np.linalg.norm(self.ear["CA"] - self.ear["CB"]))

    @cached_property
    def across(self) -> FloatArray:
        """(2, 3) unit vectors perpendicular to the axis: to the round window, and on along the basal turn."""
        window = (self.ear["RWA"] + self.ear["RWP"]) / 2 - self.ear["CB"]
        first = unit(window - (window @ self.axis) * self.axis)
        return np.stack([first, -self.ear.sign * np.cross(self.axis, first)])

    def _polar(self, code: str) -> tuple[float, float, FloatArray]:
        """Return height above CB and distance from the axis (mm) of a landmark, and its direction outward."""
        from_base = self.ear[code] - self.ear["CB"]
        height = float(from_base @ self.axis)
        radial = from_base - height * self.axis
        return height, float(np.linalg.norm(radial)), unit(radial)

    @cached_property
    def round_window(self) -> Rim:
        """The rim of the round window, through RWA, RWM, RWP and RWL."""
        points = [self.ear[code] for code in ("RWA", "RWM", "RWP", "RWL")]
        along = points[0] - points[2]
        outward = np.cross(along, points[3] - points[1])
        outward *= np.sign(outward @ self.across[0])
        return Rim.through(points, along=along, outward=outward)

    @cached_property
    def oval_window(self) -> Rim:
        """The rim of the oval window, through FPA and FPP; its narrow side is towards the round window."""
        front, back = self.ear["FPA"], self.ear["FPP"]
        middle, along = (front + back) / 2, unit(front - back)
        outward = self.ear["LLI"] - middle
        outward = unit(outward - (outward @ along) * along)
        away = np.cross(outward, along)
        away *= np.sign(away @ (middle - self.round_window.centre))
        room = float((middle - self.ear["RWM"]) @ away) - _BRIDGE
        points = [front, middle + 0.42 * away, back, middle - np.clip(room, 0.08, 0.22) * away]
        return Rim.through(points, along=along, outward=outward)

    @cached_property
    def coil(self) -> Coil:
        """How its duct winds, before the capsule is fitted to CC."""
        return Coil(self.length, self._polar("CC")[:2], self._polar("CL")[:2])

    def capsule(self) -> Solid:
        """Return the body of bone around the duct, bulging along its turns; its surface passes through CC."""
        steps = np.linspace(-2.5, self.length + 2.0, 2048)
        radii = self.coil.radius(steps).astype(np.float32)
        turns = np.interp(steps / self.length, RISE, TURNS).astype(np.float32)
        bulge = (_BULGE * np.clip(steps, 0, 1) * np.clip(self.length - steps, 0, 1)).astype(np.float32)
        cc = self.ear["CC"]
        excess = float(self._beyond(_as_grid(cc), steps, radii, turns, bulge)[0, 0, 0])

        def value(grid: Grid) -> Values:
            near_cc = np.exp(squared_length(moved(grid, cc)) / np.float32(-2 * _DENT_MM**2))
            fitted: Values = self._beyond(grid, steps, radii, turns, bulge) - np.float32(excess) * near_cc
            return fitted

        ends = np.stack([self.ear["CB"] - 1.5 * self.axis, self.ear["CA"] + CAP_MM * self.axis])
        return implicit(value, ends.min(axis=0) - 2.4, ends.max(axis=0) + 2.4)

    def _beyond(self, grid: Grid, steps: FloatArray, *tables: Values) -> Values:
        """Return squared distance from the axis less the capsule's squared radius there, mm^2."""
        here = moved(grid, self.ear["CB"])
        s, u, v = (component(here, direction) for direction in (self.axis, *self.across))
        radius, turn, bulge = (np.interp(s, steps, table).astype(np.float32) for table in tables)
        radius = radius + bulge * np.cos(np.float32(2 * np.pi) * turn - np.arctan2(v, u))
        beyond: Values = u * u + v * v - radius * np.abs(radius)
        return beyond

    def duct_line(self, per_turn: int = 32) -> tuple[FloatArray, FloatArray]:
        """Return the middle (n, 3) of the coiled duct from base to apex, and its radius (n,)."""
        height, rho, angle, thick = self.coil.duct(per_turn)
        angle = angle[:, None]
        line = (
            self.ear["CB"]
            + height[:, None] * self.axis
            + rho[:, None] * (np.cos(angle) * self.across[0] + np.sin(angle) * self.across[1])
        )
        start = self.round_window.centre - 0.6 * self.round_window.normal
        top = self.ear["CA"] - thick[-1] * self.axis  # its round end touches the bony cap at CA
        return np.concatenate([start[None], line, top[None]]), np.concatenate([[0.5], thick, thick[-1:]])

    def paint_bone(self, canvas: VoxelCanvas) -> None:
        """Paint the capsule with the lips of its windows, the corner CL and the root at CC."""
        round_window, oval = self.round_window, self.oval_window
        parts = [
            self.capsule(),
            round_window.plug(-1.0, 0.05, grow=2 * _LIP),
            round_window.ring(_LIP),
            oval.plug(-1.0, 0.05, grow=2 * _LIP),
            oval.ring(_LIP),
            self._corner(),
        ]
        canvas.paint(blend(parts, _FILLET), grey.BONE)

    def _corner(self) -> Solid:
        """Return the corner of the basal turn that ends in CL, with the ridge from it to the bulla wall."""
        cl = self.ear["CL"]
        _, _, out = self._polar("CL")
        out = unit(out + 0.35 * self.ear.towards(1, 0, 0))
        tip = tip_centre(cl, out, 0.28)
        behind = cl - 0.6 * out
        wall = self.ear.at((2.8, -0.6, -3.6), (2.8, 1.6, -3.4))
        ridge = sheet([behind - 0.6 * self.axis, behind + 0.4 * self.axis], wall, 0.22)
        return union([cone(cl - 1.3 * out, tip, 0.75, 0.28), ridge])

    def paint_inside(self, canvas: VoxelCanvas) -> None:
        """Paint duct, vestibule, nerve canal, modiolus and the open windows."""
        line, thick = self.duct_line()
        oval, axis, base = self.oval_window, self.axis, self.ear["CB"]
        vestibule = oval.centre - 0.85 * oval.normal
        canvas.paint(union([tube(line, thick), cone(vestibule, line[0], 0.62, 0.4)]), grey.FLUID)
        self._paint_lamina(canvas, line[1:-1], thick[1:-1])
        canvas.paint(cone(base + 0.9 * axis, base + 0.7 * self.length * axis, 0.4, 0.2), grey.CANCELLOUS)
        nerve = np.stack([base - 0.45 * axis, base - 1.2 * axis, self.ear.at((1.6, -2.6, 2.6))])
        canvas.paint(tube(nerve, (0.45, 0.5, 0.7)), grey.SOFT)
        canvas.paint(cone(*self._patch(), 0.3), grey.BONE)
        canvas.paint(oval.plug(-0.9, 0.0), grey.FLUID)
        canvas.paint(oval.plug(0.0, 0.6), grey.AIR)
        canvas.paint(oval.ring(_LIP), grey.BONE)  # again: an edge cut along an edge would be worn away
        self._open_round_window(canvas)

    def _patch(self) -> tuple[FloatArray, FloatArray]:
        """Return the ends of a rod under CC that keeps the bone there whole."""
        _, _, out = self._polar("CC")
        inner = self.ear["CC"] - 0.32 * out
        return inner - 0.3 * self.axis, inner

    def _open_round_window(self, canvas: VoxelCanvas) -> None:
        """Open the round window, fluid within and air without, and make its lip whole again."""
        rim = self.round_window
        canvas.paint(rim.plug(-0.9, 0.0), grey.FLUID)
        canvas.paint(rim.plug(0.0, 1.2, flare=0.4), grey.AIR)
        canvas.paint(rim.ring(_LIP), grey.BONE)

    def _paint_lamina(self, canvas: VoxelCanvas, line: FloatArray, thick: FloatArray) -> None:
        """Paint the spiral lamina and basilar membrane: a shelf across the duct, thinner than a voxel."""
        inward = -(line - self.ear["CB"])
        inward = inward - (inward @ self.axis)[:, None] * self.axis
        inward /= np.linalg.norm(inward, axis=1, keepdims=True)
        shelf = sheet(line + 1.1 * thick[:, None] * inward, line, 0.05)
        canvas.paint(shelf, grey.CANCELLOUS)

    def paint_stapes(self, canvas: VoxelCanvas) -> None:
        """Paint the stapes: its footplate free in the oval window, two limbs and the head."""
        oval = self.oval_window
        gap = 0.38
        canvas.paint(oval.plug(-0.3, -0.04, grow=-gap), grey.BONE)
        reach = oval.radii[np.argmin(np.abs(oval.angles))] - gap - 0.12
        head = oval.centre + 0.85 * oval.normal
        feet = [oval.centre + side * reach * oval.axes[0] - 0.1 * oval.normal for side in (-1, 1)]
        limbs = [tube([foot, (foot + head) / 2 + 0.35 * (foot - oval.centre), head], 0.12) for foot in feet]
        canvas.paint(union(limbs), grey.BONE)
        canvas.paint(ellipsoid(head, 0.17 * np.eye(3)), grey.BONE)


def _as_grid(point: FloatArray) -> Grid:
    x, y, z = (np.full((1, 1, 1), c, np.float32) for c in point)
    return x, y, z
