"""Planes along the anatomy of an ear: the modiolar axis, the round window and the footplate."""

from __future__ import annotations

import operator
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np

from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_core.validation import FloatArray, check_option
from gp_labeler.imaging.anatomical_frame import AnatomicalFrame
from gp_labeler.imaging.slice_plane import SlicePlane
from gp_labeler.models.labels import LabelsModel
from gp_labeler.models.pose import PoseModel
from gp_labeler.models.view import ViewModel

__all__ = ["ANATOMICAL_PLANES", "FEATURE_PLANES", "AnatomicalPlanesModel"]

ANATOMICAL_PLANES: Mapping[str, str] = MappingProxyType(
    {
        "along": "along the modiolar axis",
        "across": "across the modiolar axis",
        "round window": "through the round window",
        "footplate": "through the footplate",
    }
)
"""The planes, and how each is called in a sentence."""

FEATURE_PLANES: Mapping[str, str] = MappingProxyType(
    {
        **dict.fromkeys(("CA", "CB", "CO", "CC"), "along"),
        **dict.fromkeys(("RWA", "RWP", "RWL", "RWM"), "round window"),
        **dict.fromkeys(("FPA", "FPP"), "footplate"),
    }
)
"""The plane in which a feature is defined; all others are, in the planes of the head."""

_RIM = ("RWA", "RWP", "RWL", "RWM")
_DEFINING = ("CA", "CB", *_RIM, "FPA", "FPP")
_NEAREST_MM = 0.05
_SLICES = ("axial", "sagittal", "coronal")


@dataclass(frozen=True, eq=False)
class _Cut:
    """Three planes at right angles: the one that is meant, and two across it.

    Parameters
    ----------
    centre : (3,) float array
        On all three, mm.
    normals : (3, 3) float array
        Rows: across the plane that is meant, and across the two others.
    down : (3, 3) float array
        Rows: what is about down on the screen in each.
    titles : tuple of str
        What each is called.
    """

    centre: FloatArray
    normals: FloatArray
    down: FloatArray
    titles: tuple[str, str, str]


