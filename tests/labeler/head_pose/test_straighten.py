"""A head is straightened by its bone or by points, and what cannot be trusted is refused."""

import json
from dataclasses import replace
from functools import cache
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from gp_core.errors import GpError
from gp_core.frames import RigidTransform
from gp_core.io.markups import write_markups
from gp_core.landmarks.features import Side
from gp_core.landmarks.sets import LandmarkSet
from gp_labeler.cli.entry import main
from gp_labeler.head_pose import (
    Confidence,
    HeadPoseError,
    HeadTemplate,
    MidPlane,
    SeveralHeadsError,
    straighten,
    straighten_by_landmarks,
    straighten_by_points,
)
from gp_labeler.head_pose.bone import Bone, bone_of, coarse_scan, indices_of, threshold_above
from gp_labeler.head_pose.distance_field import DistanceField
from gp_labeler.head_pose.grey_refinement import GreyValues, refined_by_grey_values, uncertainty_deg
from gp_labeler.head_pose.holder import sameness_along_axis, without_holders
from gp_labeler.head_pose.mirror_search import search_planes
from gp_labeler.head_pose.result import DOUBTFUL_DEG
from gp_labeler.head_pose.template import front_and_up
from gp_labeler.imaging.progress import Cancelled, Report
from gp_labeler.imaging.readers import read_volume
from gp_labeler.imaging.volume import Volume
from gp_labeler.phantom import USUAL, HeadVariation, make_phantom, save_phantom

MICE = Path(__file__).resolve().parents[4] / "shared" / "data" / "mouse_ct"
TURN = (40.0, -100.0, 60.0)


@cache
def head(seed=21, names=(), turn=TURN, **given):
    variation = HeadVariation.drawn(seed, names).having({"turn": turn, **given})
    return make_phantom(seed, spacing=0.5, variation=variation)


def true_plane(phantom):
    T = phantom.T_head_scan
    return MidPlane(T.rotation[0], -T.translation[0])


def errors(pose, phantom):
    """Return by how many degrees and mm the mid-plane is off, and by how many degrees the whole head."""
    truth = true_plane(phantom)
    middle = phantom.volume.extent.mean(axis=0)[None]
    turn = pose.T_head_scan.rotation.T @ phantom.T_head_scan.rotation
    whole = np.degrees(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1)))
    off = abs(pose.mid_plane.heights(middle)[0] - truth.heights(middle)[0])
    return pose.mid_plane.angle_to_deg(truth), float(off), float(whole)


@cache
def found():
    return straighten(head(names=USUAL).volume)


def test_a_head_is_straightened_by_the_symmetry_of_its_bone():
    deg, mm, whole = errors(found(), head(names=USUAL))
    assert deg < 0.4
    assert mm < 0.15
    assert whole < 3.0  # with the pitch: the template is of the same species
    assert found().confidence.agreement > 0.65
    assert found().confidence.overlap > 0.95
    assert found().warnings == ()
    assert "file's orientation" in found().left
    assert "proposed" in found().pitch


def test_flesh_that_is_as_symmetric_is_not_taken_for_bone():
    phantom = head(404, (*USUAL, "clip"), (-70.0, 20.0, 110.0))
    coarse = coarse_scan(phantom.volume, 1.0)
    flesh, bone = (Bone.islands(coarse, level)[0] for level in (6_000, 14_000))
    assert flesh.thickness > 2 * bone.thickness
    pose = straighten(phantom.volume)
    assert errors(pose, phantom)[2] < 3.0
    assert pose.warnings == ()


def with_noise(volume, share, seed=0):
    """Return a scan with noise as strong as a share of how much brighter bone is than flesh."""
    noise = np.random.default_rng(seed).normal(0, share * 18_000, volume.array.shape)
    return Volume((volume.array + noise).astype(np.float32), volume.T_scan_voxel)


def test_a_head_amid_strong_rings_is_straightened():
    phantom = head(21, USUAL, rings=3000.0, bone_density=0.6)
    deg, mm, _ = errors(straighten(phantom.volume), phantom)
    assert deg < 0.8
    assert mm < 0.15


