"""The ear of a phantom around its cochlea: bullae, petrous bone, ear canal, eardrum and ossicles."""

from __future__ import annotations

import numpy as np

from gp_core.validation import FloatArray
from gp_labeler.phantom import grey
from gp_labeler.phantom.canvas import VoxelCanvas
from gp_labeler.phantom.cochlea import Cochlea
from gp_labeler.phantom.layout import Ear, unit
from gp_labeler.phantom.rim import Rim
from gp_labeler.phantom.solids import (
    Solid,
    blend,
    cone,
    ellipsoid,
    inset,
    sheet,
    tip_centre,
    tube,
    union,
)

__all__ = ["paint_ear", "pinna"]

_BULLA_WALL = 0.5
_LIP = 0.42
_CANAL_DEPTH = (0.7, 1.9)
_UMBO = (8.2, 1.1, -1.1)
_RECESS = 0.85
_LIMB = 0.24


def paint_ear(canvas: VoxelCanvas, ear: Ear, thickness: float = 1.0) -> None:
    """Paint one ear, from the bone outside to the ossicles inside.

    The wall of the bulla grows outwards by the factor `thickness`: the cavity stays.
    """
    cochlea, canal, cavity = Cochlea(ear), _canal(ear), _cavity(ear)
    recess = _recess(ear, cochlea)
    canals = _semicircular(ear)
    wall = _BULLA_WALL * thickness
    outer = [inset(cavity, -wall), inset(recess, -wall), *_petrous(ear)]
    canvas.paint(union([*outer, *(tube(line, 0.5) for line in canals)]), grey.BONE)
    canvas.paint(union([cavity, recess]), grey.AIR)
    depth = _canal_depth(ear, canal)
    canvas.paint(union([canal.plug(-depth, 0.0, grow=_LIP, flare=0.3), canal.ring(_LIP)]), grey.BONE)
    canvas.paint(canal.plug(-depth - 0.2, 1.0, flare=0.3), grey.AIR)
    _paint_outer_ear(canvas, ear, canal)
    canvas.paint(canal.ring(_LIP), grey.BONE)
    canvas.paint(_spur(ear), grey.BONE)
    cochlea.paint_bone(canvas)
    cochlea.paint_inside(canvas)
    canvas.paint(union([tube(line, 0.2) for line in canals]), grey.FLUID)
    _paint_drum(canvas, ear, canal, depth)
    end = _limb_end(ear)
    joint = min(_LIMB + 0.2, float(np.linalg.norm(end - ear["RWA"])) - 0.05)
    canvas.paint(cone(end, end, joint), grey.AIR)  # keeps the limb apart from the lip of the window
    canvas.paint(_ossicles(ear), grey.BONE)
    cochlea.paint_stapes(canvas)


def _cavity(ear: Ear) -> Solid:
    """Return the air of the ventral and dorsal bulla; the roof of the ventral one passes through CC."""
    centre, axes = ear.at((7.2, 1.0, -3.2)), ear.head.semi_axes(4.3, 6.3, 4.4)
    offset = axes @ (ear["CC"] - centre) / np.sum(axes**2, axis=1)
    axes = axes * np.linalg.norm(offset)
    return blend(
        [
            ellipsoid(centre, axes),
            ellipsoid(ear.at((8.6, 0.6, 2.8)), ear.head.semi_axes(2.0, 4.2, 2.0)),
            ellipsoid(ear.at((9.0, -4.6, 1.4)), ear.head.semi_axes(1.6, 3.0, 2.6)),
        ],
        0.8,
    )


def _recess(ear: Ear, cochlea: Cochlea) -> Solid:
    """Return the air in front of CC: there the bulla wall rises from the cochlea at an open angle."""
    offset = ear["CC"] - ear["CB"]
    radial = unit(offset - (offset @ cochlea.axis) * cochlea.axis)
    ahead = unit(0.87 * cochlea.axis + 0.5 * radial)
    aside = unit(np.cross(ahead, radial))
    axes = _RECESS * np.stack([ahead, 1.8 * aside, np.cross(ahead, aside)])
    return ellipsoid(ear["CC"] + _RECESS * ahead, axes)


def _petrous(ear: Ear) -> list[Solid]:
    return [
        ellipsoid(ear.at((3.9, -1.4, 1.1)), ear.head.semi_axes(2.4, 3.8, 2.4)),
        ellipsoid(ear.at((3.4, 3.0, -0.4)), ear.head.semi_axes(2.0, 3.0, 1.5)),
    ]


