from __future__ import annotations

import json
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from atlas_cases import draw_side, draw_specimens, errors, noisy, random_pose
from hypothesis import given, settings
from hypothesis import strategies as st

from gp_core import (
    EXTERNAL,
    PROBE,
    Atlas,
    LandmarkSet,
    Side,
    Specimen,
    estimate_pose,
    fit_atlas,
    read_touches,
)
from gp_core.errors import FeatureError, GeometryError, GpError
from gp_core.frames import mirror_x
from gp_core.landmarks.anatomy import axis_frame, cochlea_origin
from gp_core.pose.covariance import cochlea_jacobian, cone_95, radius_95


@pytest.fixture(scope="module")
def published() -> Atlas:
    return Atlas.published()


def _touched(landmarks: LandmarkSet, codes: tuple[str, ...] = PROBE) -> dict[str, np.ndarray]:
    return landmarks.as_mapping(codes)


def _mean_side(atlas: Atlas, side: Side) -> LandmarkSet:
    points = atlas.mean if side is Side.LEFT else mirror_x(atlas.mean)
    return LandmarkSet.from_mapping(dict(zip(atlas.codes, points, strict=True)), side, frame="tracker")


def test_the_mean_animal_is_found_exactly_on_both_sides(published: Atlas) -> None:
    T = random_pose(np.random.default_rng(0), dst="world", src="tracker")
    for side in Side:
        landmarks = _mean_side(published, side).moved(T)
        pose = estimate_pose(_touched(landmarks), side, published)
        origin = cochlea_origin(*(landmarks[c] for c in ("CA", "CB", "RWA", "RWP")))
        np.testing.assert_allclose(pose.origin, origin, atol=1e-6)
        np.testing.assert_allclose(
            pose.axis, (landmarks["CA"] - origin) / np.linalg.norm(landmarks["CA"] - origin), atol=1e-6
        )
        assert np.linalg.det(pose.transform[:3, :3]) == pytest.approx(1)
        assert max(pose.residuals.values()) < 1e-6
        assert pose.suspects == pose.warnings == ()


@pytest.mark.parametrize("codes", [PROBE, ("CL", "OI", "OS", "RWM", "ZL"), ("IN", "MN", "RWA"), EXTERNAL])
def test_any_three_or_more_external_features_will_do(published: Atlas, codes: tuple[str, ...]) -> None:
    landmarks = draw_side(published, np.random.default_rng(1))
    pose = estimate_pose(_touched(landmarks, codes), "L", published)
    distance, angle = errors(pose, landmarks)
    assert distance < 2 * pose.radius_95
    assert angle < 2 * pose.cone_95
    assert set(pose.residuals) == set(codes)


def test_the_pose_moves_with_the_tracker(published: Atlas) -> None:
    rng = np.random.default_rng(2)
    landmarks = draw_side(published, rng)
    touches = {code: noisy(p, 0.2, rng) for code, p in _touched(landmarks).items()}
    T = random_pose(rng, dst="tracker", src="tracker")
    still = estimate_pose(touches, "L", published)
    moved = estimate_pose({c: T.apply(p[None])[0] for c, p in touches.items()}, "L", published)
    np.testing.assert_allclose(moved.transform, T.matrix @ still.transform, atol=1e-6)
    turn = np.kron(np.eye(2), T.rotation)
    np.testing.assert_allclose(moved.covariance, turn @ still.covariance @ turn.T, atol=1e-6)


def test_the_right_side_is_the_mirror_of_the_left(published: Atlas) -> None:
    rng = np.random.default_rng(3)
    touches = {code: noisy(p, 0.2, rng) for code, p in _touched(draw_side(published, rng)).items()}
    left = estimate_pose(touches, "L", published)
    right = estimate_pose({c: mirror_x(p[None])[0] for c, p in touches.items()}, "R", published)
    np.testing.assert_allclose(right.origin, mirror_x(left.origin[None])[0], atol=1e-9)
    np.testing.assert_allclose(right.axis, mirror_x(left.axis[None])[0], atol=1e-9)
    flip = np.diag([-1.0, 1, 1, 1, -1, -1])
    np.testing.assert_allclose(right.covariance, flip @ left.covariance @ flip, atol=1e-9)
    assert right.cone_95 == pytest.approx(left.cone_95)
    assert right.residuals == pytest.approx(left.residuals)


