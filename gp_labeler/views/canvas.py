"""What shows the frames of the 3D view: a picture painted by Qt, or OpenGL (`views.native_canvas`)."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from typing import Protocol

from qtpy.QtCore import QPointF, QTimer
from qtpy.QtGui import QColor, QImage, QPainter
from qtpy.QtWidgets import QWidget

from gp_labeler.scene.target import RenderTarget
from gp_labeler.views.theme import theme_of

__all__ = ["Canvas", "CanvasView", "PaintedCanvas"]


class CanvasView(Protocol):
    """What a canvas asks of the view that it is in."""

    @property
    def pixels(self) -> tuple[int, int]:
        """Width and height, device pixels."""
        ...

    def draw_frame(self) -> None:
        """Draw the scene as it is now."""
        ...

    def paint_overlay(self, painter: QPainter) -> None:
        """Paint what lies over the frame and changes only with it."""
        ...

    def paint_pointer(self, painter: QPainter) -> None:
        """Paint what follows the pointer and the crosshair."""
        ...

    def forget(self) -> None:
        """Take it that all that was kept on the graphics card is lost."""
        ...


class Canvas(Protocol):
    """Shows the frames of one view; made with the view, and let go of with it."""

    target: RenderTarget
    paints_itself: bool
    """Whether it paints in widgets of its own, which have their frame drawn each time they are painted."""

    @property
    def may_stay(self) -> bool:
        """Whether what is shown may stay until the next frame is drawn in an event of its own.

        It is of the view's size, or nothing has ever been drawn.
        """
        ...

    @property
    def is_shown(self) -> bool:
        """Whether the frame drawn last has been painted."""
        ...

    def ask(self) -> None:
        """Have the scene drawn soon, once for all that is asked till then."""
        ...

    def ask_over(self) -> None:
        """Have what lies over the frame painted soon, and nothing drawn."""
        ...

    def prepare(self) -> bool:
        """Make the scene drawable outside of what Qt paints; return whether it is."""
        ...

    def unseen(self) -> AbstractContextManager[None]:
        """Return the context within which the scene is drawn outside of what Qt paints."""
        ...

    def take(self) -> None:
        """Keep the frame that the scene has just drawn."""
        ...

    def paint(self, painter: QPainter) -> None:
        """Paint the frame and what lies over it, where the view paints them itself."""
        ...

    def resize(self) -> None:
        """Take the view's size."""
        ...

    def release(self) -> None:
        """Let go of what draws; the target is closed already."""
        ...


class PaintedCanvas:
    """Draws in memory and paints the picture: no OpenGL of the display is needed, and no display.

    Parameters
    ----------
    view : QWidget
        The view, a `CanvasView`.
    """

    paints_itself = False

    def __init__(self, view: QWidget) -> None:
        self.target = RenderTarget.offscreen()
        self._view = view
        self._contents: CanvasView = view  # type: ignore[assignment]
        self._frame: QImage | None = None
        self._painted: QImage | None = None
        self._has_painted = False
        self._timer = QTimer(view, interval=0, singleShot=True)
        self._timer.timeout.connect(self._draw)

    @property
    def may_stay(self) -> bool:
        """Whether there is a picture of the view's size, or none yet."""
        frame = self._frame
        return frame is None or (frame.width(), frame.height()) == self._contents.pixels

    @property
    def is_shown(self) -> bool:
        """Whether the picture drawn last has been painted."""
        return self._frame is not None and self._painted is self._frame

    def ask(self) -> None:
        """Draw in an event of its own: other views are painted first, this one once it is drawn."""
        if self._has_painted and self.may_stay:
            self._timer.start()
        else:
            self._view.update()

    def ask_over(self) -> None:
        """Paint the last picture again, with what lies over it now."""
        self._view.update()

    def prepare(self) -> bool:
        """Return True: memory is always there."""
        return True

    def unseen(self) -> AbstractContextManager[None]:
        """Return a context that does nothing: nobody sees what is drawn in memory."""
        return nullcontext()

    def take(self) -> None:
        """Read the pixels, and paint over them: where only the pointer moves, none of it is done again."""
        pixels = self.target.pixels()
        height, width, _ = pixels.shape
        frame = QImage(pixels.data, width, height, 3 * width, QImage.Format.Format_RGB888)
        frame = frame.convertToFormat(QImage.Format.Format_RGB32)  # as the screen has it: painted at once
        frame.setDevicePixelRatio(self._view.devicePixelRatioF())
        painter = QPainter(frame)
        self._contents.paint_overlay(painter)
        painter.end()
        self._frame = frame

    def paint(self, painter: QPainter) -> None:
        """Paint the picture and what lies over it; before there is one, its background."""
        self._has_painted = True
        if self._frame is None:
            painter.fillRect(self._view.rect(), QColor(theme_of(self._view).scene.bottom))
            return
        painter.drawImage(QPointF(0, 0), self._frame)
        self._painted = self._frame
        self._contents.paint_pointer(painter)

    def resize(self) -> None:
        """Do nothing: the next picture has the view's size."""

    def release(self) -> None:
        """Draw no more; the picture stays."""
        self._timer.stop()

    def _draw(self) -> None:
        if self._view.isVisible():
            self._contents.draw_frame()
            self._view.update()