def test_half_a_head_in_strong_noise_is_refused():
    phantom = head(24, turn=(0.0, 0.0, 0.0), crop=(0.65, "L"))
    with pytest.raises(HeadPoseError, match="could not be straightened"):
        straighten(with_noise(phantom.volume, 1 / 3))


def test_the_head_frame_is_left_posterior_superior():
    pose, specimen = found(), head(names=USUAL).specimen
    left, right = (pose.T_head_scan.apply(specimen.side(s).array(["ZL", "OI", "IN"])) for s in Side)
    assert (left[:2, 0] > 4).all()
    assert (right[:2, 0] < -4).all()
    assert left[2, 1] < left[1, 1] - 30  # the nose in front
    assert np.linalg.det(pose.T_head_scan.rotation) == pytest.approx(1.0)
    assert abs(left[2, 0]) < 1.0


def test_a_silent_mirror_is_the_head_that_the_scan_shows():
    phantom = head(mirrored="silent")
    deg, _, whole = errors(straighten(phantom.volume), phantom)
    assert deg < 0.4
    assert whole < 3.0


def test_the_order_of_the_axes_of_the_grid_does_not_matter():
    volume = head(names=USUAL).volume
    swapped = np.ascontiguousarray(volume.array.transpose(1, 2, 0)[::-1])
    T = volume.T_scan_voxel[:, [2, 0, 1, 3]].copy()  # new i, j, k are old k, i, j
    T[:3, 3] += (swapped.shape[0] - 1) * T[:3, 2]
    T[:3, 2] *= -1
    other = Volume(swapped, T)
    corner = volume.voxel_to_scan([[3, 5, 7]])
    assert other.value_at(corner[0]) == volume.value_at(corner[0])
    pose = straighten(other)
    assert pose.mid_plane.angle_to_deg(found().mid_plane) < 0.2
    np.testing.assert_allclose(pose.T_head_scan.rotation, found().T_head_scan.rotation, atol=0.02)


def test_a_cropped_head_in_a_scanners_circle_is_straightened():
    phantom = head(22, turn=(10.0, 5.0, 0.0), crop=(0.25, "P"), circle=1.0)
    deg, mm, _ = errors(straighten(phantom.volume), phantom)
    assert deg < 1.5
    assert mm < 0.3


def in_large_voxels(volume):
    """Return a scan in voxels of twice the edge."""
    nz, ny, nx = (n // 2 for n in volume.array.shape)
    blocks = volume.array[: 2 * nz, : 2 * ny, : 2 * nx].reshape(nz, 2, ny, 2, nx, 2)
    T = volume.T_scan_voxel.copy()
    T[:3, 3] += T[:3, :3] @ (0.5, 0.5, 0.5)
    T[:3, :3] *= 2
    return Volume(blocks.mean(axis=(1, 3, 5)).astype(np.float32), T)


def test_a_head_in_a_cradle_in_coarse_voxels_is_never_accepted_in_silence_though_wrong():
    turn = HeadVariation.drawn(418, ["turn"]).turn
    phantom = head(418, USUAL, turn, holder="cradle")
    try:
        pose = straighten(in_large_voxels(phantom.volume))
    except HeadPoseError:
        return
    assert errors(pose, phantom)[0] < 2.0 or any("is uncertain by" in text for text in pose.warnings)


def bent(degrees):
    """Return bone whose back is symmetric in the plane x = 0, and whose front in one turned by an angle."""
    rng = np.random.default_rng(8)
    lumps = rng.uniform((4, -36, -12), (18, 36, 12), (60, 3))
    radii = rng.uniform(2.0, 4.5, 60)
    angle = np.radians(degrees) * (lumps[:, 1] < 0)
    places = np.array(np.meshgrid(*[np.arange(-n, n + 1.0) for n in (26, 44, 18)], indexing="ij"))
    away = np.full(places.shape[1:], np.inf)
    for side in (-1, 1):
        x, y, z = (lumps * (side, 1, 1)).T
        turned = np.stack([x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle), z])
        for centre, radius in zip(turned.T, radii, strict=True):
            gap = np.sqrt(((places - centre[:, None, None, None]) ** 2).sum(axis=0)) - radius
            away = np.minimum(away, gap)
    values = (1000 * np.clip(0.5 - away, 0, 1)).transpose(2, 1, 0).astype(np.float32)
    T = np.eye(4)
    T[:3, 3] = (-26, -44, -18)
    scan = coarse_scan(Volume(np.ascontiguousarray(values), T), 1.0)
    return GreyValues(Bone.islands(scan, 500.0)[0])


