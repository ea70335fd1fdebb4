"""What each test of the window is asked for at its end is found where it is, and only there."""

from __future__ import annotations

import threading
from collections import Counter

from qtpy.QtCore import QTimer
from qtpy.QtWidgets import QDialog, QWidget
from vtkmodules.vtkRenderingCore import vtkActor
from window_cases import left_by_test

from gp_labeler.scene.scene3d import Scene3D
from gp_labeler.scene.target import RenderTarget


class _Shown(vtkActor):
    """A part of a scene."""


class _Dialog(QDialog):
    """Known to what it knows, as windows and their parts are."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.itself = self


def test_a_window_is_found_until_it_is_deleted(qapp) -> None:
    dialog = _Dialog()
    assert left_by_test([], 0) == Counter({"_Dialog": 1})
    assert left_by_test([dialog]) == Counter()
    dialog.deleteLater()
    assert left_by_test([]) == Counter()


def test_a_window_that_only_knows_itself_is_not_left_behind(qapp) -> None:
    _Dialog()
    assert left_by_test([]) == Counter()


def test_a_dialog_is_found_beside_its_window(qapp) -> None:
    window = QWidget()
    dialog = _Dialog(window)
    assert left_by_test([window], 0) == Counter({"_Dialog": 1})
    dialog.deleteLater()
    assert left_by_test([window]) == Counter()


def test_a_scene_is_found_until_it_is_closed_but_beside_a_window_it_may_be_its_own(qapp) -> None:
    scene = Scene3D(RenderTarget.offscreen(40, 30))
    assert sum(left_by_test([], 0).values()) > 3
    window = QWidget()
    assert left_by_test([window]) == Counter()
    del window
    scene.close()
    del scene
    assert left_by_test([]) == Counter()


def test_what_another_thread_still_holds_is_waited_for(qapp) -> None:
    """A job that ends a little after its test holds what it was given; that is no leak."""
    ended = threading.Event()

    def work(held: list[object]) -> None:
        ended.wait()

    thread = threading.Thread(target=work, args=([_Shown()],))
    thread.start()
    assert left_by_test([], 0) == Counter({"_Shown": 1})
    QTimer.singleShot(0, ended.set)
    assert left_by_test([]) == Counter()
    thread.join()
