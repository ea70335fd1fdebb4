"""Which canvas the 3D view gets: chosen once, when the program starts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from qtpy.QtCore import QCoreApplication, Qt
from qtpy.QtGui import QSurfaceFormat
from qtpy.QtWidgets import QApplication, QWidget

from gp_core.settings import setting
from gp_labeler.views.canvas import Canvas, PaintedCanvas
from gp_labeler.views.opengl import is_software, opengl_format, renderer_name
from gp_labeler.views.window_state import WindowState

__all__ = [
    "SETTINGS",
    "VARIABLE",
    "CanvasChoice",
    "CanvasTiming",
    "canvas_for",
    "choose_canvas",
    "make_canvas",
    "share_contexts",
    "wanted_canvas",
]

SETTINGS = ("automatic", "painted", "native")
VARIABLE = "GP_LABELER_CANVAS"
"""The variable of the environment that overrules the setting."""

_PROPERTY = "gp_labeler_canvas"


@dataclass(frozen=True)
class CanvasTiming:
    """How fast both canvases were in a helper process.

    Parameters
    ----------
    renderer : str
        Of OpenGL, at that time: another one must be measured again.
    painted_ms, native_ms : float
        For a whole frame, turned and shown.
    """

    renderer: str
    painted_ms: float
    native_ms: float

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> CanvasTiming | None:
        """Return what was remembered, None where that is no timing."""
        try:
            return cls(str(values["renderer"]), float(values["painted_ms"]), float(values["native_ms"]))
        except (KeyError, TypeError, ValueError, OverflowError):
            return None


@dataclass(frozen=True)
class CanvasChoice:
    """Which canvas, and why.

    Parameters
    ----------
    kind : str
        ``painted`` or ``native``.
    reason : str
        For the user and ``gp-labeler doctor``.
    to_measure : bool
        Whether only a measurement can tell, and there is none for this renderer.
    """

    kind: str
    reason: str
    to_measure: bool = False


def choose_canvas(memory: WindowState) -> CanvasChoice:
    """Choose the canvas of this run, before its first window is made; later calls return the same.

    Parameters
    ----------
    memory : WindowState
        The setting ``canvas``, and what was measured, ``canvas_timing``.

    Raises
    ------
    GpError
        The variable ``GP_LABELER_CANVAS``, or the user's settings, which overrule it, name no canvas.
    """
    app = QApplication.instance()
    made = None if app is None else app.property(_PROPERTY)
    if isinstance(made, CanvasChoice):
        return made
    choice = canvas_for(wanted_canvas(memory), renderer_name, CanvasTiming.of(memory.fields("canvas_timing")))
    if app is not None:
        app.setProperty(_PROPERTY, choice)
    return choice


def wanted_canvas(memory: WindowState) -> str:
    """Return the setting that holds: of `SETTINGS`."""
    named: str | None = setting("canvas")
    if named is not None:
        return named
    remembered: str = memory.get("canvas", str, "automatic")
    return remembered if remembered in SETTINGS else "automatic"


def canvas_for(
    setting: str, find_renderer: Callable[[], str | None], timing: CanvasTiming | None
) -> CanvasChoice:
    """Choose by a setting, the renderer's name, which is asked for only where it counts, and a timing."""
    if setting == "painted":
        return CanvasChoice("painted", "chosen by the setting")
    name = find_renderer()
    if name is None:
        return CanvasChoice("painted", "no OpenGL on this display")
    if setting == "native":
        return CanvasChoice("native", f"chosen by the setting ({name})")
    if is_software(name):
        return CanvasChoice("painted", f"software OpenGL ({name})")
    if timing is None or timing.renderer != name:
        return CanvasChoice("painted", f"not measured yet on {name}", to_measure=True)
    kind = "native" if timing.native_ms < timing.painted_ms else "painted"
    figures = f"painted {timing.painted_ms:.0f} ms, native {timing.native_ms:.0f} ms per frame"
    return CanvasChoice(kind, f"faster on {name}: {figures}")


def make_canvas(view: QWidget) -> Canvas:
    """Return the canvas of a view, of the kind that was chosen; painted where none was."""
    app = QApplication.instance()
    choice = None if app is None else app.property(_PROPERTY)
    if isinstance(choice, CanvasChoice) and choice.kind == "native":
        from gp_labeler.views.native_canvas import NativeCanvas  # two seconds of imports

        return NativeCanvas(view)
    return PaintedCanvas(view)


def share_contexts() -> None:
    """Let all windows share what is kept on the graphics card; before the application is made."""
    QSurfaceFormat.setDefaultFormat(opengl_format())  # the version must be the same in all of them
    QCoreApplication.setAttribute(Qt.ApplicationAttribute.AA_ShareOpenGLContexts)
