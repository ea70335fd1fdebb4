"""A window on a real display, driven from outside by xdotool; prints as JSON what came of it.

Run by `test_display.py` under Xvfb: the program gets its mouse and keys from the X server, as from a person.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Callable

import numpy as np
from qtpy.QtCore import QPoint, QPointF
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QWidget
from window_cases import BALL_MM, MIDDLE, Answers, ball_volume, close, let_run

from gp_core.landmarks.features import Side
from gp_labeler.views.application import make_application, make_window

INSIDE = MIDDLE + np.array([2.1, -1.7, 0.125])
ON_BONE = MIDDLE + BALL_MM * np.array([0.3, -0.9, 0.1]) / np.linalg.norm([0.3, -0.9, 0.1])


def xdotool(*words: object) -> None:
    """Let the X server move the mouse or press keys; the window takes it in by and by, see `until`."""
    subprocess.run(["xdotool", *map(str, words)], check=True, timeout=120)


def until(true: Callable[[], bool]) -> None:
    """Wait for what a click or key brings about; where it never does, the test tells what there is."""
    end = time.monotonic() + 120
    while not true() and time.monotonic() < end:
        let_run(10)


def point_at(widget: QWidget, pixel: tuple[float, float]) -> None:
    where = widget.mapToGlobal(QPointF(*pixel)).toPoint()
    xdotool("mousemove", "--sync", where.x(), where.y())


def drive() -> dict[str, object]:
    app = make_application()
    window = make_window(None, atlas=False)
    window.prompts = Answers()
    window.resize(1200, 800)
    window.move(QPoint(20, 20))
    window.show()
    window.workspace.scan.begin(ball_volume())
    until(lambda: not window.workspace.jobs.running)
    QTest.qWaitForWindowExposed(window)
    window.activateWindow()
    scene, document = window.grid.scene_view, window.workspace.document
    until(lambda: window.isActiveWindow() and scene.is_up_to_date)
    axial = next(view for plane, view in window.grid.slice_views.items() if plane.value == "axial")
    scene.view_from("A")
    window.workspace.view.set_crosshair(INSIDE)
    found: dict[str, object] = {"platform": app.platformName()}

    point_at(axial, axial.pixel_at(INSIDE))
    xdotool("click", 1)
    until(lambda: "CA" in document.landmarks(Side.LEFT))
    found["slice_off"] = float(np.linalg.norm(document.landmarks(Side.LEFT)["CA"] - INSIDE))
    point_at(scene, scene.pixel_at(ON_BONE))
    xdotool("click", 1)
    until(lambda: "RWP" in document.landmarks(Side.LEFT))
    found["bone_off"] = float(np.linalg.norm(document.landmarks(Side.LEFT)["RWP"] - ON_BONE))
    before = scene.scene.camera.direction
    point_at(scene, scene.pixel_at(MIDDLE - [3.0, 5.0, 2.0]))  # on bone, away from the point
    xdotool("mousedown", 1)
    xdotool("mousemove_relative", "--sync", 80, 30)
    xdotool("mouseup", 1)
    until(lambda: bool((before != scene.scene.camera.direction).any()))
    found["turned_deg"] = float(np.degrees(np.arccos(np.clip(before @ scene.scene.camera.direction, -1, 1))))
    found["placed"] = list(document.landmarks(Side.LEFT).placed)
    xdotool("key", "ctrl+z")
    until(lambda: list(document.landmarks(Side.LEFT).placed) != found["placed"])
    found["after_undo"] = list(document.landmarks(Side.LEFT).placed)
    layout = window.workspace.view.state.layout
    xdotool("key", "z")
    until(lambda: window.workspace.view.state.layout != layout)
    found["layout"] = window.workspace.view.state.layout
    close(window)
    return found


if __name__ == "__main__":
    sys.stdout.write(json.dumps(drive()) + "\n")
