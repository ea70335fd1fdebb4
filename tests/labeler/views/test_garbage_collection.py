"""Cycles of widgets are destroyed on their own thread, whatever a background job makes."""

from __future__ import annotations

import gc
import sys
import threading
import types
from dataclasses import dataclass
from typing import Any

import pytest
from qtpy.QtCore import QObject
from qtpy.QtWidgets import QApplication, QWidget

from gp_labeler.jobs.runner import Jobs
from gp_labeler.views.dispatch import QtDispatcher
from gp_labeler.views.garbage_collection import collect_on_this_thread


@dataclass(frozen=True)
class MakeGarbage:
    """Makes enough cycles that Python would collect all generations."""

    title: str = "Making garbage"

    def run(self, progress: Any) -> int:
        kept = []
        for number in range(200_000):
            kept.append([number])
            kept[-1].append(kept[-1])
        return len(kept)


class Dialog(QWidget):
    """Tells on which thread it is destroyed; part of a cycle."""

    def __init__(self, destroyed_on: list[threading.Thread]) -> None:
        super().__init__()
        self.itself = self
        self.destroyed_on = destroyed_on

    def __del__(self) -> None:
        self.destroyed_on.append(threading.current_thread())


@pytest.fixture
def jobs(qapp):
    dispatcher = QtDispatcher()
    made = Jobs(dispatcher)
    yield made
    made.close()


def test_a_job_that_makes_garbage_destroys_no_widget(qtbot, jobs):
    gc.enable()
    collect_on_this_thread(QApplication.instance())
    destroyed_on: list[threading.Thread] = []
    Dialog(destroyed_on)
    jobs.submit(MakeGarbage())
    qtbot.waitUntil(lambda: not jobs.running)
    assert set(destroyed_on) <= {threading.main_thread()}


def test_closed_widgets_are_collected_while_the_events_run(qtbot, jobs):
    collect_on_this_thread(QApplication.instance())
    destroyed_on: list[threading.Thread] = []
    Dialog(destroyed_on)
    made = [[number] for number in range(2 * gc.get_threshold()[0])]
    qtbot.waitUntil(lambda: destroyed_on == [threading.main_thread()])
    assert len(made) > 0


def test_what_modules_hold_is_left_out_once_they_are_imported(qtbot, monkeypatch):
    """Else each full collection would look through all objects of all modules, some 50 ms."""
    collect_on_this_thread(QApplication.instance())
    held = [[number] for number in range(1000)]
    destroyed_on: list[threading.Thread] = []
    Dialog(destroyed_on)
    monkeypatch.setitem(sys.modules, "imported_by_a_test", types.ModuleType("imported_by_a_test"))
    qtbot.waitUntil(lambda: destroyed_on == [threading.main_thread()])  # garbage is collected before
    looked_through = {id(each) for each in gc.get_objects()}
    assert not looked_through & {id(each) for each in held}


def test_what_was_left_out_is_looked_through_when_the_window_rests(qtbot):
    """Else a dialog that was open while modules were imported would stay for ever."""
    destroyed_on: list[threading.Thread] = []
    dialog = Dialog(destroyed_on)
    owner = QObject()
    collect_on_this_thread(owner, rest_s=0.3)  # what is alive now is left out
    del dialog
    gc.collect()
    assert destroyed_on == []
    qtbot.waitUntil(lambda: destroyed_on == [threading.main_thread()])


def test_asked_twice_there_is_one_collector(qtbot):
    collect_on_this_thread(QApplication.instance())
    before = len(QApplication.instance().children())
    collect_on_this_thread(QApplication.instance())
    assert len(QApplication.instance().children()) == before
    assert not gc.isenabled()


def test_a_task_lets_go_of_what_it_calls_on_the_thread_that_asked(qtbot, jobs):
    destroyed_on: list[threading.Thread] = []
    results: list[int] = []

    class Receiver:
        def receive(self, result: int) -> None:
            results.append(result)

        def __del__(self) -> None:
            destroyed_on.append(threading.current_thread())

    for _ in range(50):
        jobs.submit(Three(), Receiver().receive)
    qtbot.waitUntil(lambda: not jobs.running)
    assert results == [3] * 50
    assert destroyed_on == [threading.main_thread()] * 50


@dataclass(frozen=True)
class Three:
    title: str = "Three"

    def run(self, progress: Any) -> int:
        return 3