@pytest.mark.parametrize(("degrees", "low", "high"), [(0.0, 0.0, 0.3), (6.0, 1.5, 6.0)])
def test_a_plane_is_as_uncertain_as_the_halves_of_a_head_differ(degrees, low, high):
    values = bent(degrees)
    plane = refined_by_grey_values(values, MidPlane([1.0, 0.0, 0.0], 0.0))
    assert low <= uncertainty_deg(values, plane) <= high


@pytest.mark.parametrize(("uncertain", "n"), [(0.0, 0), (DOUBTFUL_DEG, 0), (2.2, 1)])
def test_an_uncertain_plane_is_warned_of(uncertain, n):
    warnings = Confidence(0.9, 1.0, 0.3, uncertain).warnings
    assert len(warnings) == n
    assert all("uncertain by 2 degrees" in text for text in warnings)


@pytest.mark.parametrize("holder", ["tube", "rod"])
def test_a_holder_as_bright_as_bone_never_gives_a_wrong_plane(holder):
    phantom = head(23, holder=holder)
    try:
        pose = straighten(phantom.volume)
    except HeadPoseError:
        return
    assert errors(pose, phantom)[0] < 3.0


def test_a_cradle_that_lies_askew_does_not_pull_at_the_plane():
    """Nearly half of the surface is the cradle's, which is symmetric about another plane."""
    turn = HeadVariation.drawn(474, ["turn"]).turn
    phantom = head(474, USUAL, turn, holder="cradle")
    for volume in (phantom.volume, of_thicker_slices(phantom.volume, 4)):
        assert errors(straighten(volume), phantom)[0] < 0.4


def of_thicker_slices(volume: Volume, n: int) -> Volume:
    """Return means of n slices each."""
    n_slices = volume.size[2] // n
    means = volume.array[: n * n_slices].reshape(n_slices, n, *volume.array.shape[1:]).mean(axis=1)
    T = volume.T_scan_voxel.copy()
    T[:3, 3] += T[:3, 2] * (n - 1) / 2
    T[:3, 2] *= n
    return Volume(means.astype(np.float32), T)


@pytest.mark.parametrize("end", [22.0, np.inf], ids=["whole", "cut by the scan"])
@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (25.0, -40.0, 70.0)])
def test_what_is_extruded_is_the_same_along_its_axis_and_a_head_is_not(turn, end):
    axes = [np.linspace(-1, 1, n) * 0.5 * (n - 1) for n in (60, 60, 60)]
    places = (
        np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        @ Rotation.from_rotvec(turn, degrees=True).as_matrix()
    )
    across = np.linalg.norm(places[..., :2] - (0.0, 4.0), axis=-1)
    half_tube = (across > 14) & (across < 17) & (places[..., 1] < 4) & (np.abs(places[..., 2]) < end)
    scan = coarse_scan(Volume(half_tube.astype(np.float32), np.eye(4)), 1.0)
    assert sameness_along_axis(scan, half_tube) > 0.9
    bone = bone_of(head(names=USUAL).volume)[1]
    assert sameness_along_axis(bone.scan, bone.mask) < 0.5


