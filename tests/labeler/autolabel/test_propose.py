"""First labels: a head is found however it lies, its landmarks are guessed, and never taken as labels."""

import json
import os
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, shift
from scipy.spatial.transform import Rotation
from small_heads import FEATURES, OWN, TURN, save_markups, save_volume, small_head

from gp_core.errors import GpError
from gp_core.io import load_specimens, read_points
from gp_core.landmarks.features import Side
from gp_core.landmarks.sets import Status
from gp_labeler.autolabel import HeadNotFoundError, LabelledScan, TemplateLibrary, propose
from gp_labeler.autolabel.grey_image import SampleGrid
from gp_labeler.autolabel.labelled_scan import side_and_code
from gp_labeler.autolabel.pose_search import FoundPose, converged, find_pose, pose_from_points, refine_pose
from gp_labeler.autolabel.prediction import Prediction, predict
from gp_labeler.autolabel.registration import engine_named, register_demons, register_greedy
from gp_labeler.autolabel.registration_process import HereRegistration
from gp_labeler.autolabel.settings import Settings
from gp_labeler.autolabel.suggestion_files import write_proposal
from gp_labeler.autolabel.template import Template
from gp_labeler.autolabel.transfer import TargetScan, carry
from gp_labeler.cli.entry import main
from gp_labeler.head_pose.surface_fit import Similarity, angle_deg
from gp_labeler.imaging.progress import Cancelled, Report
from gp_labeler.imaging.volume import Volume


def labelled(seed):
    volume, points = small_head(seed)
    return LabelledScan(f"small-{seed}", points, volume=volume)


@cache
def library():
    return TemplateLibrary([labelled(seed) for seed in range(3)])


@cache
def proposed():
    return propose(small_head(7, turn=TURN)[0], library())


def errors(proposal, truth):
    return np.array([np.linalg.norm(proposal.positions[name] - truth[name]) for name in truth])


def test_a_turned_head_is_labelled_like_the_others():
    off = errors(proposed(), small_head(7, turn=TURN)[1])
    assert np.median(off) < 0.5  # voxels of 1 mm
    assert off.max() < 1.2
    assert proposed().score < 0.5
    assert proposed().scheme == FEATURES
    assert set(proposed().templates) == {"small-0", "small-1", "small-2"}


def test_the_radii_hold_and_the_doubtful_come_first():
    truth = small_head(7, turn=TURN)[1]
    radii = [guess.radius_95 for guess in proposed().guesses]
    uncertain = [guess.uncertainty for guess in proposed().guesses]  # the atlas contradicts such heads too
    assert uncertain == sorted(uncertain, reverse=True)
    assert all(mm >= radius for mm, radius in zip(uncertain, radii, strict=True))
    held = [np.linalg.norm(g.position - truth[g.name]) <= g.radius_95 for g in proposed().guesses]
    assert sum(held) >= 7
    assert max(radii) < 3.0  # and not by being huge


def test_guesses_are_suggestions_by_side(tmp_path):
    sides = proposed().suggestions()
    assert set(sides[Side.LEFT]) == {"IN", "CA", "RWA", "OI"}
    assert set(sides[Side.RIGHT]) == {"ZL", "CA", "RWA", "OI"}
    assert sides[Side.LEFT]["CA"].source == "3 labelled scans"
    files = write_proposal(tmp_path, "small-7", proposed())
    assert [file.name for file in files] == ["small-7_L_suggested.mrk.json", "small-7_R_suggested.mrk.json"]
    (specimen,) = load_specimens(tmp_path)
    for side, wanted in sides.items():
        assert specimen.side(side).placed == ()
        for code, suggestion in wanted.items():
            read = specimen.side(side).suggested[code]
            assert read.position == pytest.approx(suggestion.position)
            assert read.radius_95 == pytest.approx(suggestion.radius_95, abs=1e-3)


def test_a_mirrored_scan_is_labelled_right_once_that_is_said():
    volume, points = small_head(7, turn=TURN)
    mirror = np.diag([-1.0, 1.0, 1.0, 1.0])
    scan = replace(volume, T_scan_voxel=mirror @ volume.T_scan_voxel)
    truth = {name: xyz * (-1, 1, 1) for name, xyz in points.items()}
    alone = TemplateLibrary([labelled(0)])
    told = propose(scan, alone, stored="mirrored")
    assert np.median(errors(told, truth)) < 0.7
    assert not any("mirrored" in warning for warning in told.warnings)
    assert any("mirrored" in warning for warning in proposed().warnings)  # where nothing was said
    assert told.guesses[0].radius_95 is None  # one labelled scan says nothing of errors