@dataclass(frozen=True, eq=False)
class _Ear:
    """What is known of an ear, and the planes along it.

    Parameters
    ----------
    side : Side
    places : mapping of str to (3,) float array
        Where its features are, scan frame, mm; those of `_DEFINING` that are known.
    frame : AnatomicalFrame
        Says what is up, where the features leave it open.
    """

    side: Side
    places: Mapping[str, FloatArray]
    frame: AnatomicalFrame

    @cached_property
    def kinds(self) -> frozenset[str]:
        """Those of `ANATOMICAL_PLANES` for which enough is known."""
        return frozenset(filter(self._has, ANATOMICAL_PLANES))

    def _has(self, kind: str) -> bool:
        try:
            self.cut(kind)
        except GpError:
            return False
        return True

    def cut(self, kind: str) -> _Cut:
        """Return one of `ANATOMICAL_PLANES` and the two across it.

        Raises
        ------
        GpError
            Too little is known of the ear; says what to place.
        """
        return {
            "along": self._along,
            "across": self._across,
            "round window": self._window,
            "footplate": self._footplate,
        }[kind]()

    def _along(self) -> _Cut:
        centre, axis, towards = self._modiolus()
        across = np.cross(axis, towards)
        normals = np.stack([across, towards, axis])
        down = np.stack([-axis, -axis, -self.frame.axes[:, 2]])
        return _Cut(centre, normals, down, ("Along the axis", "Along the axis, beside it", "Across the axis"))

    def _across(self) -> _Cut:
        along = self._along()
        order = [2, 0, 1]
        return _Cut(
            along.centre,
            along.normals[order],
            along.down[order],
            tuple(along.titles[n] for n in order),  # type: ignore[arg-type]
        )

    def _window(self) -> _Cut:
        rim = {code: self.places[code] for code in _RIM if code in self.places}
        if "RWA" not in rim or "RWP" not in rim:
            raise self._lacks("RWA and RWP", "round window")
        line = _unit(rim["RWP"] - rim["RWA"], "RWA and RWP")
        if len(rim) > 2:
            around = np.array(list(rim.values()))
            across = np.linalg.svd(around - around.mean(axis=0))[2][2]
        else:  # it opens away from the cochlea
            centre, _, towards = self._modiolus()
            across = towards if np.linalg.norm(centre - rim["RWA"]) > _NEAREST_MM else self._up()
        across = _unit(across - (across @ line) * line, "the rim of the round window")
        middle = (rim["RWA"] + rim["RWP"]) / 2
        return self._beside(middle, across, line, "Round window", "Across its rim", "Between RWA and RWP")

    def _footplate(self) -> _Cut:
        front, back = self.places.get("FPA"), self.places.get("FPP")
        if front is None or back is None:
            raise self._lacks("FPA and FPP", "footplate")
        line, middle = _unit(back - front, "FPA and FPP"), (front + back) / 2
        try:  # the stapes stands on it, away from the cochlea
            outwards = middle - self._modiolus()[0]
        except GpError:
            outwards = self.frame.axes[:, 0]
        outwards = _unit(outwards - (outwards @ line) * line, "the footplate")
        across = np.cross(line, outwards)
        return self._beside(middle, across, line, "Through the footplate", "Between FPA and FPP", "Footplate")

    def _beside(self, centre: FloatArray, across: FloatArray, line: FloatArray, *titles: str) -> _Cut:
        """Return a plane and the two across it, as upright on the screen as the head is."""
        third = np.cross(across, line)
        normals = np.stack([across, line, third])
        down = np.tile(-self._up(), (3, 1))
        return _Cut(centre, normals, down, titles)  # type: ignore[arg-type]

    def _up(self) -> FloatArray:
        up: FloatArray = self.frame.axes[:, 2]
        return up

    def _modiolus(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return CO, the unit axis towards the apex, and a unit vector across it to the round window."""
        base, apex = self.places.get("CB"), self.places.get("CA")
        if base is None or apex is None:
            raise self._lacks("CA and CB", "modiolar axis")
        axis = _unit(apex - base, "CA and CB")
        front, back = self.places.get("RWA"), self.places.get("RWP")
        middle = base + self._up() if front is None or back is None else (front + back) / 2
        centre = base + ((middle - base) @ axis) * axis if front is not None and back is not None else base
        towards = middle - centre - ((middle - centre) @ axis) * axis
        if np.linalg.norm(towards) < _NEAREST_MM:
            towards = np.cross(axis, self.frame.axes[:, 1])
        return centre, axis, _unit(towards, "the round window and the axis")

    def _lacks(self, codes: str, what: str) -> GpError:
        return GpError(
            f"the position of the {what} of the {self.side.word} side is not known yet",
            remedy=f"Place {codes}, or three features, from which their positions are predicted.",
        )


class AnatomicalPlanesModel:
    """Turns the slice views into planes along an ear, as it is labelled, expected or estimated.

    Parameters
    ----------
    labels : LabelsModel
        Says where features are placed, suggested or expected; and which side is worked on.
    pose : PoseModel
        Its estimate says where they are, where nothing else does.
    view : ViewModel
        Whose planes are turned.
    """

    def __init__(self, labels: LabelsModel, pose: PoseModel, view: ViewModel) -> None:
        self._labels, self._pose, self._view = labels, pose, view
        self._made_of: tuple[object, ...] = ()
        self._ear = _Ear(labels.active.side, {}, view.frame)

    def can_show(self, kind: str) -> bool:
        """Whether enough is known of the ear for one of `ANATOMICAL_PLANES`."""
        return kind in self._known_ear().kinds

    def show(self, kind: str) -> FloatArray:
        """Turn the slice views into one of `ANATOMICAL_PLANES` and the two across it, seen from near.

        The plane itself is shown in the view that is shown alone, or in the one that turns least.

        Returns
        -------
        (3,) float array
            Its centre, scan frame, mm: where the crosshair is now.

        Raises
        ------
        GpError
            Too little is known of the ear; says what to place.
        """
        check_option(kind, "plane", tuple(ANATOMICAL_PLANES))
        cut, frame = self._known_ear().cut(kind), self._view.frame
        views = _views_for(cut.normals, frame, self._view.state.layout)
        planes = {
            name: _facing(frame.plane(name), normal, down, cut.centre)
            for name, normal, down in zip(views, cut.normals, cut.down, strict=True)
        }
        self._view.set_planes(planes, dict(zip(views, cut.titles, strict=True)))
        self._view.show_point(cut.centre)
        self._view.close_up_asked.emit(cut.centre)
        return cut.centre

    def show_for(self, code: str) -> FloatArray | None:
        """Show the plane in which a feature is defined; for others, straight planes, and return None."""
        kind = FEATURE_PLANES.get(code)
        if kind is not None:
            return self.show(kind)
        self.straighten()
        return None

    def straighten(self) -> None:
        """Show the planes of the frame again."""
        self._view.set_frame(self._view.frame)

    # Inside

    def _known_ear(self) -> _Ear:
        """Return the ear of the active side, made again only once what it is made of has changed."""
        side, estimate, frame = self._labels.active.side, self._pose.estimate, self._view.frame
        made_of = (side, self._labels.document.landmarks(side), self._labels.ghosts(side), estimate, frame)
        if len(self._made_of) != len(made_of) or any(map(operator.is_not, made_of, self._made_of)):
            found = {code: self._find(side, code) for code in _DEFINING}
            places = {code: place for code, place in found.items() if place is not None}
            self._made_of, self._ear = made_of, _Ear(side, places, frame)
        return self._ear

    def _find(self, side: Side, code: str) -> FloatArray | None:
        """Return where a feature is placed, suggested, expected or estimated."""
        where = self._labels.place_of(side, code)
        return self._estimated(side, code) if where is None else where

    def _estimated(self, side: Side, code: str) -> FloatArray | None:
        estimate = self._pose.estimate
        placed = None if estimate is None or estimate.side is not side else estimate.in_scan()
        return None if placed is None else placed.expected.get(code)


def _views_for(normals: FloatArray, frame: AnatomicalFrame, layout: str) -> tuple[str, ...]:
    """Return in which view each of three planes is shown: the first where it is looked at, or turns least."""
    straight = {name: frame.plane(name).normal for name in _SLICES}
    left = list(_SLICES)
    chosen: list[str] = []
    for n, normal in enumerate(normals):
        nearest = max(left, key=lambda name: abs(float(straight[name] @ normal)))
        name = layout if n == 0 and layout in left else nearest
        left.remove(name)
        chosen.append(name)
    return tuple(chosen)


def _facing(straight: SlicePlane, normal: FloatArray, down: FloatArray, origin: FloatArray) -> SlicePlane:
    """Return the plane across `normal`, seen from the side from which a straight one is seen."""
    into = normal if -straight.towards_viewer @ normal >= 0 else -normal
    down = down - (down @ into) * into
    if np.linalg.norm(down) < 1e-6:
        down = straight.down - (straight.down @ into) * into
    down = _unit(down, "the plane")
    forward = into if into @ straight.normal >= 0 else -into
    return SlicePlane(np.cross(down, into), down, forward, origin)


def _unit(vector: FloatArray, what: str) -> FloatArray:
    length = float(np.linalg.norm(vector))
    if length < 1e-9:
        raise GpError(f"{what} are at the same place, so they do not define a plane")
    unit: FloatArray = vector / length
    return unit
