"""Where the 3D scene is drawn: a window of a display, or memory where there is none.

This is the one seam between the two; the scene does not know which it is.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, cast

import numpy as np
import vtkmodules.vtkRenderingFreeType  # fonts: VTK finds them through its object factory
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401 - and the OpenGL classes
from numpy.typing import NDArray
from vtkmodules.vtkCommonCore import VTK_UNSIGNED_CHAR, vtkObject, vtkUnsignedCharArray
from vtkmodules.vtkRenderingCore import vtkRenderer, vtkRenderWindow
from vtkmodules.vtkRenderingOpenGL2 import vtkOpenGLFramebufferObject as Framebuffer

from gp_core.errors import GpError
from gp_labeler.imaging.vtk_arrays import to_numpy

__all__ = ["RenderTarget"]

_SMALLEST = 16

_COLOUR, _DEPTH = 0x4000, 0x100
_NEAREST, _LINEAR = 0x2600, 0x2601
"""OpenGL's words for what is copied, and how it is stretched."""


class RenderTarget:
    """A VTK render window that one scene draws into.

    Parameters
    ----------
    window : vtkRenderWindow
        Of a widget on the screen, or made by `offscreen`.
    """

    def __init__(self, window: vtkRenderWindow) -> None:
        self._window: vtkRenderWindow | None = window
        self._kept: dict[str, tuple[tuple[int, int], Any]] = {}
        self.n_forgotten = 0
        """How often everything that was kept has been lost, see `forget`."""
        window.SetNumberOfLayers(2)
        window.SetAlphaBitPlanes(1)

    @classmethod
    def offscreen(cls, width: int = 800, height: int = 600) -> RenderTarget:
        """Make a target in memory; it needs no display, and no graphics card.

        Raises
        ------
        GpError
            There is no OpenGL at all.
        """
        with _quiet():  # where there is no display, VTK says so before it takes EGL or OSMesa
            window = vtkRenderWindow()
        window.SetShowWindow(False)
        window.SetOffScreenRendering(True)
        window.SetMultiSamples(0)
        cast(Any, window).SetFrameBlitModeToNoBlit()  # nothing to show it on: pixels are read as drawn
        window.SetSize(max(width, _SMALLEST), max(height, _SMALLEST))
        if not window.SupportsOpenGL():
            raise GpError(
                f"no OpenGL to draw with ({window.ReportCapabilities() or window.GetClassName()})",
                remedy="Install Mesa's libEGL or libOSMesa.",
            )
        return cls(window)

    @property
    def window(self) -> vtkRenderWindow:
        """The VTK window.

        Raises
        ------
        RuntimeError
            The target is closed.
        """
        if self._window is None:
            raise RuntimeError("the render target is closed")
        return self._window

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, device pixels."""
        width, height = self.window.GetSize()
        return max(width, 1), max(height, 1)

    @property
    def is_ready(self) -> bool:
        """Whether it can be drawn into: a window of a widget cannot before its context is made."""
        ready = getattr(self._window, "GetReadyForRendering", None)
        return self._window is not None and (ready is None or bool(ready()))

    @contextmanager
    def unseen(self) -> Iterator[None]:
        """Draw into the window of a widget without showing it, outside of what its toolkit paints."""
        self.window.MakeCurrent()
        self._gl.GetState().Reset()  # the toolkit has used OpenGL since: what VTK remembers of it is old
        self.window.SetSwapBuffers(False)
        try:
            yield
        finally:
            self.window.SetSwapBuffers(True)

    def forget(self) -> None:
        """Drop all that was kept: it is gone with the context of OpenGL that it was kept in."""
        self._kept.clear()
        self.n_forgotten += 1

    def resize(self, width: int, height: int) -> None:
        """Take another size, device pixels."""
        if (width, height) != self.window.GetSize():
            self.window.SetSize(max(int(width), _SMALLEST), max(int(height), _SMALLEST))

    def add(self, renderer: vtkRenderer) -> None:
        """Draw a renderer from now on."""
        self.window.AddRenderer(renderer)

    def render(self) -> None:
        """Draw one frame."""
        self.window.Render()

    def draw(self, *renderers: vtkRenderer) -> None:
        """Draw these renderers alone, over what is there, and wait until that is done."""
        for renderer in self._renderers():
            renderer.SetDraw(any(renderer is one for one in renderers))
        self.window.Render()
        self.window.WaitForCompletion()

    def keep(self, name: str, *, depth: bool = True, part: tuple[int, int] | None = None) -> None:
        """Remember the picture as drawn so far, under a name.

        Parameters
        ----------
        name : str
            What to call it.
        depth : bool
            Whether the depths are remembered too, or those of before stay.
        part : (width, height), optional
            Only the lower left part of the picture, enlarged to the whole of it.
        """
        self._copy(self._drawn, self._store(name), part or self.size, self.size, depth)

    def restore(self, name: str) -> None:
        """Bring back, with its depths, the picture remembered under a name; the size must be the same."""
        self._copy(self._store(name), self._drawn, self.size, self.size, True)

    def pixels(self) -> NDArray[np.uint8]:
        """Return the frame as drawn last, (h, w, 3), rows from the top."""
        width, height = self.size
        data = vtkUnsignedCharArray()
        front = 0 if self.window.GetOffScreenRendering() else 1
        self.window.GetPixelData(0, 0, width - 1, height - 1, front, data, 0)
        return np.ascontiguousarray(to_numpy(data).reshape(height, width, 3)[::-1])

    def close(self) -> None:
        """Let go of the window and of what it holds on the graphics card."""
        if self._window is None:
            return
        for _, store in self._kept.values() if self.is_ready else ():
            store.ReleaseGraphicsResources(self._window)
        self._kept.clear()
        for renderer in self._renderers():
            self._window.RemoveRenderer(renderer)
        self._window.Finalize()
        self._window = None

    def _renderers(self) -> list[vtkRenderer]:
        found = self.window.GetRenderers()
        return [cast(vtkRenderer, found.GetItemAsObject(n)) for n in range(found.GetNumberOfItems())]

    @property
    def _gl(self) -> Any:
        """The window, whose class for OpenGL has more to it than its declaration says."""
        return self.window

    @property
    def _drawn(self) -> Any:
        return self._gl.GetRenderFramebuffer()

    def _store(self, name: str) -> Any:
        """Return the memory of a name, as large as the picture."""
        size, store = self._kept.get(name, ((0, 0), None))
        if size == self.size:
            return store
        if store is not None:
            store.ReleaseGraphicsResources(self.window)
        self.window.MakeCurrent()
        state, store = self._gl.GetState(), Framebuffer()
        store.SetContext(self.window)
        state.PushFramebufferBindings()
        stencil = bool(self.window.GetStencilCapable())  # depths are copied between equal formats only
        store.PopulateFramebuffer(*self.size, True, 1, VTK_UNSIGNED_CHAR, True, 32, 0, stencil)
        state.PopFramebufferBindings()
        self._kept[name] = (self.size, store)
        return store

    def _copy(self, source: Any, to: Any, part: tuple[int, int], whole: tuple[int, int], depth: bool) -> None:
        self.window.MakeCurrent()
        state = self._gl.GetState()
        state.PushFramebufferBindings()
        source.Bind(source.GetReadMode())
        source.ActivateReadBuffer(0)
        to.Bind(to.GetDrawMode())
        to.ActivateDrawBuffer(0)
        state.vtkglScissor(0, 0, *whole)  # the last renderer left its own corner
        what = _COLOUR | _DEPTH if depth else _COLOUR
        Framebuffer.Blit((0, part[0], 0, part[1]), (0, whole[0], 0, whole[1]), what, _NEAREST)
        if (
            part != whole and min(part) > 2
        ):  # smoothly, but at the edge, which would mix with what lies beside
            inner = (1, part[0] - 1, 1, part[1] - 1)
            enlarged = [round(n * whole[k // 2] / part[k // 2]) for k, n in enumerate(inner)]
            Framebuffer.Blit(inner, enlarged, _COLOUR, _LINEAR)
        state.PopFramebufferBindings()


@contextmanager
def _quiet() -> Iterator[None]:
    shown = vtkObject.GetGlobalWarningDisplay()
    vtkObject.GlobalWarningDisplayOff()
    try:
        yield
    finally:
        vtkObject.SetGlobalWarningDisplay(shown)