@pytest.mark.parametrize("kind", ["nothing", "specks", "a sheet", "a line"])
def test_what_is_too_small_or_too_thin_to_be_a_holder_stays(kind):
    grid = np.zeros((40, 40, 40), np.float32)
    if kind == "specks":
        grid[np.random.default_rng(0).random(grid.shape) < 0.003] = 1000
    elif kind != "nothing":
        grid[(5,) if kind == "a sheet" else (5, 5)] = 1000
        grid[15:20, 15:20, 15:20] = 1000
    scan = coarse_scan(Volume(grid, np.eye(4)), 1.0)
    assert without_holders(scan, (500.0,)) is scan


@pytest.mark.parametrize("front_is_clear", [True, False])
def test_an_uncertain_plane_needs_a_clear_front(front_is_clear, monkeypatch):
    """A box around one ear of a mouse was accepted 16 degrees off, with two warnings."""
    module = import_module("gp_labeler.head_pose.straighten")
    monkeypatch.setattr(module, "uncertainty_deg", lambda *given: 2.0)
    if not front_is_clear:
        monkeypatch.setattr(module, "front_and_up", lambda *given: replace(front_and_up(*given), margin=0.0))
    volume = head(24, turn=(0.0, 0.0, 0.0)).volume
    if front_is_clear:
        assert any("uncertain" in warning for warning in straighten(volume).warnings)
    else:
        with pytest.raises(HeadPoseError, match=r"its parts do not agree on one plane.*IN and a pair"):
            straighten(volume)


def test_half_a_head_is_refused_and_points_are_asked_for():
    phantom = head(24, turn=(0.0, 0.0, 0.0), crop=(0.65, "L"))
    with pytest.raises(HeadPoseError, match=r"could not be straightened by its symmetry.*IN and a pair"):
        straighten(phantom.volume)


def test_each_part_of_the_bone_is_searched_once(monkeypatch):
    half = head(24, turn=(0.0, 0.0, 0.0), crop=(0.65, "L")).volume
    module, searched = import_module("gp_labeler.head_pose.straighten"), []

    def search(bone, report):
        searched.append(bone)
        return search_planes(bone, report)

    monkeypatch.setattr(module, "search_planes", search)
    with pytest.raises(HeadPoseError):
        straighten(Volume(np.concatenate([half.array] * 2, axis=2), half.T_scan_voxel))
    assert len(searched) == len(set(searched)) > 2


def test_a_box_leaves_out_what_is_not_the_head():
    phantom = head(23, turn=(0.0, 0.0, 0.0), holder="tube")
    low, high = (phantom.T_head_scan.inverse().apply([p])[0] for p in ((-19, -54, -20), (19, 14, 16)))
    pose = straighten(phantom.volume, box=[low, high])
    assert errors(pose, phantom)[0] < 0.6
    with pytest.raises(GpError, match="box contains no part of the scan"):
        straighten(phantom.volume, box=[[900, 900, 900], [950, 950, 950]])


def two_heads():
    """Return a scan of a head with a second one like it beside it, and how far away that is."""
    volume = head(names=USUAL).volume
    away = volume.T_scan_voxel[:3, 0] * volume.array.shape[2]
    return Volume(np.concatenate([volume.array] * 2, axis=2), volume.T_scan_voxel), away


def test_of_two_heads_none_is_chosen_until_somebody_says_which_one_is_meant():
    scan, away = two_heads()
    with pytest.raises(SeveralHeadsError, match=r"contains 2 heads, at .*point in it, or a box") as refused:
        straighten(scan)
    first, second = sorted(refused.value.centres, key=lambda centre: float(centre @ away))
    np.testing.assert_allclose(second - first, away, atol=0.5)
    pose, truth = straighten(scan, near=second + 3.0), true_plane(head(names=USUAL))
    assert pose.mid_plane.angle_to_deg(truth) < 0.5
    height = np.sign(pose.mid_plane.normal @ truth.normal) * pose.mid_plane.heights(second[None])[0]
    assert height == pytest.approx(truth.heights((second - away)[None])[0], abs=0.15)
    np.testing.assert_allclose(pose.T_head_scan.rotation, found().T_head_scan.rotation, atol=0.05)


