"""Where the 3D scene is drawn: a window of a display, or memory where there is none.

This is the one seam between the two; the scene does not know which it is.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import vtkmodules.vtkRenderingFreeType  # fonts: VTK finds them through its object factory
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401 - and the OpenGL classes
from numpy.typing import NDArray
from vtkmodules.vtkCommonCore import vtkObject, vtkUnsignedCharArray
from vtkmodules.vtkRenderingCore import vtkRenderer, vtkRenderWindow

from gp_core.errors import GpError
from gp_labeler.imaging.vtk_arrays import to_numpy

__all__ = ["RenderTarget"]

_SMALLEST = 16


class RenderTarget:
    """A VTK render window that one scene draws into.

    Parameters
    ----------
    window : vtkRenderWindow
        Of a widget on the screen, or made by `offscreen`.
    """

    def __init__(self, window: vtkRenderWindow) -> None:
        self._window: vtkRenderWindow | None = window
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
        renderers = self._window.GetRenderers()
        while renderers.GetNumberOfItems():
            self._window.RemoveRenderer(renderers.GetFirstRenderer())
        self._window.Finalize()
        self._window = None


@contextmanager
def _quiet() -> Iterator[None]:
    shown = vtkObject.GetGlobalWarningDisplay()
    vtkObject.GlobalWarningDisplayOff()
    try:
        yield
    finally:
        vtkObject.SetGlobalWarningDisplay(shown)
