"""Landmark files out of a editing and back in."""

from __future__ import annotations

import json

import numpy as np
import pytest
from document_cases import MARK, Editing, FakeVolume, shape

from gp_core.errors import FeatureError, GpError
from gp_core.io import load_specimens, read_landmarks, write_csv
from gp_core.landmarks.features import Side
from gp_core.landmarks.sets import Status
from gp_labeler.document.edits import CheckPoint
from gp_labeler.document.landmark_export import FORMATS, export_landmarks
from gp_labeler.document.landmark_import import ImportLandmarks, OffBoneError, import_landmarks
from gp_labeler.document.recent_files import RecentFiles
from gp_labeler.document.specimen_json import document_of, state_of
from gp_labeler.document.state import How, SpecimenState

L, R = Side.LEFT, Side.RIGHT


@pytest.fixture
def editing():
    editing = Editing(SpecimenState("GP-014"), author="AB", clock=lambda: "2026-01-01T00:00:00+00:00")
    editing.document.attach_volume(FakeVolume())
    editing.document.do(ImportLandmarks((shape(L), shape(R)), MARK))
    return editing


def test_out_and_in_again_is_the_same(editing, tmp_path):
    report = export_landmarks(editing.document.state, tmp_path)
    assert [path.name for path in report.files] == ["GP-014_L.mrk.json", "GP-014_R.mrk.json"]
    assert report.is_complete
    assert report.text == "Wrote GP-014_L.mrk.json, GP-014_R.mrk.json."
    again = Editing(SpecimenState("GP-014"))
    again.document.attach_volume(FakeVolume())
    assert import_landmarks(again.document, report.files) == ()
    assert again.document.undo_text == "import 37 points"
    assert again.document.state.landmarks == editing.document.state.landmarks
    (specimen,) = load_specimens([tmp_path])
    assert specimen.name == "GP-014"
    assert np.array_equal(specimen.side(R).points, editing.document.landmarks(R).points)


@pytest.mark.parametrize("suffix", FORMATS)
def test_every_format_reads_back(editing, tmp_path, suffix):
    editing.labels.clear(side=L, code="ZL")
    editing.labels.mark_unseen(side=L, code="MN")
    report = export_landmarks(editing.document.state, tmp_path / "new", formats=[suffix])
    assert not report.is_complete
    read = read_landmarks(report.files[0])
    assert np.array_equal(read.points, editing.document.landmarks(L).points, equal_nan=True)
    assert (read.status("ZL"), read.status("MN")) == (Status.TO_DO, Status.UNSEEN)


def test_what_is_missing_is_said(editing, tmp_path):
    editing.labels.clear(side=L, code="ZL")
    editing.labels.mark_unseen(side=L, code="MN")
    editing.labels.clear(side=R, code="CA")
    assert export_landmarks(editing.document.state, tmp_path).text.splitlines()[1:] == [
        "Missing on the left side, to do: ZL.",
        "Missing on the left side, not seen: MN.",
        "Missing on the right side, to do: CA.",
        "On the right side, CO is missing: it is computed from CA, CB, RWA and RWP.",
    ]
    one = Editing(ImportLandmarks((shape(L),), MARK).apply(SpecimenState("B")))
    report = export_landmarks(one.document.state, tmp_path)
    assert [path.name for path in report.files] == ["B_L.mrk.json"]
    assert "The right side is not labelled and was not written." in report.text
    assert not report.is_complete


def test_export_refuses_what_it_should(editing, tmp_path):
    export_landmarks(editing.document.state, tmp_path)
    with pytest.raises(GpError, match=r"GP-014_L\.mrk\.json: already exists"):
        export_landmarks(editing.document.state, tmp_path)
    export_landmarks(editing.document.state, tmp_path, overwrite=True)
    with pytest.raises(GpError, match="nothing is placed yet"):
        export_landmarks(SpecimenState(), tmp_path)
    with pytest.raises(GpError, match="format must be one of"):
        export_landmarks(editing.document.state, tmp_path, formats=[".xyz"])
    (tmp_path / "file").write_text("")
    with pytest.raises(GpError, match="cannot be made"):
        export_landmarks(editing.document.state, tmp_path / "file" / "x")


def test_an_exported_file_carries_its_origin_but_no_path(editing, tmp_path):
    editing.document.attach_volume(FakeVolume(path=tmp_path / "private" / "scan.nrrd"))
    (left, _) = export_landmarks(editing.document.state, tmp_path).files
    text = left.read_text()
    assert "private" not in text
    header = json.loads(text)["gpLabeler"][0]
    assert header["volume"]["checksum"] == "abc"
    assert header["provenance"]["CA"] == {
        "how": "mesh",
        "voxel_mm": [0.1, 0.1, 0.2],
        "time": "2026-01-01T00:00:00+00:00",
        "by": "AB",
    }