def joined_heads():
    """Return a scan of two heads that a bar as bright as bone joins, and of one with that bar."""
    scan, _ = two_heads()
    values = scan.array.copy()
    nz, ny, nx = (n // 2 for n in values.shape)
    values[nz - 4 : nz + 4, ny - 4 : ny + 4, nx // 2 : 3 * nx // 2] = 30_000
    return Volume(values, scan.T_scan_voxel), Volume(values[:, :, :nx], scan.T_scan_voxel)


def test_two_heads_that_a_bar_joins_are_not_taken_for_a_cropped_one():
    both, one = joined_heads()
    with pytest.raises(HeadPoseError, match=r"may be more than one head.*IN and a pair"):
        straighten(both)
    pose = straighten(one)
    assert pose.mid_plane.angle_to_deg(true_plane(head(names=USUAL))) < 0.6


def test_a_head_of_which_the_edge_of_the_scan_cuts_off_one_side_is_one_head():
    turn = (10.0, 25.0, 0.0)
    whole, cut = head(22, USUAL, turn=turn), head(22, USUAL, turn=turn, crop=(0.2, "L"))
    assert Bone.islands(coarse_scan(whole.volume, 1.0), 14_000)[0].share_at_edge == 0
    assert Bone.islands(coarse_scan(cut.volume, 1.0), 14_000)[0].share_at_edge > 0.03
    pose = straighten(cut.volume)
    assert pose.confidence.overlap < 0.7
    assert errors(pose, cut)[0] < 2.5


def test_a_large_thing_beside_the_head_is_spoken_of():
    volume = head(names=USUAL).volume
    middle = np.array(volume.array.shape) / 2 + (0.3, 0.7, 0.45)  # no plane of the voxels is one of the ball
    z, y, x = np.indices(volume.array.shape) - middle[:, None, None, None]
    ball = np.where(abs(np.sqrt(x**2 + y**2 + z**2) - 24) < 3, 30_000, 2_500).astype(np.uint16)
    pose = straighten(Volume(np.concatenate([volume.array, ball], axis=2), volume.T_scan_voxel))
    assert pose.mid_plane.angle_to_deg(true_plane(head(names=USUAL))) < 0.6
    assert any("beside the head" in warning for warning in pose.warnings)


def test_a_template_that_cannot_tell_front_from_back_is_not_believed():
    around = np.random.default_rng(5).normal(size=(3000, 3))
    ball = HeadTemplate(18 * around / np.linalg.norm(around, axis=1, keepdims=True), 18.0, "a ball")
    said = ""
    try:
        said = " ".join(straighten(head(names=USUAL).volume, template=ball).warnings)
    except HeadPoseError as refused:
        said = str(refused)
    assert "front and up" in said


def test_a_point_in_the_only_head_changes_nothing():
    near = straighten(head(names=USUAL).volume, near=[5.0, 5.0, 5.0])
    np.testing.assert_allclose(near.T_head_scan.matrix, found().T_head_scan.matrix)


def test_the_field_of_distances_says_how_far_bone_is():
    bone = bone_of(head(names=USUAL).volume)[0]
    field, clip = DistanceField.of(bone), bone.radius / 6
    rng = np.random.default_rng(3)
    points = bone.centre + rng.uniform(-1, 1, (400, 3)) * bone.radius
    true = np.minimum(cKDTree(bone.scan.places(indices_of(bone.surface))).query(points)[0] - clip, 0)
    inside = bone.inside(points)
    cell = 1 / np.linalg.norm(field.T_index_scan[:3, :3], axis=1).min()
    told = np.array([field.means(field.indices(p[None])[None])[0] for p in points])
    assert abs(told - true)[inside].max() < 1.8 * cell
    assert abs((told - true)[inside].mean()) < 0.5 * cell


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (np.full((20, 20, 20), 7, np.uint8), "no contrast"),
        (np.random.default_rng(0).normal(100, 10, (40, 40, 40)).astype(np.float32), "bone|straightened"),
    ],
)
def test_a_scan_without_a_head_is_refused(values, said):
    with pytest.raises(GpError, match=said):
        straighten(Volume(values, np.diag([0.5, 0.5, 0.5, 1.0])))


