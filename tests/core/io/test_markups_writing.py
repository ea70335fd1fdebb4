"""Markups files as this program writes them: Slicer's form, and every bit back."""

import json
import math
import os
import stat
from dataclasses import replace
from types import MappingProxyType

import jsonschema
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from landmark_makers import SHARED, needs_shared_data, same_landmarks, some_landmarks
from markups_schema import SCHEMA

from gp_core.errors import GpError
from gp_core.io import load_specimens, read_landmarks, read_points, write_csv, write_fcsv, write_markups
from gp_core.landmarks.features import CODES
from gp_core.landmarks.sets import LandmarkSet, Status

VALIDATOR = jsonschema.Draft7Validator(SCHEMA)
COORDINATE = st.floats(-1e9, 1e9)
POSITIONS = st.dictionaries(st.sampled_from(CODES), st.tuples(*[COORDINATE] * 3), max_size=20)


def content_of(file):
    return json.loads(file.read_text(encoding="utf-8"))


@pytest.fixture
def file(tmp_path):
    return tmp_path / "GP01_L.mrk.json"


@given(positions=POSITIONS, unseen=st.sets(st.sampled_from(CODES)), side=st.sampled_from("LR"))
@settings(max_examples=40, deadline=None, derandomize=True)
@pytest.mark.parametrize("writer", ["markups", "fcsv", "csv"])
def test_what_is_written_is_read_back_to_the_last_bit(tmp_path_factory, writer, positions, unseen, side):
    if len({tuple(p) for p in positions.values()}) == 1:
        positions = dict(list(positions.items())[:2])  # three points at one place are refused
    assume(not {"CA", "CB"} <= set(positions) or math.dist(positions["CA"], positions["CB"]) >= 1e-3)
    landmarks = replace(LandmarkSet.from_mapping(positions, side), unseen=frozenset(unseen))
    folder = tmp_path_factory.mktemp("bits")
    if writer == "markups":
        write_markups(file := folder / f"GP_{side}.mrk.json", landmarks, specimen="GP")
    elif writer == "fcsv":
        write_fcsv(file := folder / f"GP_{side}.fcsv", landmarks)
    else:
        write_csv(file := folder / f"GP_{side}.csv", landmarks)
    back = read_landmarks(file)
    assert same_landmarks(back, replace(landmarks, unseen=frozenset(unseen)))


def test_frame_and_extra_points_come_back(file):
    landmarks = some_landmarks("R", frame="cochlea")
    landmarks = replace(
        landmarks, extra=MappingProxyType({"S1": np.array([0.1, 0.2, 0.3]), "tip": np.ones(3)})
    )
    write_markups(file, landmarks, specimen="GP01")
    assert same_landmarks(read_landmarks(file, side="R"), landmarks)


def test_a_whole_set_validates_against_the_schema(file):
    write_markups(
        file, some_landmarks(), specimen="GP01", volume={"name": "a.nrrd", "size": np.array([3, 4, 5])}
    )
    VALIDATOR.validate(content_of(file))


def test_a_part_set_breaks_the_schema_only_where_slicer_does(file):
    landmarks = some_landmarks(n_placed=12).with_unseen("CO").with_unseen("ZL")
    write_markups(file, landmarks, specimen="GP01")
    wrong = {(error.absolute_path[-1], error.instance) for error in VALIDATOR.iter_errors(content_of(file))}
    assert wrong == {("position", ""), ("positionStatus", "missing")}


@needs_shared_data
def test_the_keys_are_those_of_a_file_of_slicer_in_its_order(file):
    write_markups(file, some_landmarks(), specimen="GP01")
    ours = content_of(file)
    slicer = content_of(SHARED / "mouse_ct" / "C57BL6_J_.mrk.json")
    assert ours["@schema"] == slicer["@schema"]
    (mine,), (theirs,) = ours["markups"], slicer["markups"]
    assert list(mine) == list(theirs)
    assert [list(p) for p in mine["controlPoints"]] == [list(theirs["controlPoints"][0])] * 20
    assert list(mine["display"]) == list(theirs["display"])
    assert {k: type(v) for k, v in mine["display"].items()} == {
        k: type(v) for k, v in theirs["display"].items()
    }
    assert str(mine["controlPoints"][0]["orientation"]) == str(theirs["controlPoints"][0]["orientation"])
    assert '"orientation": [-1.0, -0.0, -0.0, -0.0, -1.0, -0.0, 0.0, 0.0, 1.0],\n' in file.read_text()


