"""Phantoms that differ as heads do: each switch changes what it names, and the truth stays the truth."""

import json
from functools import cache

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt
from scipy.spatial import cKDTree
from skimage.measure import marching_cubes

from gp_core.errors import GpError
from gp_core.io.markups import read_markups
from gp_core.landmarks.features import CODES, Side
from gp_labeler.cli.entry import main
from gp_labeler.imaging.readers import read_volume
from gp_labeler.phantom import SWITCHES, USUAL, HeadVariation, make_phantom, save_phantom
from gp_labeler.phantom.grey import AIR, BONE, LENS, SOFT

SEED, SPACING = 2, 0.5
PLACED = [code for code in CODES if code != "CO"]
HALF = 21_000


@cache
def head(variation=None, noise=0.0, seed=SEED):
    return make_phantom(seed, spacing=SPACING, noise=noise, variation=variation)


def change(**switches):
    """Return the plain voxels and how those of a varied head differ, both on the plain grid."""
    plain, varied = head().volume, head(HeadVariation(**switches)).volume
    assert plain.size == varied.size
    return plain.array.astype(int), varied.array.astype(int) - plain.array.astype(int)


def distances_to(point):
    """Return the distance of every voxel of the plain head from a (3,) point, mm."""
    k, j, i = np.indices(head().volume.array.shape)
    places = head().volume.voxel_to_scan(np.stack([i.ravel(), j.ravel(), k.ravel()], 1))
    return np.linalg.norm(places - point, axis=1).reshape(i.shape)


def test_without_a_variation_it_is_the_plain_phantom():
    plain, same = head(), head(HeadVariation())
    assert same.volume.checksum == plain.volume.checksum
    assert same.variation.names == ()


def test_the_same_seed_makes_the_same_voxels_and_truth():
    seed = 5
    variation = HeadVariation.drawn(seed, [n for n in SWITCHES if n != "holder"])
    one, two = (make_phantom(seed, spacing=0.5, variation=variation) for _ in range(2))
    assert one.volume.checksum == two.volume.checksum
    np.testing.assert_array_equal(one.T_head_scan.matrix, two.T_head_scan.matrix)
    for side in Side:
        np.testing.assert_array_equal(one.specimen.side(side).points, two.specimen.side(side).points)


def test_what_is_drawn_depends_on_the_seed_and_the_switch_alone():
    alone = {name: getattr(HeadVariation.drawn(4, [name]), name) for name in SWITCHES}
    together = HeadVariation.drawn(4, list(SWITCHES))
    assert {name: getattr(together, name) for name in SWITCHES} == alone
    assert set(together.names) == set(SWITCHES)
    others = [HeadVariation.drawn(seed, list(SWITCHES)) for seed in range(20)]
    for name in set(SWITCHES) - {"dry", "clip"}:
        assert len({getattr(v, name) for v in others}) > 1, name


def test_denser_bone_is_brighter_and_nothing_else_is():
    plain, changed = change(bone_density=1.25)
    assert not changed[plain < LENS - 500].any()
    assert np.median(changed[plain > BONE - 200]) == pytest.approx(0.25 * (BONE - LENS), rel=0.15)


def test_marrow_lies_inside_thick_bone():
    plain, changed = change(marrow=1.0)
    assert (changed <= 1).all()
    inside = distance_transform_edt(plain > HALF) * SPACING
    hollow = changed < -3000
    assert hollow.sum() > 200
    assert inside[hollow].min() >= SPACING  # no voxel at the surface of bone becomes soft


def test_fat_and_muscle_differ_where_soft_tissue_was():
    plain, changed = change(soft_tissue=1.0)
    fat = changed < -1500
    assert 0.1 < fat.sum() / (abs(plain - SOFT) < 50).sum() < 0.7
    assert np.abs(plain[fat] - SOFT).max() < 6000  # the blur mixes edges
    assert np.abs(changed[plain > HALF + 4000]).max() < 1000


def test_a_dry_skull_is_bone_in_air():
    plain, changed = change(dry=True)
    dry = plain + changed
    assert np.abs(changed[plain > BONE + 3000]).max() < 2000
    assert np.median(dry[abs(plain - SOFT) < 300]) == pytest.approx(AIR, abs=200)


def test_walls_grow_and_landmarks_stay_on_bone():
    plain, changed = change(bone_thickness=1.4)
    assert ((plain + changed) > HALF).sum() > 1.03 * (plain > HALF).sum()
    for side in Side:
        arch = head().specimen.side(side)["ZL"]
        assert np.abs(changed[distances_to(arch) < 1.5]).max() <= 1  # the cheek arch is no wall