def test_regions_hold_the_truth_as_often_as_they_say(published: Atlas) -> None:
    rng = np.random.default_rng(4)
    for noise in (0.0, 0.1, 0.4):
        inside = []
        for _ in range(250):
            landmarks = draw_side(published, rng)
            touches = {code: noisy(p, noise, rng) for code, p in _touched(landmarks).items()}
            pose = estimate_pose(touches, "L", published, shared_error=0)  # none was drawn
            distance, angle = errors(pose, landmarks)
            inside.append((distance < pose.plain_radius_95, angle < pose.plain_cone_95))
        shares = np.mean(inside, axis=0)
        assert (shares >= 0.90).all(), (noise, shares)
        assert (shares <= 0.995).all(), (noise, shares)


def _held_out(specimens: list[Specimen]) -> list[tuple[Atlas, LandmarkSet]]:
    """Every real side with an atlas that has seen nothing of its animal."""
    pairs = []
    for animal in specimens:
        atlas = fit_atlas([other for other in specimens if other is not animal])
        pairs += [(atlas, landmarks) for landmarks in animal.sides.values()]
    return pairs


def test_real_animals_held_out_are_found(real_specimens: list[Specimen], published: Atlas) -> None:
    own = [errors(estimate_pose(_touched(s), s.side, atlas), s) for atlas, s in _held_out(real_specimens)]
    shipped = [
        errors(estimate_pose(_touched(s), s.side, published), s)
        for animal in real_specimens
        for s in animal.sides.values()
    ]
    for found in (own, shipped):
        distance, angle = np.mean(found, axis=0)
        assert distance < 0.23
        assert np.degrees(angle) < 3.5


def test_regions_hold_real_cochleae_held_out(real_specimens: list[Specimen]) -> None:
    rng = np.random.default_rng(5)
    pairs = _held_out(real_specimens)
    for noise in (0.1, 0.4):
        inside = []
        for atlas, truth in pairs * 10:
            touches = {code: noisy(p, noise, rng) for code, p in _touched(truth).items()}
            pose = estimate_pose(touches, truth.side, atlas)
            distance, angle = errors(pose, truth)
            inside.append((distance < pose.radius_95, angle < pose.cone_95))
        assert (np.mean(inside, axis=0) > 0.88).all(), noise


def test_a_mistouch_is_named_and_does_little_harm(published: Atlas) -> None:
    rng = np.random.default_rng(6)
    named, harm = 0, []
    for trial in range(60):
        landmarks = draw_side(published, rng)
        codes = tuple(code for code in EXTERNAL if code != "IN")
        touches = {code: noisy(p, 0.1, rng) for code, p in _touched(landmarks, codes).items()}
        wrong = codes[trial % len(codes)]
        step = rng.normal(size=3)
        touches[wrong] = touches[wrong] + 3 * step / np.linalg.norm(step)
        pose = estimate_pose(touches, "L", published)
        named += wrong in pose.suspects
        harm.append(errors(pose, landmarks)[0])
    assert named >= 45
    assert np.mean(harm) < 0.35


def test_a_mistouch_that_pulls_the_pose_after_it_widens_the_region(real_specimens: list[Specimen]) -> None:
    rng = np.random.default_rng(12)
    inside, named = [], 0
    for atlas, truth in _held_out(real_specimens) * 8:
        touches = {code: noisy(p, 0.1, rng) for code, p in _touched(truth).items()}
        step = rng.normal(size=3)
        touches["MN"] = touches["MN"] + 3 * step / np.linalg.norm(step)
        pose = estimate_pose(touches, truth.side, atlas)
        distance, angle = errors(pose, truth)
        inside.append((distance < pose.radius_95, angle < pose.cone_95))
        named += "MN" in pose.suspects
    assert (np.mean(inside, axis=0) > 0.85).all()
    assert named > 0.55 * len(inside)


def test_the_wrong_side_is_called_out(published: Atlas) -> None:
    rng = np.random.default_rng(7)
    for _ in range(20):
        touches = _touched(draw_side(published, rng), tuple(c for c in EXTERNAL if c != "IN"))
        warnings = estimate_pose(touches, "R", published).warnings
        assert any("left side fits these points better" in w for w in warnings)
        assert not any("check the side" in w for w in estimate_pose(touches, "L", published).warnings)


