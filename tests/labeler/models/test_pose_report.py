"""The one-page report says what the estimate says, escapes names, and shows the pictures it is given."""

from __future__ import annotations

import re
from html.parser import HTMLParser

import numpy as np
import pytest
from document_cases import Editing

from gp_core import PROBE, Atlas
from gp_core.atlas.sampling import draw_animal
from gp_labeler.document import touching
from gp_labeler.document.edits import PlacePoint
from gp_labeler.document.state import How, Provenance, SpecimenState
from gp_labeler.models.pose_report import PoseReport

VOID = {"meta", "img", "br"}


class Page(HTMLParser):
    """What a reader sees of a page, and whether its tags are in order."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.open, self.words, self.images = [], [], []
        self.feed(html)

    def handle_starttag(self, tag, attrs):
        if tag == "img":
            self.images.append(dict(attrs)["src"])
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)

    @property
    def text(self):
        return re.sub(r"\s+", " ", " ".join(self.words))


@pytest.fixture(scope="module")
def made():
    atlas, rng = Atlas.published(), np.random.default_rng(0)
    editing = Editing(SpecimenState("GP-014"), author="AB", atlas=atlas)
    estimating = editing.pose
    animal = draw_animal(atlas, rng=rng).side("L")
    for code in ("CA", "CB", "RWA", "RWP", "CL", "MN", "OS"):
        editing.document.do(PlacePoint(animal.side, code, animal[code], Provenance(How.MESH)))
    for code in PROBE:
        touching.record_touch(editing.document, "L", code, animal[code] + (50, 0, 9), source="<Stylus & co>")
    touching.record_touch(editing.document, "L", "MN", animal["MN"] + (53, 0, 9))
    touching.record_touch(editing.document, "L", "S1", (1, 2, 3))
    estimating.record_verdict("reject", by="C&D", note="<too> deep")
    yield editing, estimating
    editing.document.close(discard=True)


def report(made, pictures=None):
    editing, estimating = made
    return PoseReport(
        editing.document.state, estimating.estimate, pictures or {}, "2026-11-22T09:00:00+00:00"
    )


def test_it_says_what_the_estimate_says(made):
    estimate = made[1].estimate
    page = Page(report(made).html())
    assert page.open == []
    assert "GP-014: pose of the left cochlea" in page.text
    for number in (*estimate.pose.origin, *estimate.in_scan().origin):
        assert f"{round(number, 2) + 0.0:.2f}".replace("-", "\N{MINUS SIGN}") in page.text
    assert not re.search(r"-\d", page.text.partition("Estimate")[2])
    error_mm, error_deg = estimate.errors()
    assert f"{error_mm:.2f} mm, {error_deg:.1f}°" in page.text
    assert f"{estimate.pose.radius_95:.2f} mm, cone" in page.text
    for warning in estimate.pose.warnings:
        assert warning in page.text
    for name in (*PROBE, "S1"):
        assert name in page.text
    assert "2026-11-22 09:00 UTC" in page.text


def test_the_suspect_is_marked_and_the_verdict_is_told(made):
    page = Page(report(made).html())
    assert made[1].estimate.pose.suspects == ("MN",)
    assert re.search(r"MN\s+suspect", page.text)
    assert re.search(r"Rejected\s+by C&D", page.text)
    assert "<too> deep" in page.text, "escaped, not lost"
    assert "<Stylus & co>" in page.text


def test_a_verdict_on_another_estimate_is_said_to_be_that():
    editing = Editing(SpecimenState("GP-015"), author="AB", atlas=Atlas.published())
    estimating = editing.pose
    for code in PROBE:
        touching.record_touch(editing.document, "L", code, Atlas.published()[code])
    check = estimating.record_verdict("accept")
    made = (editing, estimating)
    assert "Refers to an earlier estimate" not in Page(report(made).html()).text
    touching.record_touch(editing.document, "L", "RWP", Atlas.published()["RWP"] + (0.8, 0, 0))
    mm, degrees = estimating.estimate.moved_since(check.pose)
    page = Page(report(made).html()).text
    assert f"Refers to an earlier estimate: this one differs by {mm:.2f} mm and {degrees:.1f}°." in page
    assert mm > 0.05
    editing.document.undo()
    assert estimating.estimate.moved_since(check.pose) is None
    estimating.choose(round_window="expected")
    touching.record_touch(editing.document, "L", "RWP", Atlas.published()["RWP"])
    assert "round window as expected" in Page(report(made).html()).text
    assert estimating.estimate.moved_since({}) is None
    editing.document.close(discard=True)


def test_pictures_are_part_of_the_page_or_named_beside_it(made):
    pictures = {"Overview": b"\x89PNG1", "Along the axis": b"\x89PNG2"}
    embedded = Page(report(made, pictures).html())
    assert all(source.startswith("data:image/png;base64,") for source in embedded.images)
    assert len(embedded.images) == 2
    assert Page(report(made, pictures).html(embed=False)).images == ["picture-0.png", "picture-1.png"]


def test_skull_features_tell_how_well_they_fit() -> None:
    atlas, rng = Atlas.published(), np.random.default_rng(0)
    editing = Editing(SpecimenState("GP-015"), author="AB", atlas=atlas)
    estimating = editing.pose
    animal = draw_animal(atlas, rng=rng).side("L")
    for code in PROBE:
        touching.record_touch(editing.document, "L", code, animal[code])
    for n, there in enumerate(rng.uniform(-20, 20, (8, 3)), start=1):
        touching.mark_skull(editing.document, f"S{n}", there)
        off = 8.0 if n == 7 else 0.0  # one that is wrong
        touching.record_touch(editing.document, "L", f"S{n}", there + 0.1 * rng.normal(size=3) + off)
    residuals = estimating.estimate.registered.fiducials.residuals_mm
    text = Page(PoseReport(editing.document.state, estimating.estimate).html()).text
    for name in ("S1", "S5"):
        assert re.search(rf"{name} .{{0,60}} {residuals[name]:.2f} ", text)
    assert re.findall(r"(S\d) suspect", text) == ["S7"]
    editing.document.close(discard=True)
