"""A fit leaves out what is known to be wrong, one wrong animal hardly moves it; the plain fit stays."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from gp_core import PROBE, TRAINING, Atlas, LandmarkSet, Side, Specimen, fit_atlas, leave_one_out
from gp_core.atlas.plain_fit import fit_plain_atlas, left_shapes
from gp_core.atlas.sampling import draw_animal
from gp_core.atlas.screening import mean_shared_points, screen_labels
from gp_core.frames import mirror_x
from gp_core.landmarks.anatomy import cochlea_frame, with_cochlea_origin
from gp_core.landmarks.features import CODES
from gp_core.landmarks.provenance import LabelProvenance
from gp_core.registration.procrustes import weighted_procrustes
from gp_core.study.leave_one_out import held_out_sides

L, R = Side.LEFT, Side.RIGHT
Change = Callable[[LandmarkSet], LandmarkSet]


@pytest.fixture(scope="module")
def animals() -> list[Specimen]:
    rng = np.random.default_rng(4)
    return [draw_animal(Atlas.published(), rng=rng, name=f"GP{i}", tilt_deg=15) for i in range(8)]


def _changed(animal: Specimen, change: Change, *sides: Side) -> Specimen:
    return Specimen(
        animal.name, {s: change(marks) if s in sides else marks for s, marks in animal.sides.items()}
    )


def _swapped(a: str, b: str) -> Change:
    return lambda marks: marks.with_point(a, marks[b]).with_point(b, marks[a])


def _scaled(marks: LandmarkSet) -> LandmarkSet:
    return LandmarkSet(1.2 * marks.points, marks.side)


def _shuffled(marks: LandmarkSet) -> LandmarkSet:
    order = np.random.default_rng(1).permutation(len(CODES))
    return LandmarkSet(marks.points[order], marks.side)


def _mirrored(marks: LandmarkSet) -> LandmarkSet:
    return LandmarkSet(mirror_x(marks.points), marks.side)


def _same(one: Atlas, other: Atlas) -> bool:
    names = ("mean", "covariance", "scatter")
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in names)


def test_where_no_label_is_rejected_the_fit_is_the_plain_one_to_the_bit(
    animals: list[Specimen], real_specimens: list[Specimen]
) -> None:
    for those in (animals, real_specimens):
        assert _same(fit_atlas(those), fit_plain_atlas(those))


@pytest.mark.parametrize(
    ("change", "sides"),
    [
        (_swapped("CA", "CB"), (L, R)),
        (_swapped("FPA", "LLI"), (L,)),
        (_mirrored, (L,)),
        (_mirrored, (L, R)),
        (_scaled, (L, R)),
        (_shuffled, (L, R)),
        (lambda marks: marks.with_point("OS", marks["OS"] + [0, 3, 0]), (R,)),
    ],
)
def test_one_wrong_animal_of_eight_hardly_moves_the_atlas(
    animals: list[Specimen], change: Change, sides: tuple[Side, ...]
) -> None:
    seven, wrong = fit_atlas(animals[:-1]), [*animals[:-1], _changed(animals[-1], change, *sides)]
    atlas, plain = fit_atlas(wrong), fit_atlas(wrong, keep_doubtful=True)
    assert np.linalg.norm(atlas.mean - seven.mean, axis=1).max() < 0.05
    ratio = atlas.variances(atlas.codes) / seven.variances(atlas.codes)
    np.testing.assert_allclose(np.sqrt(ratio), 1, atol=0.2)
    assert np.linalg.norm(plain.mean - seven.mean, axis=1).max() > 0.1
    assert _same(plain, fit_plain_atlas(wrong))


def test_what_is_left_out_is_said_the_worst_first(animals: list[Specimen]) -> None:
    wrong = list(animals)
    wrong[1] = _changed(wrong[1], lambda m: m.with_point("LLI", m["LLI"] + [2, 0, 0]), L)
    wrong[2] = _changed(wrong[2], _swapped("CA", "CB"), R)
    wrong[3] = _changed(wrong[3], lambda m: m.with_point("DTM", m["DTM"] + [0, 4, 0]), L)
    screened = screen_labels(wrong)
    assert [(f.specimen, f.side, f.kind, f.landmarks) for f in screened.left_out] == [
        ("GP2", R, "exchanged", ("CA", "CB")),
        ("GP3", L, "far", ("DTM",)),
        ("GP1", L, "far", ("LLI",)),
    ]
    assert all(finding.remedy for finding in screened.left_out)
    left = {animal.name: animal for animal in screened.specimens}
    assert "LLI" not in left["GP1"].side(L)
    assert "LLI" in left["GP1"].side(R)
    assert not {"CA", "CB"} & set(left["GP2"].side(R).placed)
    assert (screened.weights < 1).tolist() == [False, True, True, True, False, False, False, False]


def test_a_label_that_a_person_confirmed_is_believed(animals: list[Specimen]) -> None:
    wrong = [_changed(animals[0], lambda m: m.with_point("LLI", m["LLI"] + [2, 0, 0]), L), *animals[1:]]
    assert screen_labels(wrong).left_out
    assert not screen_labels(wrong, confirmed={("GP0", L, "LLI")}).left_out


def test_a_label_whose_file_says_that_it_was_checked_is_believed_and_still_reported(
    animals: list[Specimen],
) -> None:
    checked = {"LLI": LabelProvenance(checked=True, checked_by="AB")}
    far_off = _changed(
        animals[0], lambda m: m.with_point("LLI", m["LLI"] + [2, 0, 0]).with_provenance(checked), L
    )
    screened = screen_labels([far_off, *animals[1:]])
    assert not screened.left_out
    assert [(f.landmarks, f.checked_by) for f in screened.problems] == [(("LLI",), "AB")]
    assert (screened.weights == 1).all()
    exchanged = _changed(animals[0], lambda m: _swapped("CA", "LLI")(m).with_provenance(checked), L)
    assert screen_labels([exchanged, *animals[1:]]).left_out, "CA was not looked at again"


def test_what_most_animals_have_elsewhere_is_how_it_is_labelled_here(animals: list[Specimen]) -> None:
    habit = [_changed(a, lambda m: m.with_point("OS", m["OS"] + [0, 0, 3]), L, R) for a in animals]
    screened = screen_labels(habit)
    assert not screened.left_out
    assert screened.notes == ("OS is far from its published place on 16 of 16 sides: it is kept.",)


def test_animals_unlike_the_published_ones_are_held_against_each_other(animals: list[Specimen]) -> None:
    other = [_changed(a, lambda m: LandmarkSet(0.6 * m.points, m.side), L, R) for a in animals]
    other[5] = _changed(other[5], _swapped("CA", "OS"), L)
    screened = screen_labels(other)
    assert [(f.specimen, f.kind, set(f.landmarks)) for f in screened.left_out] == [
        ("GP5", "exchanged", {"CA", "OS"})
    ]
    assert len(screened.notes) == 1


def test_both_sides_get_the_mean_of_their_shared_point(animals: list[Specimen]) -> None:
    animal = animals[0]
    noisy = _changed(animal, lambda m: m.with_point("IN", m["IN"] + [0.3, 0, 0]), R)
    assert not [f for f in screen_labels([noisy]).findings if f.is_problem]
    middle = mean_shared_points(noisy)
    np.testing.assert_allclose(middle.side(L)["IN"], animal.side(L)["IN"] + [0.15, 0, 0])
    np.testing.assert_array_equal(middle.side(L)["IN"], middle.side(R)["IN"])


@pytest.mark.parametrize("apart_mm", [1.1, 3.0, 70.0])
def test_two_labels_of_a_shared_point_that_cannot_both_be_right_are_left_out(
    animals: list[Specimen], apart_mm: float
) -> None:
    moved = _changed(animals[-1], lambda m: m.with_point("IN", m["IN"] + [0, apart_mm, 0]), R)
    wrong = [*animals[:-1], moved]
    screened = screen_labels(wrong)
    assert {(f.specimen, f.landmarks) for f in screened.left_out} == {("GP7", ("IN",))}
    assert all("IN" in f.remedy for f in screened.left_out)
    kept = [s for s in screened.specimens[-1].sides.values() if "IN" in s]
    assert all(np.array_equal(s["IN"], animals[-1].side(L)["IN"]) for s in kept)
    assert bool(kept) == (apart_mm > 10)  # then it is known which of the two is wrong
    seven, atlas = fit_atlas(animals[:-1]), fit_atlas(wrong)
    assert np.linalg.norm(atlas.mean - seven.mean, axis=1).max() < 0.05


def _plain_as_it_was(specimens: Sequence[Specimen], codes: tuple[str, ...]) -> np.ndarray:
    """The mean of the fit as the study of the paper has always had it, step by step."""
    _, shapes = left_shapes(specimens)
    shapes = shapes[:, [CODES.index(code) for code in codes]]
    mean, weights = shapes[0].copy(), np.ones(len(codes))
    for _ in range(50):
        aligned = []
        for shape in shapes:
            every = ~np.isnan(shape[:, 0])
            rotation, translation = weighted_procrustes(shape[every], mean[every], weights[every])
            aligned.append(shape @ rotation.T + translation)
        aligned = np.array(aligned)
        updated = np.nanmean(aligned, axis=0)
        variances = np.nansum((aligned - updated) ** 2, axis=(0, 2)) / (3 * (len(shapes) - 1))
        weights = 1 / (variances + 0.05**2)
        moved, mean = np.abs(updated - mean).max(), updated
        if moved < 1e-9:
            break
    landmarks = LandmarkSet.from_mapping(dict(zip(codes, mean, strict=True)), "L", frame="mean")
    return cochlea_frame(landmarks).inverse().apply(mean)


def test_the_study_believes_every_label_to_the_bit(animals: list[Specimen]) -> None:
    wrong = [_changed(animals[0], _swapped("CA", "CB"), L, R), *animals[1:]]
    plain = fit_plain_atlas(wrong)
    assert np.array_equal(plain.mean, _plain_as_it_was(wrong, plain.codes))
    atlases, _ = held_out_sides(wrong, TRAINING, [animals[3].name])
    others = [animal for animal in wrong if animal.name != animals[3].name]
    assert _same(atlases[0], fit_plain_atlas(others, features=TRAINING))
    assert not _same(atlases[0], fit_atlas(others, features=TRAINING))
    whole = [Specimen(a.name, {s: with_cochlea_origin(m) for s, m in a.sides.items()}) for a in wrong]
    report = leave_one_out(whole, method="robust", training=TRAINING, probe=PROBE)
    assert len(report.rows) == 16, "every animal takes part"
