"""Suggestions in files: never positions that others take as observed, and read back as suggestions."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from gp_core.errors import FeatureError, GpError
from gp_core.io import (
    landmark_file_name,
    load_specimens,
    read_landmarks,
    read_points,
    read_touches,
    write_csv,
    write_fcsv,
    write_markups,
    write_suggestions,
)
from gp_core.landmarks.features import CODES
from gp_core.landmarks.sets import LandmarkSet, Status
from gp_core.landmarks.suggestion import Suggestion

ATLAS = Suggestion((1.25, -2.5, 1 / 3), 0.862, "atlas")


def _side(side: str = "L") -> LandmarkSet:
    placed = LandmarkSet.from_mapping({"CA": (0, 0, 0), "OS": (5, 1, 2)}, side)
    return placed.with_suggestions({"RWP": ATLAS, "IN": Suggestion((3, 2, 1))})


def _positions(file: Path) -> dict[str, object]:
    rows = json.loads(file.read_text())["markups"][0]["controlPoints"]
    return {row["label"]: row["position"] for row in rows if row["positionStatus"] == "defined"}


@pytest.mark.parametrize("ending", [".mrk.json", ".fcsv", ".csv"])
def test_a_suggestion_is_no_position_in_a_landmark_file(tmp_path: Path, ending: str) -> None:
    file = tmp_path / f"GP1_L{ending}"
    if ending == ".mrk.json":
        write_markups(file, _side(), specimen="GP1")
        assert _positions(file).keys() == {"CA", "OS"}
    else:
        (write_fcsv if ending == ".fcsv" else write_csv)(file, _side())
    back = read_landmarks(file)
    assert back.placed == ("CA", "OS")
    assert back.status("RWP") is Status.TO_DO


@pytest.mark.parametrize("source", ["5 labelled scans", ""])
@pytest.mark.parametrize("radius", [0.412, None])
@pytest.mark.parametrize(("away", "doubtful"), [(1.25, False), (1.25, True), (None, True)])
def test_a_file_of_suggestions_tells_where_the_atlas_disagrees_and_what_is_doubtful(
    tmp_path: Path, source: str, radius: float | None, away: float | None, doubtful: bool
) -> None:
    said = Suggestion((1, 2, 3), radius, source, away, doubtful)
    file = tmp_path / "GP1_L_suggested.mrk.json"
    write_suggestions(file, LandmarkSet.empty("L").with_suggestions({"RWP": said}), specimen="GP1")
    assert dict(read_landmarks(file).suggested) == {"RWP": said}


def test_a_file_of_suggestions_says_so_of_each_point_and_is_read_as_such(tmp_path: Path) -> None:
    file = tmp_path / landmark_file_name("GP1", _side().side, suggested=True)
    assert file.name == "GP1_L_suggested.mrk.json"
    write_suggestions(file, _side(), specimen="GP1")
    rows = json.loads(file.read_text())["markups"][0]["controlPoints"]
    assert [row["label"] for row in rows] == list(CODES)
    marked = {r["label"]: r["description"] for r in rows if r["positionStatus"] == "defined"}
    assert marked.keys() == {"RWP", "IN"}
    assert all(text.startswith("Suggested, not confirmed") for text in marked.values())
    assert "atlas; 95 % within 0.862 mm" in marked["RWP"]
    back = read_landmarks(file)
    assert not back.placed
    assert dict(back.suggested) == dict(_side().suggested)


def _saved_by_slicer(file: Path, target: Path) -> Path:
    """Write what 3D Slicer keeps of a file: it drops keys that it does not know."""
    content = json.loads(file.read_text())
    del content["gpLabeler"]
    target.write_text(json.dumps(content))
    return target


def test_the_description_alone_or_the_name_alone_marks_suggestions(tmp_path: Path, caplog) -> None:
    write_suggestions(tmp_path / "a_L_suggested.mrk.json", _side(), specimen="GP1")
    renamed = _saved_by_slicer(tmp_path / "a_L_suggested.mrk.json", tmp_path / "mine_L.mrk.json")
    assert dict(read_landmarks(renamed).suggested) == dict(_side().suggested)
    table = tmp_path / "GP2_R_suggested.csv"
    table.write_text("name,x,y,z\nCA,1,2,3\nOS,4,5,6\n")
    assert not read_landmarks(table).placed
    assert set(read_landmarks(table).suggested) == {"CA", "OS"}
    assert all(point.position is None for point in read_points(table).points)
    assert not read_touches(table, "R").placed
    assert "suggestions are no touches, left out: CA OS" in caplog.text


def test_a_side_and_its_suggestions_are_one_animal(tmp_path: Path) -> None:
    write_suggestions(tmp_path / "GP1_L_suggested.mrk.json", _side(), specimen="GP1")
    write_markups(tmp_path / "GP1_L.mrk.json", _side().with_point("IN", (9, 9, 9)), specimen="GP1")
    write_markups(tmp_path / "GP1_R.mrk.json", _side("R"), specimen="GP1")
    for order in (tmp_path, sorted(tmp_path.iterdir()), sorted(tmp_path.iterdir(), reverse=True)):
        (animal,) = load_specimens(order)
        assert animal.side("L").placed == ("CA", "IN", "OS")
        assert dict(animal.side("L").suggested) == {"RWP": ATLAS}
        assert not animal.side("R").suggested


def test_two_files_of_observations_are_still_one_too_many(tmp_path: Path) -> None:
    write_markups(tmp_path / "GP1_L.mrk.json", _side(), specimen="GP1")
    write_markups(tmp_path / "GP1-left.mrk.json", _side(), specimen="GP1")
    with pytest.raises(FeatureError, match="the left side is in"):
        load_specimens(tmp_path)


def test_ghosts_that_an_earlier_version_placed_unseen_are_suggestions(tmp_path: Path, caplog) -> None:
    file = tmp_path / "GP1_L.mrk.json"
    provenance = {"CA": {"how": "mesh"}, "OS": {"how": "accepted ghost"}, "RWP": {"how": "accepted ghost"}}
    write_markups(file, _side(), specimen="GP1", provenance=provenance)
    back = read_landmarks(file)
    assert back.placed == ("CA",)
    assert dict(back.suggested) == {"OS": Suggestion((5, 1, 2), None, "atlas")}
    assert "GP1_L.mrk.json: accepted ghosts that nobody confirmed are taken as suggestions: OS" in caplog.text


def test_there_is_no_file_without_suggestions(tmp_path: Path) -> None:
    file = tmp_path / "GP1_L_suggested.mrk.json"
    with pytest.raises(GpError, match="nothing is suggested on the left side"):
        write_suggestions(file, LandmarkSet.empty("L"), specimen="GP1")
    assert not file.exists()


@pytest.mark.parametrize(
    "text",
    [
        "Suggested, not confirmed",
        "suggested, not confirmed (me (and you); 95 % within 1.5 mm). Apex",
        "Suggested, not confirmed (; 95 % within 1.2.3 mm)",
        "Suggested, not confirmed, says Ann",
    ],
)
def test_however_a_mark_is_written_it_makes_no_observation(tmp_path: Path, text: str) -> None:
    file = tmp_path / "GP1_L.csv"
    file.write_text(f'label,l,p,s,description\nCA,1,2,3,"{text}"\nOS,4,5,6,\n')
    assert read_landmarks(file).placed == ("OS",)
    assert set(read_landmarks(file).suggested) == {"CA"}
