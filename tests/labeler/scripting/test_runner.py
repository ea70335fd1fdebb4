"""Steps do in the real window what a hand would do there."""

from __future__ import annotations

import numpy as np
import pytest
from script_cases import SPECIMEN, content, place, run
from window_cases import MIDDLE, VOXEL_MM, ball_volume, on_ball

from gp_labeler.scripting.runner import do_step, run_script
from gp_labeler.scripting.script import StepError, make_script
from gp_labeler.scripting.window_driver import WindowDriver

pytestmark = pytest.mark.machine


INSIDE = MIDDLE + np.array([2.1, -1.7, 1.3])
LOOK = {"do": "view", "camera": "A"}
CA = place("CA", on_ball(0.2, -1, 0.1))


def test_a_click_on_a_slice_places_within_a_voxel(tmp_path) -> None:
    codes = {"CA": "axial", "CB": "sagittal", "CC": "coronal"}
    clicks = [place(code, INSIDE, view=view, within=0.6 * VOXEL_MM) for code, view in codes.items()]
    report = run(tmp_path, *clicks, {"do": "save"})
    assert report.ok, report.error
    marks = content(tmp_path / "out" / SPECIMEN)["landmarks"]["L"]
    assert [marks[code]["provenance"]["how"] for code in codes] == ["slice"] * 3
    assert max(np.abs(marks[code]["position"] - INSIDE).max() for code in codes) < 0.6 * VOXEL_MM


def test_a_click_on_bone_places_on_it(tmp_path) -> None:
    report = run(tmp_path, LOOK, place("CA", on_ball(0.2, -1, 0.1), within=0.5 * VOXEL_MM), {"do": "save"})
    assert report.ok, report.error
    mark = content(tmp_path / "out" / SPECIMEN)["landmarks"]["L"]["CA"]
    assert mark["provenance"]["how"] == "mesh"


def test_best_rotates_the_head_to_what_is_hidden(tmp_path) -> None:
    behind = on_ball(0.3, 1, 0.2)
    hidden = run(tmp_path, LOOK, place("RWA", behind))
    assert "bone hides that position" in hidden.error
    found = run(tmp_path, LOOK, place("RWA", behind, view="best", within=0.5 * VOXEL_MM))
    assert found.ok, found.error
    assert found.steps[-1].text.startswith("3d")


def test_pixels_ghosts_and_the_crosshair_place_too(tmp_path) -> None:
    report = run(
        tmp_path,
        {"do": "place", "feature": "CB", "side": "L", "pixel": [200, 150], "view": "coronal"},
        {"do": "view", "go_to": INSIDE.tolist()},
        {"do": "place", "feature": "CC", "side": "L", "at": "crosshair"},
        {"do": "expect", "feature": "CC", "side": "L", "near": INSIDE.tolist(), "within": 1e-9},
        {"do": "place", "feature": "CA", "side": "L", "at": "ghost"},
    )
    assert report.error.startswith("step 6: place CA left: landmark CA: CA left was not placed")


def test_drag_key_and_undo(tmp_path) -> None:
    there = INSIDE + np.array([1.0, 0.5, 0.0])
    report = run(
        tmp_path,
        place("CA", INSIDE, view="axial"),
        {"do": "drag", "feature": "CA", "side": "L", "to": there.tolist(), "view": "axial"},
        {"do": "expect", "feature": "CA", "side": "L", "near": there.tolist()},
        {"do": "key", "keys": "Left", "times": 4, "view": "axial"},
        {"do": "expect", "feature": "CA", "near": (there - [4 * VOXEL_MM, 0, 0]).tolist()},
        {"do": "undo", "times": 2},
        {"do": "expect", "feature": "CA", "near": INSIDE.tolist()},
        {"do": "undo"},
        {"do": "expect", "placed": 0},
        {"do": "undo"},
    )
    assert report.error == "step 11: undo: there is nothing to undo"


def test_files_go_out_and_come_back(tmp_path) -> None:
    out = run(
        tmp_path,
        LOOK,
        CA,
        {"do": "export", "formats": [".mrk.json", ".fcsv"]},
        {"do": "save", "path": "a/b.gpspecimen.json"},
    )
    assert out.ok, out.error
    assert out.files == ["ball_L.mrk.json", "ball_L.fcsv", "a/b.gpspecimen.json"]
    back = run(
        tmp_path,
        {"do": "import", "files": "out/ball_L.mrk.json"},
        {"do": "expect", "feature": "CA", "side": "L", "near": CA["at"]},
        {"do": "export", "folder": "again", "complete": True},
    )
    assert "step 4: export: Wrote ball_L.mrk.json. Missing on the left side, to do" in back.error


