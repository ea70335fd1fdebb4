"""Confirming a page: one edit of several labels, each of which says how it came to be."""

from __future__ import annotations

import pytest
from document_cases import Editing, FakeVolume

from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_core.landmarks.suggestion import Suggestion
from gp_labeler.document.page_confirmation import ConfirmPage, page_refusal
from gp_labeler.document.specimen_json import document_of, state_of
from gp_labeler.document.state import How

L, R = Side.LEFT, Side.RIGHT
SURE = Suggestion((1, 2, 3), 0.4, "5 labelled scans")


@pytest.fixture
def editing():
    made = Editing(author="AB", clock=lambda: "2026-01-01T00:00:00+00:00")
    made.document.attach_volume(FakeVolume())
    for n, (side, code) in enumerate([(L, "CA"), (R, "RWP"), (L, "IN")]):
        source = "atlas" if code == "IN" else SURE.source
        made.labels.suggest((n, 1, 2), radius_95=0.4, source=source, side=side, code=code)
    return made


def confirm(editing, *points) -> bool:
    return editing.document.do(ConfirmPage(points, editing.document.provenance(How.PAGE)))


def test_each_label_says_who_confirmed_it_when_and_from_what(editing) -> None:
    assert confirm(editing, (L, "CA"), (R, "RWP"), (R, "IN"))
    state = editing.document.state
    for side, code, source in ((L, "CA", SURE.source), (R, "RWP", SURE.source), (L, "IN", "atlas")):
        mark = state.landmark(side, code)
        about = mark.provenance
        assert mark.position is not None
        assert (about.how, about.by, about.source) == (How.PAGE, "AB", source)
        assert about.time == "2026-01-01T00:00:00+00:00"
    exported = state.described_side(L).provenance["CA"]
    assert (exported.how, exported.observer) == ("confirmed from a page", "AB")


def test_one_undo_takes_the_whole_page_back(editing) -> None:
    before = editing.document.state
    confirm(editing, (L, "CA"), (R, "RWP"))
    assert editing.document.undo_text == "confirm 2 points from a page"
    editing.document.undo()
    assert editing.document.state == before


@pytest.mark.parametrize(
    "doubtful",
    [
        Suggestion((1, 2, 3), 0.4, doubtful=True),
        Suggestion((1, 2, 3), 0.4, atlas_distance=1.2),
        Suggestion((1, 2, 3)),
        Suggestion((1, 2, 3), 4.0),
    ],
)
def test_what_is_doubtful_is_refused_and_nothing_else_confirmed(editing, doubtful) -> None:
    assert page_refusal(doubtful)
    assert not page_refusal(SURE)
    state = editing.document.state
    mark = state.landmark(L, "CA")
    for suggestion in (doubtful, SURE):
        changed = state.with_landmarks({(L, "CA"): type(mark)(suggestion=suggestion)})
        edit = ConfirmPage(((R, "RWP"), (L, "CA")), editing.document.provenance(How.PAGE))
        if suggestion is SURE:
            assert edit.apply(changed).side(L).placed == ("CA",)
        else:
            with pytest.raises(GpError, match="CA left cannot be confirmed from a page"):
                edit.apply(changed)


def test_what_is_not_suggested_is_refused(editing) -> None:
    confirm(editing, (L, "CA"))
    with pytest.raises(GpError, match="CA left is not suggested"):
        confirm(editing, (R, "RWP"), (L, "CA"))
    assert editing.document.landmarks(R).suggested.keys() == {"RWP", "IN"}


def test_that_a_suggestion_is_doubtful_is_saved(editing) -> None:
    mark = editing.document.state.landmark(L, "CA")
    doubtful = type(mark)(suggestion=Suggestion((1, 2, 3), 0.4, doubtful=True))
    state = editing.document.state.with_landmarks({(L, "CA"): doubtful})
    assert state_of(document_of(state)).landmark(L, "CA").suggestion.doubtful
    assert not state_of(document_of(state)).landmark(R, "RWP").suggestion.doubtful
