"""Pictures of what the check of a library found: label and expected place, where they are in the scan."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gp_core.atlas.atlas import Atlas
from gp_core.atlas.sampling import mean_animal
from gp_core.frames import RigidTransform
from gp_labeler.autolabel import LabelledScan
from gp_labeler.autolabel.cross_check import LibraryCheck, LibraryFinding
from gp_labeler.autolabel.labelled_scan import flat_points
from gp_labeler.autolabel.prediction import Prediction
from gp_labeler.imaging.volume import Volume
from gp_labeler.jobs.library_sheet import draw_library_check, finding_blocks, head_rotation
from gp_labeler.jobs.picture_page import PIXELS

LABEL, EXPECTED = np.array([4.0, -2.0, 1.0]), np.array([4.0, 0.0, 1.0])
POINTS = {"MN_L": LABEL, "RWA_L": EXPECTED, "nose": np.array([0.0, -8.0, 0.0])}


def small_balls() -> Volume:
    """Return two balls of bone of radius 0.6 mm: one at the label of MN, the other where it is expected."""
    axes = np.arange(-11.0, 11.0, 0.4)
    z, y, x = np.meshgrid(axes, axes, axes, indexing="ij")
    away = [np.linalg.norm(np.stack([x, y, z], -1) - at, axis=-1) for at in (LABEL, EXPECTED)]
    grey = 1000.0 * (np.minimum(*away) < 0.6)
    return Volume.from_parts(grey.astype(np.float32), [0.4] * 3, [axes[0]] * 3, name="balls")


SCAN = LabelledScan("GP1", POINTS, volume=small_balls())
PREDICTION = Prediction({"a": {**POINTS, "MN_L": EXPECTED}, "b": {**POINTS, "MN_L": EXPECTED}}, None)
FAR = LibraryFinding("GP1", "far", ("MN_L",), 2.0, 0.3)


def test_both_places_are_marked_on_the_balls_that_lie_there():
    (block,) = finding_blocks(SCAN, [FAR], PREDICTION, SCAN.load(), 500.0)
    assert block.heading == "MN left  Mandible"
    assert block.note == "2.00 mm from where it is expected · usually 0.30 mm"
    assert block.pictures.shape == (PIXELS, 3 * PIXELS, 3)
    for mark in block.marks:  # MN is seen in coronal slices, so each slice shows one ball
        shown = block.pictures[round(mark.y), round(mark.picture * PIXELS + mark.x)]
        assert (shown.max() > 0.5) is not mark.faint
    faint = [(mark.picture, mark.look) for mark in block.marks if mark.faint]
    assert faint == [(0, "expected"), (1, "label")]
    side = [mark for mark in block.marks if mark.picture == 2]
    assert side[1].x - side[0].x == pytest.approx(2.0 / 12.0 * PIXELS)  # from the left, posterior is right


def test_pictures_are_made_in_the_frame_of_a_head_that_lies_turned():
    """The same head, turned in its scan by a quarter about x: the pictures are the same."""
    turn = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])  # from the head into the scan
    plain, balls = SCAN.load(), small_balls()
    matrix = np.eye(4)
    matrix[:3, :3] = turn
    volume = replace(balls, T_scan_voxel=matrix @ balls.T_scan_voxel)
    points = {name: turn @ at for name, at in POINTS.items()}
    scan = LabelledScan("GP1", points, volume=volume, T_head_scan=RigidTransform(matrix.T, "head", "scan"))
    expected = {name: turn @ at for name, at in PREDICTION.centres.items()}
    (block,) = finding_blocks(scan, [FAR], Prediction({"a": expected}, None), volume, 500.0, turn)
    (upright,) = finding_blocks(SCAN, [FAR], PREDICTION, plain, 500.0)
    np.testing.assert_allclose(block.pictures, upright.pictures, atol=0.02)
    marks = [(mark.picture, round(mark.x, 3), round(mark.y, 3), mark.faint) for mark in block.marks]
    assert marks == [(mark.picture, round(mark.x, 3), round(mark.y, 3), mark.faint) for mark in upright.marks]
    np.testing.assert_allclose(head_rotation(scan, PREDICTION, volume), turn)


def test_without_a_known_frame_the_predicted_places_tell_it_however_the_labels_lie():
    sides = mean_animal(Atlas.published())
    turn = Rotation.from_rotvec([0.4, -0.8, 1.2]).as_matrix()
    places = {name: turn @ at for name, at in flat_points(sides.sides).items()}
    told = Prediction({"a": places}, None)
    wrong = LabelledScan("GP1", places | {"CA_L": places["MN_R"]}, volume=SCAN.volume)
    np.testing.assert_allclose(head_rotation(wrong, told, SCAN.volume), turn, atol=1e-6)
    assert head_rotation(SCAN, PREDICTION, SCAN.volume) is None  # a scheme of its own


def test_a_pair_shows_both_labels_and_a_whole_head_the_worst():
    pair = LibraryFinding("GP1", "exchanged", ("MN_L", "RWA_L"), 2.0, 0.3)
    blocks = finding_blocks(SCAN, [pair], PREDICTION, SCAN.load(), 500.0)
    assert [block.heading[:3] for block in blocks] == ["MN ", "RWA"]
    assert "exchanged with RWA left?" in blocks[0].note
    whole = LibraryFinding("GP1", "other scan", (), 9.0, 0.3)
    blocks = finding_blocks(SCAN, [whole], PREDICTION, SCAN.load(), 500.0)
    assert (len(blocks), blocks[0].heading) == (3, "MN left  Mandible")
    assert {block.heading for block in blocks} >= {"nose"}


def test_a_file_for_all_or_one_for_each_and_none_where_all_is_well(tmp_path):
    check = LibraryCheck((FAR,), ("GP0", "GP1"))
    scans = [LabelledScan("GP0", POINTS, volume=SCAN.volume), SCAN]
    (file,) = draw_library_check(check, scans, {"GP1": PREDICTION}, tmp_path / "new" / "all.pdf")
    assert file.read_bytes().count(b"/Type /Page ") == 1
    assert [f.name for f in draw_library_check(check, scans, {"GP1": PREDICTION}, tmp_path)] == [
        "GP1_check.pdf"
    ]
    assert draw_library_check(LibraryCheck((), ("GP0",)), scans, {}, tmp_path / "none") == ()
    assert not (tmp_path / "none").exists()