def test_points_say_how_a_head_lies():
    volume, truth = small_head(7, turn=TURN)
    alone = TemplateLibrary([labelled(0)])
    three = {name: truth[name] for name in ("CA_L", "OI_L", "ZL_R")}
    assert np.median(errors(propose(volume, alone, placed=three), truth)) < 0.7
    line = {name: truth["IN"] + [0, 0, n] for n, name in enumerate(three)}
    with pytest.raises(GpError, match="not on a line"):
        propose(volume, alone, placed=line)


def test_a_ball_is_no_head():
    far = np.linalg.norm(np.stack(np.meshgrid(*[np.arange(-20, 20)] * 3, indexing="ij")), axis=0)
    ball = Volume.from_parts((1000 * (far < 11)).astype(np.int16), [1.0] * 3)
    found = find_pose(ball, Template.of(labelled(0)).surface)
    assert not found.is_accepted
    assert found.refusal in str(HeadNotFoundError(found))
    assert "Place three landmarks" in str(HeadNotFoundError(found))


def test_a_pose_is_refined_until_it_stays():
    known, (volume, truth) = Template.of(labelled(0)).surface, small_head(7, turn=TURN)
    there = np.array(list(labelled(0).points.values()))
    found = pose_from_points(volume, known, np.array(list(truth.values())), there)
    off = Rotation.from_rotvec(np.radians([0, 18, 0])).as_matrix()
    centre = found.fit.forth(known.centre[None])[0]
    shift = off @ (found.fit.shift - centre) + centre
    begun = replace(found.fit, rotation=off @ found.fit.rotation, shift=shift)
    again = converged(replace(found, fit=begun), known)
    assert angle_deg(again.fit.rotation, found.fit.rotation) < 0.5
    once = refine_pose(found.bone, known, begun)  # which ends before it has arrived
    assert angle_deg(once.fit.rotation, found.fit.rotation) > 1.0
    assert (again.score, again.rival, again.seen) == (found.score, found.rival, found.seen)


class PoseAlone:
    """A registration that leaves everything where the pose puts it."""

    name = "none"

    def register(self, fixed, moving, step, iterations, cancel=None):
        return np.zeros((*fixed.shape, 3), np.float32)


def with_names_moved_on(scan):
    """Return a labelled scan in which each label bears the name of the next one."""
    places = list(scan.points.values())
    return replace(scan, points=dict(zip(scan.points, [*places[1:], places[0]], strict=True)))


def bar():
    """Return a labelled scan of a bar of bone: no head."""
    grey = np.zeros((20, 24, 60), np.float32)
    grey[8:12, 8:15, 8:52] = 1000
    points = {name: np.array([5.0 * n + 8, 8.0 + n % 3, 10.0]) for n, name in enumerate(FEATURES)}
    return LabelledScan("bar", points, volume=Volume.from_parts(grey, [0.9] * 3))


def test_a_labelled_scan_with_wrong_labels_is_posed_by_its_bone_and_one_without_a_head_is_left_out():
    volume, truth = small_head(7, turn=TURN)
    three = {name: truth[name] for name in ("CA_L", "OI_L", "ZL_R")}  # for a quick pose of the first one
    given = [Template.of(scan) for scan in (labelled(0), with_names_moved_on(labelled(1)), bar())]
    found = predict(volume, given, PoseAlone(), Settings(), placed=three)
    assert (set(found.templates), found.left_out) == ({"small-0", "small-1"}, ("bar",))
    right = predict(volume, [Template.of(labelled(1))], PoseAlone(), Settings(), placed=three)
    off = [
        np.linalg.norm(found.carried["small-1"][name] - right.carried["small-1"][its_name])
        for name, its_name in pairwise(FEATURES)
    ]
    assert max(off) < 1.0


class LibraryPredictedExactly(TemplateLibrary):
    """A library in which each head is predicted where its landmarks truly are."""

    def held_out(self, registration, report=None):
        rng = np.random.default_rng(0)
        return {
            scan.name: Prediction(
                {
                    str(k): {name: xyz + rng.normal(0, 0.1, 3) for name, xyz in truth.items()}
                    for k in range(3)
                },
                None,
            )
            for scan, truth in zip(self.scans, [small_head(seed)[1] for seed in range(4)], strict=True)
        }


def test_labels_that_the_other_scans_contradict_are_not_suggested_from():
    scans = [labelled(0), with_names_moved_on(labelled(1)), labelled(2), labelled(3)]
    found = propose(small_head(7, turn=TURN)[0], LibraryPredictedExactly(scans), registration=PoseAlone())
    assert set(found.templates) == {"small-0", "small-2", "small-3"}
    (told,) = [warning for warning in found.warnings if "small-1" in warning]
    assert "contradict" in told
    assert max(guess.history for guess in found.guesses) < 0.3  # its errors say nothing of the others


