"""Steps that change or keep what is seen, press keys and run commands."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_labeler.commands.actions import action
from gp_labeler.imaging.anatomical_frame import FRAMES
from gp_labeler.imaging.slab import DENOISERS, Slab
from gp_labeler.models.anatomical_planes import ANATOMICAL_PLANES
from gp_labeler.scene.planes import Plane
from gp_labeler.scripting.events import leave, press_keys
from gp_labeler.scripting.step import Lengths, Pair, Step, Triple
from gp_labeler.scripting.window_driver import VIEWS, WindowDriver
from gp_labeler.views.fonts import TEXT_SIZES
from gp_labeler.views.pictures import PICTURES, picture, write_picture
from gp_labeler.views.theme import THEMES

__all__ = ["Act", "Look", "PressKey", "Screenshot", "Undo"]

_SMALLEST, _LARGEST = 16, 8192
"""Pixels; beyond, graphics memory and the PNG's reader give in."""

_FIELDS = {
    "opacity": "mesh_opacity",
    "outline": "outline_visible",
    "names": "labels_visible",
    "ghosts": "ghosts_visible",
    "axes": "axis_visible",
    "hidden": "hidden_visible",
    "advance": "auto_advance",
    "follow": "follow_ghost",
}
"""Keys of `Look` that are fields of `ViewState` by another name."""