def test_three_points_cannot_tell_the_side_and_say_so(published: Atlas) -> None:
    touches = _touched(_mean_side(published, Side.LEFT), ("OS", "MN", "RWA"))
    pose = estimate_pose(touches, "L", published)
    assert pose.side_state == "undecided"
    assert any("right side" in warning for warning in pose.warnings)


def test_exchanged_names_are_called_out(published: Atlas) -> None:
    codes = tuple(c for c in EXTERNAL if c not in ("IN", "ZL"))
    touches = _touched(_mean_side(published, Side.LEFT), codes)
    for a, b in (("OS", "CL"), ("MN", "RWP"), ("OI", "RWA")):
        swapped = {**touches, a: touches[b], b: touches[a]}
        pose = estimate_pose(swapped, "L", published)
        assert pose.swapped is not None
        assert set(pose.swapped) == {a, b}
        assert f"{' and '.join(pose.swapped)} look exchanged" in pose.warnings
    assert estimate_pose(touches, "L", published).swapped is None


def test_names_exchanged_in_real_touches_are_called_out(published: Atlas, shared_data: Path) -> None:
    named = []
    for file, side in (("SkullE_Right.dat", "R"), ("SkullD_Right.dat", "R"), ("SkullA_Left_new.dat", "L")):
        touches = read_touches(shared_data / "probe" / file, side).as_mapping()
        assert not any("exchanged" in w for w in estimate_pose(touches, side, published).warnings)
        for a, b in combinations(PROBE, 2):
            swapped = {**touches, a: touches[b], b: touches[a]}
            named.append(f"{a} and {b} look exchanged" in estimate_pose(swapped, side, published).warnings)
    assert sum(named) >= 43  # of 45


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    codes=st.lists(st.sampled_from(EXTERNAL), min_size=3, max_size=11, unique=True),
    seed=st.integers(0, 2**32 - 1),
    scale=st.sampled_from([1e-9, 0.04, 0.3, 1.0, 3.0, 25.4, 1e9]),
    shuffle=st.booleans(),
)
def test_any_touches_make_a_finite_pose_or_an_error(
    codes: list[str], seed: int, scale: float, shuffle: bool
) -> None:
    rng = np.random.default_rng(seed)
    atlas = Atlas.published()
    points = scale * noisy(atlas.rows(codes), 0.3, rng)
    points = rng.permutation(points) if shuffle else points
    try:
        pose = estimate_pose(dict(zip(codes, points, strict=True)), "L", atlas)
    except GpError:
        return
    assert np.isfinite(pose.covariance).all()
    assert pose.radius_95 < 1000


def test_the_authors_answers_are_met(real_specimens: list[Specimen], shared_data: Path) -> None:
    oracle = json.loads((shared_data / "oracles" / "estimate_shared.json").read_text())
    for name, answer in oracle.items():
        touches = read_touches(shared_data / "probe" / name, answer["side"])
        pose = estimate_pose(touches, answer["side"], method="jrmpc", specimens=real_specimens)
        np.testing.assert_allclose(pose.origin, answer["co_mm"], atol=1e-6)
        np.testing.assert_allclose(pose.axis, answer["modiolar_axis"], atol=1e-6)


def test_jrmpc_says_what_it_needs(published: Atlas) -> None:
    touches = _touched(_mean_side(published, Side.LEFT))
    with pytest.raises(GpError, match="needs labelled specimens"):
        estimate_pose(touches, "L", published, method="jrmpc")
    animals = draw_specimens(published, 4, np.random.default_rng(8))
    without = {code: p for code, p in touches.items() if code != "LLI"}
    with pytest.raises(FeatureError, match="LLI"):
        estimate_pose(without, "L", method="jrmpc", specimens=animals)