@pytest.mark.parametrize("suffix", FORMATS)
def test_who_looked_at_a_point_again_goes_with_it(editing, tmp_path, suffix):
    editing.document.do(CheckPoint(L, "CA", by=editing.document.author))
    editing.document.do(CheckPoint(L, "CB"))
    export_landmarks(editing.document.state, tmp_path, formats=[suffix])
    assert dict(read_landmarks(tmp_path / f"GP-014_L{suffix}").checked) == {"CA": "AB", "CB": ""}
    editing.labels.place(editing.document.landmarks(L)["CA"] + [0.5, 0, 0], side=L, code="CA")
    export_landmarks(editing.document.state, tmp_path, formats=[suffix], overwrite=True)
    assert dict(read_landmarks(tmp_path / f"GP-014_L{suffix}").checked) == {"CB": ""}
    again = state_of(document_of(editing.document.state))
    assert again.landmark(L, "CB").checked
    assert again == editing.document.state


def test_points_that_cannot_be_of_this_scan_are_refused(editing, tmp_path):
    far = Editing(SpecimenState("far"))
    far.document.do(ImportLandmarks((shape(L),), MARK))
    far.labels.place((60, 0, 0), side=L, code="ZL")
    far.labels.place((0, 0, -70), side=L, code="MN")
    (file,) = export_landmarks(far.document.state, tmp_path).files
    before = editing.document.state
    with pytest.raises(
        OffBoneError, match=r"specimen GP-014: 2 of 19 points .MN left, ZL left. lie outside the scan"
    ):
        import_landmarks(editing.document, [file])
    assert editing.document.state is before
    warnings = import_landmarks(editing.document, [file], accept_off_bone=True)
    assert warnings[0] == "far_L.mrk.json is of specimen far"
    assert warnings[1].startswith("2 of 19 points")


def test_a_flipped_file_is_recognised(editing, tmp_path):
    class Octant(FakeVolume):
        def contains(self, points):
            return (points[:, 0] < 20).all() & (points[:, 1] < 40) & (points[:, 0] < 0)

    flipped = Editing(SpecimenState("GP-014"))
    flipped.document.do(ImportLandmarks((shape(L).with_point("IN", (1, 0, 0)),), MARK))
    (file,) = export_landmarks(flipped.document.state, tmp_path).files
    editing.document.attach_volume(Octant())
    with pytest.raises(OffBoneError, match="With x and y negated, all are inside"):
        import_landmarks(editing.document, [file])


def test_points_off_the_bone(editing, tmp_path):
    (left, _) = export_landmarks(editing.document.state, tmp_path).files

    def near(n_off):
        return lambda points: np.arange(len(points)) >= n_off

    with pytest.raises(
        OffBoneError, match=r"10 of 19 points \(CA left, CB left, .*\.\.\.\) lie off the bone"
    ):
        import_landmarks(editing.document, [left], near_bone=near(10))
    assert import_landmarks(editing.document, [left], near_bone=near(1)) == (
        "1 of 19 points (CA left) lie off the bone",
    )


def test_files_of_others(editing, tmp_path):
    plain = tmp_path / "points.csv"
    write_csv(plain, shape(R))
    with pytest.raises(FeatureError, match="does not say which side"):
        import_landmarks(editing.document, [plain])
    assert import_landmarks(editing.document, [plain], side="R") == ()
    with pytest.raises(GpError, match="no landmark file was given"):
        import_landmarks(editing.document, [])
    fresh = Editing(author="CD", clock=lambda: "now")
    import_landmarks(fresh.document, [plain], side="R")
    found = fresh.document.state.landmark(R, "CA").provenance
    assert (found.how, found.by, found.source) == (How.IMPORTED, "CD", "points.csv")
    assert fresh.document.undo_text == "import 19 points"


def test_labels_of_another_scan_are_told(editing, tmp_path):
    (left, _) = export_landmarks(editing.document.state, tmp_path).files
    content = json.loads(left.read_text())
    content["gpLabeler"][0]["provenance"] = {"CA": {"how": "magic"}, "XX": {"how": "mesh"}}
    left.write_text(json.dumps(content))
    other = Editing(SpecimenState("GP-014"))
    other.document.attach_volume(FakeVolume(checksum="other"))
    assert import_landmarks(other.document, [left]) == ("GP-014_L.mrk.json was labelled on another scan",)
    assert other.document.state.landmark(L, "CA").provenance.how is How.IMPORTED


def test_recent_files(tmp_path):
    recent = RecentFiles(tmp_path / "state", limit=3)
    assert recent.all() == ()
    for name in "abcad":
        recent.add(tmp_path / name)
    assert [path.name for path in recent.all()] == ["d", "a", "c"]
    recent.remove(tmp_path / "a")
    assert [path.name for path in RecentFiles(tmp_path / "state").all()] == ["d", "c"]
    for rubbish in ("{", "[1]", '{"files": 3}', '{"files": [1, "", null]}', "\xff"):
        (tmp_path / "state" / "recent.json").write_bytes(rubbish.encode("latin1"))
        assert recent.all() == ()
    recent.add(tmp_path / "e")
    assert len(recent.all()) == 1
    recent.clear()
    assert recent.all() == ()
    (tmp_path / "file").write_text("")
    RecentFiles(tmp_path / "file").add("x")  # cannot be written: no matter
