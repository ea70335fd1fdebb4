"""A listener that fails is reported, and neither stops the others nor undoes what they are told of."""

from __future__ import annotations

import gc

import pytest

from gp_core import Side
from gp_labeler.document.edits import PlacePoint
from gp_labeler.document.signals import Signal
from gp_labeler.document.specimen_document import SpecimenDocument
from gp_labeler.document.state import How, Provenance


class Listener:
    """Notes what it hears, and fails at it where it has an error."""

    def __init__(self, error: Exception | None = None) -> None:
        self.heard: list[object] = []
        self.error = error

    def hear(self, value: object) -> None:
        self.heard.append(value)
        if self.error is not None:
            raise self.error


class Speaker:
    spoke = Signal(object)


@pytest.fixture
def faults(monkeypatch: pytest.MonkeyPatch) -> list[BaseException]:
    found: list[BaseException] = []
    monkeypatch.setattr("sys.excepthook", lambda kind, error, trace: found.append(error))
    return found


def test_all_are_told_and_each_error_is_reported_in_turn(faults) -> None:
    speaker = Speaker()
    listeners = [Listener(KeyError("a")), Listener(), Listener(ValueError("b")), Listener()]
    for listener in listeners:
        speaker.spoke.connect(listener.hear)
    speaker.spoke.emit(1)
    assert [listener.heard for listener in listeners] == [[1]] * 4
    assert faults == [listeners[0].error, listeners[2].error]
    assert faults[0].__traceback__ is not None, "it can be found who failed"


def test_one_that_was_let_go_meanwhile_is_not_told(faults) -> None:
    speaker, kept = Speaker(), [Listener()]

    def drop(_: object) -> None:
        kept.clear()
        gc.collect()

    speaker.spoke.connect(drop)
    speaker.spoke.connect(kept[0].hear)
    speaker.spoke.emit(1)
    assert faults == []
    assert len(speaker.spoke) == 1


def test_endless_telling_ends(faults) -> None:
    speaker, later = Speaker(), Listener(KeyError("a"))
    speaker.spoke.connect(lambda value: speaker.spoke.emit(value))
    speaker.spoke.connect(later.hear)
    with pytest.raises(RecursionError):
        speaker.spoke.emit(1)


def test_an_edit_is_announced_whole_though_each_of_its_signals_fails_somewhere(faults) -> None:
    document = SpecimenDocument()
    broken, sound = Listener(ZeroDivisionError("x")), Listener()
    for listener in (broken, sound):
        document.landmarks_changed.connect(listener.hear)
        document.history_changed.connect(lambda listener=listener: listener.hear("history"))
        document.dirty_changed.connect(listener.hear)
        document.edited.connect(listener.hear)
    edit = PlacePoint(Side.LEFT, "CA", (1.0, 2.0, 3.0), Provenance(How.MESH))
    assert document.do(edit)
    assert broken.heard == sound.heard == [frozenset({(Side.LEFT, "CA")}), "history", True, edit]
    assert faults == [broken.error] * 4
    assert document.undo()
    assert document.landmarks("L").placed == ()
