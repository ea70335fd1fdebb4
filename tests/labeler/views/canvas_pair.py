"""A program of its own for the tests of the native canvas: ``canvas_pair.py TRIAL`` prints JSON.

It needs an X server: Qt makes contexts of OpenGL once for each process, and scales once.
"""

from __future__ import annotations

import gc
import json
import os
import sys
import time
import weakref
from pathlib import Path

import numpy as np
from qtpy.QtCore import QCoreApplication, QEvent, QPoint, Qt
from qtpy.QtGui import QImage
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QApplication, QHBoxLayout, QWidget
from window_cases import BALL_MM, MIDDLE, ball_volume

from gp_core import Side
from gp_labeler.models.workspace import Workspace
from gp_labeler.scene.gestures import Button
from gp_labeler.scene.scene3d import Scene3D
from gp_labeler.views.canvas import PaintedCanvas
from gp_labeler.views.canvas_choice import share_contexts

LEFT, PLAIN = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier


class Trial:
    """A workspace with a ball of bone, and views of it in windows of their own."""

    def __init__(self) -> None:
        from gp_labeler.views.application import make_application, make_window
        from gp_labeler.views.native_canvas import NativeCanvas

        self.app = make_application()
        self.window = make_window(None, atlas=False)
        self.kinds = {"painted": PaintedCanvas, "native": NativeCanvas}
        self.workspace: Workspace = self.window.workspace
        self.workspace.scan.begin(ball_volume())
        while self.workspace.jobs.running:
            self.app.processEvents()
            time.sleep(0.005)
        for code, x in (("CA", 0.0), ("RWP", 2.0), ("OS", -2.0)):
            on_bone = MIDDLE + np.array([x, -np.sqrt(BALL_MM**2 - x**2), 0.0])
            self.workspace.labels.place(on_bone, side=Side.LEFT, code=code)
        self.workspace.view.set_crosshair(MIDDLE + np.array([1.0, -BALL_MM, 1.0]))

    def show(self, *kinds: str, size=(380, 332)) -> tuple[QWidget, list]:
        """Return a window with views on it, drawn to the end."""
        from gp_labeler.views.scene_view import SceneView

        top = QWidget()
        row = QHBoxLayout(top)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(0)
        views = [SceneView(self.workspace, top, self.kinds[kind]) for kind in kinds]
        for view in views:
            row.addWidget(view)
        top.resize(size[0] * len(kinds), size[1])
        top.move(0, 0)
        top.show()
        QTest.qWaitForWindowExposed(top)
        for view in views:
            view.scene.bone.show(self.workspace.bone.surfaces, self.workspace.bone.quick_surfaces)
            view.scene.fit()
            view.redraw()
        self.rest(*views)
        return top, views

    def rest(self, *views) -> None:
        """Wait until all is drawn and shown."""
        end = time.monotonic() + 60
        while time.monotonic() < end:
            QTest.qWait(10)
            if all(view.is_up_to_date and view.scene.is_fine for view in views):
                break
        QTest.qWait(120)


def pixels(image: QImage) -> np.ndarray:
    image = image.convertToFormat(QImage.Format.Format_RGB888)
    rows = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), image.bytesPerLine())
    return rows[:, : 3 * image.width()].reshape(image.height(), image.width(), 3).astype(int)


def differing(one: np.ndarray, other: np.ndarray) -> int:
    return int((np.abs(one - other).max(axis=-1) > 0).sum()) if one.shape == other.shape else -1


def on_screen(view) -> np.ndarray:
    """What the X server shows of a view, overlay included."""
    whole = pixels(view.screen().grabWindow(0).toImage())
    corner, ratio = view.mapToGlobal(QPoint(0, 0)), view.devicePixelRatioF()
    x, y = round(corner.x() * ratio), round(corner.y() * ratio)
    width, height = view.scene.target.size
    return whole[y : y + height, x : x + width]


def over_of(view) -> QWidget:
    from qtpy.QtOpenGLWidgets import QOpenGLWidget

    from gp_labeler.views.focus_ring import FocusRing

    (over,) = [w for w in view.findChildren(QWidget) if not isinstance(w, (QOpenGLWidget, FocusRing))]
    return over


