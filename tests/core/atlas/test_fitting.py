from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from atlas_cases import draw_specimens, random_pose

from gp_core import Atlas, LandmarkSet, Side, Specimen, fit_atlas
from gp_core.errors import FeatureError, FileFormatError, GpError
from gp_core.frames import RigidTransform, mirror_x


def _moved(specimen: Specimen, rng: np.random.Generator) -> Specimen:
    matrix = random_pose(rng).matrix
    moved = {
        side: landmarks.moved(RigidTransform(matrix, landmarks.frame, landmarks.frame))
        for side, landmarks in specimen.sides.items()
    }
    return Specimen(specimen.name, moved)


def _mirrored(specimen: Specimen) -> Specimen:
    sides = {
        landmarks.side.other: LandmarkSet(mirror_x(landmarks.points), landmarks.side.other, landmarks.frame)
        for landmarks in specimen.sides.values()
    }
    return Specimen(specimen.name, sides)


@pytest.fixture(scope="module")
def animals() -> list[Specimen]:
    return draw_specimens(Atlas.published(), 12, np.random.default_rng(5))


def test_it_finds_the_shape_that_the_animals_were_drawn_from() -> None:
    truth = Atlas.published()
    fitted = fit_atlas(draw_specimens(truth, 150, np.random.default_rng(6)))
    near = [code for code in truth.codes if code not in ("IN", "ZL", "MN", "OI")]
    np.testing.assert_allclose(fitted.rows(near), truth.rows(near), atol=0.06)
    ratio = fitted.variances(near) / truth.variances(near)
    assert np.median(ratio) == pytest.approx(1, abs=0.2)
    np.testing.assert_allclose(fitted["CO"], 0, atol=1e-9)


def test_head_pose_order_and_side_do_not_matter(animals: list[Specimen]) -> None:
    rng = np.random.default_rng(7)
    atlas = fit_atlas(animals)
    for others in (
        [_moved(animal, rng) for animal in animals],
        animals[::-1],
        [_mirrored(animal) for animal in animals],
    ):
        again = fit_atlas(others)
        np.testing.assert_allclose(again.mean, atlas.mean, atol=1e-6)
        np.testing.assert_allclose(again.covariance, atlas.covariance, atol=1e-6)


def test_one_side_and_missing_features_will_do(animals: list[Specimen]) -> None:
    whole = fit_atlas(animals)
    gaps = [
        Specimen(a.name, {Side.LEFT: a.side("L").with_point("RWL" if i % 2 else "MN", None)})
        for i, a in enumerate(animals)
    ]
    part = fit_atlas(gaps)
    assert part.n_samples == len(animals)
    assert part.codes == whole.codes
    near = [code for code in whole.codes if code not in ("IN", "ZL", "MN", "OI")]
    np.testing.assert_allclose(part.rows(near), whole.rows(near), atol=0.15)


def test_the_covariance_is_positive_and_pulled_towards_independent_features(animals: list[Specimen]) -> None:
    atlas = fit_atlas(animals)
    assert np.linalg.eigvalsh(atlas.covariance).min() > 0
    off = ~np.kron(np.eye(len(atlas.codes), dtype=bool), np.ones((3, 3), dtype=bool))
    assert np.abs(atlas.covariance[off]).sum() < 0.6 * np.abs(atlas.scatter[off]).sum()


def test_too_little_is_refused(animals: list[Specimen]) -> None:
    with pytest.raises(GpError, match="at least three labelled sides, got 2"):
        fit_atlas(animals[:1])
    blind = [Specimen(a.name, {Side.LEFT: a.side("L").with_point("CA", None)}) for a in animals]
    with pytest.raises(FeatureError, match="fewer than two sides have CA"):
        fit_atlas(blind)


def test_a_file_keeps_every_bit(animals: list[Specimen], tmp_path: Path) -> None:
    atlas = fit_atlas(animals, name="drawn")
    atlas.save(tmp_path / "a.json")
    again = Atlas.load(tmp_path / "a.json")
    for name in ("mean", "covariance", "scatter"):
        np.testing.assert_array_equal(getattr(again, name), getattr(atlas, name))
    assert (again.name, again.codes, again.n_samples, again.specimens) == (
        atlas.name,
        atlas.codes,
        atlas.n_samples,
        atlas.specimens,
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda c: c.pop("gpAtlas"), "is not an atlas"),
        (lambda c: c.update(gpAtlas=99), "atlas version 99, not 1"),
        (lambda c: c.pop("mean_mm"), "damaged atlas"),
        (lambda c: c.update(mean_mm=[[1, 2]]), "damaged atlas"),
        (lambda c: c.update(features=["CA", "QQ"]), "damaged atlas"),
        (lambda c: c["mean_mm"][0].__setitem__(0, float("nan")), "damaged atlas"),
        (lambda c: c.update(n_samples="many"), "damaged atlas"),
        (lambda c: c.update(n_samples=-3), "at least one side"),
        (lambda c: c.update(side="R"), "says side 'R', not 'L'"),
        (lambda c: c.update(units="in"), "says units 'in'"),
        (lambda c: c.update(specimens="abc"), "not a list of names"),
        (lambda c: c.update(features=c["features"][::-1]), "out of order"),
        (lambda c: c["features"].__setitem__(2, "CO"), "must not contain CO"),
        (lambda c: c.update(scatter_mm2=(-np.array(c["scatter_mm2"])).tolist()), "scatter .* not positive"),
        (lambda c: c["covariance_mm2"][0].__setitem__(1, 5.0), "covariance .* not symmetric"),
        (lambda c: c.update(mean_mm=(np.array(c["mean_mm"]) / 1000).tolist()), "look like metres"),
    ],
)
def test_a_bad_file_is_named(change: object, message: str, tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    Atlas.published().save(path)
    content = json.loads(path.read_text())
    change(content)  # type: ignore[operator]
    path.write_text(json.dumps(content))
    with pytest.raises(FileFormatError, match=message) as caught:
        Atlas.load(path)
    assert str(path) in str(caught.value)


def test_what_is_no_file_is_named(tmp_path: Path) -> None:
    for name, content in (("empty.json", b""), ("binary.json", bytes(range(256))), ("list.json", b"[1]")):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(FileFormatError, match=r"is not an atlas|is not JSON"):
            Atlas.load(tmp_path / name)
    (tmp_path / "deep.json").write_text("[" * 100_000)
    (tmp_path / "huge.json").write_text('{"gpAtlas": ' + "9" * 5000 + "}")
    for name in ("deep.json", "huge.json"):
        with pytest.raises(FileFormatError, match=r"is not JSON|atlas version"):
            Atlas.load(tmp_path / name)
    with pytest.raises(FileFormatError, match="does not exist"):
        Atlas.load(tmp_path / "none.json")
