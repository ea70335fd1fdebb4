"""What is written of a pose: by the file's name, exact, and refused under another ending; insertion paths."""

from __future__ import annotations

import json

import numpy as np
import pytest
from document_cases import Editing

from gp_core import PROBE, Atlas, Side
from gp_core.atlas.sampling import draw_animal
from gp_core.errors import GpError
from gp_labeler.document import touching
from gp_labeler.document.touches import TouchHow
from gp_labeler.models.pose_exports import FORMATS, InsertionPath, save_pose


@pytest.fixture
def estimating():
    editing, animal = (
        Editing(atlas=Atlas.published()),
        draw_animal(Atlas.published(), rng=np.random.default_rng(1)).side("L"),
    )
    for code in PROBE:
        touching.record_touch(editing.document, "L", code, animal[code], TouchHow.SCAN)
    yield editing.pose
    editing.document.close(discard=True)


@pytest.mark.parametrize("suffix", FORMATS)
def test_every_format_is_written_by_its_ending(tmp_path, estimating, suffix):
    pose = estimating.estimate.pose
    file = save_pose(pose, tmp_path / f"pose{suffix}")
    text = file.read_text()
    number = repr(float(pose.origin[0])) if suffix != ".tfm" else "AffineTransform"
    assert number in text
    if suffix == ".csv":
        np.testing.assert_array_equal(np.loadtxt(file, delimiter=","), pose.transform)
    if suffix == ".mrk.json":
        assert json.loads(text)["markups"][0]["coordinateSystem"] == "LPS"


def test_another_ending_is_refused(tmp_path, estimating):
    with pytest.raises(GpError, match=r"no ending of a pose file.*\.tfm"):
        save_pose(estimating.estimate.pose, tmp_path / "pose.txt")
    assert not list(tmp_path.iterdir())


def test_a_path_goes_with_the_cochlea_and_is_mirrored_for_the_other_ear(tmp_path, estimating):
    table = tmp_path / "path.csv"
    table.write_text("x,y,z\n-0.5,2,0\n0,1.5,0.2\n0.4,1,0.5\n")
    left, right = (InsertionPath.read(table, side, units="mm") for side in Side)
    estimate = estimating.estimate
    T_scan_cochlea = estimate.in_scan().T_scan_cochlea
    np.testing.assert_allclose(left.in_scan(estimate), T_scan_cochlea.apply(left.points), atol=1e-9)
    mirrored = right.points * (1, 1, -1)
    np.testing.assert_allclose(right.in_scan(estimate), T_scan_cochlea.apply(mirrored), atol=1e-9)
    carried = left.save_carried(estimate, tmp_path / "robot.csv")
    np.testing.assert_array_equal(np.loadtxt(carried, delimiter=","), left.in_touches(estimate))
    with pytest.raises(GpError, match="look like m"):
        InsertionPath.read(table, "L", units="um")
