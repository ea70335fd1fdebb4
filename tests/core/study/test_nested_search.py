"""The honest search: nothing of an animal helps to choose what it is scored with."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from study_cases import cohort

from gp_core import CODES, EXTERNAL, Atlas, GpError, Side, Specimen
from gp_core.atlas.plain_fit import as_left
from gp_core.frames import mirror_x
from gp_core.landmarks.anatomy import with_cochlea_origin
from gp_core.landmarks.sets import LandmarkSet
from gp_core.registration.jrmpc import JrmpcSettings
from gp_core.study.backward_elimination import SearchProgress
from gp_core.study.nested_search import nested_search
from gp_core.study.parallel import open_executor
from gp_core.study.scoring import PoseErrors, angle_between_deg
from gp_core.study.subset_search import search_features

SMALL = ("CA", "CB", "CL", "LLI", "MN", "OS", "RWA", "RWP")
OPTIONS: dict[str, Any] = {
    "training": SMALL,
    "fewest_training": 7,
    "settings": JrmpcSettings(max_iterations=20),
}


def uninformed(seed: int) -> list[Specimen]:
    """Animals whose cochleae lie anyhow, whatever is seen from outside."""
    rng = np.random.default_rng(seed)
    return [Specimen(f"U{i}", {side: uninformed_side(side, rng) for side in Side}) for i in range(5)]


def uninformed_side(side: Side, rng: np.random.Generator) -> LandmarkSet:
    atlas = Atlas.published()
    turn = Rotation.from_rotvec(np.radians(8) * rng.normal(size=3)).as_matrix()
    shift = 0.6 * rng.normal(size=3)
    points = {}
    for code in (code for code in CODES if code != "CO"):
        outside = atlas[code] + 0.2 * rng.normal(size=3)
        point = outside if code in EXTERNAL else turn @ atlas[code] + shift
        points[code] = point if side is Side.LEFT else mirror_x(point[None])[0]
    return with_cochlea_origin(LandmarkSet.from_mapping(points, side))


def mean_pose(animals: list[Specimen], *, both_sides: bool) -> PoseErrors:
    """Errors of the mean cochlea of the other animals, in the head's own frame, nothing touched."""
    co, ca, cb = (CODES.index(code) for code in ("CO", "CA", "CB"))
    e_co, e_ma = [], []
    for side in Side:
        for animal in animals:
            others = [
                as_left(landmarks)
                for other in animals
                for its, landmarks in other.sides.items()
                if other is not animal and (both_sides or its is side)
            ]
            truth, mean = as_left(animal.side(side)), np.mean(others, axis=0)
            e_co.append(np.linalg.norm(truth[co] - mean[co]))
            e_ma.append(angle_between_deg(truth[ca] - truth[cb], mean[ca] - mean[cb]))
    return PoseErrors(np.array(e_co), np.array(e_ma))


@pytest.mark.parametrize(
    ("method", "features"), [("jrmpc", SMALL), ("robust", [code for code in SMALL if code != "LLI"])]
)
def test_touches_that_say_nothing_do_not_beat_the_mean_pose(method: str, features: list[str]) -> None:
    options = {**OPTIONS, "training": features, "fewest_training": 7}
    totals = []
    for seed in range(3):  # the mean of some cohorts: one alone can be lucky
        animals = uninformed(seed)
        report = nested_search(animals, method=method, **options)
        chance = mean_pose(animals, both_sides=method == "robust")
        totals.append((chance.e_t, report.errors.e_t, report.optimistic.errors.e_t))
    by_chance, honest, optimistic = np.mean(totals, axis=0)
    assert honest >= by_chance
    assert optimistic < 0.95 * honest  # which is why the honest one is needed


def test_held_out_animal_has_no_say() -> None:
    animals = cohort(4)
    rng = np.random.default_rng(1)
    spoilt = {}
    for side, landmarks in animals[0].sides.items():
        for code in landmarks.placed:
            landmarks = landmarks.with_point(code, landmarks[code] + 0.3 * rng.normal(size=3))
        spoilt[side] = with_cochlea_origin(landmarks)
    before = nested_search(animals, **OPTIONS)
    after = nested_search([Specimen("D01", spoilt), *animals[1:]], **OPTIONS)
    assert before.folds[0] == after.folds[0]
    assert before.folds[1] != after.folds[1]
    assert before.rows[0] != after.rows[0]


def test_each_fold_is_a_search_without_the_animal() -> None:
    animals = cohort(4)
    report = nested_search(animals, **OPTIONS)
    best = search_features([animals[i] for i in (0, 1, 3)], **OPTIONS).best
    fold = report.folds[2]
    assert (fold.held_out, fold.features, fold.probe, fold.e_t) == (
        "D03", best.features, best.probe, best.e_t,
    )  # fmt: skip
    whole = search_features(animals, **OPTIONS).best
    assert report.optimistic.training == whole.features
    assert report.optimistic.errors.e_t == pytest.approx(whole.e_t)
    assert [(row.specimen, row.side) for row in report.rows] == [
        (animal.name, side) for side in "LR" for animal in animals
    ]


def test_stopped_search_goes_on_with_any_workers(tmp_path: Path) -> None:
    animals = cohort(4)
    expected = nested_search(animals, **OPTIONS)
    seen: list[SearchProgress] = []

    def stop(progress: SearchProgress) -> None:
        seen.append(progress)
        if len(seen) == 9:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        nested_search(animals, checkpoint=tmp_path / "nested.json", progress=stop, **OPTIONS)
    rest: list[SearchProgress] = []
    with open_executor(2) as executor:
        report = nested_search(
            animals,
            checkpoint=tmp_path / "nested.json",
            progress=rest.append,
            executor=executor,
            **OPTIONS,
        )
    assert report.rows == expected.rows
    assert report.folds == expected.folds
    assert report.fits == expected.fits
    assert len(rest) == 5 * 9 - 9
    assert rest[-1].fraction == pytest.approx(1.0)
    assert all(progress.left >= 0 for progress in rest)


def test_report_as_json() -> None:
    content = json.loads(json.dumps(nested_search(cohort(4), **OPTIONS).as_dict(), allow_nan=False))
    assert content.keys() == {
        "rows", "summary", "folds", "optimistic", "fits", "seconds", "settings",
    }  # fmt: skip
    assert content["folds"][0].keys() == {"held_out", "features", "probe", "e_t"}
    assert content["optimistic"]["summary"].keys() == content["summary"].keys()


def test_too_few_animals_are_refused() -> None:
    with pytest.raises(GpError, match="at least 4 animals, got 3"):
        nested_search(cohort(3), **OPTIONS)