def test_a_sphere_is_symmetric_in_every_plane_and_refused():
    z, y, x = np.indices((50, 50, 50)) - 25.0
    ball = np.where(abs(np.sqrt(x**2 + y**2 + z**2) - 18) < 2, 30_000, 9_000)
    noisy = ball + np.random.default_rng(0).normal(0, 300, ball.shape)
    with pytest.raises(HeadPoseError, match="nearly as symmetric in another plane"):
        straighten(Volume(noisy.astype(np.float32), np.diag([0.5, 0.5, 0.5, 1.0])))


def test_a_threshold_between_fat_and_muscle_is_followed_by_one_between_muscle_and_bone():
    rng = np.random.default_rng(0)
    parts = [(200, 50_000), (5_000, 30_000), (9_000, 30_000), (18_000, 4_000)]
    values = np.concatenate([rng.normal(mean, 300, n) for mean, n in parts])
    scan = coarse_scan(Volume(values.reshape(40, 50, 57).astype(np.float32), np.eye(4)), 1.0)
    assert 9_900 < threshold_above(scan, 7_000) < 17_100
    assert threshold_above(scan, 15_000) is None  # all of it is bone


def test_it_stops_when_asked_and_tells_how_far_it_is():
    told = []
    with pytest.raises(Cancelled):
        straighten(head(names=USUAL).volume, progress=told.append, cancel=lambda: len(told) > 5)
    assert told == sorted(told)


def some(phantom, codes, noise=0.3, sides="LR", seed=0):
    rng = np.random.default_rng(seed)
    return {
        Side(s): LandmarkSet.from_mapping(
            {c: phantom.specimen.side(s)[c] + rng.normal(0, noise, 3) for c in codes}, s
        )
        for s in sides
    }


def test_in_and_a_pair_give_the_pose_and_the_bone_refines_it():
    phantom = head(names=USUAL)
    clicked = some(phantom, ["IN", "OI"])
    rough = straighten_by_landmarks(phantom.volume, clicked, refine=False)
    fine = straighten_by_landmarks(phantom.volume, clicked)
    assert errors(rough, phantom)[2] < 6.0
    assert errors(fine, phantom)[0] < 0.5
    assert errors(fine, phantom)[1] < 0.15
    assert fine.found_by == "landmarks"
    assert fine.warnings == ()
    assert rough.confidence is None


def test_exchanged_sides_are_noticed():
    phantom = head(names=USUAL)
    clicked = some(phantom, ["IN", "OI"])
    exchanged = {
        side: LandmarkSet(clicked[Side.RIGHT if side is Side.LEFT else Side.LEFT].points, side)
        for side in Side
    }
    assert "left and right are exchanged" in straighten_by_landmarks(phantom.volume, exchanged).warnings[0]


@pytest.mark.parametrize(("codes", "sides"), [(["OI", "MN", "OS", "IN"], "L"), (["OI"], "LR"), ([], "LR")])
def test_too_few_landmarks_are_refused(codes, sides):
    phantom = head(names=USUAL)
    with pytest.raises(HeadPoseError, match="IN, and one feature such as OI or MN on both sides"):
        straighten_by_landmarks(phantom.volume, some(phantom, codes, sides=sides))


def test_landmarks_and_the_bone_straighten_a_front_half():
    phantom = head(24, turn=(0.0, 0.0, 0.0), crop=(0.3, "P"))
    left, right = (phantom.specimen.side(side) for side in Side)
    pair = [c for c in ("ZL", "IN") if c in left and c in right]
    assert pair == ["ZL", "IN"]
    pose = straighten_by_landmarks(phantom.volume, some(phantom, pair, noise=0.1))
    assert errors(pose, phantom)[0] < 2.5