@pytest.mark.parametrize("side", list("LR"))
def test_a_broken_bulla_is_open_on_its_side_alone(side):
    _, changed = change(broken_bulla=side)
    ear, other = (head().specimen.side(s)["CO"] for s in (side, "LR".replace(side, "")))
    assert (changed < -5000).sum() > 10  # bone went
    far = distances_to(ear) > 12.0
    assert np.abs(changed[far]).max() <= 1
    assert np.abs(changed[distances_to(other) < 5.0]).max() <= 1


def test_an_electrode_leads_to_the_round_window_of_its_side():
    plain, changed = change(electrode="R")
    window = head().specimen.side("R").array(["RWA", "RWP"]).mean(axis=0)
    wire = (changed > 8_000) & (plain < SOFT + 1000)
    assert distances_to(window)[wire].min() < 1.5
    assert distances_to(window)[wire].max() > 12.0
    assert np.abs(changed[distances_to(head().specimen.side("L")["CO"]) < 3.0]).max() < 1500


def test_a_clip_lies_in_the_skin_of_the_neck():
    plain, changed = change(clip=True)
    metal = np.argwhere((changed > 20_000) & (plain < HALF))[:, ::-1]
    assert len(metal) > 10
    at = head().T_head_scan.apply(head().volume.voxel_to_scan(metal))
    assert at[:, 2].min() > 13  # above the roof of the skull


@pytest.mark.parametrize("kind", ["tube", "cradle", "rod"])
def test_a_holder_is_as_bright_as_bone_and_leaves_the_skull_alone(kind):
    varied = head(HeadVariation(holder=kind))
    k, j, i = np.indices(varied.volume.array.shape)
    places = varied.volume.voxel_to_scan(np.stack([i.ravel(), j.ravel(), k.ravel()], 1))
    inside = head().volume.contains(places)
    skull = (head().volume.array > HALF).sum()
    bright = varied.volume.array > HALF
    assert bright.sum() > 1.02 * skull
    top = head().T_head_scan.apply(places[inside & bright.ravel()])
    assert (top[:, 2] > 0).any()
    for side in Side:
        np.testing.assert_allclose(varied.specimen.side(side).points, head().specimen.side(side).points)
    np.testing.assert_array_equal(varied.T_head_scan.matrix, head().T_head_scan.matrix)


def test_rings_are_circles_that_are_alike_in_every_slice():
    plain, changed = change(rings=800.0)
    free = (plain + changed).min(axis=0) > 0  # a value below 0 is stored as 0
    assert np.ptp(changed, axis=0)[free].max() <= 1
    assert changed[0].std() == pytest.approx(800, rel=0.4)
    ny, nx = changed.shape[1:]
    assert np.abs(changed[0] - changed[0, ::-1, ::-1])[free & free[::-1, ::-1]].max() <= 1
    assert (ny, nx) == changed[0].shape


def test_beam_hardening_darkens_the_middle_of_much_bone():
    plain, changed = change(beam_hardening=0.3)
    assert changed.max() <= 1
    share = -changed / np.maximum(plain, 1)
    assert share.max() == pytest.approx(0.3, abs=0.03)
    assert share[:, 0, 0].max() < 0.01


def test_partial_volume_keeps_the_sum_and_takes_the_edges():
    plain, changed = change(partial_volume=2.5)
    assert (plain + changed).sum() == pytest.approx(plain.sum(), rel=1e-3)
    assert (plain + changed).std() < plain.std()
    sharp = np.abs(np.diff(plain, axis=0)).max()
    assert np.abs(np.diff(plain + changed, axis=0)).max() < 0.7 * sharp


def test_outside_the_circle_there_is_one_value_that_counts_as_nothing(tmp_path):
    varied = head(HeadVariation(circle=0.8)).volume
    plain = head().volume.array
    outside = varied.array == varied.fill
    assert varied.fill == 0
    assert 0.2 < outside.mean() < 0.9
    np.testing.assert_array_equal(varied.array[~outside], np.maximum(plain, 1)[~outside])
    assert (outside == outside[0]).all()
    scan, *_ = save_phantom(head(HeadVariation(circle=0.8)), tmp_path / "head.nrrd")
    read = read_volume(scan)
    assert ((read.array == read.fill) == outside).mean() > 0.999


