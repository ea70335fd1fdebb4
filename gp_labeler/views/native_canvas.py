"""The 3D view on pyvistaqt's widget of OpenGL, drawn by the scene, under a widget that paints the rest.

Imported only where this canvas is chosen: pyvistaqt takes two seconds.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any

from pyvistaqt import QtInteractor
from qtpy.QtCore import QMessageLogContext, Qt, QtMsgType, qInstallMessageHandler
from qtpy.QtGui import QPainter, QPaintEvent
from qtpy.QtWidgets import QWidget

from gp_labeler.scene.target import RenderTarget
from gp_labeler.views.canvas import CanvasView

__all__ = ["NativeCanvas"]


class NativeCanvas:
    """Draws into a widget of OpenGL, which shows it without reading it back.

    Contexts should be shared among windows (`canvas_choice.share_contexts`): else everything must be drawn
    again when the view comes into another window.

    Parameters
    ----------
    view : QWidget
        The view, a `CanvasView`; it takes all events.
    """

    paints_itself = True

    def __init__(self, view: QWidget) -> None:
        self._view = view
        self._contents: CanvasView = view  # type: ignore[assignment]
        self._widget = _DrawnWidget(view, self._draw)
        self._over = _Over(view)
        self._over.raise_()
        self.target = RenderTarget(self._widget.window_of_vtk)
        self._context: Any = None
        self._size = (0, 0)

    @property
    def may_stay(self) -> bool:
        """Whether a frame of the view's size has been drawn, or none yet."""
        return self._size in ((0, 0), self._contents.pixels)

    @property
    def is_shown(self) -> bool:
        """Whether a frame has been drawn: it is while Qt paints."""
        return self._size != (0, 0)

    def ask(self) -> None:
        """Have Qt paint the widget, which draws."""
        self._widget.update()
        self._over.update()

    def ask_over(self) -> None:
        """Paint what lies over the frame; Qt puts it over the widget's last frame."""
        self._over.update()

    def prepare(self) -> bool:
        """Return whether there is a context; Qt makes it when the widget is painted for the first time."""
        if not self.target.is_ready and self._widget.width() > 0:
            self._widget.grabFramebuffer()
        if self.target.is_ready:
            self._take_context()
        return self.target.is_ready

    def unseen(self) -> AbstractContextManager[None]:
        """Return the context within which frames are drawn but not shown."""
        return self.target.unseen()

    def take(self) -> None:
        """Remember the frame's size: the widget shows what was drawn."""
        self._size = self._contents.pixels

    def paint(self, painter: QPainter) -> None:
        """Do nothing: two widgets lie over the view and paint all of it."""

    def resize(self) -> None:
        """Cover the view."""
        for widget in (self._widget, self._over):
            widget.setGeometry(self._view.rect())

    def release(self) -> None:
        """Let go of the widget."""
        self._widget.stop()
        self._widget.close()

    def _draw(self) -> None:
        """Draw while Qt paints, the context being current."""
        self._take_context()
        self._contents.draw_frame()

    def _take_context(self) -> None:
        """Look whether Qt has made another context, as in another window: the old one's pictures are gone."""
        context = self._widget.context()
        if self._context is not None and context is not self._context:
            self._contents.forget()
        self._context = context


class _DrawnWidget(QtInteractor):
    """Shows what a function draws in its render window; takes no event and draws nothing by itself."""

    def __init__(self, parent: QWidget, draw: Any) -> None:
        with _without_warning():
            super().__init__(parent, auto_update=False, multi_samples=0)
        window: Any = self.render_window
        self.window_of_vtk = window
        for renderer in list(self.renderers):
            window.RemoveRenderer(renderer)
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setMinimumSize(0, 0)
        self.setAcceptDrops(False)
        self._interactor = window.GetInteractor()
        self._interactor.SetInteractorStyle(None)
        self._interactor.EnableRenderOff()  # what Qt paints is then asked for by an event alone
        self._tag = self._interactor.AddObserver("RenderEvent", lambda *_: draw())

    def stop(self) -> None:
        """Draw no more."""
        self._interactor.RemoveObserver(self._tag)


@contextmanager
def _without_warning() -> Iterator[None]:
    """Drop what Qt says when pyvistaqt sets the default format: `share_contexts` has set the same."""

    def tell(kind: QtMsgType, context: QMessageLogContext, text: str) -> None:
        if "Setting a new default format" in text:
            return
        if before is None:
            sys.stderr.write(f"{text}\n")
        else:
            before(kind, context, text)

    before = qInstallMessageHandler(tell)
    try:
        yield
    finally:
        qInstallMessageHandler(before)


class _Over(QWidget):
    """Paints what lies over the frame."""

    def __init__(self, view: QWidget) -> None:
        super().__init__(view)
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.setAttribute(Qt.WidgetAttribute.WA_NoSystemBackground)
        self._contents: CanvasView = view  # type: ignore[assignment]

    def paintEvent(self, _: QPaintEvent) -> None:  # noqa: N802
        painter = QPainter(self)
        self._contents.paint_overlay(painter)
        self._contents.paint_pointer(painter)
        painter.end()
