"""Touches in a editing, and the estimate that follows them: real probe files, and drawn animals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from document_cases import Editing

from gp_core import PROBE, Atlas, Side, estimate_pose, read_touches
from gp_core.atlas.sampling import draw_animal
from gp_core.errors import GpError
from gp_core.frames import RigidTransform
from gp_core.io import write_markups
from gp_labeler.document import touching
from gp_labeler.document.edits import PlacePoint
from gp_labeler.document.opening import open_specimen
from gp_labeler.document.state import How, Provenance
from gp_labeler.document.touches import TouchHow

DATA = Path(__file__).resolve().parents[4] / "shared" / "data"
TRUTH = ("CA", "CB", "RWA", "RWP")


@pytest.fixture(scope="module")
def atlas():
    return Atlas.published()


@pytest.fixture
def editing(atlas):
    editing = Editing(author="AB", atlas=atlas)
    yield editing
    editing.document.close(discard=True)


@pytest.fixture
def estimating(editing, atlas):
    return editing.pose


def motion(rng: np.random.Generator) -> RigidTransform:
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn[:, 0] *= np.linalg.det(turn)
    return RigidTransform.from_parts(turn, 80 * rng.normal(size=3), dst="tracker", src="scan")


def label(editing, landmarks, codes):
    for code in codes:
        editing.document.do(PlacePoint(landmarks.side, code, landmarks[code], Provenance(How.MESH)))


def touch(editing, landmarks, T_tracker_scan, codes, noise=0.0, rng=None):
    for code in codes:
        error = 0.0 if rng is None else noise * rng.normal(size=3)
        touching.record_touch(
            editing.document, landmarks.side, code, T_tracker_scan.apply(landmarks[code][None])[0] + error
        )


@pytest.mark.parametrize("side", list(Side))
def test_touches_of_a_labelled_animal_give_its_cochlea_in_the_scan(editing, estimating, atlas, side):
    rng = np.random.default_rng(3)
    animal = draw_animal(atlas, rng=rng).side(side)
    T_tracker_scan = motion(rng)
    estimating.choose(side=side)
    label(editing, animal, (*TRUTH, "CL", "MN", "OS", "LLI"))
    touch(editing, animal, T_tracker_scan, PROBE, 0.05, rng)
    found = estimating.estimate
    placed = found.in_scan()
    assert found.registered.way == "features"
    assert found.registered.fre_mm < 0.15
    assert found.registered.tre_mm(placed.origin) < 0.15
    np.testing.assert_allclose(found.truth.translation, animal["CO"], atol=1e-9)
    error_mm, error_deg = found.errors()
    assert error_mm == pytest.approx(np.linalg.norm(placed.origin - animal["CO"]), abs=1e-9)
    assert error_mm < found.pose.radius_95
    assert error_deg < np.degrees(found.pose.cone_95)
    near = np.linalg.norm(placed.expected["CA"] - animal["CA"])
    assert near < 2.0, "the atlas lies on the animal, on its own side"


@pytest.mark.skipif(not DATA.exists(), reason="the shared data are not here")
@pytest.mark.parametrize("name", ["SkullD_Right", "SkullA_Left_new", "SkullE_Right"])
def test_a_real_probe_file_gives_what_the_library_gives(editing, estimating, atlas, name):
    files = list((DATA / "probe").glob(f"{name}*.dat"))
    if not files:
        pytest.skip(f"no {name}")
    side = Side.LEFT if "Left" in name else Side.RIGHT
    touching.load_touches(editing.document, files[0], side)
    estimating.choose(side=side)
    alone = estimate_pose(read_touches(files[0], side), side, atlas)
    assert estimating.estimate.pose.as_dict() == alone.as_dict()
    assert estimating.estimate.in_scan() is None
    assert editing.document.state.touches[side, "S1"].how is TouchHow.FILE


def test_skull_features_register_the_touches(editing, estimating, atlas, tmp_path):
    rng = np.random.default_rng(5)
    animal, T_tracker_scan = draw_animal(atlas, rng=rng).side("L"), motion(rng)
    touch(editing, animal, T_tracker_scan, PROBE)
    for n in range(1, 6):
        there = rng.uniform(-20, 20, 3)
        touching.mark_skull(editing.document, f"S{n}", there)
        touching.record_touch(editing.document, "L", f"S{n}", T_tracker_scan.apply(there[None])[0])
    registered = estimating.estimate.registered
    assert registered.way == "skull"
    np.testing.assert_allclose(registered.T_scan_touches.matrix, T_tracker_scan.inverse().matrix, atol=1e-9)
    estimating.choose(registration="features")
    assert "registration" in estimating.estimate.problems, "asked for labels that are not there"


def test_a_dry_run_on_the_scan_needs_no_registration(editing, estimating, atlas):
    animal = draw_animal(atlas, rng=np.random.default_rng(1)).side("L")
    for code in PROBE:
        touching.record_touch(editing.document, "L", code, animal[code], TouchHow.SCAN)
    assert estimating.estimate.registered.way == "placed"
    assert estimating.estimate.pose.transform_to_touches.dst == "scan"
    with pytest.raises(GpError, match="cannot mix tracker and scan"):
        touching.record_touch(editing.document, "L", "ZL", (0, 0, 0), TouchHow.TYPED)
    assert len(editing.document.state.touches) == len(PROBE), "nothing is lost"


def test_a_left_out_touch_changes_the_estimate_as_promised(editing, estimating, atlas):
    animal = draw_animal(atlas, rng=np.random.default_rng(2)).side("L")
    touch(editing, animal, motion(np.random.default_rng(4)), PROBE)
    touching.record_touch(
        editing.document, "L", "MN", editing.document.state.touches["L", "MN"].position + np.array([3, 0, 0])
    )
    before = estimating.estimate.pose
    promised = estimating.without("MN")
    touching.leave_out(editing.document, "L", "MN")
    after = estimating.estimate.pose
    assert np.linalg.norm(after.origin - before.origin) == pytest.approx(promised[0])
    assert "MN" not in after.residuals
    assert estimating.without("MN") == pytest.approx(promised), "and the way back"
    editing.document.undo()
    np.testing.assert_array_equal(estimating.estimate.pose.transform, before.transform)


def test_the_estimate_tells_when_it_changes_and_is_remembered_between(editing, estimating, atlas):
    told = []
    estimating.changed.connect(lambda: told.append(1))
    animal = draw_animal(atlas, rng=np.random.default_rng(2)).side("L")
    touch(editing, animal, motion(np.random.default_rng(4)), PROBE[:2])
    assert estimating.estimate is None
    assert estimating.waiting_text == "1 more touch for an estimate"
    touch(editing, animal, motion(np.random.default_rng(4)), PROBE[2:3])
    assert len(told) == 3
    assert estimating.estimate is estimating.estimate
    estimating.choose(probe_noise=0.3)
    assert len(told) == 4
    assert estimating.estimate.pose.probe_noise == 0.3
    with pytest.raises(GpError, match="probe noise"):
        estimating.choose(probe_noise=-1.0)


def test_both_methods_once_jrmpc_is_ready(editing, estimating, atlas):
    rng = np.random.default_rng(0)
    animals = [draw_animal(atlas, rng=rng, name=f"S{n}") for n in range(4)]
    editing.atlas.use(atlas, animals)
    touch(editing, draw_animal(atlas, rng=rng).side("L"), motion(rng), PROBE)
    estimating.choose(methods=("robust", "jrmpc"))
    assert set(estimating.estimate.poses) == {"robust"}
    estimating.set_joint_ready()
    assert set(estimating.estimate.poses) == {"robust", "jrmpc"}
    touching.clear_touches(editing.document, "L", "RWP")
    assert "starts at the round window and needs RWP" in estimating.estimate.problems["jrmpc"]
    editing.atlas.use(atlas)
    assert "labelled" in estimating.estimate.problems["jrmpc"]
    assert "--" not in estimating.estimate.problems["jrmpc"], "no options of a command in the window"


def test_a_verdict_is_kept_with_what_was_judged(tmp_path, editing, estimating, atlas):
    with pytest.raises(GpError, match="no estimate to judge"):
        estimating.record_verdict("accept")
    animal = draw_animal(atlas, rng=np.random.default_rng(2)).side("L")
    label(editing, animal, (*TRUTH, "CL", "MN"))
    touch(editing, animal, motion(np.random.default_rng(4)), PROBE)
    estimating.record_verdict("reject", by="CD", note="too deep")
    file = editing.document.save(tmp_path / "GP-1.gpspecimen.json")
    reopened = Editing(open_specimen(file)).document
    (check,) = reopened.state.pose_checks
    assert (check.verdict, check.by, check.note, check.side) == ("reject", "CD", "too deep", Side.LEFT)
    assert check.pose["error_mm"] == pytest.approx(estimating.estimate.errors()[0])
    assert reopened.state.touches == editing.document.state.touches
    reopened.close()


def test_a_file_of_skull_features_is_taken_and_one_without_is_refused(editing, atlas, tmp_path):
    names = tmp_path / "skull.csv"
    names.write_text("name,x,y,z\nS1,1,2,3\nS2,4,5,6\nCA,7,8,9\n")
    assert touching.load_skull(editing.document, names) == ("S1", "S2")
    assert editing.document.state.skull == {"S1": (1.0, 2.0, 3.0), "S2": (4.0, 5.0, 6.0)}
    file = tmp_path / "GP_L.mrk.json"
    write_markups(file, draw_animal(atlas, rng=np.random.default_rng(0)).side("L"), specimen="GP")
    with pytest.raises(GpError, match="names no skull feature"):
        touching.load_skull(editing.document, file)


def test_only_a_touched_or_an_expected_window_can_be_chosen(estimating):
    estimating.choose(round_window="expected")
    with pytest.raises(GpError, match="round window must be one of touched, expected"):
        estimating.choose(round_window="seen")
    assert estimating.settings.round_window == "expected"


def test_what_lies_inside_the_bone_cannot_be_touched(editing):
    with pytest.raises(GpError, match="CA is inside the bone"):
        touching.record_touch(editing.document, "L", "CA", (0, 0, 0))