@pytest.mark.parametrize("face", list("LRAPSI"))
def test_a_crop_takes_its_share_of_the_bone_at_its_face(face):
    cut, whole = head(HeadVariation(crop=(0.3, face))), head()
    lost = 1 - (cut.volume.array > 22_000).sum() / (whole.volume.array > 22_000).sum()
    assert lost == pytest.approx(0.3, abs=0.05)
    axis, sign = "LRPASI".index(face) // 2, "LPS".find(face)
    moved = cut.volume.extent - whole.volume.extent
    assert np.count_nonzero(np.abs(moved) > 1e-9) == 1
    assert abs(moved[1 if sign >= 0 else 0, axis]) > 1
    unseen = 0
    for side in Side:
        truth, seen = whole.specimen.side(side), cut.specimen.side(side)
        for code in PLACED:
            inside = cut.volume.contains(truth[code][None])[0]
            assert (code in seen) == inside
            assert (code in seen.unseen) == (not inside)
            unseen += not inside
    assert unseen or face == "I"  # no landmark lies that low in the jaw


def test_a_turn_carries_landmarks_and_pose_together():
    turned, plain = head(HeadVariation(turn=(20.0, -70.0, 110.0))), head()
    for side in Side:
        np.testing.assert_allclose(
            turned.T_head_scan.apply(turned.specimen.side(side).points),
            plain.T_head_scan.apply(plain.specimen.side(side).points),
            atol=1e-9,
        )
    from scipy.spatial.transform import Rotation

    turn = turned.T_head_scan.rotation.T @ plain.T_head_scan.rotation
    np.testing.assert_allclose(Rotation.from_matrix(turn).as_rotvec(degrees=True), [20, -70, 110], atol=1e-6)
    assert (turned.volume.array > HALF).sum() == pytest.approx((plain.volume.array > HALF).sum(), rel=0.12)


def test_asymmetry_moves_places_by_what_was_asked_and_the_head_not_at_all():
    varied, plain = head(HeadVariation(asymmetry=0.3)), head()
    np.testing.assert_allclose(varied.T_head_scan.matrix, plain.T_head_scan.matrix, atol=1e-9)
    moved = np.concatenate(
        [varied.specimen.side(s).array(PLACED) - plain.specimen.side(s).array(PLACED) for s in Side]
    )
    assert 0.1 < np.sqrt((moved**2).sum(axis=1).mean()) < 0.6
    left, right = moved[: len(PLACED)], moved[len(PLACED) :]
    assert np.abs(left - right * (-1, 1, 1)).max() > 0.1  # the sides differ


def test_size_scales_all_that_lies_in_the_head():
    large, plain = head(HeadVariation(size=1.1)), head()
    for side in Side:
        np.testing.assert_allclose(
            large.specimen.side(side).array(PLACED), 1.1 * plain.specimen.side(side).array(PLACED)
        )
    np.testing.assert_allclose(large.T_head_scan.rotation, plain.T_head_scan.rotation, atol=1e-9)
    extent = [np.ptp(np.argwhere(p.volume.array > HALF), axis=0) for p in (large, plain)]
    np.testing.assert_allclose(extent[0] / extent[1], 1.1, atol=0.03)


def test_a_left_handed_grid_holds_the_same_values_at_the_same_places():
    varied, plain = head(HeadVariation(mirrored="grid")), head()
    assert varied.volume.is_mirrored
    points = np.random.default_rng(0).uniform(*plain.volume.extent, (500, 3))
    np.testing.assert_array_equal(varied.volume.values_at(points), plain.volume.values_at(points))
    np.testing.assert_allclose(varied.specimen.side("L").points, plain.specimen.side("L").points)


def test_a_silent_mirror_swaps_what_looks_left_and_keeps_the_animals_names():
    varied, plain = head(HeadVariation(mirrored="silent")), head()
    assert not varied.volume.is_mirrored
    np.testing.assert_array_equal(varied.volume.array, plain.volume.array[:, :, ::-1])
    assert varied.specimen.side("L")["ZL"][0] < varied.specimen.side("R")["ZL"][0]
    left = varied.T_head_scan.apply(varied.specimen.side("L").points)
    np.testing.assert_allclose(
        left, plain.T_head_scan.apply(plain.specimen.side("L").points) * (-1, 1, 1), atol=1e-9
    )


@pytest.mark.parametrize(
    ("seed", "names"),
    [(3, (*USUAL, "turn")), (4, ("dry", "turn", "mirrored")), (6, ("broken_bulla", "asymmetry"))],
)
def test_every_placed_feature_is_on_the_surface_of_bone(seed, names):
    variation = HeadVariation.drawn(seed, names).having({"partial_volume": 1.0, "beam_hardening": 0.0})
    phantom = make_phantom(seed, spacing=0.25, variation=variation)
    level = SOFT + (BONE - SOFT) * (0.5 if "bone_density" not in names else 0.4)
    off = {}
    for side in Side:
        for code in PLACED:
            off[side.value, code] = distance_to_surface(phantom, side, code, level)
    thin = {key: off.pop(key) for key in list(off) if key[1] in ("LLI", "DTL", "MH")}
    assert max(off.values()) < 1.5 * 0.25, off
    assert max(thin.values()) < 2.5 * 0.25, thin  # thinner than two voxels: their tips fade when turned
    assert np.median(list(off.values())) < 0.6 * 0.25


