"""An edit is one thing: what undo says, what the journal holds, and a step of a script."""

from __future__ import annotations

import json

import pytest
from document_cases import MARK, edits, quick, text_of
from hypothesis import given
from hypothesis import strategies as st

from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_labeler.document import edits as edits_module
from gp_labeler.document import (
    head_edits,
    import_edit,
    labelling_edits,
    measurement_edits,
    page_confirmation,
    specimen_edits,
    touch_edits,
)
from gp_labeler.document.edit_tables import EDITS, edit_of, edit_table, redone, script_table
from gp_labeler.document.edits import CheckPoint, PlacePoint
from gp_labeler.document.journal import read_journal
from gp_labeler.document.opening import new_specimen
from gp_labeler.document.specimen_document import SpecimenDocument
from gp_labeler.document.state import How
from gp_labeler.document.touch_edits import RecordTouch, TakeTouches
from gp_labeler.document.touches import Touch, TouchHow

L = Side.LEFT
BY_STEPS_OF_THEIR_OWN = {"import_landmarks", "record_pose_check"}


@quick
@given(edits)
def test_a_table_says_all_of_an_edit_to_the_last_bit(edit):
    table = json.loads(json.dumps(edit_table(edit)))
    if edit.do in EDITS:
        assert edit_of(table) == edit
        assert edit_of(table).text == edit.text
    else:
        assert edit.do in BY_STEPS_OF_THEIR_OWN


def test_every_kind_of_edit_has_a_name_of_its_own():
    kinds = {
        kind
        for module in (
            *(edits_module, head_edits, labelling_edits, specimen_edits),
            *(touch_edits, import_edit, measurement_edits, page_confirmation),
        )
        for kind in vars(module).values()
        if isinstance(kind, type) and kind.__module__ == module.__name__ and "do" in vars(kind)
    }
    assert {kind.do for kind in kinds} == EDITS.keys() | BY_STEPS_OF_THEIR_OWN
    assert len({kind.do for kind in kinds}) == len(kinds)


@quick
@given(st.lists(edits, max_size=8))
def test_edits_that_are_made_again_from_their_tables_leave_the_same_specimen(sequence):
    one, other = (SpecimenDocument(author="AB", clock=lambda: "now") for _ in range(2))
    for edit in sequence:
        if edit.do in EDITS:
            again = edit_of(json.loads(json.dumps(script_table(edit))))
            for document, each in ((one, edit), (other, again)):
                try:
                    document.do(redone(each, document))
                except GpError:
                    continue
    assert text_of(one.state) == text_of(other.state)


def test_a_script_says_neither_who_nor_when_but_a_point_may_be_called_so():
    document = SpecimenDocument(author="CD", clock=lambda: "now")
    place = script_table(PlacePoint(L, "CA", (1, 2, 3), MARK))
    assert place == {
        "do": "place_point",
        "side": "L",
        "code": "CA",
        "position": [1.0, 2.0, 3.0],
        "provenance": {"how": "mesh"},
    }
    found = redone(edit_of(place), document).provenance
    assert (found.how, found.by, found.time) == (How.MESH, "CD", "now")
    assert redone(edit_of(script_table(CheckPoint(L, "CA", by="AB"))), document).by == "CD"
    touches = {name: Touch((1, 2, 3), TouchHow.TRACKED, "then", "AB") for name in ("time", "by")}
    again = redone(edit_of(script_table(TakeTouches(L, touches))), document)
    assert [(touch.by, touch.time) for touch in again.touches.values()] == [("CD", "now")] * 2


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"do": "place_pont"}, "unknown edit 'place_pont' .did you mean place_point"),
        ({"do": "place_point", "sid": "L"}, "place_point: unknown key 'sid' .did you mean side"),
        ({"do": "place_point", "side": "L", "code": "CA"}, "place_point: .*position"),
        (
            {"do": "place_point", "side": "L", "code": "CA", "position": [1, 2, "x"]},
            r"place_point: position\[2\] must be a number, got 'x'",
        ),
        (
            {"do": "record_touch", "side": "L", "name": "MN", "touch": {"position": [1, 2]}},
            r"touch\.position",
        ),
        ({"do": "clear_point", "side": "up", "code": "CA"}, "side"),
        ({"do": "clear_point", "side": "L", "code": "XX"}, "unknown feature 'XX'"),
    ],
)
def test_a_table_that_is_wrong_is_named_to_the_key(table, words):
    with pytest.raises(GpError, match=words):
        edit_of(table)


def test_the_journal_holds_each_edit_as_it_was_made(tmp_path):
    document = SpecimenDocument(new_specimen(tmp_path), author="AB", clock=lambda: "now")
    made = [PlacePoint(L, "CA", (1, 2, 3), MARK), RecordTouch(L, "MN", Touch((4, 5, 6), by="AB"))]
    for edit in made:
        document.do(edit)
    document.undo()
    (path,) = (tmp_path / "journals").glob("*.jsonl")
    entries = read_journal(path).entries
    assert [entry.edit and edit_of(entry.edit) for entry in entries] == [*made, None]
    document.close(discard=True)
