"""Shared by the tests of the window: a ball of bone, answers to its questions, closing and waiting."""

from __future__ import annotations

import gc
import time
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
from qtpy.QtCore import QCoreApplication, QEvent, QEventLoop, Qt, QTimer
from qtpy.QtGui import QImage
from qtpy.QtWidgets import QApplication, QWidget

from gp_labeler.imaging.volume import Volume
from gp_labeler.views.prompts import Prompts

BALL_MM, VOXEL_MM = 6.0, 0.25
PATIENCE_MS = 120_000
"""How long a test waits for what must come true: only a failure lasts that long, however busy the machine."""

LET_GO_S = 10.0
"""How long what a test showed may live on: only a leak lasts that long."""

MIDDLE = np.array([10.0, -20.0, 30.0])


def ball_volume() -> Volume:
    """A ball of bone, hollow in the middle, away from the origin; its outer radius is `BALL_MM`."""
    n = 64
    start = MIDDLE - VOXEL_MM * (n - 1) / 2
    axis = [start[a] + VOXEL_MM * np.arange(n) - MIDDLE[a] for a in range(3)]
    z, y, x = np.meshgrid(axis[2], axis[1], axis[0], indexing="ij")
    away = np.sqrt(x**2 + y**2 + z**2)
    value = 1000 + 400 * np.clip((BALL_MM - away) / VOXEL_MM, -1, 1)
    value[away < 3.0] = 700
    return Volume.from_parts(value.astype(np.float32), [VOXEL_MM] * 3, start, name="ball")


def on_ball(*direction: float) -> np.ndarray:
    """The point of the ball in a direction from its middle, (3,) mm."""
    towards = np.array(direction, dtype=float)
    return MIDDLE + BALL_MM * towards / np.linalg.norm(towards)


def write_ball(file: Path) -> Path:
    """Write that ball as a scan."""
    import SimpleITK as sitk  # noqa: N813

    volume = ball_volume()
    image = sitk.GetImageFromArray(volume.array)
    image.SetSpacing(volume.spacing)
    image.SetOrigin(volume.origin.tolist())
    sitk.WriteImage(image, str(file))
    return file


class Answers(Prompts):
    """Answers questions in the user's place, and remembers them."""

    in_dialogs = False

    def __init__(self) -> None:
        super().__init__()
        self.asked: list[str] = []
        self.answers: list[str] = []
        self.files: list[Path] = []

    def choose(self, title: str, text: str, answers: list[str], **_: object) -> str:
        self.asked.append(title)
        given = self.answers.pop(0) if self.answers else "Do not save"
        return given if given in answers else ""

    def tell(self, title: str, text: str) -> None:
        self.asked.append(title)

    def open_files(self, *_: object, **__: object) -> list[Path]:
        return self.files

    def folder(self, *_: object, **__: object) -> Path | None:
        return self.files[0] if self.files else None

    def save_file(self, *_: object) -> Path | None:
        return self.files[0] if self.files else None

    def item(self, title: str, text: str, items: list[str]) -> str:
        given = self.answers.pop(0)
        return next(item for item in items if item.startswith(given))

    def text(self, title: str, text: str, value: str = "") -> str | None:
        self.asked.append(text)
        return self.answers.pop(0) if self.answers else None

    def number(self, title: str, text: str, value: float) -> float | None:
        self.asked.append(text)
        return value


def drop_file(widget, path: Path, x: float = 9, y: float = 9, entered: Callable[[], object] = bool) -> None:
    """Drag a file onto a widget and let it go; `entered` is called while it hovers."""
    from qtpy.QtCore import QMimeData, QPointF, Qt, QUrl
    from qtpy.QtGui import QDragEnterEvent, QDropEvent
    from qtpy.QtWidgets import QApplication

    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(str(path))])
    where = QPointF(x, y)
    how = (Qt.DropAction.CopyAction, data, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier)
    try:
        entering = QDragEnterEvent(where, *how)
    except TypeError:  # PySide6 before 6.12; from there on, whole pixels are deprecated
        entering = QDragEnterEvent(where.toPoint(), *how)
    QApplication.sendEvent(widget, entering)
    assert entering.isAccepted()
    entered()
    QApplication.sendEvent(widget, QDropEvent(where, *how))


