"""The specimen file keeps full precision, and says what is wrong with one that was damaged."""

from __future__ import annotations

import json
import shutil
import tempfile
from dataclasses import replace
from pathlib import Path

import pytest
from document_cases import FakeVolume, edits, json_values, quick, text_of
from hypothesis import given
from hypothesis import strategies as st

from gp_core import disk
from gp_core.errors import FileFormatError, GpError
from gp_labeler.document.frozen_json import freeze
from gp_labeler.document.opening import open_specimen
from gp_labeler.document.specimen_document import SpecimenDocument, VolumeChangedError
from gp_labeler.document.specimen_edits import SetNotes
from gp_labeler.document.specimen_file import read_specimen, write_specimen
from gp_labeler.document.specimen_json import document_of, state_of
from gp_labeler.document.state import SpecimenState
from gp_labeler.document.volume_reference import VolumeReference

volumes = st.none() | st.builds(
    VolumeReference,
    st.text(max_size=5),
    st.tuples(*[st.integers(1, 4000)] * 3),
    st.tuples(*[st.floats(1e-4, 1.0)] * 3),
    st.text(max_size=5),
    st.none() | st.just("/no/such/scan.nrrd"),
)


@quick
@given(st.lists(edits, max_size=15), volumes, st.dictionaries(st.text(max_size=3), json_values, max_size=3))
def test_saved_and_read_is_the_same_to_the_last_bit(sequence, volume, choices):
    state = SpecimenState().on_volume(volume, choices)
    for edit in sequence:
        try:
            state = edit.apply(state)
        except GpError:
            continue
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.gpspecimen.json"
        write_specimen(path, state)
        again = read_specimen(path)
        assert [p.name for p in Path(folder).iterdir()] == ["a.gpspecimen.json"]
    assert text_of(again) == text_of(state)
    for side, landmarks in state.sets.items():
        assert again.side(side).points.tobytes() == landmarks.points.tobytes()
    assert state_of(document_of(state)) == state


def damaged(**changes):
    mark = {"position": [1, 2, 3]}
    return {"format": "gp-labeler specimen", "version": 1, "landmarks": {"L": {"CA": mark}}, **changes}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "is not JSON: damaged or cut off. Choose a"),
        ("[" * 100_000, "is not JSON"),
        ([], "is not a specimen file"),
        ({"format": "other"}, "is not a specimen file"),
        (damaged(version=5), "saved by a newer program .version 5, this one reads up to 4.. Update"),
        (damaged(version="1"), "version must be a whole number from 1, got '1'"),
        (damaged(specimen=3), "specimen must be text, got 3"),
        (damaged(specimen=""), "must be a valid file name"),
        (damaged(landmarks=[]), "landmarks must be an object"),
        (damaged(landmarks={"X": {}}), "side must be L or R, got 'X'"),
        (damaged(landmarks={"L": {"XX": {}}}), "landmark XX: unknown feature 'XX'"),
        (damaged(landmarks={"L": {"CO": {"position": [1, 2, 3]}}}), "landmark CO: CO is computed"),
        (damaged(landmarks={"L": {"IN": {"position": [1, 2, 3]}}}), "IN is under the wrong key"),
        (damaged(landmarks={"both": {"CA": {"position": [1, 2, 3]}}}), "CA is under the wrong key"),
        (damaged(landmarks={"L": {"CA": {"position": [1, 2]}}}), r"L\.CA\.position must be three numbers"),
        (
            damaged(landmarks={"L": {"CA": {"position": [1, 2, "3"]}}}),
            r"L\.CA\.position\[2\] must be a number, got '3'",
        ),
        (damaged(landmarks={"L": {"CA": {"position": [1, 2, float("nan")]}}}), "must be finite, got nan"),
        (damaged(landmarks={"L": {"CA": {"position": [1, 2, 10**400]}}}), "must be finite"),
        (damaged(landmarks={"L": {"CA": {"position": [1, 2, 1e6]}}}), "landmark CA: .*within ±10000 mm"),
        (damaged(landmarks={"L": {"CA": {"locked": 1}}}), r"L\.CA\.locked must be true or false"),
        (
            damaged(landmarks={"L": {"CA": {"provenance": {"how": "magic"}}}}),
            r"provenance\.how is unknown: 'magic'",
        ),
        (damaged(landmarks={"L": {"CA": {"provenance": {"how": []}}}}), r"provenance\.how must be text"),
        (damaged(threshold="high"), "threshold must be a number"),
        (damaged(volume={"name": "x"}), "volume.size is missing"),
        (damaged(pose_checks=[{"side": "L", "verdict": "perhaps"}]), "verdict must be one of accept, reject"),
        (damaged(pose_checks=[3]), r"pose_checks\[0\] must be an object"),
        (damaged(import_choices={"a": float("inf")}), "import_choices.a must be finite"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, content, message):
    path = tmp_path / "a.gpspecimen.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    with pytest.raises(FileFormatError, match=message) as caught:
        read_specimen(path)
    assert str(path) in str(caught.value)


