"""The phantom: every feature is there at its definition, and the truth beside it is the truth."""

import numpy as np
import pytest
import SimpleITK
from scipy.spatial import cKDTree
from skimage.measure import label, marching_cubes

from gp_core.atlas.atlas import Atlas
from gp_core.atlas.sampling import draw_animal, mean_animal
from gp_core.errors import GpError
from gp_core.io.markups import read_markups
from gp_core.landmarks.features import CODES, Side
from gp_labeler.imaging.progress import Cancelled
from gp_labeler.imaging.threshold import propose_threshold
from gp_labeler.phantom import make_phantom, write_phantom

BONE = 21_000.0
PLACED = [code for code in CODES if code != "CO"]
EAR = [code for code in PLACED if code not in ("IN", "ZL", "MN")]
TILT_DEG = 2.0


def animal(seed):
    return draw_animal(Atlas.published(), rng=np.random.default_rng(seed), tilt_deg=TILT_DEG)


def around(points, margin):
    return np.stack([np.min(points, axis=0) - margin, np.max(points, axis=0) + margin])


def crop(volume, centre, reach):
    """Return the values (k, j, i) of a cube around a place and the index of its first voxel."""
    n = int(np.ceil(reach / volume.spacing[0]))
    low = np.maximum(np.floor(volume.scan_to_voxel(np.reshape(centre, (1, 3)))[0]).astype(int) - n, 0)
    i, j, k = (slice(a, a + 2 * n + 2) for a in low)
    return volume.array[k, j, i].astype(np.float32), low


def surface_points(volume, centre, reach):
    """Return the isosurface's vertices in a cube, LPS mm."""
    part, low = crop(volume, centre, reach)
    return volume.voxel_to_scan(marching_cubes(part, BONE)[0][:, ::-1] + low)


def bone_of(volume, point, reach):
    """Return the isosurface's vertices, from `point`, of the one bone it is on, no further than `reach`."""
    part, low = crop(volume, point, reach)
    places = volume.voxel_to_scan(np.argwhere(part > -1)[:, ::-1] + low) - point
    inside = np.linalg.norm(places, axis=1).reshape(part.shape) <= reach
    bones = label((part > BONE) & inside, connectivity=1)
    nearest = np.where(bones.ravel() > 0, np.linalg.norm(places, axis=1), np.inf).argmin()
    own = bones == bones.ravel()[nearest]
    alone = np.where((part > BONE) & ~own, 15_000, part)
    found = volume.voxel_to_scan(marching_cubes(alone, BONE)[0][:, ::-1] + low) - point
    return found[np.linalg.norm(found, axis=1) <= reach]


def values_along(volume, start, end, n=80):
    return volume.values_at(np.linspace(start, end, n))


@pytest.fixture(scope="module")
def whole():
    return make_phantom(0, spacing=0.25)


@pytest.fixture(scope="module", params=[("L", 1), ("R", 2)], ids=["left-1", "right-2"])
def ear(request):
    """One ear of an animal at 0.2 mm: volume, landmarks, and outward sign."""
    side, seed = request.param
    landmarks = animal(seed).side(side)
    box = around(landmarks.array(EAR), 2.0)
    phantom = make_phantom(seed, spacing=0.2, box=box)
    np.testing.assert_array_equal(phantom.specimen.side(side).points, landmarks.points)
    return phantom.volume, landmarks, 1.0 if side == "L" else -1.0


def test_the_whole_head_is_as_large_as_a_guinea_pigs_and_surrounded_by_air(whole):
    bone = np.argwhere(whole.volume.array > BONE)[:, ::-1]
    size = np.ptp(whole.volume.voxel_to_scan(bone), axis=0)
    assert 28 < size[0] < 42
    assert 55 < size[1] < 78
    assert 22 < size[2] < 40
    edges = np.concatenate([whole.volume.array[:, :, [0, -1]].ravel(), whole.volume.array[[0, -1]].ravel()])
    assert np.percentile(edges, 99.9) < 8000
    assert whole.volume.array.dtype == np.uint16


def test_all_points_lie_in_the_volume(whole):
    for landmarks in whole.specimen.sides.values():
        assert whole.volume.contains(landmarks.points).all()


def test_a_threshold_for_bone_can_be_proposed(whole):
    assert 16_000 < propose_threshold(whole.volume) < 27_000


@pytest.mark.parametrize("side", list("LR"))
def test_every_placed_feature_is_on_the_surface_of_bone(whole, side):
    volume, landmarks = whole.volume, whole.specimen.side(side)
    off = {c: cKDTree(surface_points(volume, landmarks[c], 2.0)).query(landmarks[c])[0] for c in PLACED}
    assert max(off.values()) < volume.spacing[0], off


def test_features_of_other_animals_at_finer_voxels_are_on_the_surface(ear):
    volume, landmarks, _ = ear
    off = {c: cKDTree(surface_points(volume, landmarks[c], 1.5)).query(landmarks[c])[0] for c in EAR}
    assert max(off.values()) < 0.2, off
    assert np.median(list(off.values())) < 0.1


