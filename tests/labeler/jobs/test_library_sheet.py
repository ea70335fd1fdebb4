"""Pictures of what the check of a library found: label and expected place, where they are in the scan."""

from __future__ import annotations

import numpy as np
import pytest

from gp_labeler.autolabel import LabelledScan
from gp_labeler.autolabel.cross_check import LibraryCheck, LibraryFinding
from gp_labeler.autolabel.prediction import Prediction
from gp_labeler.imaging.volume import Volume
from gp_labeler.jobs.library_sheet import draw_library_check, finding_blocks
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