def _semicircular(ear: Ear) -> list[FloatArray]:
    """Return the three semicircular canals as arcs behind and above the vestibule."""
    centre = np.array([5.4, -2.9, 2.6])
    turn = np.linspace(-0.9 * np.pi, 0.75 * np.pi, 24)[:, None]
    planes = (
        ((0.9, -0.45, 0.0), (0.3, 0.9, -0.1)),
        ((0.7, 0.7, 0.0), (0.0, 0.0, 1.0)),
        ((-0.7, 0.7, 0.0), (-0.2, -0.3, 0.9)),
    )
    shifts = ((0.6, -0.5, -0.7), (-0.4, 1.1, 0.9), (-0.1, -1.6, 0.4))
    lines = []
    for (a, b), shift in zip(planes, shifts, strict=True):
        circle = 1.5 * (np.cos(turn) * unit(a) + np.sin(turn) * unit(b))
        lines.append(ear.at(*(centre + np.array(shift) + circle)))
    return lines


def _canal(ear: Ear) -> Rim:
    """Return the rim of the bony ear canal, through OS and OI."""
    top, bottom = ear["OS"], ear["OI"]
    middle, along = (top + bottom) / 2, unit(top - bottom)
    lateral = ear.towards(1, 0, 0)
    outward = unit(lateral - (lateral @ along) * along)
    side = 0.75 * np.linalg.norm(top - bottom) / 2 * np.cross(outward, along)
    return Rim.through([top, middle + side, bottom, middle - side], along=along, outward=outward)


def _canal_depth(ear: Ear, canal: Rim) -> float:
    """Return how deep the bony canal reaches, mm: no nearer to the malleus than leaves MH free."""
    room = float((canal.centre - ear["MH"]) @ canal.normal) - 0.75
    return float(np.clip(room, *_CANAL_DEPTH))


def _paint_outer_ear(canvas: VoxelCanvas, ear: Ear, canal: Rim) -> None:
    """Paint the soft ear canal out to the skin, and the ear."""
    start = canal.centre + 0.5 * canal.normal
    way = np.stack([start, ear.at((15.5, -1.5, 2.0)), ear.at((21.5, -2.5, 4.5))])
    canvas.paint(pinna(ear), grey.SOFT)
    canvas.paint(tube(way, (1.5, 1.1, 1.5)), grey.AIR)


def pinna(ear: Ear) -> Solid:
    """Return the outer ear."""
    root = ear.at((18.6, 1.5, 7.0), (18.2, -2.0, 10.5), (17.0, -5.0, 9.0))
    edge = ear.at((22.5, 1.5, 6.5), (24.5, -3.5, 8.0), (23.0, -7.5, 3.5))
    return sheet(root, edge, (0.7, 0.6, 0.6), steps=4)


def _spur(ear: Ear) -> Solid:
    """Return the spur in the dorsal bulla: from the roof, bent to the side, its pointed tip DTL."""
    root, bend = ear.at((8.4, 1.2, 4.8), (8.8, 1.6, 2.8))
    tip = tip_centre(ear["DTL"], ear.towards(1, 0, 0), 0.24)
    return tube([root, bend, tip], (0.6, 0.4, 0.24), steps=3)


def _limb_end(ear: Ear) -> FloatArray:
    """Return the middle of the round end of the long limb; LLI is where it is nearest to the window."""
    window = (ear["RWA"] + ear["RWP"]) / 2
    return tip_centre(ear["LLI"], unit(window - ear["LLI"]), _LIMB)


def _ossicles(ear: Ear) -> Solid:
    """Return malleus and incus, fused: head DTM, handle with MH at its upper end, long limb ending in LLI."""
    body, back = ear.at((8.75, 2.0, 1.0), (8.35, 1.15, 1.35))
    short = ear.at((8.5, 0.2, 1.6), (8.6, -0.7, 1.8))
    neck, top, middle, umbo = ear.at((8.7, 1.8, 0.65), (8.55, 1.4, 0.25), (8.4, 1.25, -0.4), _UMBO)
    process = unit(ear["MH"] - top)
    return union(
        [
            cone(body, tip_centre(ear["DTM"], ear.towards(0, 0, 1), 0.42), 0.55, 0.42),
            tube([body, back, *short], (0.6, 0.5, 0.32, 0.2), steps=3),
            tube([back, ear.at((7.95, 0.5, 0.95)), _limb_end(ear)], (0.38, 0.26, _LIMB)),
            tube([body, neck, top, middle, umbo], (0.5, 0.3, 0.28, 0.22, 0.26), steps=3),
            cone(top, tip_centre(ear["MH"], process, 0.24), 0.28, 0.24),
        ]
    )


def _paint_drum(canvas: VoxelCanvas, ear: Ear, canal: Rim, depth: float) -> None:
    """Paint the eardrum: a thin cone of membrane from the inner end of the canal to the tip of the handle."""
    edge = canal.curve(0.1 - 0.3 * depth, 24) - depth * canal.normal
    tip = np.broadcast_to(ear.at(_UMBO), edge.shape)
    canvas.paint(sheet(edge, tip, 0.09), grey.THIN_MEMBRANE)
