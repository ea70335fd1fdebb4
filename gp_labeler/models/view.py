"""What the views show, and where: nothing of this is saved with the specimen, and undo does not change it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gp_core.errors import GpError
from gp_core.validation import FloatArray, check_option
from gp_labeler.document.edits import as_position
from gp_labeler.document.head_frame import HeadFrame
from gp_labeler.document.signals import Signal
from gp_labeler.document.specimen_document import SpecimenDocument
from gp_labeler.imaging.anatomical_frame import SCAN_FRAME, AnatomicalFrame
from gp_labeler.imaging.slab import DENOISERS, Slab
from gp_labeler.imaging.slice_plane import SlicePlane

__all__ = ["CUTS", "GREY_WINDOW", "LAYOUTS", "Camera", "Cut", "ViewModel", "ViewState"]

LAYOUTS = ("four-up", "two-up", "3d", "axial", "sagittal", "coronal")
"""``two-up`` is the 3D view beside the slice view in which the active feature is best seen."""

GREY_WINDOW = frozenset({"level", "width"})
"""Fields of `ViewState` that a drag on a slice changes with every movement."""

CUTS = ("axial", "sagittal", "coronal", "view")
"""By which planes bone can be cut open; ``view`` is across the line of sight."""


@dataclass(frozen=True)
class Camera:
    """Where the 3D view is seen from, scan mm; `scale` is half the height of a parallel view."""

    position: tuple[float, float, float]
    focus: tuple[float, float, float]
    up: tuple[float, float, float]
    scale: float


@dataclass(frozen=True)
class Cut:
    """A plane that cuts bone open in the 3D view.

    Parameters
    ----------
    plane : str
        One of `CUTS`.
    origin : (3,) tuple of float
        A point of it, scan frame, mm.
    normal : (3,) tuple of float
        Unit vector towards the side that stays.
    """

    plane: str
    origin: tuple[float, float, float]
    normal: tuple[float, float, float]

    def __post_init__(self) -> None:
        check_option(self.plane, "cut", CUTS)

    def through(self, position: ArrayLike) -> Cut:
        """Return the same cut through another (3,) scan position."""
        x, y, z = np.asarray(position, dtype=np.float64).tolist()
        return replace(self, origin=(x, y, z))

    def moved(self, mm: float) -> Cut:
        """Return the cut so much deeper."""
        return self.through(np.asarray(self.origin) + mm * np.asarray(self.normal))

    def flipped(self) -> Cut:
        """Return the cut that leaves the other side."""
        x, y, z = self.normal
        return replace(self, normal=(-x, -y, -z))


@dataclass(frozen=True)
class ViewState:
    """Everything about the look of the four views.

    Parameters
    ----------
    layout : str
        One of `LAYOUTS`.
    level, width : float, optional
        Grey-value window of the slices; None for automatic.
    mesh_opacity, outline_visible, hidden_visible, labels_visible, ghosts_visible, axis_visible
        What of mesh and points is shown; ``hidden`` are the points behind bone.
    glyph_mm : float, optional
        Diameter of the points; None for one that does not change with zoom.
    auto_advance : bool
        Whether placing a point makes the next one active.
    follow_ghost : bool
        Whether the crosshair jumps to where the next point is expected.
    slab : Slab, optional
        What the slice views show in place of single slices; display only.
    denoise : str, optional
        One of `DENOISERS`, with which the slice views are denoised; display only.
    cut : Cut, optional
        What cuts bone open in the 3D view; None leaves it whole.
    slices_visible : bool
        Whether the 3D view shows the slices.
    camera : Camera, optional
        None until the first picture.
    """

    layout: str = "four-up"
    level: float | None = None
    width: float | None = None
    mesh_opacity: float = 1.0
    outline_visible: bool = True
    hidden_visible: bool = True
    labels_visible: bool = True
    ghosts_visible: bool = True
    axis_visible: bool = True
    glyph_mm: float | None = None
    auto_advance: bool = True
    follow_ghost: bool = True
    slab: Slab | None = None
    denoise: str | None = None
    cut: Cut | None = None
    slices_visible: bool = False
    camera: Camera | None = None

    def __post_init__(self) -> None:
        check_option(self.layout, "layout", LAYOUTS)
        if not 0 <= self.mesh_opacity <= 1:
            raise GpError(f"mesh_opacity must be from 0 to 1, got {self.mesh_opacity}")
        if self.denoise is not None:
            check_option(self.denoise, "denoise", DENOISERS)
        for name in ("width", "glyph_mm"):
            value = getattr(self, name)
            if value is not None and not value > 0:
                raise GpError(f"{name} must be above 0, got {value}")


_OF_ONE_SPECIMEN = ("level", "width", "slab", "denoise", "cut", "camera")


class ViewModel:
    """The `ViewState`, the planes of the slice views, and the crosshair that all views share.

    Parameters
    ----------
    document : SpecimenDocument
        Another specimen begins with its own frame, grey window, cut, camera and crosshair.
    """

    changed = Signal(frozenset)
    """Names of the fields of `state` that changed."""
    crosshair_changed = Signal(object)
    """The crosshair, (3,) mm in the scan frame."""
    planes_changed = Signal()
    """The slice views show other planes, or name directions in another frame."""
    turning_changed = Signal(bool)
    """Whether the user is turning the planes: what takes long is drawn coarsely meanwhile."""
    planes_turned = Signal(str, float)
    """(view, angle): the user has turned the planes of the two other views, by `rotate_planes`."""
    point_shown = Signal(object)
    """(3,) scan position that every view shall bring into view, mm."""

    close_look_asked = Signal(object)
    """(3,) scan position that every view shall show so closely that it can be judged, mm."""

    close_up_asked = Signal(object)
    """(3,) scan position around which every slice view shall show a few mm."""

    reset_asked = Signal()
    """Every view shall show everything again."""

    def __init__(self, document: SpecimenDocument) -> None:
        self.state = ViewState()
        self._crosshair = _read_only([0.0, 0.0, 0.0])
        self._document = document
        self._frame, self._planes = SCAN_FRAME, MappingProxyType(SCAN_FRAME.planes())
        self._titles: Mapping[str, str] = MappingProxyType({})
        self._turning = False
        document.reset.connect(self._on_reset)
        document.head_frame_changed.connect(self._on_head_frame)

    def update(self, **changes: Any) -> None:
        """Change some fields of the state.

        Raises
        ------
        GpError
            A field is unknown or its value not allowed; nothing changes then.
        """
        for name in changes:
            check_option(name, "view field", [field.name for field in fields(ViewState)])
        new, old = replace(self.state, **changes), self.state
        self.state = new
        changed = frozenset(name for name in changes if getattr(new, name) != getattr(old, name))
        if changed:
            self.changed.emit(changed)

    @property
    def crosshair(self) -> FloatArray:
        """(3,) mm, scan frame."""
        return self._crosshair

    def set_crosshair(self, position: ArrayLike) -> None:
        """Move the crosshair to a (3,) position, mm, scan frame."""
        crosshair = _read_only(as_position(position, "crosshair"))
        if not np.array_equal(crosshair, self._crosshair):
            self._crosshair = crosshair
            self.crosshair_changed.emit(crosshair)

    @property
    def frame(self) -> AnatomicalFrame:
        """The frame in which letters and views are named; positions are the scan's in any."""
        return self._frame

    @property
    def planes(self) -> Mapping[str, SlicePlane]:
        """What the ``axial``, ``sagittal`` and ``coronal`` views show; the crosshair lies on all three."""
        return self._planes

    def is_turned(self, name: str) -> bool:
        """Whether a view shows another plane than the one of its name in the frame."""
        return not self._planes[name].same_as(self._frame.plane(name))

    @property
    def is_turning(self) -> bool:
        """Whether a hand is turning the planes right now."""
        return self._turning

    def set_turning(self, on: bool) -> None:
        """Take down that a hand begins to turn the planes, or has ended."""
        if on != self._turning:
            self._turning = on
            self.turning_changed.emit(on)

    @property
    def planes_are_turned(self) -> bool:
        """Whether any view does."""
        return any(self.is_turned(name) for name in self._planes)

    def set_frame(self, frame: AnatomicalFrame) -> None:
        """Name directions in a frame, and show its planes."""
        self._frame = frame
        self.set_planes(frame.planes())

    def title(self, name: str) -> str:
        """Say what a view shows: ``Axial``, the title its plane was given, or that it is oblique."""
        if name in self._titles:
            return self._titles[name]
        return f"{name.capitalize()}, oblique" if self.is_turned(name) else name.capitalize()

    @property
    def shows_anatomy(self) -> bool:
        """Whether a view shows a plane with a title of its own, such as one along an ear."""
        return bool(self._titles)

    @property
    def frame_text(self) -> str:
        """Say in which frame the views are, and whether they are turned out of it."""
        return f"{self._frame.name.capitalize()} frame" + (", turned" if self.planes_are_turned else "")

    def set_planes(
        self, planes: Mapping[str, SlicePlane], titles: Mapping[str, str] = MappingProxyType({})
    ) -> None:
        """Show other planes in some of the slice views.

        Parameters
        ----------
        planes : mapping of str to SlicePlane
            By the name of the view.
        titles : mapping of str to str
            What they are called, where they have a name of their own.

        Raises
        ------
        GpError
            There is no view of such a name.
        """
        for name in planes:
            check_option(name, "view", tuple(self._planes))
        self._planes = MappingProxyType({**self._planes, **planes})
        kept = {name: title for name, title in self._titles.items() if name not in planes}
        self._titles = MappingProxyType({**kept, **titles})
        self.planes_changed.emit()

    def rotate_planes(self, about: str, angle: float) -> None:
        """Rotate the planes of the two other views about the normal of one, through the crosshair.

        Parameters
        ----------
        about : str
            The view that stays: ``axial``, ``sagittal`` or ``coronal``.
        angle : float
            From right to down on its screen, rad.
        """
        check_option(about, "view", tuple(self._planes))
        axis = -self._planes[about].towards_viewer
        others = {name: plane for name, plane in self._planes.items() if name != about}
        self.set_planes({n: plane.rotated(axis, angle, self._crosshair) for n, plane in others.items()})

    def show_point(self, position: ArrayLike) -> None:
        """Move the crosshair to a (3,) position, and bring it into view in every view; mm, scan frame."""
        self.set_crosshair(position)
        self.point_shown.emit(self._crosshair)

    def look_closely(self, position: ArrayLike) -> None:
        """Set the crosshair, and show the (3,) scan position closely enough in every view to judge it."""
        self.set_crosshair(position)
        self.close_look_asked.emit(self._crosshair)

    def _on_reset(self) -> None:
        """Keep how the user likes to look at things; whoever listens to `reset` reads the rest again."""
        self.state = replace(self.state, **{name: getattr(ViewState, name) for name in _OF_ONE_SPECIMEN})
        self._frame = _frame_of(self._document.state.head_frame)
        self._planes = MappingProxyType(self._frame.planes())
        self._titles = MappingProxyType({})
        self._crosshair = _read_only([0.0, 0.0, 0.0])

    def _on_head_frame(self) -> None:
        self.set_frame(_frame_of(self._document.state.head_frame))


def _frame_of(head: HeadFrame | None) -> AnatomicalFrame:
    """Return the frame in which the views are shown."""
    return AnatomicalFrame("head", head.T_head_scan) if head is not None and head.shown else SCAN_FRAME


def _read_only(position: ArrayLike) -> FloatArray:
    array = np.array(position, dtype=np.float64)
    array.setflags(write=False)
    return array