def test_all_points_are_there_in_the_tables_order_with_a_status(file):
    landmarks = some_landmarks(n_placed=3).with_unseen("CO")
    write_markups(file, landmarks, specimen="GP01")
    points = content_of(file)["markups"][0]["controlPoints"]
    assert tuple(p["label"] for p in points) == CODES
    assert len({p["id"] for p in points}) == 20
    assert [p["positionStatus"] for p in points] == [landmarks.status(code).value for code in CODES]
    assert all((p["position"] == "") == (p["positionStatus"] != "defined") for p in points)
    computed = points[CODES.index("CO")]
    assert "Computed from CA, CB" in computed["description"]
    assert computed["locked"]


def test_the_header_carries_specimen_side_volume_and_provenance(file):
    volume = {"name": "GP01.nrrd", "size": [10, 20, 30], "spacing": [0.1, 0.1, 0.2], "checksum": "sha256:00"}
    provenance = {"CA": {"by": "Ä. B.", "on": "slice"}}
    write_markups(file, some_landmarks(), specimen="GP01", volume=volume, provenance=provenance)
    header = read_points(file).header
    assert header.specimen == "GP01"
    assert header.side.value == "L"
    assert header.volume == volume
    assert header.provenance == provenance
    write_markups(file, some_landmarks(), specimen="GP01")
    assert read_points(file).header.volume is None


@pytest.mark.parametrize("provenance", [{"CA": object()}, {"CA": float("nan")}])
def test_what_json_cannot_hold_is_refused_and_the_old_file_stays(file, provenance):
    write_markups(file, some_landmarks(), specimen="GP01")
    before = file.read_bytes()
    with pytest.raises(GpError, match="cannot be written as JSON"):
        write_markups(file, some_landmarks(seed=1), specimen="GP01", provenance=provenance)
    assert file.read_bytes() == before


def test_a_failing_disk_leaves_the_old_file_and_no_draft(file, monkeypatch):
    write_markups(file, some_landmarks(), specimen="GP01")
    before = file.read_bytes()

    def full(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(GpError, match=r"GP01_L.*No space left"):
        write_markups(file, some_landmarks(seed=1), specimen="GP01")
    assert file.read_bytes() == before
    assert list(file.parent.iterdir()) == [file]


def test_the_old_file_is_whole_until_the_new_one_is(file, monkeypatch):
    write_markups(file, some_landmarks(), specimen="GP01")
    before, drafts = file.read_bytes(), []

    def interrupted(draft, target):
        drafts.append(draft.read_bytes())
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(type(file), "replace", interrupted)
    with pytest.raises(GpError, match="Input/output error"):
        write_markups(file, some_landmarks(seed=1), specimen="GP01")
    assert file.read_bytes() == before
    assert json.loads(drafts[0])["gpLabeler"][0]["specimen"] == "GP01"


def test_a_missing_folder_is_named(tmp_path):
    with pytest.raises(GpError, match=r"cannot be written .*Check the folder"):
        write_markups(tmp_path / "none" / "GP01_L.mrk.json", some_landmarks(), specimen="GP01")


@pytest.mark.skipif(os.name != "posix", reason="links and permission bits as POSIX has them")
def test_a_link_stays_a_link_and_permissions_stay(tmp_path):
    target, link = tmp_path / "a_L.mrk.json", tmp_path / "b_L.mrk.json"
    target.write_text("old")
    target.chmod(0o640)
    link.symlink_to(target)
    write_markups(link, some_landmarks(), specimen="GP01")
    assert link.is_symlink()
    assert stat.S_IMODE(target.stat().st_mode) == 0o640
    assert read_landmarks(target).status("CA") is Status.PLACED


def test_slicermorph_reads_what_is_written(tmp_path):
    """Its module GPA takes positions as below, by pandas, and stops where a point is not defined."""
    pandas = pytest.importorskip("pandas")
    file = tmp_path / "GP01_L.mrk.json"
    landmarks = some_landmarks(seed=1)
    write_markups(file, landmarks, specimen="GP01")
    table = pandas.DataFrame(pandas.read_json(file)["markups"][0]["controlPoints"])
    assert list(table["label"]) == list(CODES)
    defined = table[table["positionStatus"] == "defined"]
    read = np.array(defined["position"].tolist())
    np.testing.assert_allclose(read, [landmarks[code] for code in defined["label"]], atol=1e-9)


def test_the_header_of_earlier_versions_an_object_by_itself_is_still_read(tmp_path):
    file = tmp_path / "left.mrk.json"
    write_markups(file, some_landmarks(seed=1), specimen="GP01")
    content = json.loads(file.read_text())
    (content["gpLabeler"],) = content["gpLabeler"]
    earlier = tmp_path / "earlier.mrk.json"
    earlier.write_text(json.dumps(content))
    assert read_landmarks(earlier).provenance == read_landmarks(file).provenance
    assert load_specimens(earlier)[0].name == load_specimens(file)[0].name == "GP01"
