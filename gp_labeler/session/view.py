"""How the user looks at the specimen: nothing of it is saved with it, and undo leaves it alone."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

from psygnal import Signal

from gp_core.checks import check_option
from gp_core.errors import GpError

__all__ = ["LAYOUTS", "Camera", "View", "ViewState"]

LAYOUTS = ("four-up", "3d", "axial", "sagittal", "coronal")


@dataclass(frozen=True)
class Camera:
    """Where the 3D view is seen from, scan mm; `scale` is half the height of a parallel view."""

    position: tuple[float, float, float]
    focus: tuple[float, float, float]
    up: tuple[float, float, float]
    scale: float


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
    camera: Camera | None = None

    def __post_init__(self) -> None:
        check_option(self.layout, "layout", LAYOUTS)
        if not 0 <= self.mesh_opacity <= 1:
            raise GpError(f"mesh_opacity must be from 0 to 1, got {self.mesh_opacity}")
        for name in ("width", "glyph_mm"):
            value = getattr(self, name)
            if value is not None and not value > 0:
                raise GpError(f"{name} must be above 0, got {value}")


class View:
    """The holder of the current `ViewState`."""

    changed = Signal(frozenset)
    """Emitted with the names of the fields that changed."""

    def __init__(self, state: ViewState | None = None) -> None:
        self.state = state or ViewState()

    def update(self, **changes: Any) -> None:
        """Change some fields.

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