def test_three_free_points_are_enough():
    phantom = head(names=USUAL)
    left, right = (phantom.specimen.side(side) for side in Side)
    shift = np.array([0.4, -0.3, 0.5])
    pose = straighten_by_points(
        phantom.volume, midline=left["IN"] - shift, left=left["MN"] + shift, right=right["MN"] - shift
    )
    deg, mm, whole = errors(pose, phantom)
    assert (deg < 0.5, mm < 0.15, whole < 3.0) == (True, True, True)
    other = straighten_by_points(phantom.volume, midline=left["IN"], left=right["MN"], right=left["MN"])
    assert "on the right according" in other.warnings[-1]
    with pytest.raises(HeadPoseError, match="too close"):
        straighten_by_points(phantom.volume, midline=left["IN"], left=left["MN"], right=left["MN"])


def test_a_labelled_head_serves_as_a_template():
    known, other = head(names=USUAL), head(25, turn=(0.0, 90.0, 0.0))
    template = HeadTemplate.of(known.volume, known.T_head_scan)
    pose = straighten(other.volume, template=template)
    assert errors(pose, other)[2] < 4.0
    assert known.volume.name in pose.pitch


@pytest.mark.skipif(not MICE.is_dir(), reason="the shared mice are not here")
def test_the_pitch_of_a_cropped_head_is_that_of_the_whole_one():
    whole = read_volume(MICE / "AKR_J_.nii.gz")
    rows = json.loads((MICE / "AKR_J_.mrk.json").read_text())["markups"][0]["controlPoints"]
    points = {row["label"]: np.array(row["position"]) for row in rows}
    a, b = (
        np.array([points[label] for label in labels]) for labels in (("2", "24", "40"), ("3", "27", "41"))
    )
    plane = MidPlane.through((a + b).mean(axis=0) / 2, (a - b).sum(axis=0))
    left, back = plane.normal, np.linalg.svd(plane.normal[None])[2][1]
    axes = np.stack([left, back, np.cross(left, back)], axis=1)
    T_scan_head = RigidTransform.from_parts(axes, plane.nearest(np.zeros(3)), dst="scan", src="head")
    template = HeadTemplate.of(whole, T_scan_head.inverse())
    cropped = bone_of(Volume(whole.array[:96], whole.T_scan_voxel))[1]
    assert cropped.radius < 0.9 * template.radius  # the radius tells nothing of how large the head is
    turn = axes.T @ front_and_up(cropped, plane, template, Report()).axes
    assert np.degrees(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1))) < 1.0


def test_a_mirrored_point_lies_as_far_behind_the_plane():
    plane = MidPlane([0.0, 3.0, 4.0], 10.0)
    points = np.random.default_rng(1).normal(0, 10, (20, 3))
    image = plane.mirrored(points)
    np.testing.assert_allclose(plane.heights(image), -plane.heights(points))
    np.testing.assert_allclose(plane.mirrored(image), points)
    np.testing.assert_allclose(plane.heights(np.array([plane.nearest(points[0])])), 0, atol=1e-12)
    assert np.linalg.norm(plane.normal) == pytest.approx(1.0)
    assert plane.angle_to_deg(MidPlane([0.0, -3.0, -4.0], 0.0)) == pytest.approx(0.0, abs=1e-5)


def test_cubes_of_a_long_voxel_are_means_at_the_right_place():
    values = np.arange(4 * 6 * 9, dtype=np.float32).reshape(4, 6, 9)
    volume = Volume.from_parts(values, [0.1, 0.2, 0.4], [5.0, 6.0, 7.0])
    scan = coarse_scan(volume, 0.4)
    assert scan.grid.shape == (4, 3, 2)
    np.testing.assert_allclose(scan.grid[1, 2, 1], values[1, 4:6, 4:8].mean())
    at = scan.places(np.zeros((1, 3)))[0]
    np.testing.assert_allclose(at, volume.voxel_to_scan([[1.5, 0.5, 0.0]])[0])
    np.testing.assert_allclose(scan.sampled(scan.grid, at[None]), scan.grid[0, 0, 0])