def same_pictures(trial: Trial) -> dict:
    """Criteria 1, 2 and 4: the same pixels, picks and gestures; a ring draws no frame."""
    top, (painted, native) = trial.show("painted", "native")
    hover = painted.scene.pick(*(n / 2 for n in painted.scene.target.size)).point
    for view in (painted, native):
        QTest.mouseMove(view, QPoint(*(round(n) for n in view.pixel_at(hover))))
        QTest.qWait(60)
    for view in (painted, native):
        QTest.mouseMove(view, QPoint(2, 2))
    trial.rest(painted, native)
    found = {"ratio": native.devicePixelRatioF(), "pixels": int(np.prod(native.scene.target.size))}
    found["grab"] = differing(pixels(painted.grab().toImage()), pixels(native.grab().toImage()))
    shown = on_screen(painted), on_screen(native)
    found["screen"], found["screen_most"] = differing(*shown), int(np.abs(shown[0] - shown[1]).max())
    over_of(native).lower()
    native.redraw()
    trial.rest(native)
    found["control"] = differing(on_screen(painted), on_screen(native))
    over_of(native).raise_()
    rng = np.random.default_rng(1)
    picks = [
        (painted.scene.pick(x, y), native.scene.pick(x, y))
        for x, y in rng.uniform((0, 0), native.scene.target.size, (400, 2))
    ]
    found["picks"] = sum(
        (a is None) == (b is None) and (a is None or float(np.abs(a.point - b.point).max()) < 1e-9)
        for a, b in picks
    )
    found["hits"] = sum(a is not None for a, _ in picks)
    frames = []
    native.frame_drawn.connect(lambda: frames.append(1))
    for n in range(10):
        QTest.mouseMove(native, QPoint(200 + 3 * n, 180))
        QTest.qWait(20)
    found["frames_for_a_ring"] = len(frames)
    twin = painted.scene
    found["camera_off_before"] = camera_off(twin, native.scene)
    start = native.scene.camera.state()
    handle, ratio = top.windowHandle(), native.devicePixelRatioF()
    corner = native.mapTo(top, QPoint(0, 0))
    QTest.mousePress(handle, LEFT, PLAIN, corner + QPoint(60, 70))
    for n in range(1, 6):
        QTest.mouseMove(handle, corner + QPoint(60 + 10 * n, 70 + 5 * n))
        QTest.qWait(10)
    QTest.mouseRelease(handle, LEFT, PLAIN, corner + QPoint(110, 95))
    twin.control.press(Button.LEFT, 60 * ratio, 70 * ratio)
    for n in range(1, 6):
        twin.control.move((60 + 10 * n) * ratio, (70 + 5 * n) * ratio)
    twin.control.release(110 * ratio, 95 * ratio)
    found["camera_off"] = camera_off(twin, native.scene)
    for key in (Qt.Key.Key_Q, Qt.Key.Key_W, Qt.Key.Key_E, Qt.Key.Key_3):
        QTest.keyClick(handle, key)
    found["camera_off_after_keys"] = camera_off(twin, native.scene)
    found["turned"] = float(np.abs(np.subtract(start["position"], twin.camera.state()["position"])).max())
    trial.rest(native)
    native.scene.camera.rotate(40, 0)
    native.redraw(quick=True)
    grabbed = pixels(native.grab().toImage())
    trial.rest(native)
    found["early_grab"] = differing(grabbed, pixels(native.grab().toImage()))
    for view in (painted, native):
        view.release()
    top.close()
    return found


def camera_off(one: Scene3D, other: Scene3D) -> float:
    states = [scene.camera.state() for scene in (one, other)]
    return max(
        float(np.abs(np.subtract(states[0][k], states[1][k])).max()) for k in ("position", "focus", "up")
    )


def cycles(trial: Trial) -> dict:
    """Criterion 3: opened and closed again and again, nothing stays."""
    kept, files, memory = [], [], []
    for _ in range(10):
        top, (view,) = trial.show("native", size=(300, 260))
        drawn = float(pixels(view.grab().toImage()).std())
        kept.append([weakref.ref(each) for each in (view.scene, view.scene.target.window, view.canvas)])
        view.release()
        top.close()
        top.deleteLater()
        del top, view
        QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
        QTest.qWait(20)
        gc.unfreeze()  # as the program does when its window rests
        gc.collect()
        files.append(len(list(Path("/proc/self/fd").iterdir())))
        memory.append(int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6)
    alive = [sum(refs[n]() is not None for refs in kept) for n in range(3)]
    return {"alive": alive, "files": files, "grown_mb": memory[-1] - memory[1], "drawn": drawn}


def moves(trial: Trial) -> dict:
    """Criterion 3: another top-level window, four times."""
    top, (view,) = trial.show("native", size=(320, 280))
    other = QWidget()
    row = QHBoxLayout(other)
    row.setContentsMargins(0, 0, 0, 0)
    other.resize(320, 280)
    before, found = pixels(view.grab().toImage()), []
    for n in range(4):
        here = other if n % 2 == 0 else top
        here.layout().addWidget(view)
        here.show()
        view.show()
        QTest.qWaitForWindowExposed(here)
        view.redraw()
        trial.rest(view)
        found.append(differing(before, pixels(view.grab().toImage())))
    forgotten = view.scene.target.n_forgotten
    view.release()
    return {"differing": found, "forgotten": forgotten, "drawn": float(before.std())}


def main() -> None:
    name = sys.argv[1]
    if "alone" in sys.argv:  # without what is shared among contexts
        QApplication([])
    else:
        share_contexts()
    found = {"same": same_pictures, "cycles": cycles, "moves": moves}[name](Trial())
    sys.stdout.write(json.dumps(found) + "\n")
    sys.stdout.flush()
    os._exit(0)


if __name__ == "__main__":
    main()