def test_a_script_does_not_write_over_what_it_reads(tmp_path) -> None:
    assert run(tmp_path, LOOK, CA, {"do": "export"}).ok
    before = (tmp_path / "out" / "ball_L.mrk.json").read_bytes()
    report = run(tmp_path, {"do": "import", "files": "out/ball_L.mrk.json"}, {"do": "export"})
    assert "ball_L.mrk.json: is an input, and would be overwritten" in report.error
    assert (tmp_path / "out" / "ball_L.mrk.json").read_bytes() == before


def test_points_that_belong_elsewhere_stop_an_import(tmp_path) -> None:
    (tmp_path / "far.csv").write_text("label,x,y,z\nCA,500,500,500\n")
    step = {"do": "import", "files": ["far.csv"]}
    (tmp_path / "far_L.csv").write_bytes((tmp_path / "far.csv").read_bytes())
    step["files"] = ["far_L.csv"]
    assert "outside the scan" in run(tmp_path, step).error
    accepted = run(tmp_path, {**step, "accept_misfit": True})
    assert accepted.ok, accepted.error
    assert "outside the scan" in accepted.steps[-1].warnings[0]


def test_a_failing_step_stops_and_keeps_what_was_done(tmp_path) -> None:
    report = run(tmp_path, LOOK, CA, {"do": "expect", "placed": 7}, {"do": "export"})
    assert report.error == "step 4: expect: 1 points are placed, expected were 7"
    assert [step.number for step in report.steps] == [1, 2, 3, 4]
    assert "CA" in content(tmp_path / "out" / SPECIMEN)["landmarks"]["L"]
    written = content(tmp_path / "out" / "report.json")
    assert (written["ok"], written["error"]) == (False, report.error)
    assert not (tmp_path / "out" / "ball_L.mrk.json").exists()


IMPOSSIBLE = (
    ({"do": "open", "path": "none.nrrd"}, "does not exist. Paths of inputs are relative to the script."),
    ({"do": "open"}, "a path, phantom"),
    ({"do": "place", "feature": "CO", "side": "L", "at": [0, 0, 0]}, "CO left cannot be chosen"),
    ({"do": "place", "feature": "XX", "side": "L", "at": [0, 0, 0]}, "unknown feature"),
    ({"do": "place", "feature": "CA", "side": "L", "at": "truth"}, "known only for a phantom"),
    ({"do": "place", "feature": "CA", "side": "L", "at": "there"}, "at must be truth, ghost"),
    ({"do": "place", "feature": "CA", "side": "L", "pixel": [9e3, 0]}, "outside the view"),
    ({"do": "place", "feature": "CA", "side": "L", "pixel": [0, 0], "view": "3d"}, "nothing was hit"),
    ({"do": "place", "feature": "CA", "side": "L"}, "at or pixel"),
    ({"do": "drag", "feature": "CA", "side": "L", "by": [1, 1]}, "not placed yet"),
    ({"do": "key", "keys": "Ctrl+Zed"}, "unknown keys"),
    ({"do": "action", "id": "point.luck"}, "unknown action"),
    ({"do": "action", "id": "edit.undo"}, "cannot be done now"),
    ({"do": "view", "layout": "five"}, "layout must be one of"),
    ({"do": "view", "zoom": 0}, "zoom must be above 0"),
    ({"do": "screenshot", "path": "a.png", "what": "moon"}, "what must be one of"),
    ({"do": "screenshot", "path": "a.nothing"}, "ends with .png"),
    ({"do": "overlay"}, "3 more touches"),
    ({"do": "screenshot", "path": "a.png", "size": [99999, 10]}, "size must be"),
    ({"do": "view", "size": [0, 10]}, "size must be"),
    (place("CA", [999, 0, 0], view="axial"), "outside the scan"),
    ({"do": "action", "id": "point.clear"}, "cannot be done now: Click on bone or a slice to place CA left"),
    ({"do": "estimate", "side": "L"}, "cannot be touched"),
    ({"do": "estimate", "side": "L", "touches": {"MN": [0, 0, 0]}}, "2 more touches"),
    ({"do": "touches", "side": "L"}, "touches needs points"),
    ({"do": "touches", "side": "L", "points": {"CA": [0, 0, 0]}}, "inside the bone"),
    ({"do": "touches", "side": "L", "points": "none.dat"}, "none.dat"),
    ({"do": "touches", "side": "L", "points": {}, "how": "guessed"}, "how must be one of"),
    ({"do": "touches", "side": "L", "leave_out": "OS"}, "not touched yet"),
    ({"do": "touches", "side": "L", "swap": "OS"}, "swap must be two names, got OS"),
    ({"do": "touches", "side": "L", "swap": ["OS", "MN"]}, "OS left is not touched yet"),
    ({"do": "skull", "points": "none.csv"}, "none.csv"),
    ({"do": "register", "side": "R"}, "3 more touches"),
    ({"do": "verdict", "side": "R", "verdict": "accept"}, "3 more touches"),
    ({"do": "report", "side": "R"}, "3 more touches"),
    ({"do": "atlas"}, "path or specimens"),
    ({"do": "atlas", "path": "none.json"}, "none.json"),
    ({"do": "put", "feature": "CA", "side": "L", "at": [0, 0, 0], "how": "by eye"}, "how must be one of"),
    ({"do": "put", "feature": "CO", "side": "L", "at": [0, 0, 0]}, "CO left cannot be chosen"),
    ({"do": "specimen"}, "needs name or notes"),
    ({"do": "specimen", "name": "a/b"}, "a/b"),
    ({"do": "action", "id": "edit.swap"}, "Exchange CA left with"),
    ({"do": "fit", "specimens": "none"}, "none"),
    ({"do": "export"}, "nothing is placed"),
    ({"do": "expect"}, "expect needs"),
    ({"do": "expect", "message": "wonder"}, "no message holds 'wonder'"),
)