def test_what_has_little_noise_is_not_smoothed_and_rings_are_taken_out_of_the_rest():
    z, y, x = np.indices((40, 60, 60)) - 29.5
    ball = np.where(z**2 + y**2 + x**2 < 15**2, 1_000, 0).astype(np.float32)
    rng = np.random.default_rng(0)
    noisy = ball + rng.normal(0, 10, ball.shape).astype(np.float32)
    for scan in (noisy, ball):  # of a ball without noise, only its edge differs from what is around it
        np.testing.assert_array_equal(coarse_scan(Volume(scan, np.eye(4)), 1.0).grid, scan)
    rings = rng.normal(0, 200, 60)[np.hypot(y, x)[0].astype(int)].astype(np.float32)
    ringed = coarse_scan(Volume(ball + rings, np.eye(4)), 1.0).grid
    without = abs(np.hypot(np.hypot(z, y), x) - 15) > 4  # the edge is smoothed
    assert abs(ringed - ball)[without].std() < 0.3 * rings.std()


@pytest.mark.skipif(not MICE.is_dir(), reason="the shared mice are not here")
def test_a_real_mouse_is_straightened():
    rows = json.loads((MICE / "A_J_.mrk.json").read_text())["markups"][0]["controlPoints"]
    points = {row["label"]: np.array(row["position"]) for row in rows}
    pose = straighten(read_volume(MICE / "A_J_.nii.gz"))
    pairs = [
        pair.split("-")
        for pair in ["2-3", "4-5", "10-11", "17-15", "20-18", "24-27", "36-37", "40-41", "46-47"]
    ]
    across = np.array([points[a] - points[b] for a, b in pairs])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    assert np.median(np.abs(across @ pose.mid_plane.normal)) > np.cos(np.radians(3.0))
    middles = np.array([(points[a] + points[b]) / 2 for a, b in pairs])
    assert np.abs(pose.mid_plane.heights(middles)).max() < 0.3


def test_the_command_says_the_pose_and_writes_it(tmp_path, capsys):
    phantom = head(names=USUAL)
    scan, truth = save_phantom(phantom, tmp_path / "head.nrrd")
    assert main(["straighten", str(scan), "--json", str(tmp_path / "pose.json")]) == 0
    said = capsys.readouterr().out
    assert "mid-sagittal plane" in said
    assert "file's orientation" in said
    pose = json.loads((tmp_path / "pose.json").read_text())
    known = np.array(json.loads(truth.read_text())["T_head_scan"])
    assert np.abs(np.array(pose["T_head_scan"])[0, :3] @ known[0, :3]) > np.cos(np.radians(0.4))
    assert pose["foundBy"] == "symmetry"
    assert set(pose["confidence"]) == {"agreement", "overlap", "margin", "uncertaintyDegrees"}


def test_the_command_takes_landmarks(tmp_path, capsys):
    phantom = head(names=USUAL)
    scan, _ = save_phantom(phantom, tmp_path / "head.nrrd")
    files = []
    for side, landmarks in some(phantom, ["IN", "OI"]).items():
        files.append(str(tmp_path / f"GP_{side.value}.mrk.json"))
        write_markups(files[-1], landmarks, specimen="GP")
    assert main(["straighten", str(scan), "--landmarks", *files]) == 0
    assert "pitch: from OI, IN" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--left", "1", "2", "3"], "belong together"),
        (["--threshold", "nan"], "--threshold must be a number"),
        (
            [
                "--landmarks",
                "a",
                "--midline",
                "0",
                "0",
                "0",
                "--left",
                "1",
                "0",
                "0",
                "--right",
                "2",
                "0",
                "0",
            ],
            "not both",
        ),
        ([], "there is no such file"),
    ],
)
def test_the_command_refuses_in_one_line(options, said, tmp_path, capsys):
    assert main(["straighten", str(tmp_path / "none.nrrd"), *options]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert said in error