@dataclass(frozen=True)
class Look(Step):
    """Change what the views show; the keys are done in this order.

    Parameters
    ----------
    size : two numbers, optional
        Width and height of the window, logical pixels.
    theme : str, optional
        ``dark`` or ``light``.
    text_size : int, optional
        Of all words, percent of the desktop's: one of 85, 100, 115, 130, 150, 175, 200.
    panel : str, optional
        ``scan`` or ``label``: the panel beside the views.
    layout : str, optional
        ``four-up``, ``two-up`` (3D and the slice in which the chosen feature is best seen), ``3d``,
        ``axial``, ``sagittal`` or ``coronal``.
    reset : bool or str
        Show everything in every view, or in one: ``3d``, ``axial``, ``sagittal`` or ``coronal``.
    camera : str or three numbers, optional
        Look at the bone from ``A``, ``P``, ``L``, ``R``, ``S`` or ``I``, or in a direction.
    go_to : three numbers or str, optional
        A scan position, mm, or a point such as ``CA L``, to bring into view in every view.
    frame : str, optional
        ``head`` or ``scan``: how the views lie, and what letters mean.
    plane : str, optional
        Planes along the anatomy of the active side: ``along`` or ``across`` the modiolar axis, ``round
        window``, ``footplate``, or ``feature``: where the active feature is defined; ``straight`` ends them.
    turn : table of numbers, optional
        Degrees, from right to down on the screen of a view, by which the planes of the two other views turn
        about the crosshair: ``{axial = 15}``, as by dragging an arm of the crosshair there.
    axial, sagittal, coronal : float, optional
        Positions of the slices, mm, in the frame that is shown.
    zoom : float, optional
        Magnify the 3D view, and the slices with the crosshair in their middle.
    opacity : float, optional
        Of the bone, 0 to 1.
    greys : two numbers or str, optional
        Level and width of the grey window of the slices, or ``auto``.
    slab : table or str, optional
        Thickness in mm by what is shown of a thick slab, such as ``{maximum = 0.5}`` (or ``mean``,
        ``minimum``), or ``off``.
    denoise : str, optional
        ``median``, ``gaussian``, ``bilateral`` or ``off``.
    outline, names, ghosts, axes, hidden : bool, optional
        Whether the edge of bone is drawn on the slices, the names of points, where points are expected, the
        axis and the round window, points behind bone.
    glyphs : float or str, optional
        Diameter of points, mm, or ``screen``: the same at any zoom.
    advance, follow : bool, optional
        Whether the next feature is chosen once one is placed, and shown where it is expected.
    """

    do: ClassVar[str] = "view"
    size: Pair | None = None
    theme: str | None = None
    text_size: int | None = None
    panel: str | None = None
    layout: str | None = None
    reset: bool | str = False
    camera: str | Triple | None = None
    go_to: Triple | str | None = None
    frame: str | None = None
    plane: str | None = None
    turn: Lengths | None = None
    axial: float | None = None
    sagittal: float | None = None
    coronal: float | None = None
    zoom: float | None = None
    opacity: float | None = None
    greys: Pair | str | None = None
    slab: Lengths | str | None = None
    denoise: str | None = None
    outline: bool | None = None
    names: bool | None = None
    ghosts: bool | None = None
    axes: bool | None = None
    hidden: bool | None = None
    glyphs: float | str | None = None
    advance: bool | None = None
    follow: bool | None = None

    def __post_init__(self) -> None:
        """Refuse words and sizes that there are not, before any step runs."""
        if self.theme is not None:
            _check(self.theme, "theme", tuple(THEMES))
        if self.text_size is not None:
            _check(str(self.text_size), "text_size", tuple(map(str, TEXT_SIZES)))
        if self.frame is not None:
            _check(self.frame, "frame", FRAMES)
        if self.plane is not None:
            _check(self.plane, "plane", (*ANATOMICAL_PLANES, "feature", "straight"))
        for view in self.turn or ():
            _check(view, "turn", tuple(plane.value for plane in Plane))
        if isinstance(self.greys, str):
            _check(self.greys, "greys", ("auto",))
        if isinstance(self.glyphs, str):
            _check(self.glyphs, "glyphs", ("screen",))
        if self.slab is not None:
            _slab(self.slab)
        if self.denoise is not None:
            _check(self.denoise, "denoise", ("off", *DENOISERS))
        if isinstance(self.reset, str) and self.reset not in VIEWS:
            allowed = ", ".join(VIEWS)
            raise GpError(f"reset must be true or false, or one of {allowed}, got {self.reset!r}")

    def run(self, driver: WindowDriver) -> None:  # noqa: D102
        self._set_window(driver)
        driver.workspace.view.update(**self._shown())
        if isinstance(self.reset, str):
            driver.window.grid.frames[self.reset].view.reset()
        elif self.reset:
            driver.window.grid.reset()
        if isinstance(self.camera, str):
            driver.scene.view_from(self.camera.upper())
        elif self.camera is not None:
            direction = np.array(self.camera) / np.linalg.norm(self.camera)
            axes = driver.workspace.view.frame.axes
            up = -axes[:, 1] if abs(direction @ axes[:, 2]) > 0.95 else axes[:, 2]
            driver.scene.scene.camera.look(direction, up)
            driver.scene.redraw()
        self._go(driver)
        if self.zoom is not None:
            self._magnify(driver, self.zoom)
        driver.app.processEvents()

    def _shown(self) -> dict[str, Any]:
        """Return the fields of the view that are given."""
        given = {name: getattr(self, key) for key, name in _FIELDS.items()}
        shown = {name: value for name, value in given.items() if value is not None}
        if isinstance(self.greys, str):
            shown |= {"level": None, "width": None}
        elif self.greys is not None:
            shown |= {"level": self.greys[0], "width": self.greys[1]}
        if self.slab is not None:
            shown |= {"slab": _slab(self.slab)}
        if self.denoise is not None:
            shown |= {"denoise": None if self.denoise == "off" else self.denoise}
        if isinstance(self.glyphs, str):
            shown |= {"glyph_mm": None}
        elif self.glyphs is not None:
            shown |= {"glyph_mm": self.glyphs}
        return shown

    def _set_window(self, driver: WindowDriver) -> None:
        if self.size is not None:
            driver.window.resize(*_pixels(self.size))
        if self.theme is not None:
            driver.window.set_theme(self.theme)
        if self.text_size is not None:
            driver.window.set_text_size(self.text_size)
        if self.panel is not None:
            _check(self.panel, "panel", tuple(driver.window.steps))
            driver.window.set_step(self.panel)
        if self.layout is not None:
            driver.workspace.view.update(layout=self.layout)
        driver.app.processEvents()  # sizes are known from here on

    def _go(self, driver: WindowDriver) -> None:
        if isinstance(self.go_to, str):
            code, _, side = self.go_to.partition(" ")
            driver.workspace.labels.go_to(Side.parse(side or "L"), code)
        elif self.go_to is not None:
            driver.bring(np.array(self.go_to))
        self._turn_planes(driver)
        crosshair = np.array(driver.workspace.view.crosshair)
        for name, plane in driver.workspace.view.planes.items():
            position = getattr(self, name)
            if position is not None:
                crosshair = plane.moved_to(crosshair, position)
        driver.workspace.view.set_crosshair(crosshair)

    def _turn_planes(self, driver: WindowDriver) -> None:
        workspace = driver.workspace
        if self.frame is not None and workspace.view.frame.name != self.frame:
            workspace.head.show(self.frame == "head")
        if self.plane == "straight":
            workspace.planes.straighten()
        elif self.plane == "feature":
            workspace.planes.show_for(workspace.labels.active.code or "")
        elif self.plane is not None:
            workspace.planes.show(self.plane)
        for view, degrees in (self.turn or {}).items():
            workspace.view.rotate_planes(view, np.radians(degrees))

    def _magnify(self, driver: WindowDriver, factor: float) -> None:
        if factor <= 0:
            raise GpError(f"zoom must be above 0, got {factor:g}")
        camera = driver.scene.scene.camera
        if self.go_to is not None:
            camera.focus_on(driver.workspace.view.crosshair)
        camera.zoom(factor)
        driver.scene.redraw()
        for view in driver.window.grid.slice_views.values():
            if view.shown is not None:
                view.shown = view.shown.centred(driver.workspace.view.crosshair).zoomed(factor)
                view.update()


