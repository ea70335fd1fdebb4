"""Panels of installed packages: shown as steps of their own; one that fails is named, and loses no label."""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import EntryPoint

import pytest
from qtpy.QtCore import QCoreApplication, QEvent
from qtpy.QtWidgets import QLabel
from window_cases import MIDDLE, wait_until_idle

from gp_core import Side
from gp_core.extensions import Extensions
from gp_labeler.document.recovery import find_recoveries
from gp_labeler.document.state import How
from gp_labeler.views import main_window
from gp_labeler.views.application import report_fault
from gp_labeler.views.fonts import text_width
from gp_labeler.views.panels import table

_MODULE = """
from qtpy.QtWidgets import QLabel

from gp_labeler.views.signals import follow


def sound(workspace, actions):
    return QLabel(", ".join(sorted(actions)[:1]))


class Fragile(QLabel):
    def __init__(self, workspace, actions):
        super().__init__("fragile")
        follow(self, workspace.document.landmarks_changed, self.fail)
        workspace.document.edited.connect(self.fail)
        workspace.messages.said.connect(self.fail)

    def fail(self, *_):
        raise KeyError("gone")


def refuse(workspace, actions):
    raise ZeroDivisionError("a fault")


def nothing(workspace, actions):
    return None
"""


@pytest.fixture
def added(monkeypatch, tmp_path):
    """Let an installed package seem to add panels."""

    def add(**panels: str) -> None:
        (tmp_path / "their_panels.py").write_text(_MODULE)
        monkeypatch.syspath_prepend(str(tmp_path))
        monkeypatch.delitem(sys.modules, "their_panels", raising=False)
        entries = [
            EntryPoint(name, f"their_panels:{what}", "gp_labeler.panels") for name, what in panels.items()
        ]
        monkeypatch.setattr("gp_core.extensions.entry_points", lambda group: entries)
        fresh = Extensions("gp_labeler.panels", table.PANELS.builtin)
        for module in (table, main_window):
            monkeypatch.setattr(module, "PANELS", fresh)

    return add


@contextmanager
def faults_reported_to(window) -> Iterator[list[BaseException]]:
    """Report errors of listeners as the running program does."""
    faults: list[BaseException] = []

    def report(kind, error, trace) -> None:
        faults.append(error)
        report_fault(window, error)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "excepthook", report)
        yield faults


def warnings_of(window) -> list[str]:
    said: list[str] = []
    window.workspace.messages.said.connect(lambda text, level: said.append(text))
    return said


def test_a_panel_of_a_package_is_a_step_once_a_scan_is_open(added, make_window, ball, qtbot) -> None:
    added(notes="sound")
    window = make_window()
    assert list(window.steps) == ["scan", "label", "atlas", "pose", "notes"]
    button = window.rail.buttons["notes"]
    assert not button.isEnabled()
    window.workspace.scan.begin(ball)
    wait_until_idle(qtbot, window)
    assert button.text() == "Notes"
    assert button.toolTip() == "the panel 'notes' of the package unknown"
    button.click()
    assert window.rail.step == "notes"
    assert window.steps["notes"].isVisible()
    assert [label.text() for label in window.steps["notes"].findChildren(QLabel)] == ["atlas.fit_files"]
    assert not window.workspace.interaction.is_labelling, "a click beside it moves no landmark"
    window.rail.buttons["label"].click()
    assert window.steps["label"].isVisible()


def test_the_rail_has_room_for_the_name_of_a_panel_and_gives_it_back(added, make_window, ball, qtbot) -> None:
    added(measurements="sound")
    window = make_window()
    rail, button = window.rail, window.rail.buttons["measurements"]
    plain = rail.keys_button.sizeHint().width()
    for size in (100, 150):
        window.set_text_size(size)
        QCoreApplication.processEvents()
        assert rail.width() >= text_width(button, "5 Measurements", bold=True)
    window.set_text_size(100)
    rail.remove_step("measurements")
    assert rail.width() == plain


def test_panels_that_cannot_be_made_are_named_and_left_out(added, make_window) -> None:
    added(away="missing", empty="nothing", fails="refuse", label="sound", sound="sound")
    window = make_window()
    assert list(window.steps) == ["scan", "label", "atlas", "pose", "sound"]
    told = " ".join(label.text().replace("\u200b", "") for label in window.status.findChildren(QLabel))
    left_out = " ".join(table.PANELS.left_out)
    assert "the panel 'away' of the package unknown is left out: AttributeError" in left_out
    assert "the panel 'label' of the package unknown is left out: label is built in" in left_out
    assert "label is built in" in told, "the last of them is still in the status line"


def test_a_panel_that_fails_later_is_taken_away_and_no_label_is_lost(
    added, make_window, ball, qtbot, tmp_path
) -> None:
    added(fragile="Fragile")
    window = make_window()
    window.workspace.scan.begin(ball)
    wait_until_idle(qtbot, window)
    window.set_step("fragile")
    said, labels = warnings_of(window), window.workspace.labels
    later = []
    window.workspace.document.edited.connect(lambda edit, merged: later.append(edit.code))
    with faults_reported_to(window) as faults:
        labels.place(MIDDLE, How.SLICE, side=Side.LEFT, code="CA")
        labels.place(MIDDLE + 1.0, How.SLICE, side=Side.LEFT, code="OS")  # it fails again, and is named once
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)  # as the running program does next
    assert later == ["CA", "OS"], "who listens after it is told"
    assert window.workspace.document.undo_text == "place OS left"
    failure = "the panel 'fragile' of the package unknown failed (KeyError: 'gone')"
    assert {table.fault_text(fault).partition(".")[0] for fault in faults} == {failure}, "what a script says"
    faults.clear()  # their tracebacks keep the panel, which listens on as long as it lives
    gc.collect()
    (named,) = (text for text in said if "fragile" in text)
    assert named.startswith("The panel 'fragile' of the package unknown is left out (")
    assert "gone" in named
    assert list(window.steps) == ["scan", "label", "atlas", "pose"]
    assert window.rail.step == "label"
    assert "fragile" not in window.rail.buttons
    labels.place(MIDDLE + 1.0, How.SLICE, side=Side.LEFT, code="RWP")
    assert set(window.workspace.document.landmarks("L").placed) == {"CA", "OS", "RWP"}
    window.workspace.close()  # as a crash would leave it
    (recovery,) = find_recoveries(tmp_path / "state")
    assert set(recovery.state.side("L").placed) == {"CA", "OS", "RWP"}


def test_faults_of_the_program_are_not_blamed_on_a_package(added, make_window) -> None:
    added(notes="sound")
    window = make_window()
    said = warnings_of(window)
    report_fault(window, ValueError("x"))
    assert said == ["Something went wrong in the program (ValueError: x). Save your work."]
    assert "notes" in window.steps
