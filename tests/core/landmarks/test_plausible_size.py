"""Sizes that give away the wrong unit."""

import numpy as np
import pytest
from landmark_makers import SHARED, needs_shared_data

from gp_core import Atlas
from gp_core.errors import GeometryError
from gp_core.io import read_authors_mat
from gp_core.landmarks.features import PROBE
from gp_core.landmarks.plausible_size import check_plausible_size
from gp_core.landmarks.sets import LandmarkSet

pytestmark = needs_shared_data


def real_sides():
    mats = [
        SHARED / "usevitch2021" / f"combined_coords_method2_morepts_final_co_correct_{s}_CO.mat" for s in "LR"
    ]
    return [landmarks for specimen in read_authors_mat(*mats) for landmarks in specimen.sides.values()]


@pytest.mark.parametrize(
    ("factor", "message"),
    [
        (1e-6, "1000000 times smaller.*kilometres.*multiply them by 1000000"),
        (1e-3, "1000 times smaller.*like metres. .*multiply them by 1000"),
        (1e-2, "100 times smaller than in a guinea pig. .*multiply them by 100"),
        (1e-1, "10 times smaller.*centimetres.*multiply them by 10"),
        (1e1, "10 times larger.*divide them by 10"),
        (1e3, "1000 times larger.*micrometres.*divide them by 1000"),
        (1e6, "nanometres.*divide them by 1000000"),
        (1e8, r"10\^8 times larger.*divide them by 10\^8"),
    ],
)
def test_powers_of_ten_are_named_on_every_real_side(factor, message):
    for landmarks in real_sides():
        for codes in (landmarks.placed, PROBE, PROBE[:3]):
            part = LandmarkSet.from_mapping({c: landmarks[c] * factor + 50 for c in codes}, landmarks.side)
            with pytest.raises(GeometryError, match=rf"here\.dat: .*{message}"):
                check_plausible_size(part, "here.dat")


@pytest.mark.parametrize("factor", [0.7, 1.0, 1.4, 2.54, 0.3])
def test_other_sizes_pass(factor):
    for landmarks in real_sides():
        check_plausible_size(LandmarkSet(landmarks.points * factor, landmarks.side))


def test_too_few_and_odd_points_pass():
    two = LandmarkSet.from_mapping({"CA": [0, 0, 0], "CB": [5000, 0, 0]}, "L")
    check_plausible_size(two)
    check_plausible_size(LandmarkSet.empty("L"))
    check_plausible_size(LandmarkSet(np.ones((20, 3)), "L"))
    huge = np.random.default_rng(0).normal(size=(20, 3)) * 1e300
    check_plausible_size(LandmarkSet(huge, "L"))


@pytest.mark.parametrize(
    ("factor", "words"), [(1 / 25.4, "look like inches"), (0.3, "0.3 times"), (3.0, "3 times")]
)
def test_what_a_pose_is_made_of_must_have_the_size_of_a_guinea_pig(factor, words):
    mean = Atlas.published()
    landmarks = LandmarkSet.from_mapping({code: factor * mean[code] for code in PROBE}, "L")
    check_plausible_size(landmarks)
    with pytest.raises(GeometryError, match=words):
        check_plausible_size(landmarks, strict=True)