@dataclass(frozen=True)
class Screenshot(Step):
    """Write a picture.

    Parameters
    ----------
    path : str
        The file, .png.
    what : str
        ``window``, ``views`` (all four), ``slices`` (three side by side), ``3d``, ``axial``, ``sagittal`` or
        ``coronal``.
    size : two numbers, optional
        Width and height in pixels; by default as large as on the screen.
    """

    do: ClassVar[str] = "screenshot"
    says: ClassVar[tuple[str, ...]] = ("path",)
    path: str
    what: str = "window"
    size: Pair | None = None

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        _check(self.what, "what", PICTURES)
        driver.wait_until_idle()
        for view in driver.window.grid.views:
            leave(view)
        size = None if self.size is None else _pixels(self.size)
        image, file = picture(driver.window, self.what, size), driver.to_write(self.path)
        write_picture(image, file)
        return f"{driver.wrote(file)}, {image.width()} x {image.height()}"


@dataclass(frozen=True)
class PressKey(Step):
    """Press keys while the pointer is in a view.

    Parameters
    ----------
    keys : str
        Such as ``Ctrl+Z``, ``Return``, ``Left``.
    view : str
        ``3d``, ``axial``, ``sagittal`` or ``coronal``.
    times : int
        How often.
    """

    do: ClassVar[str] = "key"
    says: ClassVar[tuple[str, ...]] = ("keys",)
    keys: str
    view: str = "axial"
    times: int = 1

    def run(self, driver: WindowDriver) -> None:  # noqa: D102
        view = driver.view(self.view)
        view.setFocus()
        for _ in range(self.times):
            press_keys(view, self.keys)
        driver.wait_until_idle(in_passing=False)


@dataclass(frozen=True)
class Act(Step):
    """Run a command of the window's menus by its id, such as ``point.lock``.

    Parameters
    ----------
    id : str
        The command; an unknown one is answered with all there are.
    answers : text or texts
        What to answer where it asks for one of several, such as ``RWP`` for ``edit.swap``.
    files : text or texts
        What to answer where it asks for files or a folder; those to read are relative to the script, those to
        write to the output folder.
    """

    do: ClassVar[str] = "action"
    says: ClassVar[tuple[str, ...]] = ("id",)
    id: str
    answers: tuple[str, ...] = ()
    files: tuple[str, ...] = ()

    def run(self, driver: WindowDriver) -> None:  # noqa: D102
        if not action(self.id).enabled(driver.workspace):
            raise GpError(f"{self.id} cannot be done now: {driver.workspace.labels.click_text}")
        saves = [driver.to_write(file) for file in self.files]
        driver.prompts.prepare([driver.to_read(file) for file in self.files], self.answers, saves)
        since = len(driver.messages)
        if not driver.window.commands.run(self.id):
            raise GpError(" ".join(driver.warnings(since)) or f"{self.id} was not done")
        driver.wait_until_idle()
        driver.wrote(*(file for file in saves if file.is_file()))


@dataclass(frozen=True)
class Undo(Step):
    """Take back the last edits.

    Parameters
    ----------
    times : int
        How many.
    """

    do: ClassVar[str] = "undo"
    times: int = 1

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        undone = []
        for _ in range(self.times):
            text = driver.workspace.document.undo_text
            if text is None:
                raise GpError("there is nothing to undo")
            undone.append(text)
            driver.window.commands.run("edit.undo")
        driver.wait_until_idle(in_passing=False)
        return ", ".join(undone)


def _slab(given: Lengths | str) -> Slab | None:
    """Return the slab of a table such as ``{maximum = 0.5}``; None for ``off``."""
    if isinstance(given, str):
        _check(given, "slab", ("off",))
        return None
    if len(given) != 1:
        raise GpError("slab must be a table of one thickness, such as {maximum = 0.5}, or off")
    ((mode, mm),) = given.items()
    return Slab(mode, mm)


def _pixels(size: Pair) -> tuple[int, int]:
    width, height = (round(each) for each in size)
    if not (min(width, height) >= _SMALLEST and max(width, height) <= _LARGEST):
        raise GpError(f"size must be from {_SMALLEST} to {_LARGEST} pixels, got {width} x {height}")
    return width, height


def _check(value: str, name: str, allowed: tuple[str, ...]) -> None:
    if value not in allowed:
        raise GpError(f"{name} must be one of {', '.join(allowed)}, got {value!r}")
