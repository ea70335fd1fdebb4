"""Pages of suggestions: what is on them, and that nothing is confirmed that was not seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from window_cases import MIDDLE, ball_volume

from gp_core.errors import GpError
from gp_core.landmarks.features import FEATURES, Side
from gp_core.landmarks.suggestion import Suggestion
from gp_labeler.document.edit_tables import edit_of, edit_table, script_table
from gp_labeler.document.edits import SuggestPoints
from gp_labeler.document.state import How
from gp_labeler.jobs.runner import QueueDispatcher
from gp_labeler.models.suggestion_pages import PAGE_SIZE
from gp_labeler.models.workflow import Active
from gp_labeler.models.workspace import Workspace

L, R = Side.LEFT, Side.RIGHT
CODES = [row.code for row in FEATURES if not row.computed]


@pytest.fixture(scope="module")
def shared():
    """A workspace with the ball, which every test fills with suggestions of its own."""
    calls = QueueDispatcher()
    made = Workspace(None, calls, author="AB")
    made.scan.begin(ball_volume())
    calls.deliver_until_idle(made.jobs)
    yield made, calls
    made.close(discard=True)


@pytest.fixture
def pages(shared):
    """Pages of 37 suggestions; ZL of both sides and IN are doubtful."""
    workspace, calls = shared
    while workspace.document.undo():
        pass
    for side in Side:
        found = {code: suggestion(n, code) for n, code in enumerate(CODES) if side is L or code != "IN"}
        workspace.document.do(SuggestPoints(side, found, workspace.document.provenance(How.GHOST)))
    workspace.pages.begin()
    calls.deliver_until_idle(workspace.jobs)
    return workspace.pages


def suggestion(n: int, code: str) -> Suggestion:
    at = MIDDLE + 0.2 * np.array([n % 5, n % 3, n // 5])
    return Suggestion(tuple(at), 0.2 + 0.02 * n, "5 labelled scans", doubtful=code in ("IN", "ZL"))


def look_at_all(pages) -> None:
    for entry in pages.entries:
        pages.take_shown(entry)


def n_placed(shared) -> int:
    return sum(len(set(shared[0].document.landmarks(side).placed) - {"CO"}) for side in Side)


def test_the_least_certain_come_first_and_pages_are_as_few_and_as_even_as_can_be(pages) -> None:
    seen, sizes = [], []
    for _ in range(pages.n_pages):
        seen += [(entry.side, entry.code) for entry in pages.entries]
        sizes.append(len(pages.entries))
        pages.turn(1)
    assert len(seen) == len(set(seen)) == 37  # IN once
    assert sizes == [7, 7, 8, 7, 8]
    assert max(sizes) <= PAGE_SIZE
    assert not pages.is_open
    radii = [suggestion(CODES.index(code), code).radius_95 for _, code in seen]
    assert radii == sorted(radii, reverse=True)


def test_what_was_not_shown_is_not_confirmed_and_the_page_stays(shared, pages) -> None:
    before = n_placed(shared)
    pages.confirm()
    assert (pages.number, n_placed(shared)) == (0, before)
    first = next(entry for entry in pages.entries if entry.is_offered)
    pages.take_shown(first)
    pages.confirm()
    assert (pages.number, n_placed(shared)) == (0, before + 1)
    look_at_all(pages)
    pages.confirm()
    assert pages.number == 1


def test_a_close_view_that_is_not_drawn_yet_counts_for_nothing(shared, pages) -> None:
    pages.begin()  # nobody has drawn the first page again
    shared[0].jobs.cancel("close views")
    for entry in pages.entries:
        pages.take_shown(replace(entry, pictures=()))
    pages.confirm()
    assert n_placed(shared) == 0


def test_a_suggestion_that_has_moved_since_it_was_shown_is_not_confirmed(shared, pages) -> None:
    look_at_all(pages)
    entry = next(entry for entry in pages.entries if entry.is_offered)
    moved = Suggestion(tuple(MIDDLE), 0.3, "x")
    workspace = shared[0]
    workspace.document.do(
        SuggestPoints(entry.side, {entry.code: moved}, workspace.document.provenance(How.GHOST))
    )
    pages.confirm()
    assert workspace.document.landmarks(entry.side).suggested[entry.code] == moved
    assert pages.number == 0


def test_the_doubtful_and_the_marked_are_left_and_come_up_afterwards(shared, pages) -> None:
    marked = []
    while pages.is_open:
        look_at_all(pages)
        offered = next(entry for entry in pages.entries if entry.is_offered)
        pages.mark(offered.side, offered.code)
        marked.append((offered.side, offered.code))
        pages.confirm()
    workspace = shared[0]
    left = {(side, code) for side in Side for code in workspace.document.landmarks(side).suggested}
    assert left == {*marked, *((side, code) for side in Side for code in ("ZL", "IN"))}
    marks = workspace.document.state.landmarks.values()
    assert {mark.provenance.how for mark in marks if mark.position is not None} == {How.PAGE}
    assert workspace.labels.active in [Active(side, "ZL") for side in Side]


def test_a_mark_is_taken_back(shared, pages) -> None:
    entry = next(entry for entry in pages.entries if entry.is_offered)
    for on, offered in ((True, False), (False, True)):
        pages.mark(entry.side, entry.code, on)
        (now,) = [each for each in pages.entries if (each.side, each.code) == (entry.side, entry.code)]
        assert (now.is_marked, now.is_offered) == (on, offered)


def test_undo_brings_the_page_back_as_a_whole(shared, pages) -> None:
    before = [(entry.side, entry.code, entry.suggestion) for entry in pages.entries]
    look_at_all(pages)
    pages.confirm()
    assert pages.number == 1
    pages.undo()
    assert pages.number == 0
    assert n_placed(shared) == 0
    assert [(entry.side, entry.code, entry.suggestion) for entry in pages.entries] == before


def test_a_close_view_shows_the_grey_values_around_its_place(pages) -> None:
    """The ball is hollow where the points are, and bone where the pictures end, 4 mm beside them."""
    for entry in pages.entries:
        grey = entry.pictures[0].rgb[..., 0]
        middle = grey.shape[0] // 2
        assert grey[middle, middle] < 50
        assert min(grey[middle, 0], grey[middle, -1], grey[0, middle], grey[-1, middle]) > 200


def again(pages, entry):
    """Return an entry as it stands now."""
    (now,) = [each for each in pages.entries if (each.side, each.code) == (entry.side, entry.code)]
    return now


@pytest.mark.parametrize("doubtful", [False, True])
def test_a_corrected_suggestion_is_a_label_of_its_own_and_undo_brings_the_suggestion_back(
    shared, pages, doubtful
) -> None:
    workspace, calls = shared
    entry = next(each for each in pages.entries if bool(each.refusal) is doubtful and each.code != "IN")
    picture = entry.pictures[0]
    aim = picture.position_at(0.6, 0.35)
    pages.correct(entry.side, entry.code, 0, 0.6, 0.35)
    mark = workspace.document.state.landmark(entry.side, entry.code)
    assert mark.position == tuple(aim)
    assert (mark.provenance.how, mark.provenance.source) == (How.CORRECTED, "5 labelled scans")
    assert again(pages, entry).place_in(0) == pytest.approx((0.6, 0.35))  # until it is drawn again
    calls.deliver_until_idle(workspace.jobs)
    assert [each.centre for each in again(pages, entry).pictures] == [mark.position] * 2
    pages.undo()
    calls.deliver_until_idle(workspace.jobs)
    now = again(pages, entry)
    assert (now.suggestion, now.shows_its_place) == (entry.suggestion, True)


def test_the_journal_and_a_recorded_script_say_all_of_a_correction(shared, pages) -> None:
    document, edits = shared[0].document, []
    entry, before = pages.entries[0], document.state
    document.edited.connect(lambda edit, _: edits.append(edit))
    pages.correct(entry.side, entry.code, 1, 0.4, 0.4)
    (edit,) = edits
    assert edit_of(edit_table(edit)) == edit
    assert edit_of(script_table(edit)).apply(before).landmark(entry.side, entry.code).position == (
        document.state.landmark(entry.side, entry.code).position
    )


@pytest.mark.parametrize("side", [L, R])
def test_a_notch_turns_a_picture_by_one_voxel_along_the_normal_of_the_view(shared, pages, side) -> None:
    workspace, calls = shared
    entry = next(each for each in pages.entries if each.side is side)
    for notches in (2, -3):
        pages.scroll(side, entry.code, 0, notches)
        calls.deliver_until_idle(workspace.jobs)
    picture, place = again(pages, entry).pictures[0], np.array(entry.position)
    normal = workspace.view.frame.plane(picture.name).normal
    assert picture.centre - place == pytest.approx(-workspace.scan.volume.spacing[0] * normal)
    assert again(pages, entry).pictures[1].centre == entry.position
    seen = picture.position_at(0.7, 0.2)
    assert pages.slices_to(side, entry.code, 0, seen) == pytest.approx(0, abs=1e-9)
    assert pages.slices_to(side, entry.code, 0, place) == pytest.approx(1)
    pages.correct(side, entry.code, 0, 0.7, 0.2)
    assert workspace.document.state.landmark(side, entry.code).position == tuple(seen)


def test_bone_has_no_slices(shared, pages) -> None:
    entry = next(e for e in pages.entries if e.pictures[1].depths is not None)
    assert not pages.scroll(entry.side, entry.code, 1, 1)
    assert again(pages, entry).pictures[1].centre == entry.position


def test_a_picture_that_is_turned_away_from_its_suggestion_confirms_nothing(shared, pages) -> None:
    workspace, calls = shared
    for entry in pages.entries:
        pages.scroll(entry.side, entry.code, 0, 1)
        calls.deliver_until_idle(workspace.jobs)
    look_at_all(pages)
    pages.confirm()
    assert (pages.number, n_placed(shared)) == (0, 0)


def test_a_click_beside_the_picture_places_nothing(shared, pages) -> None:
    entry = pages.entries[0]
    for where in ((1.2, 0.5), (0.5, -0.1)):
        with pytest.raises(GpError, match=f"nothing to place {entry.name} on"):
            pages.correct(entry.side, entry.code, 0, *where)
    assert n_placed(shared) == 0


def test_another_specimen_ends_the_pages_and_nothing_is_there_to_begin(shared) -> None:
    workspace, calls = shared
    ended = []
    workspace.pages.finished.connect(lambda: ended.append(True))
    workspace.scan.begin(ball_volume())
    calls.deliver_until_idle(workspace.jobs)
    assert not workspace.pages.is_open
    assert not workspace.pages.can_begin
    with pytest.raises(GpError, match="nothing is suggested"):
        workspace.pages.begin()
    with pytest.raises(GpError, match="Open one first"):
        Workspace().pages.begin()
