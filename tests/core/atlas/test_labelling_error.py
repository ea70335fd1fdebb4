"""The error of labels, assumed or measured, in checks and in the regions of expected features."""

from __future__ import annotations

import json
import pickle
from dataclasses import replace

import numpy as np
import pytest
from atlas_cases import draw_side, draw_specimens

from gp_core import Atlas, LabellingError, check_side, predict
from gp_core.atlas.certainty_weights import certainty_weights, checked_weights
from gp_core.atlas.fitting import fit_atlas
from gp_core.atlas.plain_fit import fit_plain_atlas
from gp_core.cli.entry import main
from gp_core.constants import CHI2_3_95
from gp_core.errors import GpError
from gp_core.io import write_markups
from gp_core.landmarks.provenance import LabelProvenance
from gp_core.landmarks.sets import LandmarkSet, Specimen

PUBLISHED = Atlas.published()
FIRST = ("CA", "RWP", "OS", "RWA", "MN", "CB")


def mislabelled(landmarks: LandmarkSet, sd: float, rng: np.random.Generator) -> LandmarkSet:
    points = {c: landmarks[c] + rng.normal(0, sd, 3) for c in landmarks.placed if c != "CO"}
    return LandmarkSet.from_mapping(points, landmarks.side)


def first(landmarks: LandmarkSet) -> LandmarkSet:
    return LandmarkSet.from_mapping({code: landmarks[code] for code in FIRST}, landmarks.side)


def test_regions_hold_what_they_say_for_labels_with_the_measured_error() -> None:
    rng, sd = np.random.default_rng(3), 0.35
    measured = PUBLISHED.with_labelling_error(LabellingError(dict.fromkeys(PUBLISHED.codes, sd)))
    inside = {id(PUBLISHED): 0, id(measured): 0}
    n = 0
    for _ in range(40):
        truth = draw_side(PUBLISHED, rng)
        seen = first(mislabelled(truth, sd, rng))
        for atlas in (PUBLISHED, measured):
            for code, (mean, covariance) in predict(atlas, seen).items():
                off = truth[code] - mean
                inside[id(atlas)] += code != "CO" and off @ np.linalg.solve(covariance, off) < CHI2_3_95
        n += len(PUBLISHED.codes) - len(FIRST)
    assert 0.90 < inside[id(measured)] / n < 0.98
    assert inside[id(PUBLISHED)] / n < 0.85  # the assumed 0.1 mm is too small for such labels


def test_the_check_allows_for_the_measured_error() -> None:
    rng = np.random.default_rng(0)
    side = mislabelled(draw_side(PUBLISHED, rng), 0.02, rng)
    side = side.with_point("RWL", side["RWL"] + [1.5, 0, 0])
    assert check_side(side, PUBLISHED).deviations["RWL"].is_outlier
    lenient = PUBLISHED.with_labelling_error(LabellingError({"RWL": 1.0}))
    found = check_side(side, lenient).deviations["RWL"]
    assert not found.is_outlier
    assert found.labelling_sd == 1.0


def test_features_may_differ_and_a_worse_known_one_counts_less() -> None:
    rng = np.random.default_rng(1)
    side = first(draw_side(PUBLISHED, rng))
    rough = PUBLISHED.with_labelling_error(LabellingError({"CB": 2.0}))
    moved = side.with_point("CB", side["CB"] + [0.0, 0.5, 0.0])
    shifts = [
        np.linalg.norm(predict(atlas, moved)["CC"][0] - predict(atlas, side)["CC"][0])
        for atlas in (PUBLISHED, rough)
    ]
    assert shifts[1] < 0.2 * shifts[0]


def test_a_feature_is_drawn_towards_all_features_by_ten_pairs() -> None:
    row = {"sd_mm": 0.3, "n_pairs": 30}
    report = {
        "overall": {"intra": {"sd_mm": 9.0}, "inter": {"sd_mm": 0.1}},
        "features": [{"feature": "CA", "inter": row, "intra": None}, {"feature": "CB", "inter": None}],
        "n_animals": 5,
        "observers": ["AB", "CD"],
    }
    error = LabellingError.from_reliability(report)
    assert error.of(["CA", "CB"]) == pytest.approx([np.sqrt((30 * 0.09 + 10 * 0.01) / 40), 0.1])
    assert error.text == "0.1 mm per coordinate, measured on 5 animals, 2 observers"


