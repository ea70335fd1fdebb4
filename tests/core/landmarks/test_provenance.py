"""What is known of a label beside its place is kept in sets, in every file and in Slicer's description."""

from __future__ import annotations

import json
import pickle
from pathlib import Path

import numpy as np
import pytest

from gp_core import Atlas, LandmarkSet, read_landmarks
from gp_core.errors import FileFormatError, GpError
from gp_core.io import landmark_file_name, write_csv, write_fcsv, write_markups
from gp_core.landmarks.provenance import Certainty, LabelProvenance, described, without_description

NOTE = "broken bulla; fluid [left], see p. 3"
KNOWN = {
    "CA": LabelProvenance("mesh", "AB", "2026-11-30T08:00Z", "sure", "", True, "CD", {"voxel_mm": [1, 1, 1]}),
    "CB": LabelProvenance("slice", "AB", "2026-11-30T08:01Z", "guess", NOTE),
    "FPA": LabelProvenance("looked for", "AB", note="artefact"),
}


@pytest.fixture
def landmarks() -> LandmarkSet:
    atlas = Atlas.published()
    points = {code: atlas[code] for code in atlas.codes if code not in ("FPA", "ZL")}
    marks = LandmarkSet.from_mapping(points, "L").with_unseen("FPA").with_provenance(KNOWN)
    return LandmarkSet(marks.points, "L", unseen=marks.unseen, provenance=KNOWN, observer="AB", round=2)


def test_it_stays_with_a_label_until_that_is_placed_again(landmarks: LandmarkSet) -> None:
    assert landmarks.provenance["CB"].certainty is Certainty.GUESS
    assert dict(landmarks.checked) == {"CA": "CD"}
    again = landmarks.with_point("CB", [1, 2, 3])
    assert set(again.provenance) == {"CA", "FPA"}
    assert pickle.loads(pickle.dumps(landmarks)).provenance == landmarks.provenance
    assert "ZL" not in landmarks.with_provenance({"ZL": LabelProvenance(note="to do")}).provenance


def test_a_landmark_file_keeps_all_of_it(landmarks: LandmarkSet, tmp_path: Path) -> None:
    path = tmp_path / landmark_file_name("GP01", landmarks.side, observer="AB", round_=2)
    assert path.name == "GP01_AB_r2_L.mrk.json"
    write_markups(path, landmarks, specimen="GP01")
    again = read_landmarks(path)
    assert (dict(again.provenance), again.observer, again.round) == (KNOWN, "AB", 2)
    text = {p["label"]: p["description"] for p in json.loads(path.read_text())["markups"][0]["controlPoints"]}
    assert "certainty: guess; observer: AB; round: 2;" in text["CB"]
    assert "note: broken bulla; fluid [left], see p. 3]" in text["CB"]
    assert "checked by: CD" in text["CA"]
    assert "[" not in text["ZL"] + text["CO"], "nobody placed these"


def test_it_survives_a_program_that_keeps_descriptions_alone(landmarks: LandmarkSet, tmp_path: Path) -> None:
    path = tmp_path / "whatever_L.mrk.json"
    write_markups(path, landmarks, specimen="GP01")
    content = json.loads(path.read_text())
    del content["gpLabeler"]  # as 3D Slicer does on saving
    path.write_text(json.dumps(content))
    again = read_landmarks(path)
    for code, known in KNOWN.items():
        kept = again.provenance[code]
        assert (kept.observer, kept.time, kept.certainty) == (known.observer, known.time, known.certainty)
        assert (kept.note, kept.checked, kept.checked_by) == (known.note, known.checked, known.checked_by)
    assert (again.observer, again.round) == ("AB", 2)


@pytest.mark.parametrize("writer", [write_csv, write_fcsv])
def test_tables_keep_it(writer, landmarks: LandmarkSet, tmp_path: Path) -> None:
    path = tmp_path / ("GP01_AB_r2_L.csv" if writer is write_csv else "GP01_AB_r2_L.fcsv")
    writer(path, landmarks)
    again = read_landmarks(path)
    assert again.provenance["CB"].note == KNOWN["CB"].note
    assert again.provenance["CA"].checked_by == "CD"
    assert (again.observer, again.round) == ("AB", 2)
    np.testing.assert_array_equal(again.points, landmarks.points)


def test_a_table_may_have_columns_of_its_own(tmp_path: Path) -> None:
    path = tmp_path / "GP01_L.csv"
    path.write_text("label,x,y,z,certainty,note\nCA,1,2,3,guess,fluid\nCB,1,2,9,,\n")
    assert read_landmarks(path).provenance["CA"] == LabelProvenance(certainty=Certainty.GUESS, note="fluid")
    path.write_text("label,x,y,z,certainty\nCA,1,2,3,perhaps\n")
    with pytest.raises(GpError, match=r"CA.*certainty must be one of sure, fair, guess, got 'perhaps'"):
        read_landmarks(path)


def test_what_cannot_be_is_refused_by_name(landmarks: LandmarkSet, tmp_path: Path) -> None:
    path = tmp_path / "GP01_L.mrk.json"
    write_markups(path, landmarks, specimen="GP01")
    content = json.loads(path.read_text())
    for key, value in (("certainty", "perhaps"), ("note", 3), ("checked", "yes")):
        wrong = json.loads(json.dumps(content))
        wrong["gpLabeler"][0]["provenance"]["CB"][key] = value
        path.write_text(json.dumps(wrong))
        with pytest.raises(FileFormatError, match=rf"CB.*its {key} must be"):
            read_landmarks(path)
    for key, value in (("round", 0), ("round", "two"), ("observer", 3)):
        wrong = json.loads(json.dumps(content))
        wrong["gpLabeler"][0][key] = value
        path.write_text(json.dumps(wrong))
        with pytest.raises(FileFormatError, match=f"wrong {key}"):
            read_landmarks(path)
    with pytest.raises(GpError, match="a round is a whole number from 1"):
        LandmarkSet(landmarks.points, "L", round=0)


@pytest.mark.parametrize(
    "text", ["", "Cochlea apex", "Apex [of the left ear]", "Apex [observer:AB]", "Apex [note: ]", "a [b: c]"]
)
def test_other_descriptions_are_left_alone(text: str) -> None:
    found, known, _ = without_description(text)
    assert (found, known) == (text, None) or text == "Apex [note: ]"


@pytest.mark.parametrize(
    "note", ["", "a; note: b", "[x]", "observer: me; round: 9", "ends in ]", "tab\tand\nline"]
)
def test_a_description_comes_apart_as_it_was_put_together(note: str) -> None:
    known = LabelProvenance(observer="A; B", certainty="fair", note=note, checked=True)
    text, again, round_ = without_description(described("Apex. On bone", known, round_=3))
    assert (text, round_) == ("Apex. On bone", 3)
    assert again == LabelProvenance(observer="A, B", certainty="fair", note=note, checked=True)
