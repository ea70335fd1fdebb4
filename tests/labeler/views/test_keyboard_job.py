"""The whole job by real keys alone: scan, atlas, landmarks, export, touches, pose, verdict; no mouse."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from panel_cases import ATLAS
from qtpy.compat import isalive
from qtpy.QtCore import QTimer
from qtpy.QtGui import QKeySequence
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QApplication, QDialog, QWidget
from window_cases import MIDDLE, VOXEL_MM, Answers, wait_until_idle, write_ball

from gp_core import PROBE, Side, load_specimens, read_pose
from gp_labeler.models.labels import PointState
from gp_labeler.scene.planes import Plane
from gp_labeler.views.prompts import Prompts

FIRST = ("CA", "RWP", "OS")
TIMES = 60


def there(code: str) -> np.ndarray:
    """Where a feature is in the ball: it holds the middle of an ear."""
    ahead, out, up = ATLAS[code] - ATLAS["CO"]
    return np.add(MIDDLE, [out, -ahead, up])


class Keyboard:
    """Presses keys wherever the keyboard is."""

    def __init__(self, window, qtbot) -> None:
        self.window, self.qtbot = window, qtbot

    @property
    def place(self) -> QWidget:
        """The widget that the next key goes to."""
        if QApplication.activeWindow() is None:  # a window manager does it after a dialog
            self.window.activateWindow()
            QApplication.processEvents()
        return QApplication.activePopupWidget() or QApplication.focusWidget() or self.window

    def press(self, *keys: str) -> None:
        for one in keys:
            QTest.keySequence(self.place, QKeySequence(one))
            QApplication.processEvents()

    def type(self, words: str, *keys: str) -> None:
        for letter in words:  # the first may open a field, which the others go to
            QTest.keyClicks(self.place, letter)
        QApplication.processEvents()
        self.press(*keys)

    def press_until(self, key: str, is_there: Callable[[], bool]) -> None:
        """Press a key until it has led somewhere."""
        for _ in range(TIMES):
            if is_there():
                return
            self.press(key)
        raise AssertionError(f"{key} never leads there: the keyboard is at {self.place}")

    def tab_to(self, name: str) -> None:
        self.press_until("Tab", lambda: _name(self.place).startswith(name))

    def answer(self, keys: str, words: str, *then: str) -> None:
        """Press keys that open a question, and type its answer there."""
        is_answered = []

        def type_answer() -> None:
            dialog = QApplication.activeModalWidget()
            if isinstance(dialog, QDialog) and dialog.isVisible() and dialog.isActiveWindow():
                is_answered.append(True)
                self.type(words, *then)
            else:
                QTimer.singleShot(10, type_answer)

        QTimer.singleShot(0, type_answer)
        self.press(keys)
        self.qtbot.waitUntil(lambda: bool(is_answered))

    def choose(self, menu: str, entry: str) -> None:
        """Open a menu by its letter, and go down to an entry."""
        self.press(menu)
        self.qtbot.waitUntil(lambda: QApplication.activePopupWidget() is not None)
        popup = QApplication.activePopupWidget()
        self.press_until(
            "Down", lambda: popup.activeAction() is not None and popup.activeAction().text() == entry
        )


def _name(widget: QWidget) -> str:
    text = getattr(widget, "text", lambda: "")
    return widget.accessibleName() or text()


@pytest.fixture
def keyboard(make_window, qtbot, tmp_path) -> Iterator[Keyboard]:
    write_ball(tmp_path / "ball.nrrd")
    ATLAS.save(tmp_path / "atlas.json")
    window = make_window()
    window.prompts = Prompts(window, window.memory)
    qtbot.waitUntil(window.isActiveWindow)
    yield Keyboard(window, qtbot)
    window.prompts = Answers()  # else a test that failed would be asked whether to save


def test_the_whole_job_by_keyboard_alone(keyboard, qtbot, tmp_path) -> None:
    window, labels = keyboard.window, keyboard.window.workspace.labels
    _open_scan_and_atlas(keyboard, tmp_path)
    _place_first(keyboard)
    qtbot.waitUntil(lambda: bool(labels.ghosts(Side.LEFT)))
    _judge_ghosts(keyboard)
    _save_and_export(keyboard, tmp_path)
    _touch(keyboard)
    _judge_pose(keyboard, tmp_path)
    keyboard.answer("Ctrl+Q", "", "Return")  # saves what came since
    qtbot.waitUntil(lambda: not isalive(window) or not window.isVisible())
    assert '"verdict": "accept"' in (tmp_path / "ball.gpspecimen.json").read_text()


def _open_scan_and_atlas(keyboard: Keyboard, folder: Path) -> None:
    window, workspace = keyboard.window, keyboard.window.workspace
    keyboard.answer("Ctrl+O", str(folder / "ball.nrrd"), "Return")
    keyboard.qtbot.waitUntil(lambda: workspace.scan.volume is not None)
    wait_until_idle(keyboard.qtbot, window)
    keyboard.choose("Alt+A", "Open atlas file…")
    keyboard.answer("Return", str(folder / "atlas.json"), "Return")
    keyboard.qtbot.waitUntil(lambda: workspace.atlas.current is not None)
    keyboard.press("F6")
    assert window.rail.step == "label"


def _place_first(keyboard: Keyboard) -> None:
    window, document = keyboard.window, keyboard.window.workspace.document
    axial = window.grid.slice_views[Plane.AXIAL]
    keyboard.press_until("F3", axial.hasFocus)
    for code in FIRST:
        x, y, z = there(code) - [2 * VOXEL_MM, -VOXEL_MM, VOXEL_MM]
        keyboard.answer("Ctrl+G", " ".join(f"{value:.4f}" for value in (x, y, z)), "Return")
        keyboard.press("Shift+Right", "Shift+Right", "Shift+Up", "F", "+", "-", "Space")
        near = document.landmarks(Side.LEFT)[code] - there(code)
        assert np.abs(near).max() < VOXEL_MM, code


def _judge_ghosts(keyboard: Keyboard) -> None:
    workspace, labels = keyboard.window.workspace, keyboard.window.workspace.labels
    states = lambda: labels.point_states(Side.LEFT)  # noqa: E731

    def state(code: str) -> PointState:
        return states()[code]

    ghost = "CB"
    keyboard.press_until(".", lambda: labels.active.code == ghost)
    keyboard.press("Return")
    assert state(ghost) is PointState.SUGGESTED
    keyboard.press_until(",", lambda: labels.active.code == ghost)
    keyboard.press_until("Return", lambda: state(ghost) is PointState.PLACED)
    keyboard.press_until(",", lambda: labels.active.code == ghost)
    keyboard.press("K", "Alt+1")
    assert state(ghost) is PointState.CHECKED
    keyboard.press_until(".", lambda: state(labels.active.code) is PointState.GHOST)
    other = labels.active.code
    keyboard.press("X")
    assert state(other) is PointState.UNSEEN
    keyboard.press("Ctrl+Z")
    assert state(other) is PointState.GHOST
    keyboard.press("Ctrl+Y", "Q")
    assert state(other) is PointState.UNSEEN
    assert labels.active.side is Side.RIGHT
    keyboard.press("Q")
    assert workspace.document.dirty


def _save_and_export(keyboard: Keyboard, folder: Path) -> None:
    document, out = keyboard.window.workspace.document, folder / "out"
    out.mkdir()
    keyboard.answer("Ctrl+S", str(folder / "ball.gpspecimen.json"), "Return")
    assert not document.dirty
    keyboard.press("Ctrl+E")
    keyboard.qtbot.waitUntil(lambda: QApplication.activeModalWidget() is not None)
    keyboard.tab_to("Folder")
    keyboard.press("Ctrl+A")
    keyboard.type(str(out), "Return")
    (specimen,) = load_specimens([out])
    assert set(FIRST) <= set(specimen.side("L").placed)


def _touch(keyboard: Keyboard) -> None:
    window, pose = keyboard.window, keyboard.window.workspace.pose
    keyboard.press("F8")
    table = window.steps["pose"].touches.table
    for code in PROBE:
        keyboard.press_until("Up", lambda: table.currentIndex().row() == 0)
        keyboard.press_until("Down", lambda code=code: table.name_at(table.currentIndex()) == code)
        keyboard.type(" ".join(f"{value:.3f}" for value in there(code)), "Return")
        assert code in pose.names_touched
    keyboard.qtbot.waitUntil(lambda: pose.estimate is not None and pose.estimate.pose is not None)
    wait_until_idle(keyboard.qtbot, window)


def _judge_pose(keyboard: Keyboard, folder: Path) -> None:
    document = keyboard.window.workspace.document
    keyboard.tab_to("Note on the verdict")
    keyboard.type("clear")
    keyboard.tab_to("Accept")
    keyboard.press("Space")
    (check,) = document.state.pose_checks
    assert (check.verdict, check.note) == ("accept", "clear")
    keyboard.answer("Ctrl+Shift+E", str(folder / "pose.json"), "Return")
    assert np.allclose(read_pose(folder / "pose.json").origin, MIDDLE, atol=0.3)


def test_a_ruler_and_a_touch_on_the_scan_by_keyboard(window, qtbot) -> None:
    workspace = window.workspace
    keyboard = Keyboard(window, qtbot)
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow)
    keyboard.press("F6")
    keyboard.press_until("F3", window.grid.slice_views[Plane.SAGITTAL].hasFocus)
    keyboard.press("U", "Space", "Ctrl+Shift+Right", "Space")
    (ruler,) = workspace.document.state.measurements
    assert np.linalg.norm(np.subtract(*ruler.points)) == pytest.approx(10 * VOXEL_MM)
    keyboard.press("F8", "I")
    target = workspace.pose.target
    keyboard.press_until("F3", window.grid.slice_views[Plane.SAGITTAL].hasFocus)
    keyboard.press("Space")
    assert np.allclose(
        workspace.document.state.touches[workspace.pose.side, target].position, ruler.points[1]
    )


def test_each_step_has_a_key_that_moves_the_keyboard_to_its_panel(window, qtbot) -> None:
    keyboard = Keyboard(window, qtbot)
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow)
    for key, step in zip(("F5", "F6", "F7", "F8"), ("scan", "label", "atlas", "pose"), strict=True):
        keyboard.press(key)
        assert window.rail.step == step
        assert window.steps[step].isAncestorOf(QApplication.focusWidget())
