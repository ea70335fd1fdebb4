"""The demo, on a coarse phantom so that it takes seconds."""

from __future__ import annotations

import pytest
from qtpy.QtGui import QImage
from script_cases import content

from gp_core.io import read_landmarks
from gp_labeler.scripting.demo import demo_script
from gp_labeler.scripting.runner import run_script

PICTURES = ("window.png", "mesh.png", "slices.png", "measured.png", "overlay.png")


@pytest.mark.slow
def test_the_demo_leaves_everything_it_promises(qapp, tmp_path) -> None:
    report = run_script(demo_script(seed=1, voxel_mm=0.4), tmp_path)
    assert report.ok, report.error
    written = content(tmp_path / "report.json")
    assert written["n_placed"] == 40
    assert written["largest_error_voxels"] < 1.0
    assert {pose["side"]: pose["error_mm"] < 1.0 for pose in written["poses"]} == {"L": True, "R": True}
    assert all(step["seconds"] >= 0 for step in written["steps"])
    for side in "LR":
        assert len(read_landmarks(tmp_path / f"phantom-1_{side}.mrk.json").placed) == 20
    assert (tmp_path / "phantom-1.gpspecimen.json").exists()
    poses = {name: content(tmp_path / f"pose{name}.json") for name in ("", "_L", "_R")}
    assert poses[""] == poses["_L"]
    assert {name: pose["side"] for name, pose in poses.items()} == {"": "L", "_L": "L", "_R": "R"}
    assert {pose["frame"] for pose in poses.values()} == {"tracker"}
    assert set(content(tmp_path / "phantom-1.gpspecimen.json")["touches"]) == {"L", "R"}
    first = content(tmp_path / "phantom-1.gpspecimen.json")
    assert (first["landmarks"]["L"]["MN"]["certainty"], first["observer"]) == ("fair", "demo")
    (again,) = first["other_labellings"]
    assert (again["round"], again["blind"], len(again["landmarks"]["L"])) == (2, True, 4)
    assert content(tmp_path / "reliability.json")["overall"]["intra"]["n_pairs"] == 4
    ruler, angle = first["measurements"]
    assert (ruler["name"], angle["name"]) == ("round window", "axis and window")
    assert (tmp_path / "distances.json").exists()
    assert len(list(tmp_path.glob("*round*window*.mrk.json"))) == 1
    assert (tmp_path / "contact.pdf").read_bytes().count(b"/Type /Page ") == 2
    assert content(tmp_path / "specimens.json")[0]["finished"]
    for name in PICTURES:
        image = QImage(str(tmp_path / name))
        assert min(image.width(), image.height()) >= 600
