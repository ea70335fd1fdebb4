"""Steps for observers, labellings, repeatability, the list of specimens and contact sheets."""

from __future__ import annotations

import pytest
from script_cases import SPECIMEN, content, run

from gp_labeler.scripting.script import StepError, make_script

POINTS = {"CA": [2.0, 1.0, 3.0], "CB": [1.0, 0.0, 2.0], "RWA": [3.0, 3.0, 0.0], "RWP": [0.0, 3.0, 1.0]}


def put(shift: float = 0.0, **more):
    return [
        {"do": "place_point", "side": "L", "code": code, "position": [at[0] + shift, *at[1:]], **more}
        for code, at in POINTS.items()
    ]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("steps")
    report = run(
        folder,
        {"do": "observer", "name": "AB"},
        *put(),
        {"do": "annotate_point", "side": "L", "code": "CA", "certainty": "guess", "note": "fluid"},
        {"do": "label_again", "observer": "CD"},
        {"do": "expect", "placed": 0},
        *put(0.4),
        {"do": "label_again", "observer": "AB"},
        *put(0.1),
        {"do": "labelling", "observer": "AB"},
        {"do": "expect", "side": "L", "placed": 5},
        {"do": "export", "formats": [".mrk.json", ".csv"]},
        {"do": "save"},
        {"do": "reliability", "path": ["r.json", "r.csv"], "use": True},
        {"do": "list", "path": "list.json"},
        {"do": "contact_sheet", "path": "sheet.pdf"},
    )
    assert report.ok, report.error
    return folder


def test_labellings_are_kept_apart_and_exported_apart(folder):
    out = folder / "out"
    names = {path.name for path in out.glob("*_L.mrk.json")}
    assert names == {f"ball_{who}_L.mrk.json" for who in ("AB_r1", "AB_r2", "CD_r1")}
    assert ",guess,AB," in (out / "ball_AB_r1_L.csv").read_text()
    saved = content(out / SPECIMEN)
    others = [(each["observer"], each.get("round", 1), each["blind"]) for each in saved["other_labellings"]]
    assert sorted(others) == [("AB", 2, True), ("CD", 1, True)]


def test_the_report_says_who_how_surely_and_what_was_seen(folder):
    report = content(folder / "out" / "report.json")
    assert (report["observer"], report["round"]) == ("AB", 1)
    row = next(row for row in report["features"] if row["feature"] == "CA")
    assert (row["observer"], row["certainty"], row["note"]) == ("AB", "guess", "fluid")


def test_repeatability_list_and_sheet_are_of_the_open_specimen(folder):
    out = folder / "out"
    overall = content(out / "r.json")["overall"]
    assert overall["inter"]["mean_mm"] == pytest.approx(0.4)
    assert overall["intra"]["mean_mm"] == pytest.approx(0.1)
    (row,) = content(out / "list.json")
    assert row["labellings"] == ["AB, round 1", "AB, round 2", "CD, round 1"]
    assert (out / "sheet.pdf").read_bytes().count(b"/Type /Page ") == 1


def test_a_specimen_that_is_not_saved_is_no_ground_for_a_sheet(tmp_path):
    report = run(tmp_path, *put(), {"do": "contact_sheet"})
    assert not report.ok
    assert "the open specimen is not saved" in report.error


def test_wrong_keys_are_named():
    with pytest.raises(StepError, match="unknown key 'who'"):
        make_script([{"do": "observer", "who": "AB"}])
