"""Labelled scans on disk: a specimen file names its scan, and how the head lies in it."""

import pickle

import numpy as np
from document_cases import Editing, shape
from small_heads import save_volume, small_head

from gp_core.frames import RigidTransform
from gp_core.landmarks.features import Side
from gp_labeler.document.head_edits import SetHeadFrame
from gp_labeler.document.head_frame import HeadFrame
from gp_labeler.document.labelled_scans import read_labelled_scans
from gp_labeler.imaging.readers import read_volume


def test_a_specimen_brings_its_scan_and_the_frame_of_its_head(tmp_path):
    save_volume(tmp_path / "GP1.nrrd", small_head(0)[0])
    turn = RigidTransform.from_parts(np.diag([1.0, -1, -1]), [1.0, 2, 3], dst="head", src="scan")
    editing = Editing()
    editing.document.begin("GP1")
    editing.document.attach_volume(read_volume(tmp_path / "GP1.nrrd"))
    for code in ("CA", "RWP", "OS"):
        editing.labels.place(shape()[code], side=Side.LEFT, code=code)
    editing.document.do(SetHeadFrame(HeadFrame.of(turn)))
    editing.document.save(tmp_path / "GP1.gpspecimen.json")
    (scan,) = read_labelled_scans([tmp_path]).scans
    assert (scan.name, set(scan.points)) == ("GP1", {"CA_L", "RWP_L", "OS_L"})
    assert scan.path == tmp_path / "GP1.nrrd"
    for read in (scan, pickle.loads(pickle.dumps(scan))):  # other processes get it
        np.testing.assert_allclose(read.T_head_scan.matrix, turn.matrix)
