"""Steps on labelled scans: a script checks them against each other as the window and the command do."""

from __future__ import annotations

import numpy as np
import pytest
from script_cases import content, run
from small_heads import save_markups, save_volume, small_head

from gp_labeler.autolabel.library import TemplateLibrary
from gp_labeler.autolabel.prediction import Prediction


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Return a folder with three labelled heads, CA and OI of the last exchanged, and known predictions."""
    labelled, told, rng = tmp_path / "labelled", {}, np.random.default_rng(0)
    labelled.mkdir()
    for seed in range(3):
        volume, points = small_head(seed)
        told[f"small-{seed}"] = Prediction(
            {k: {n: at + rng.normal(0, 0.2, 3) for n, at in points.items()} for k in "abc"}, None
        )
        if seed == 2:
            points["CA_L"], points["OI_L"] = points["OI_L"], points["CA_L"]
        save_volume(labelled / f"small-{seed}.nrrd", volume)
        for side in "LR":
            own = {n.removesuffix(f"_{side}"): at for n, at in points.items() if n[-1] in (side, "N")}
            save_markups(labelled / f"small-{seed}_{side}.mrk.json", own)
    monkeypatch.setattr(TemplateLibrary, "held_out", lambda self, registration, report: told)
    return tmp_path


def test_a_script_checks_labelled_scans_against_each_other(folder):
    check = {"do": "check_library", "labelled": ["labelled"], "path": "review.pdf", "findings": "found.json"}
    report = run(folder, check)
    assert report.ok, report.error
    (found,) = content(folder / "out" / "found.json")["findings"]
    assert (found["specimen"], found["kind"], set(found["names"])) == (
        "small-2",
        "exchanged",
        {"CA_L", "OI_L"},
    )
    assert (folder / "out" / "review.pdf").read_bytes().count(b"/Type /Page ") == 1
    strict = run(folder, {**check, "strict": True})
    assert not strict.ok
    assert "CA_L and OI_L seem to be exchanged" in strict.error


def test_pages_confirm_all_but_what_somebody_wants_to_look_at(tmp_path):
    placed = [
        {"do": "place", "feature": code, "side": "L", "at": "truth"} for code in ("CA", "RWA", "OI", "IN")
    ]
    ghosts = [{"do": "place", "feature": code, "side": "L", "at": "ghost"} for code in ("CB", "RWP", "FPA")]
    check = {"do": "check_pages", "look_at": ["CB L"]}
    report = run(tmp_path, {"do": "open", "phantom": 0}, *placed, *ghosts, check)
    assert report.ok, report.error
    assert {each["feature"] for each in report.suggested} == {"CB"}
    placed_codes = {each["feature"] for each in report.features}
    assert {"RWP", "FPA"} <= placed_codes
    assert "CB" not in placed_codes


def test_a_script_corrects_on_the_page_what_lies_off_the_truth(tmp_path):
    placed = [
        {"do": "place", "feature": code, "side": "L", "at": "truth"} for code in ("CA", "RWA", "OI", "IN")
    ]
    ghosts = [{"do": "place", "feature": code, "side": "L", "at": "ghost"} for code in ("CB", "RWP", "FPA")]
    check = {"do": "check_pages", "within": 0.01, "correct": True}
    near = [
        {"do": "expect", "feature": code, "side": "L", "near": "truth", "within": 0.3}
        for code in ("CB", "RWP", "FPA")
    ]
    report = run(tmp_path, {"do": "open", "phantom": 0}, *placed, *ghosts, check, *near)
    assert report.ok, report.error
    assert report.suggested == []
    (told,) = [step.text for step in report.steps if "corrected" in step.text]
    assert told == "0 confirmed on 1 page, 3 corrected, 0 left"