def test_what_cannot_be_done_says_why(tmp_path) -> None:
    driver = WindowDriver(tmp_path / "out", tmp_path)
    driver.workspace.scan.begin(ball_volume())
    driver.wait_until_idle()
    try:
        for number, (table, text) in enumerate(IMPOSSIBLE, start=1):
            (step,) = make_script([table]).steps
            with pytest.raises(StepError) as caught:
                do_step(driver, number, step)
            assert str(caught.value).startswith(f"step {number}: {step.title}: ")
            assert text in str(caught.value)
    finally:
        driver.close()


def test_without_a_scan_steps_say_so(tmp_path) -> None:
    for table in ({"do": "threshold", "value": 1}, {"do": "mesh"}, CA, {"do": "import", "files": "a"}):
        report = run_script(make_script([table]), tmp_path)
        assert "no scan is open" in report.error


def test_a_scan_without_a_voxel_size_stops_unless_the_script_gives_it(tmp_path) -> None:
    import tifffile

    voxels = np.zeros((40, 60, 50), np.uint16)
    voxels[10:30, 15:45, 10:40] = 3000
    tifffile.imwrite(tmp_path / "stack.tif", voxels)
    opening = {"do": "open", "path": "stack.tif"}
    silent = run_script(make_script([opening], folder=tmp_path), tmp_path / "out")
    assert "oxel size" in silent.error
    told = make_script([{"do": "spacing", "mm": 0.5}, opening], folder=tmp_path)
    report = run_script(told, tmp_path / "out")
    assert report.ok, report.error
    assert report.steps[1].text == "stack, 50 x 60 x 40 voxels"


def test_an_atlas_is_fitted_to_labelled_animals(tmp_path) -> None:
    from gp_core import Atlas, Side, write_markups
    from gp_core.atlas.sampling import draw_animal

    rng, animals = np.random.default_rng(5), tmp_path / "animals"
    animals.mkdir()
    for n in range(3):
        animal = draw_animal(Atlas.published(), rng=rng, name=f"GP-{n}")
        for side in Side:
            write_markups(animals / f"GP-{n}_{side.value}.mrk.json", animal.side(side), specimen=animal.name)
    steps = make_script([{"do": "fit", "specimens": "animals", "path": "own/atlas.json"}], folder=tmp_path)
    report = run_script(steps, tmp_path / "out")
    assert report.ok, report.error
    assert report.steps[0].text == "atlas.json, 3 animals"
    assert Atlas.load(tmp_path / "out" / "own" / "atlas.json").n_samples == 6