def test_landmarks_outside_their_scan_are_refused_with_the_specimen():
    scan = labelled(0)
    far = replace(scan, points={name: xyz + 300 for name, xyz in scan.points.items()})
    with pytest.raises(GpError, match=r"small-0: 8 of its 8 landmarks lie outside its scan\."):
        TemplateLibrary([far]).templates()


def test_a_thin_box_has_a_grid_that_can_be_registered():
    low, high = np.array([0.0, 10.0, -3.0]), np.array([30.0, 10.2, -3.0])
    grid = SampleGrid.around(low, high, 1.0)
    assert grid.size == (31, 16, 16)
    assert np.abs((grid.origin + grid.high - low - high) / 2).max() <= 0.5
    pytest.importorskip("picsl_greedy")
    rng = np.random.default_rng(0)
    fixed, moving = rng.normal(size=(2, *grid.size[::-1])).astype(np.float32)
    assert HereRegistration("greedy").register(fixed, moving, 1.0, "2x2x2").shape == (*fixed.shape, 3)


def test_what_the_registration_cannot_do_is_said_in_one_line():
    pytest.importorskip("picsl_greedy")
    tiny = np.zeros((3, 3, 3), np.float32)
    with pytest.raises(GpError, match=r"^the registration failed \(RuntimeError: ") as caught:
        HereRegistration("greedy").register(tiny, tiny, 1.0, "2x2x2")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("score", "rival", "seen", "accepted", "why"),
    [
        (0.40, 0.60, 0.9, True, ""),
        (0.56, 0.62, 0.9, True, ""),
        (0.58, 0.90, 0.9, False, "the bones do not match"),
        (0.40, 0.44, 0.9, False, "a different orientation"),
        (0.40, 0.60, 0.2, False, "only 20 % of a head"),
    ],
)
def test_a_pose_is_accepted_if_it_fits_stands_out_and_shows_enough(score, rival, seen, accepted, why):
    found = FoundPose(None, score, rival, seen, None)
    assert found.is_accepted is accepted
    assert why in found.refusal
    assert found.is_certain is (accepted and score <= 0.5)


def test_a_copy_of_the_scan_does_not_suggest_its_own_labels():
    copy = replace(small_head(0)[0], name="a copy")
    with pytest.raises(GpError, match="only labelled scan"):
        propose(copy, TemplateLibrary([labelled(0)]), with_history=False)


def test_it_stops_when_it_is_asked_to():
    with pytest.raises(Cancelled):
        propose(small_head(7)[0], TemplateLibrary([labelled(0)]), cancel=lambda: True)


def test_what_was_kept_is_made_again_when_a_label_or_a_setting_changes():
    scan = labelled(0)
    moved = replace(scan, points={**scan.points, "CA_L": scan.points["CA_L"] + 0.01})
    keys = {Template.key_of(scan, Settings()), Template.key_of(moved, Settings())}
    assert len(keys | {Template.key_of(scan, Settings(fine=50))}) == 3
    assert Template.key_of(labelled(0), Settings()) in keys
    volume = scan.volume
    other = volume.voxels.read(slice(None), slice(None), slice(None)).copy()
    other[3, 4, 5] += 1
    changed = replace(scan, volume=replace(volume, voxels=other))
    assert Template.key_of(changed, Settings()) not in keys
    assert Template.key_of(replace(scan, name="renamed"), Settings()) in keys


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    """Return a folder of two labelled small heads of a lab's own scheme, and of one that is new."""
    folder = tmp_path_factory.mktemp("lab")
    (folder / "labelled").mkdir()
    (folder / "new").mkdir()
    for seed in range(2):
        volume, points = small_head(seed, names=OWN)
        save_volume(folder / "labelled" / f"small-{seed}.nrrd", volume)
        save_markups(folder / "labelled" / f"small-{seed}.mrk.json", points)
    save_volume(folder / "new" / "small-3.nrrd", small_head(3, turn=TURN)[0])
    return folder


def proposing(lab, *more):
    given = ["propose", lab / "new", "--like", lab / "labelled", "-o", lab / "out"]
    return main([str(word) for word in (*given, "--templates", lab / "kept", *more)])


