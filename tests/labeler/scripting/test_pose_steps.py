"""Steps from touches to a judged and reported pose: shared probe files, simulated skulls, labels."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from qtpy.QtGui import QImage
from scipy.spatial.transform import Rotation
from script_cases import content, run
from window_cases import MIDDLE, image_bytes

from gp_core import PROBE, Atlas, RigidTransform, Side, estimate_pose, read_touches
from gp_core.landmarks.features import CODES

SHARED = Path(__file__).resolve().parents[4] / "shared" / "data" / "probe"
RGB = QImage.Format.Format_RGB888
ATLAS = Atlas.published()
SHIFT = MIDDLE - np.mean([ATLAS[code] for code in PROBE], axis=0)
LABELS = {code: ATLAS[code] + SHIFT for code in CODES if code != "CO"}
AROUND = MIDDLE + np.random.default_rng(1).uniform(-12, 12, (8, 3))
SKULL = {f"S{n}": point for n, point in enumerate(AROUND, start=1)}
T_TRACKER_SCAN = RigidTransform.from_parts(
    Rotation.from_rotvec([1.0, 2.0, 0.5]).as_matrix(), [100.0, -50.0, 20.0], dst="tracker", src="scan"
)


def table(points) -> dict[str, list[float]]:
    return {name: [float(x) for x in point] for name, point in points.items()}


def touched(names, noise: float = 0.0, seed: int = 3) -> dict[str, list[float]]:
    """Touch labels and skull features in the tracker's frame."""
    rng, there = np.random.default_rng(seed), LABELS | SKULL
    return table({n: T_TRACKER_SCAN.apply(there[n][None])[0] + rng.normal(0, noise, 3) for n in names})


@pytest.fixture
def labels(tmp_path) -> dict[str, object]:
    """A step that labels the left side as the atlas has it."""
    lines = [f"{code},{x!r},{y!r},{z!r}" for code, (x, y, z) in table(LABELS).items()]
    (tmp_path / "labels_L.csv").write_text("\n".join(["label,x,y,z", *lines]))
    return {"do": "import", "files": "labels_L.csv", "accept_misfit": True}


def test_touches_are_laid_on_the_labels_of_the_same_names(tmp_path, labels) -> None:
    report = run(
        tmp_path,
        labels,
        {"do": "estimate", "side": "L", "touches": touched(PROBE), "path": ["pose.json", "pose.tfm"]},
        {"do": "expect", "pose_within": 1e-6},
        {"do": "overlay", "parts": ["estimate", "cochlea"], "opacity": 0.9},
        {"do": "screenshot", "path": "on.png", "what": "views"},
        {"do": "overlay", "visible": False},
        {"do": "screenshot", "path": "off.png", "what": "views"},
    )
    assert report.ok, report.error
    found = content(tmp_path / "out" / "pose.json")["cochlea_origin_mm"]
    np.testing.assert_allclose(found, T_TRACKER_SCAN.apply(SHIFT[None])[0], atol=1e-6)
    assert report.poses[0]["registered_by"] == "features"
    assert report.files == ["pose.json", "pose.tfm", "on.png", "off.png"]
    on, off = (QImage(str(tmp_path / "out" / f"{name}.png")).convertToFormat(RGB) for name in ("on", "off"))
    rows = [image_bytes(image).reshape(image.height(), -1).astype(int) for image in (on, off)]
    assert np.count_nonzero(np.abs(rows[0] - rows[1]) > 60) > 600  # channels of pixels: it is drawn


def test_a_skull_registers_what_its_features_say(tmp_path, labels) -> None:
    noise = 0.1
    report = run(
        tmp_path,
        labels,
        {"do": "skull", "points": table(SKULL)},
        {"do": "touches", "side": "L", "points": touched((*PROBE, *SKULL), noise)},
        {"do": "register", "side": "L", "by": "skull", "within": 0.5, "path": "registration.json"},
        {"do": "estimate", "side": "L"},
        {"do": "verdict", "side": "L", "verdict": "accept", "by": "AB", "note": "fits"},
        {"do": "report", "side": "L"},
        {"do": "report", "side": "L", "path": "pose.pdf"},
        {"do": "save", "path": "a.gpspecimen.json"},
        {"do": "register", "side": "L", "by": "features", "within": 0.001},
    )
    assert report.error.startswith("step 11: register left: fiducial registration error")
    registration = content(tmp_path / "out" / "registration.json")
    assert 0.05 < registration["fre_mm"] < 2.5 * noise
    off = np.array(registration["transform"])[:3, :3] - T_TRACKER_SCAN.inverse().rotation
    assert np.abs(off).max() < 0.05
    (pose,) = report.poses
    assert (pose["registered_by"], pose["side"]) == ("skull", "L")
    assert pose["error_mm"] < 1.0
    assert 0 < pose["tre_mm"] < 0.3
    saved = content(tmp_path / "out" / "a.gpspecimen.json")
    assert [check["verdict"] for check in saved["pose_checks"]] == ["accept"]
    assert set(saved["touches"]["L"]) == {*PROBE, *SKULL}
    page = (tmp_path / "out" / "pose.html").read_text()
    assert "Accepted" in page
    assert page.count("data:image/png") >= 4
    assert (tmp_path / "out" / "pose.pdf").read_bytes().startswith(b"%PDF")


