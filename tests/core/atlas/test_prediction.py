from __future__ import annotations

import numpy as np
import pytest
from atlas_cases import draw_side, random_pose

from gp_core import Atlas, LandmarkSet, Side, Specimen, check_specimen, fit_atlas, predict
from gp_core.atlas.label_check import check_landmarks, check_side
from gp_core.errors import FeatureError, GeometryError
from gp_core.frames import mirror_x


@pytest.fixture(scope="module")
def published() -> Atlas:
    return Atlas.published()


@pytest.fixture
def side(published: Atlas) -> LandmarkSet:
    return draw_side(published, np.random.default_rng(0))


def _kinds(landmarks: LandmarkSet, atlas: Atlas) -> dict[str, tuple[str, ...]]:
    return {finding.kind: finding.landmarks for finding in check_landmarks(landmarks, atlas)}


def _only(landmarks: LandmarkSet, codes: tuple[str, ...]) -> LandmarkSet:
    return LandmarkSet.from_mapping(landmarks.as_mapping(codes), landmarks.side, frame=landmarks.frame)


def test_three_points_predict_the_near_ones_within_a_voxel(real_specimens: list[Specimen]) -> None:
    away, inside = [], []
    for animal in real_specimens:
        atlas = fit_atlas([other for other in real_specimens if other is not animal])
        for landmarks in animal.sides.values():
            for code, (mean, covariance) in predict(atlas, _only(landmarks, ("CA", "RWP", "OS"))).items():
                miss = landmarks[code] - mean
                inside.append(miss @ np.linalg.solve(covariance + 1e-6 * np.eye(3), miss) < 7.815)
                if code not in ("IN", "ZL", "MN", "OI"):
                    away.append(np.linalg.norm(miss))
    assert np.median(away) < 0.25
    assert 0.90 < np.mean(inside) < 0.99


def test_predictions_move_with_the_head_and_mirror(published: Atlas, side: LandmarkSet) -> None:
    some = _only(side, ("CA", "RWP", "OS", "MN"))
    T = random_pose(np.random.default_rng(1))
    right = LandmarkSet(mirror_x(some.points), Side.RIGHT, some.frame)
    still, moved, mirrored = (predict(published, s) for s in (some, some.moved(T), right))
    for code, (mean, covariance) in still.items():
        np.testing.assert_allclose(moved[code][0], T.apply(mean[None])[0], atol=1e-6)
        np.testing.assert_allclose(moved[code][1], T.rotation @ covariance @ T.rotation.T, atol=1e-6)
        np.testing.assert_allclose(mirrored[code][0], mirror_x(mean[None])[0], atol=1e-9)
    assert set(still) == {*published.codes, "CO"} - {"CA", "RWP", "OS", "MN"}


def test_two_points_predict_nothing(published: Atlas, side: LandmarkSet) -> None:
    with pytest.raises(FeatureError, match="at least three placed features are needed, got 2"):
        predict(published, _only(side, ("CA", "OS")))


@pytest.mark.parametrize("jitter", [0.0, 1e-9, 1e-3])
def test_labels_at_one_place_or_on_a_line_predict_nothing(published: Atlas, jitter: float) -> None:
    rng = np.random.default_rng(0)
    at_one_place = {code: jitter * rng.normal(size=3) for code in published.codes[:8]}
    on_a_line = {code: (n, jitter * rng.normal(), 0) for n, code in enumerate(published.codes[:8])}
    for points in (at_one_place, on_a_line):
        with pytest.raises(GeometryError):
            predict(published, LandmarkSet.from_mapping(points, "L"))


def test_good_labels_pass(published: Atlas) -> None:
    for seed in range(5):
        landmarks = draw_side(published, np.random.default_rng(seed))
        assert _kinds(landmarks, published) == {}


def test_real_labels_pass(real_specimens: list[Specimen], published: Atlas) -> None:
    for animal in real_specimens:
        assert check_specimen(animal, published) == []


def test_a_label_in_the_wrong_place_is_found(published: Atlas, side: LandmarkSet) -> None:
    kinds = _kinds(side.with_point("LLI", side["LLI"] + (1.5, 0, 0)), published)
    assert "LLI" in kinds["far"]
    away = check_side(side.with_point("LLI", side["LLI"] + (1.5, 0, 0)), published).deviations["LLI"]
    assert away.distance == pytest.approx(1.5, abs=0.4)
    assert away.n_sd > 5


def test_exchanged_names_and_sides_are_found(published: Atlas, side: LandmarkSet) -> None:
    swapped = side.with_point("FPA", side["LLI"]).with_point("LLI", side["FPA"])
    assert set(_kinds(swapped, published)["exchanged"]) == {"FPA", "LLI"}
    other = LandmarkSet(side.points, Side.RIGHT, side.frame)
    assert "other side" in _kinds(other, published)


def test_missing_unseen_and_duplicate_labels_are_found(published: Atlas, side: LandmarkSet) -> None:
    kinds = _kinds(side.with_point("MH", None).with_unseen("RWM").with_point("OI", side["OS"]), published)
    assert kinds["missing"] == ("MH",)
    assert kinds["unseen"] == ("RWM",)
    assert kinds["duplicate"] == ("OI", "OS")


def test_two_labels_are_not_checked_but_said_so(published: Atlas, side: LandmarkSet) -> None:
    assert "unchecked" in _kinds(_only(side, ("CA", "OS")), published)


def test_the_shared_point_must_be_one(published: Atlas) -> None:
    rng = np.random.default_rng(2)
    left, right = draw_side(published, rng), draw_side(published, rng, Side.RIGHT)
    animal = Specimen("S", {Side.LEFT: left, Side.RIGHT: right.with_point("IN", left["IN"] + (0, 0, 0.6))})
    found = [f for f in check_specimen(animal, published) if f.kind == "shared point differs"]
    assert len(found) == 1
    assert "0.60 mm apart" in found[0].text
