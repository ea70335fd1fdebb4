"""One plain word for how far a pose can be trusted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gp_core import PROBE, Atlas, estimate_pose
from gp_core.atlas.sampling import draw_animal
from gp_core.pose.quality import pose_quality

ATLAS = Atlas.published()
ANIMAL = draw_animal(ATLAS, rng=np.random.default_rng(3)).side("L").as_mapping(PROBE)


def test_six_touches_that_agree_are_good():
    found = pose_quality(estimate_pose(ANIMAL, "L", ATLAS))
    assert (found.level, found.word) == ("good", "Good")


def test_a_wrong_side_and_swapped_names_are_reported_first():
    wrong = estimate_pose(ANIMAL, "R", ATLAS)
    swapped = estimate_pose({**ANIMAL, "MN": ANIMAL["OS"], "OS": ANIMAL["MN"]}, "L", ATLAS)
    assert (pose_quality(wrong).level, pose_quality(swapped).level) == ("danger", "danger")
    assert (pose_quality(wrong).word, pose_quality(swapped).word) == ("Check the side", "Check the names")
    assert wrong.side_state == "wrong"
    assert swapped.side_state == "clear"


def test_few_touches_and_a_mistouch_ask_for_a_second_look():
    few = estimate_pose({code: ANIMAL[code] for code in ("CL", "MN", "OS")}, "L", ATLAS)
    off = estimate_pose({**ANIMAL, "MN": ANIMAL["MN"] + [3, 0, 0]}, "L", ATLAS)
    assert (pose_quality(few).word, pose_quality(few).level) == ("Side undecided", "warning")
    assert (pose_quality(off).word, pose_quality(off).level) == ("Check first", "warning")


@pytest.mark.parametrize(("scale", "word"), [(1, "Good"), (4, "Fair"), (16, "Poor")])
def test_a_large_region_is_said_to_be_one(scale, word):
    pose = estimate_pose(ANIMAL, "L", ATLAS)
    assert pose_quality(replace(pose, covariance=scale * pose.covariance)).word == word