def test_a_touch_is_left_out_taken_in_and_forgotten(tmp_path, labels) -> None:
    bad = touched((*PROBE, "OI"))
    bad["OI"][0] += 5.0
    side = {"do": "touches", "side": "L"}
    report = run(
        tmp_path,
        labels,
        {**side, "points": bad},
        {**side, "leave_out": ["OI", "MN"]},
        {**side, "take_in": "MN", "forget": "CL"},
        {**side, "points": touched(["ZL"]), "add": True},
        {"do": "estimate", "side": "L", "probe_noise": 0.2},
        {"do": "expect", "pose_within": 1e-3},
        {**side, "clear": True},
    )
    assert report.ok, report.error
    texts = [step.text for step in report.steps]
    assert set(texts[5].split()) == {"7", "touched:", *PROBE, "OI", "ZL"} - {"CL"}
    assert texts[-1] == "nothing touched"


@pytest.mark.skipif(not SHARED.exists(), reason="the shared probe files are not here")
def test_real_touches_give_what_the_core_gives(tmp_path) -> None:
    file = SHARED / "SkullE_Right.dat"
    report = run(tmp_path, {"do": "estimate", "side": "R", "touches": str(file)})
    assert report.ok, report.error
    landmarks = read_touches(file, Side.RIGHT)
    points = {code: landmarks[code] for code in landmarks.placed}
    wanted, found = estimate_pose(points, Side.RIGHT), content(tmp_path / "out" / "pose.json")
    np.testing.assert_allclose(found["cochlea_origin_mm"], wanted.origin, atol=1e-9)
    np.testing.assert_allclose(found["modiolar_axis"], wanted.axis, atol=1e-9)
    assert report.poses[0]["error_mm"] is None


def test_what_must_be_known_of_an_estimate_is_told_with_its_step(tmp_path) -> None:
    wrong = touched(PROBE)
    wrong["CL"], wrong["MN"] = wrong["MN"], wrong["CL"]
    report = run(
        tmp_path,
        {"do": "estimate", "side": "L", "touches": wrong},
        {"do": "touches", "side": "L", "swap": ["CL", "MN"]},
        {"do": "estimate", "side": "L"},
        {"do": "touches", "side": "L", "other_side": True},
        {"do": "estimate", "side": "R"},
    )
    assert report.ok, report.error
    first, right, other = (record.warnings for record in report.steps if record.title.startswith("estimate"))
    assert first == ("robust: CL and MN look exchanged",)
    assert right == ()
    assert other == ("robust: the left side fits these points better than the right: check the side",)


@pytest.mark.parametrize("window", ["touched", "expected"])
def test_the_matrix_for_a_robot_turns_y_to_the_window_that_was_chosen(tmp_path, window) -> None:
    points = touched(PROBE, noise=0.15, seed=4)
    step = {"do": "estimate", "side": "L", "touches": points, "round_window": window, "path": "robot.csv"}
    assert run(tmp_path, step).ok
    matrix = np.loadtxt(tmp_path / "out" / "robot.csv", delimiter=",")
    to_window = np.mean([points["RWA"], points["RWP"]], axis=0) - matrix[:3, 3]
    off = abs(np.degrees(np.arctan2(to_window @ matrix[:3, 2], to_window @ matrix[:3, 1])))
    assert off < 1e-6 if window == "touched" else 1 < off < 10


def test_an_insertion_path_is_carried_to_the_estimate_and_written(tmp_path) -> None:
    drawn = np.array([[-0.5, 2, 0], [0, 1.5, 0.2], [0.4, 1, 0.5], [0.5, 0.9, 0.6]])
    np.savetxt(tmp_path / "drawn.csv", 1000 * drawn, delimiter=",")
    about = {"path": "drawn.csv", "units": "um", "side": "L", "rows": 3}
    report = run(
        tmp_path,
        {"do": "estimate", "side": "L", "touches": touched(PROBE, 0.15), "path": "robot.csv"},
        {"do": "path", **about, "save": "carried.csv"},
    )
    assert report.ok, report.error
    matrix, carried = (np.loadtxt(tmp_path / "out" / f"{n}.csv", delimiter=",") for n in ("robot", "carried"))
    np.testing.assert_allclose(carried, drawn[:3] @ matrix[:3, :3].T + matrix[:3, 3], atol=1e-9)


@pytest.mark.parametrize(
    ("step", "complaint"),
    [
        ({}, "needs path, or save"),
        ({"path": "drawn.csv", "side": "L"}, "needs units and side"),
        ({"path": "drawn.csv", "units": "mm"}, "needs units and side"),
        ({"path": "drawn.csv", "units": "mm", "side": "L", "rows": 9}, "rows of the path must be 2 to 3"),
        (
            {"path": "drawn.csv", "units": "mm", "side": "L", "save": "out.csv"},
            "no estimate yet",
        ),
        ({"save": "out.csv"}, "no insertion path"),
    ],
)
def test_an_insertion_path_that_cannot_be_carried_is_refused(tmp_path, step, complaint) -> None:
    (tmp_path / "drawn.csv").write_text("-0.5,2,0\n0,1.5,0.2\n0.4,1,0.5\n")
    report = run(tmp_path, {"do": "path", **step})
    assert not report.ok
    assert re.search(complaint, report.error)


@pytest.mark.slow
def test_both_methods_side_by_side(tmp_path) -> None:
    from gp_core import write_markups
    from gp_core.atlas.sampling import draw_animal

    rng, animals = np.random.default_rng(5), tmp_path / "animals"
    animals.mkdir()
    for n in range(4):
        animal = draw_animal(ATLAS, rng=rng, name=f"GP-{n}")
        for side in Side:
            write_markups(animals / f"GP-{n}_{side.value}.mrk.json", animal.side(side), specimen=animal.name)
    step = {"do": "estimate", "side": "L", "touches": touched(PROBE), "method": ["jrmpc", "robust"]}
    report = run(tmp_path, {**step, "specimens": "animals"})
    assert report.ok, report.error
    assert content(tmp_path / "out" / "pose.json")["method"] == "jrmpc"
    without = run(tmp_path, step)
    assert "step 2: estimate left" in without.error