def test_the_command_suggests_any_scheme_for_a_folder_and_goes_on_where_it_was(lab, capsys):
    assert proposing(lab) == 0
    said = capsys.readouterr()
    assert "small-3.nrrd: 8 suggestions from 2 labelled scans" in said.out
    assert "stored mirrored" in said.err
    truth = small_head(3, turn=TURN, names=OWN)[1]
    read = read_points(lab / "out" / "small-3_suggested.mrk.json")
    assert read.labels == OWN
    assert set(read.statuses) == {Status.SUGGESTED}  # never labels
    assert np.median([np.linalg.norm(p.suggestion.position - truth[p.label]) for p in read.points]) < 0.7
    assert all(p.suggestion.radius_95 > 0 for p in read.points)
    content = json.loads((lab / "out" / "small-3.proposal.json").read_text())
    assert {guess["name"] for guess in content["guesses"]} == set(OWN)

    before = (lab / "out" / "small-3_suggested.mrk.json").stat().st_mtime_ns
    packs = sorted((lab / "kept").glob("templates/*"))
    assert len(packs) == 2
    for scan in (*(lab / "labelled").iterdir(), lab / "new" / "small-3.nrrd"):
        os.utime(scan, (0, 0))  # touched, as copying and unpacking do; the scan is the same
    (lab / "new" / "broken.nrrd").write_text("no scan")
    assert proposing(lab) == 2  # and the other head is not lost
    assert (lab / "out" / "small-3_suggested.mrk.json").stat().st_mtime_ns == before
    assert sorted((lab / "kept").glob("templates/*")) == packs
    said = capsys.readouterr()
    assert "kept from an earlier run" in said.out
    assert said.err.count("broken.nrrd") >= 1


def test_a_library_without_scans_is_refused_in_one_line(lab, tmp_path, capsys):
    save_markups(tmp_path / "alone.mrk.json", small_head(0)[1])
    status = main(["propose", str(lab / "new"), "--like", str(tmp_path), "-o", str(tmp_path / "out")])
    assert status == 2
    said = capsys.readouterr().err
    assert "its scan is not there" in said
    assert len(said.strip().splitlines()) == 1


def test_names_of_features_carry_their_side():
    assert side_and_code("CA_L") == (Side.LEFT, "CA")
    assert side_and_code("IN") == (Side.LEFT, "IN")
    for other in ("CA", "nose", "CO_L"):
        assert side_and_code(other) is None


def test_a_second_pass_adds_what_the_first_one_missed():
    """The first pass stops short; the field of both is the whole shift, not that of the second alone."""
    pytest.importorskip("picsl_greedy")
    texture = gaussian_filter(np.random.default_rng(0).normal(size=(24, 24, 24)), 2).astype(np.float32)
    moved = shift(texture, (0, 0, 1.5), mode="nearest")  # voxels of 0.5 mm
    once, twice = (
        register_greedy(texture, moved, 0.5, iterations)[8:16, 8:16, 8:16].mean(axis=(0, 1, 2))
        for iterations in ("0x4x0", "0x4x0 0x20x15")
    )
    assert once[0] < 0.69
    assert twice == pytest.approx([0.75, 0, 0], abs=0.04)


def test_demons_are_said_to_be_coarser(monkeypatch):
    """In a plain image that is shifted, the field is that shift; without greedy, demons are taken."""
    z, y, x = np.meshgrid(*[np.arange(24.0)] * 3, indexing="ij")
    fixed, moving = (
        np.exp(-((x - 12 - by) ** 2 + (y - 12) ** 2 + (z - 12) ** 2) / 40).astype(np.float32)
        for by in (0, 1.5)
    )
    field = register_demons(fixed, moving, 0.5, "40x30x15")
    assert field[12, 12, 12] == pytest.approx([0.75, 0, 0], abs=0.15)
    monkeypatch.setattr("gp_labeler.autolabel.registration.find_spec", lambda name: None)
    assert engine_named() == "demons"
    with pytest.raises(GpError, match="picsl_greedy is not installed"):
        engine_named("greedy")


class EverythingByThreeMm:
    """A registration that moves all that it is given to the left."""

    name = "greedy"

    def register(self, fixed, moving, step, iterations, cancel=None):
        return np.broadcast_to(np.float32([3.0, 0.0, 0.0]), (*fixed.shape, 3))


def test_what_lies_beyond_a_cut_stays_there_and_is_not_pulled_to_the_edge():
    scan, settings = labelled(0), Settings()
    volume = scan.load()
    half = Volume(np.asarray(volume.array)[:, :, : volume.size[0] // 2], volume.T_scan_voxel)
    target = TargetScan(half, 500.0, 1.0)
    here = Similarity(1.0, np.eye(3), np.zeros(3))
    found = carry(Template.of(scan, settings), target, here, EverythingByThreeMm(), settings, Report())
    moved = {name: np.linalg.norm(found[name] - xyz) for name, xyz in scan.points.items()}
    beyond = {name for name, xyz in scan.points.items() if not half.contains(xyz[None])[0]}
    assert 2 <= len(beyond) <= 6
    assert {name for name, mm in moved.items() if mm < 1e-9} == beyond