@pytest.mark.parametrize(
    ("touches", "message"),
    [
        ({}, "at least three touched features"),
        ({"OS": (0, 0, 0), "CL": (1, 2, 3)}, r"got 2: CL OS"),
        ({"OS": (0, 0, 0), "CL": (0, 0, 0), "MN": (0, 0, 0)}, "one line"),
        ({"OS": (0, 0, 0), "CL": (7, 0, 0), "MN": (3, 0, 0)}, "one line"),
        ({"OS": (0, 0, 0), "CA": (7, 0, 0), "MN": (3, 0, 5)}, "CA is inside the bone"),
        ({"OS": (0, 0, np.nan), "CL": (7, 0, 0), "MN": (3, 0, 5)}, "landmark OS: position"),
        ({"OX": (0, 0, 0)}, r"unknown feature 'OX' \(did you mean"),
    ],
)
def test_touches_that_make_no_pose_are_refused(touches: dict, message: str, published: Atlas) -> None:
    with pytest.raises(GpError, match=message):
        estimate_pose(touches, "L", published)


def test_a_file_name_is_no_touches() -> None:
    with pytest.raises(GpError, match=r"touches must be a mapping .* got str. Read a file .* read_touches"):
        estimate_pose("touches.csv", "L")  # type: ignore[arg-type]


def test_metres_are_recognised(published: Atlas) -> None:
    metres = {code: p / 1000 for code, p in _touched(_mean_side(published, Side.LEFT)).items()}
    with pytest.raises(GeometryError, match=r"look like metres.*multiply them by 1000"):
        estimate_pose(metres, "L", published)


@pytest.mark.parametrize("noise", [0.0, -1.0, np.nan, np.inf])
def test_probe_noise_must_be_positive(noise: float, published: Atlas) -> None:
    with pytest.raises(GpError, match="probe noise must be a positive number"):
        estimate_pose(_touched(_mean_side(published, Side.LEFT)), "L", published, probe_noise=noise)


def test_a_transform_file_says_what_slicer_expects(published: Atlas, tmp_path: Path) -> None:
    pose = estimate_pose(_touched(draw_side(published, np.random.default_rng(9))), "L", published)
    pose.save_tfm(tmp_path / "pose.tfm")
    lines = (tmp_path / "pose.tfm").read_text().splitlines()
    assert lines[0] == "#Insight Transform File V1.0"
    (numbers,) = (line.split()[1:] for line in lines if line.startswith("Parameters:"))
    back = np.array(numbers, dtype=float)
    np.testing.assert_allclose(back[:9].reshape(3, 3) @ pose.origin + back[9:], 0, atol=1e-9)


def test_the_jacobian_of_the_cochlea_frame_is_its_derivative() -> None:
    rng = np.random.default_rng(10)
    points = rng.normal(size=(4, 3)) + np.array([(4, 0, 0), (0, 0, 0), (1, 3, 0), (0, 3, 0)])

    def frame(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        origin = cochlea_origin(*p)
        T = axis_frame(origin, p[0] - p[1], (p[2] + p[3]) / 2 - origin, dst="a", src="b")
        return T.translation, T.rotation

    origin, rotation = frame(points)
    for column, (i, c) in enumerate((i, c) for i in range(4) for c in range(3)):
        moved = points.copy()
        moved[i, c] += 1e-6
        origin_2, rotation_2 = frame(moved)
        turn = rotation_2 @ rotation.T
        vector = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2
        change = np.hstack([origin_2 - origin, vector]) / 1e-6
        np.testing.assert_allclose(cochlea_jacobian(*points)[:, column], change, atol=1e-5)


def test_radius_and_cone_are_the_95_percent_quantiles() -> None:
    rng = np.random.default_rng(11)
    root = rng.normal(size=(6, 6)) * [[0.3], [0.2], [0.1], [0.02], [0.05], [0.03]]
    covariance = root @ root.T
    drawn = rng.multivariate_normal(np.zeros(6), covariance, size=100_000)
    axis = np.array([1.0, 0, 0])
    assert np.mean(np.linalg.norm(drawn[:, :3], axis=1) < radius_95(covariance)) == pytest.approx(
        0.95, abs=0.01
    )
    tilt = np.linalg.norm(np.cross(drawn[:, 3:], axis), axis=1)
    assert np.mean(tilt < cone_95(covariance, axis)) == pytest.approx(0.95, abs=0.01)


def test_any_three_features_work_and_are_warned_of(published: Atlas) -> None:
    landmarks = _mean_side(published, Side.LEFT)
    for codes in combinations(EXTERNAL, 3):
        pose = estimate_pose(_touched(landmarks, codes), "L", published)
        assert np.isfinite(pose.covariance).all()
        assert pose.warnings
