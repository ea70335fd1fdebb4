"""Every key of the sheet does what the sheet says: as a law of the table, and pressed on a real X display."""

from __future__ import annotations

import shutil
import subprocess
import time
from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest
from qtpy.QtGui import QGuiApplication
from qtpy.QtTest import QTest
from window_cases import MIDDLE, VOXEL_MM

from gp_labeler.commands.actions import ACTIONS
from gp_labeler.scene.planes import Plane

KEYS = [(row.id, keys) for row in ACTIONS.values() for keys in row.shortcuts]
SHIFTED = dict(zip('~!@#$%^&*()_+{}|:"<>?', "`1234567890-=[]\\;',./", strict=True))
"""What Shift makes of a key, on the keyboard that has all these signs without AltGr."""

KEYSYMS = {
    "Ctrl": "ctrl",
    "Shift": "shift",
    "Alt": "alt",
    "Space": "space",
    "Backspace": "BackSpace",
    "Enter": "KP_Enter",
    "?": "question",
    "[": "bracketleft",
    "]": "bracketright",
    ".": "period",
    ",": "comma",
    "+": "plus",
    "-": "minus",
    "=": "equal",
}
"""X's words for keys, where they are not Qt's."""

KEYPAD = {"1": "KP_End", "3": "KP_Next", "5": "KP_Begin", "7": "KP_Home"}
"""X's words for the keys of the number pad; Num Lock makes numbers of them."""


def _pressed(keys: str) -> str:
    """Return which keys a hand presses: ``}`` is ``Shift+]``."""
    held, key = _split(keys)
    return "+".join([*held, "Shift", SHIFTED[key]] if key in SHIFTED else [*held, key])


def _split(keys: str) -> tuple[list[str], str]:
    """Return the modifiers of a shortcut, and its key, which may be ``+``."""
    *held, key = keys.removesuffix("+").split("+")
    return held, key or "+"


def test_no_two_shortcuts_are_the_same_keys() -> None:
    counted = Counter(_pressed(keys) for _, keys in KEYS)
    assert [keys for keys, n in counted.items() if n > 1] == []


def _keysym(keys: str) -> str:
    held, key = _split(keys)
    if "Num" in held:
        return KEYPAD[key]
    words = [KEYSYMS.get(word, word) for word in held]
    return "+".join([*words, KEYSYMS.get(key, key.lower() if len(key) == 1 else key)])


def _press(keysym: str) -> None:
    subprocess.run(["xdotool", "key", keysym], check=True)


def _wait(is_so: Callable[[], bool], seconds: float) -> None:
    end = time.monotonic() + seconds
    while not is_so() and time.monotonic() < end:
        QTest.qWait(5)


@pytest.fixture
def keyboard(qtbot, window):
    """A window that has the keyboard of a real display, whose keymap says what each key is."""
    if QGuiApplication.platformName() != "xcb" or shutil.which("xdotool") is None:
        pytest.skip("needs an X display and xdotool, as .ci/run has them")
    window.activateWindow()
    subprocess.run(["xdotool", "windowfocus", "--sync", str(int(window.winId()))], check=True)
    qtbot.waitUntil(window.isActiveWindow)
    return window


def test_every_shortcut_of_the_sheet_fires_on_a_real_display(keyboard) -> None:
    fired = []
    for id, made in keyboard.commands.actions.items():
        made.triggered.disconnect()
        made.triggered.connect(lambda *_, id=id: fired.append(id))
        made.setEnabled(True)
    keyboard.grid.scene_view.setFocus()
    _press("Num_Lock")
    missed = {}
    for id, keys in KEYS:
        fired.clear()
        _press(_keysym(keys))
        _wait(lambda: bool(fired), 2.0)
        if fired != [id]:
            missed[id, keys] = list(fired)
    _press("Num_Lock")
    assert missed == {}


@pytest.mark.parametrize(
    ("keysym", "axis", "voxels"),
    [("f", 2, 1), ("b", 2, -1), ("Next", 2, -1), ("Prior", 2, 1), ("Left", 0, -1), ("Up", 1, -1)],
)
def test_keys_over_a_slice_move_by_a_voxel_on_a_real_display(keyboard, keysym, axis, voxels) -> None:
    view = keyboard.grid.slice_views[Plane.AXIAL]
    keyboard.workspace.view.set_crosshair(MIDDLE + VOXEL_MM / 2)  # on a slice, not between two
    view.setFocus()
    before = np.array(keyboard.workspace.view.crosshair)
    _press(keysym)
    _wait(lambda: not np.allclose(keyboard.workspace.view.crosshair, before), 5.0)
    moved = keyboard.workspace.view.crosshair - before
    assert moved[axis] == pytest.approx(voxels * VOXEL_MM)
    assert np.count_nonzero(np.abs(moved) > 1e-9) == 1