def test_it_is_kept_in_the_atlas_file_and_absent_where_it_is_assumed(tmp_path) -> None:
    path = tmp_path / "atlas.json"
    PUBLISHED.save(path)
    assert "labelling_error" not in json.loads(path.read_text())
    assert Atlas.load(path).labelling_error == LabellingError()
    error = LabellingError({"CA": 0.25}, 0.2, "8 animals, 2 observers")
    PUBLISHED.with_labelling_error(error).save(path)
    assert Atlas.load(path).labelling_error == error
    assert pickle.loads(pickle.dumps(error)) == error
    content = json.loads(path.read_text())
    path.write_text(json.dumps({**content, "labelling_error": {"sd_mm": {"CA": -1}}}))
    with pytest.raises(GpError, match="damaged atlas: the labelling error of CA must be above 0"):
        Atlas.load(path)


@pytest.mark.parametrize("value", [0, -0.1, float("nan"), 6.0, "0.1", True])
def test_what_is_no_error_is_refused(value) -> None:
    with pytest.raises(GpError, match="labelling error of CA must be"):
        LabellingError({"CA": value})


# Weights by certainty


def certain(specimens: list[Specimen], rows: dict[str, str]) -> list[Specimen]:
    """Say the certainty of every label of some animals."""
    found = []
    for specimen in specimens:
        about = LabelProvenance(certainty=rows.get(specimen.name))
        sides = {s: m.with_provenance(dict.fromkeys(m.placed, about)) for s, m in specimen.sides.items()}
        found.append(Specimen(specimen.name, sides))
    return found


def test_certainty_counts_only_where_it_is_asked_for_and_said() -> None:
    animals = draw_specimens(PUBLISHED, 4, np.random.default_rng(5))
    guessed = certain(animals, {"S00": "guess"})
    plain = fit_atlas(animals)
    assert np.array_equal(fit_atlas(guessed).mean, plain.mean)
    assert np.array_equal(fit_atlas(animals, certainty_weights=True).covariance, plain.covariance)
    assert np.array_equal(fit_atlas(guessed, certainty_weights={"guess": 1.0}).mean, plain.mean)
    weighed = fit_plain_atlas(guessed, by_certainty=checked_weights({"guess": 1e-9}))
    without = fit_plain_atlas(animals[1:])
    assert np.allclose(weighed.mean, without.mean, atol=1e-5)
    assert not np.allclose(plain.mean, without.mean, atol=1e-3)


def test_a_label_and_not_its_animal_is_weighed() -> None:
    (animal,) = certain(draw_specimens(PUBLISHED, 1, np.random.default_rng(5)), {})
    side = animal.sides["L"].with_provenance({"CA": LabelProvenance(certainty="fair")})
    animal = Specimen("S", {**animal.sides, side.side: side})
    weights = certainty_weights([animal], ("CA", "CB"), checked_weights(True) or {})
    assert weights.tolist() == [[0.5, 1.0], [1.0, 1.0]]


@pytest.mark.parametrize("weights", [{"guess": 0}, {"guess": 1.5}, {"maybe": 0.5}, {"sure": True}])
def test_what_is_no_weight_is_refused(weights) -> None:
    with pytest.raises(GpError, match=r"certainty|weight of"):
        checked_weights(weights)


def test_the_commands_take_both(tmp_path, capsys) -> None:
    animals = certain(draw_specimens(PUBLISHED, 3, np.random.default_rng(5)), {"S00": "guess"})
    for animal in animals:
        for side, landmarks in animal.sides.items():
            file = tmp_path / f"{animal.name}_{side.value}.mrk.json"
            write_markups(file, replace(landmarks, frame="scan"), specimen=animal.name)
    report = {"overall": {"inter": None, "intra": {"sd_mm": 0.2}}, "features": [], "n_animals": 1}
    error, atlas = tmp_path / "reliability.json", tmp_path / "atlas.json"
    error.write_text(json.dumps({**report, "observers": ["AB"]}))
    options = ["--certainty-weights", "guess=0.3", "--labelling-error", str(error)]
    assert main(["fit", str(tmp_path), "-o", str(atlas), *options]) == 0
    said = capsys.readouterr().out
    assert "Weights by certainty: sure 1, fair 0.5, guess 0.3; 38 of 114 labels have one" in said
    assert "0.2 mm per coordinate, measured on 1 animal, 1 observer" in said
    assert Atlas.load(atlas).labelling_error.other_mm == 0.2
    assert main(["check", str(tmp_path), "--labelling-error", str(error)]) in (0, 1)
    assert "Labelling error: 0.2 mm" in capsys.readouterr().out
    assert main(["fit", str(tmp_path), "-o", str(atlas), "--certainty-weights", "guess"]) == 2
    assert "such as guess=0.2" in capsys.readouterr().err
    assert main(["check", str(tmp_path), "--labelling-error", str(atlas)]) == 2
    assert "is not a reliability report" in capsys.readouterr().err