def close(window) -> None:
    """Close a window and let Qt delete it."""
    from qtpy.compat import isalive

    if not isalive(window):
        return
    window.prompts.answers = ["Do not save"]
    window.close()
    window.deleteLater()
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)


def left_behind() -> Counter[str]:
    """Count the widgets, and the actors, renderers and render windows of VTK, that are alive, by type."""
    return _never_let_go(lambda: _names(_but_the_desktop(QApplication.allWidgets())) + _scenes())


def left_by_test(before: list[QWidget], patience_s: float = LET_GO_S) -> Counter[str]:
    """Count the windows that were not there before, by type; where none was, the parts of scenes too."""

    def alive() -> Counter[str]:
        windows = _names(widget for widget in top_level_widgets() if widget not in before)
        return windows if before else windows + _scenes()

    return _never_let_go(alive, patience_s)


def top_level_widgets() -> list[QWidget]:
    """Return all windows, dialogs and menus that are alive, shown or not."""
    return _but_the_desktop(QApplication.topLevelWidgets())


def _but_the_desktop(widgets: Iterable[QWidget]) -> list[QWidget]:
    """Leave out Qt's own widget of the whole desktop, which some versions make with a menu."""
    return [widget for widget in widgets if widget.windowType() != Qt.WindowType.Desktop]


def _never_let_go(alive: Callable[[], Counter[str]], patience_s: float = LET_GO_S) -> Counter[str]:
    """Count what is still alive once threads that end and events that wait have had time to let go of it."""
    end = time.monotonic() + patience_s
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
    left = alive()
    gc.unfreeze()  # what the program leaves out until it rests
    while left:
        gc.collect()  # windows and their parts know each other
        one_turn()
        left = alive()
        if time.monotonic() > end:
            break
    return left


def _names(things: Iterable[object]) -> Counter[str]:
    return Counter(type(thing).__name__ for thing in things)


def _scenes() -> Counter[str]:
    drawn = ("vtkRenderWindow", "vtkRenderer", "vtkProp")
    types = Counter(map(type, gc.get_objects()))
    return Counter(
        {t.__name__: n for t, n in types.items() if any(base.__name__ in drawn for base in t.__mro__)}
    )


def one_turn() -> None:
    """Let Qt do all that is due: what was posted, timers that are over, and what both of these post."""
    for _ in range(3):
        let_run(0)


def let_run(ms: int) -> None:
    """Let the event loop run; `QTest.qWait` would keep Python's lock, and background work stand still."""
    loop = QEventLoop()
    QTimer.singleShot(ms, loop.quit)
    loop.exec()


def wait_until_idle(qtbot, window, seconds: float = PATIENCE_MS / 1000) -> None:
    """Wait until all work is done, and all is drawn."""
    workspace = window.workspace
    qtbot.waitUntil(lambda: not workspace.jobs.running, timeout=int(1000 * seconds))
    one_turn()
    view = window.grid.scene_view  # drawn in an event of its own, which a busy machine may put off
    qtbot.waitUntil(lambda: not (view.is_stale and view.isVisible()), timeout=int(1000 * seconds))


def image_bytes(image: QImage) -> np.ndarray:
    """Return a copy of a picture's bytes, whichever binding Qt has: the picture may be gone before them."""
    bits = image.constBits()
    raw = bits.asarray(image.sizeInBytes()) if hasattr(bits, "asarray") else bits
    return np.frombuffer(raw, np.uint8).copy()


def shown_pixels(view) -> np.ndarray:
    """What a view shows now, (height, width, 3), blue, green, red."""
    image = view.grab().toImage().convertToFormat(QImage.Format.Format_RGB32)
    return image_bytes(image).reshape(image.height(), image.width(), 4)[..., :3].astype(int)