def distance_to_surface(phantom, side, code, level):
    """Return how far a true landmark is from the surface of bone, mm."""
    volume, point = phantom.volume, phantom.specimen.side(side)[code]
    low = np.maximum(np.rint(volume.scan_to_voxel(point[None])[0]).astype(int) - 8, 0)
    i, j, k = (slice(a, a + 17) for a in low)
    vertices = marching_cubes(volume.array[k, j, i].astype(np.float32), level)[0][:, ::-1] + low
    return cKDTree(volume.voxel_to_scan(vertices)).query(point)[0]


def test_the_head_frame_is_that_of_the_landmarks():
    for seed in (2, 8):
        phantom = make_phantom(seed, spacing=0.5, variation=HeadVariation.drawn(seed, ["turn", "size"]))
        left, right = (phantom.T_head_scan.apply(phantom.specimen.side(s).array(PLACED)) for s in Side)
        middle = (left + right)[:, 0] / 2
        assert abs(middle.mean()) < 0.1
        assert (left[:, 0] >= middle).all()
        ears = PLACED.index("RWA")
        assert left[PLACED.index("IN"), 1] < left[ears, 1] - 30  # y is posterior
        assert left[PLACED.index("IN"), 2] < left[ears, 2]


@pytest.mark.parametrize(
    "wrong",
    [
        {"size": 2.0},
        {"marrow": -0.1},
        {"rings": float("nan")},
        {"holder": "hand"},
        {"electrode": "both"},
        {"crop": (0.9, "L")},
        {"crop": (0.2, "X")},
        {"turn": (0.0, float("inf"), 0.0)},
        {"circle": 0.1},
        {"mirrored": "yes"},
    ],
)
def test_a_value_that_cannot_be_is_refused(wrong):
    with pytest.raises(GpError, match=next(iter(wrong))):
        HeadVariation(**wrong)


def test_an_unknown_switch_is_refused():
    with pytest.raises(GpError, match="variation must be one of"):
        HeadVariation.drawn(0, ["marow"])


def test_the_command_writes_a_library_with_its_truth(tmp_path, capsys):
    options = ["--spacing", "0.5", "--varied", "--crop", "0.2:I", "--turn=-20,0,45", "--labelled"]
    assert main(["phantom", "--seeds", "1,3", *options, "-o", str(tmp_path / "library")]) == 0
    assert "phantom-3.nrrd" in capsys.readouterr().out
    for seed in (1, 3):
        truth = json.loads((tmp_path / "library" / f"phantom-{seed}.truth.json").read_text())
        volume = read_volume(tmp_path / "library" / f"phantom-{seed}.nrrd")
        assert truth["volume"]["checksum"] == volume.checksum
        assert truth["variation"]["crop"] == [0.2, "I"]
        assert truth["variation"]["turn"] == [-20, 0, 45]
        assert set(truth["varied"]) == {*USUAL, "crop", "turn"}
        variation = HeadVariation.drawn(seed, USUAL).having({"crop": (0.2, "I"), "turn": (-20.0, 0.0, 45.0)})
        phantom = make_phantom(seed, spacing=0.5, variation=variation)
        assert volume.checksum == phantom.volume.checksum
        np.testing.assert_array_equal(truth["T_head_scan"], phantom.T_head_scan.matrix)
        normal, offset = truth["midPlane"]["normal"], truth["midPlane"]["offset"]
        for side in "LR":
            points = read_markups(tmp_path / "library" / f"phantom-{seed}_{side}.mrk.json").points
            found = {p.label: p.position for p in points if p.status.value == "defined"}
            assert {code: list(at) for code, at in found.items()} == truth["landmarks"][side]
            outward = np.array([found[c] for c in found if c != "IN"]) @ normal - offset
            assert (outward > 0).all() == (side == "L")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--size", "big"], "--size must be"),
        (["--crop", "0.2:Q"], "crop must be one of"),
        (["--seeds", "5-1"], "--seeds must rise"),
        (["--seeds", "a"], "--seeds must be like"),
        (["--seed", "-1"], "a seed must be"),
        (["--noise", "inf"], "--noise must be"),
        (["--spacing", "3"], "spacing must be"),
    ],
)
def test_the_command_refuses_in_one_line(options, said, tmp_path, capsys):
    assert main(["phantom", "-o", str(tmp_path / "head.nrrd"), *options]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_the_command_refuses_a_format_before_it_begins(tmp_path, capsys):
    assert main(["phantom", "-o", str(tmp_path / "head.png")]) == 2
    assert "Change the ending" in capsys.readouterr().err