def test_reading_is_lenient_about_what_does_not_matter(tmp_path):
    path = tmp_path / "a.gpspecimen.json"
    path.write_text(
        json.dumps(damaged(future={"x": 1}, landmarks={"left": {"ca": {"position": [1, 2, 3], "x": 1}}}))
    )
    assert read_specimen(path).side("L").placed == ("CA",)
    with pytest.raises(GpError, match="does not exist"):
        read_specimen(tmp_path / "none")


def test_a_failed_save_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "a.gpspecimen.json"
    write_specimen(path, SpecimenState("old"))

    def full(handle):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(disk.os, "fsync", full)
    with pytest.raises(GpError, match=r"cannot be written .No space left"):
        write_specimen(path, SpecimenState("new"))
    assert read_specimen(path).specimen == "old"
    assert len(list(tmp_path.iterdir())) == 1


def test_the_scan_is_found_where_the_folder_was_moved_to(tmp_path):
    there = tmp_path / "there"
    there.mkdir()
    scan = there / "scan.nrrd"
    scan.write_text("voxels")
    document = SpecimenDocument()
    document.attach_volume(FakeVolume(path=scan))
    document.save(there / "a")
    assert read_specimen(there / "a.gpspecimen.json").volume.path == str(scan)
    here = tmp_path / "here"
    shutil.move(there, here)
    assert read_specimen(here / "a.gpspecimen.json").volume.path == str(here / "scan.nrrd")
    (here / "scan.nrrd").rename(tmp_path / "elsewhere.nrrd")
    lost = SpecimenDocument(read_specimen(here / "a.gpspecimen.json"))
    assert lost.state.volume.path == str(scan)
    assert lost.volume_is_lost
    with pytest.raises(GpError, match="does not exist"):
        lost.relink(tmp_path / "nowhere")
    lost.relink(tmp_path / "elsewhere.nrrd")
    assert not lost.volume_is_lost
    assert lost.dirty
    assert lost.attach_volume(FakeVolume(path=tmp_path / "elsewhere.nrrd")) == ()


def test_another_scan_is_noticed():
    document = SpecimenDocument()
    with pytest.raises(GpError, match="no scan belongs to this specimen yet"):
        document.relink("x")
    document.attach_volume(FakeVolume())
    document.attach_volume(FakeVolume(path=Path("moved")))
    assert document.state.volume.path == "moved"
    for other, message in [
        (FakeVolume(checksum="other"), "its voxels were changed since it was labelled"),
        (FakeVolume(size=(1, 50, 60)), "it has 1 x 50 x 60 voxels, the labelled one 40 x 50 x 60"),
        (
            FakeVolume(spacing=(0.1, 0.1, 0.1)),
            "voxels are 0.1 x 0.1 x 0.1 mm, the labelled one's 0.1 x 0.1 x 0.2 mm",
        ),
    ]:
        with pytest.raises(VolumeChangedError, match=message):
            document.attach_volume(other)
        assert document.volume == FakeVolume(path=Path("moved"))
    document.attach_volume(FakeVolume(checksum="other"), accept_changes=True)
    assert document.state.volume.checksum == "other"


def test_paths_and_notes_of_any_kind_are_kept(tmp_path):
    state = SpecimenState(notes="é \udc80 🐹").on_volume(
        VolumeReference("x", (1, 1, 1), (1, 1, 1), path="/\udcff"), {}
    )
    write_specimen(tmp_path / "a", state)
    assert read_specimen(tmp_path / "a") == state
    document = SpecimenDocument(state)
    for do in (document.save, open_specimen):
        with pytest.raises(GpError, match="is not a valid path"):
            do("a\0b")


def test_undo_leaves_the_scan_alone():
    document = SpecimenDocument()
    document.do(SetNotes("x"))
    document.attach_volume(FakeVolume(), import_choices={"reverse": True})
    assert document.undo()
    assert document.state.volume == VolumeReference.of(FakeVolume())
    assert document.redo()
    assert (document.state.notes, document.state.import_choices["reverse"]) == ("x", True)


def test_frozen_values_cannot_be_changed_and_must_be_json():
    frozen = freeze({"a": [1, {"b": None}]}, "choices")
    with pytest.raises(TypeError):
        frozen["a"] = 1
    assert frozen["a"][1]["b"] is None
    with pytest.raises(GpError, match=r"choices\.a\[0\] must be text, numbers.*got object"):
        freeze({"a": [object()]}, "choices")
    with pytest.raises(GpError, match="choices may only have text as keys, got 1"):
        freeze({1: 2}, "choices")
    assert replace(SpecimenState(), import_choices={"a": (1, 2)}).import_choices["a"] == (1, 2)