@pytest.mark.parametrize(
    ("code", "direction", "reach"),
    [
        ("ZL", (1, 0, 0), 6.0),  # lateralmost of the arch
        ("MN", (0, 1, 1), 1.5),  # most posterior and superior of the jaw
        ("DTM", (0, 0, 1), 1.2),  # top of the ossicles
        ("DTL", (1, 0, 0), 0.7),  # lateralmost spur
    ],
)
@pytest.mark.parametrize("side", list("LR"))
def test_tips_are_extremes_of_their_bone(whole, code, direction, reach, side):
    landmarks = whole.specimen.side(side)
    towards = np.array(direction, float) / np.linalg.norm(direction)
    towards[0] *= 1 if side == "L" else -1
    bone = bone_of(whole.volume, landmarks[code], reach)
    assert abs((bone @ towards).max()) < 1.2 * whole.volume.spacing[0]


@pytest.mark.parametrize("side", list("LR"))
def test_the_incisor_point_is_the_lowest_point_of_the_bone_between_the_incisors(whole, side):
    tip = whole.specimen.side(side)["IN"]
    bone = surface_points(whole.volume, tip, 1.0) - tip
    between = bone[(np.abs(bone[:, 0]) < 0.3) & (bone[:, 1] > -0.3)]
    assert abs(between[:, 2].min()) < whole.volume.spacing[0]
    for sign in (-1, 1):
        tooth = tip + np.array([sign * 1.15, -0.9, -1.5])
        assert whole.volume.values_at(tooth[None])[0] > BONE


@pytest.mark.parametrize(("side", "seed"), [("L", 1), ("L", 4), ("R", 7)])
def test_the_long_limb_of_the_incus_ends_where_it_is_nearest_to_the_round_window(side, seed):
    landmarks = animal(seed).side(side)
    volume = make_phantom(seed, spacing=0.1, box=around(landmarks["LLI"][None], 1.2)).volume
    window = landmarks.array(["RWA", "RWP"]).mean(axis=0)
    towards = (window - landmarks["LLI"]) / np.linalg.norm(window - landmarks["LLI"])
    limb = bone_of(volume, landmarks["LLI"], 0.5)
    assert abs((limb @ towards).max()) < 0.1
    gap = values_along(volume, landmarks["LLI"] + 0.15 * towards, window)
    assert gap.max() < BONE  # air and fluid, not bone, between it and the window


def test_the_rim_of_the_round_window_surrounds_an_opening(ear):
    volume, landmarks, _ = ear
    rwa, rwp, rwl, rwm = landmarks.array(["RWA", "RWP", "RWL", "RWM"])
    centre = (rwa + rwp + rwl + rwm) / 4
    normal = np.cross(rwa - rwp, rwl - rwm)
    normal *= np.sign(normal @ (centre - landmarks["CO"])) / np.linalg.norm(normal)
    through = values_along(volume, centre - 0.6 * normal, centre + 0.35 * normal)
    assert through.max() < BONE
    assert through[:10].mean() > 8000  # fluid within
    assert through[-10:].mean() < 8000  # air without
    for point in (rwa, rwp, rwl, rwm):
        beyond = values_along(volume, centre, centre + 1.6 * (point - centre))
        first = np.flatnonzero(beyond > BONE)[0] / len(beyond) * 1.6
        assert first * np.linalg.norm(point - centre) == pytest.approx(
            np.linalg.norm(point - centre), abs=0.2
        )


def test_the_oval_window_opens_between_its_rims(ear):
    volume, landmarks, _ = ear
    front, back = landmarks["FPA"], landmarks["FPP"]
    line = (back - front) / np.linalg.norm(back - front)
    rims = [
        values_along(volume, point, point + out * 0.3 * line).max() for point, out in ((front, -1), (back, 1))
    ]
    assert min(rims) > BONE
    assert values_along(volume, front, front + 0.25 * line).min() < BONE  # the gap beside the footplate
    assert values_along(volume, back, back - 0.25 * line).min() < BONE


def test_the_malleus_handle_is_seen_through_the_ear_canal(ear):
    volume, landmarks, sign = ear
    middle = landmarks.array(["OS", "OI"]).mean(axis=0)
    line = middle + sign * np.array([1.5, 0, 0]) - landmarks["MH"]
    ray = values_along(volume, landmarks["MH"] + 0.3 * line / np.linalg.norm(line), landmarks["MH"] + line)
    assert np.nanmax(ray) < BONE


def test_the_ear_canal_is_open_from_its_upper_to_its_lower_edge(ear):
    volume, landmarks, _ = ear
    top, bottom = landmarks["OS"], landmarks["OI"]
    inside = values_along(volume, top + 0.1 * (bottom - top), bottom + 0.1 * (top - bottom))
    assert inside.max() < 8000
    for edge, other in ((top, bottom), (bottom, top)):
        assert values_along(volume, edge, edge + 0.15 * (edge - other)).max() > BONE


def test_the_cochlea_is_coiled_around_a_bony_axis(ear):
    volume, landmarks, _ = ear
    ca, cb = landmarks["CA"], landmarks["CB"]
    axis = ca - cb
    assert (values_along(volume, cb + 0.1 * axis, cb + 0.75 * axis) > BONE).mean() > 0.9  # modiolus
    away = landmarks["CL"] - cb
    away -= (away @ axis) / (axis @ axis) * axis
    away /= np.linalg.norm(away)
    cut = np.array(
        [
            values_along(volume, cb + h * axis, cb + h * axis + 2.0 * away).min()
            for h in np.linspace(0.05, 0.95, 90)
        ]
    )
    wall = np.array(
        [
            values_along(volume, p, p + 0.05 * axis).mean()
            for p in np.linspace(cb + 1.2 * away, ca + 0.4 * away, 90)
        ]
    )
    turns = np.count_nonzero(np.diff((wall < BONE).astype(int)) == 1)
    assert turns >= 3, (turns, cut)


def test_the_same_seed_makes_the_same_voxels():
    box = around(animal(4).side("L").array(["RWA", "LLI"]), 2.0)
    first, again = (make_phantom(4, spacing=0.2, box=box) for _ in range(2))
    np.testing.assert_array_equal(first.volume.array, again.volume.array)
    assert first.volume.checksum == again.volume.checksum
    assert make_phantom(5, spacing=0.2, box=box).volume.checksum != first.volume.checksum


def test_the_two_sides_of_a_symmetric_animal_mirror_each_other():
    mean = mean_animal(Atlas.published())
    x, y, z = mean.side("L")["RWA"]
    box = np.array([[-x - 2.5, y - 2.0, z - 2.0], [x + 2.5, y + 2.0, z + 2.0]])
    box[:, 0] = np.array([-0.2, 0.2]) * np.ceil(box[1, 0] / 0.2)
    grey = make_phantom(spacing=0.2, box=box, specimen=mean, noise=0).volume.array.astype(float)
    assert np.ptp(grey) > 20_000
    assert np.abs(grey - grey[:, :, ::-1]).max() < 1000  # 0.02 mm at an edge


def test_noise_is_as_strong_as_asked():
    mean = mean_animal(Atlas.published())
    box = np.array([[58.0, 0, 0], [60.0, 2, 2]])  # air beside the head
    still, noisy = (make_phantom(spacing=0.1, box=box, specimen=mean, noise=n).volume.array for n in (0, 500))
    assert np.ptp(still) == 0
    assert noisy.std() == pytest.approx(500, rel=0.05)


def test_written_files_give_the_phantom_back(tmp_path):
    box = around(animal(4).side("L").array(["RWA", "LLI"]), 1.0)
    phantom = make_phantom(4, spacing=0.2, box=box)
    volume, left, right = write_phantom(phantom, tmp_path / "new")
    image = SimpleITK.ReadImage(str(volume))
    np.testing.assert_array_equal(SimpleITK.GetArrayFromImage(image), phantom.volume.array)
    np.testing.assert_allclose(image.GetOrigin(), phantom.volume.origin, atol=1e-9)
    np.testing.assert_allclose(image.GetSpacing(), phantom.volume.spacing, atol=1e-9)
    for path, side in ((left, Side.LEFT), (right, Side.RIGHT)):
        points = read_markups(path)
        assert points.header.side is side
        assert points.header.volume["checksum"] == phantom.volume.checksum
        found = {point.label: point.position for point in points.points}
        for code in CODES:
            np.testing.assert_array_equal(found[code], phantom.specimen.side(side)[code])


def test_a_folder_that_cannot_be_made_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    box = np.array([[60.0, 0, 0], [61.0, 1, 1]])
    with pytest.raises(GpError, match="file: cannot be made"):
        write_phantom(make_phantom(box=box), tmp_path / "file")


@pytest.mark.parametrize("spacing", [0.01, 2.0, float("nan")])
def test_an_unfit_spacing_is_refused(spacing):
    with pytest.raises(GpError, match="spacing must be"):
        make_phantom(spacing=spacing)


def test_it_tells_how_far_it_is_from_nothing_to_all():
    told = []
    make_phantom(spacing=0.5, progress=told.append)
    assert told == sorted(told)
    assert told[0] < 0.02
    assert told[-1] == 1.0
    assert max(np.diff(told)) < 0.2


@pytest.mark.parametrize("after", [0, 7, 150])
def test_it_stops_soon_when_asked_to(after):
    asked, told = [], []

    def cancel():
        asked.append(len(told))
        return len(asked) > after

    with pytest.raises(Cancelled):
        make_phantom(spacing=0.5, progress=told.append, cancel=cancel)
    assert len(asked) == after + 1
    assert len(told) - asked[after] <= 1
    assert max(np.diff([0, *asked])) <= 2, "it asks again and again"
