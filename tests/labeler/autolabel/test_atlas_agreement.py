"""Where labelled scans and the atlas disagree, both are named; where they agree, nothing is said."""

from dataclasses import replace

import numpy as np
import pytest

from gp_core.atlas.atlas import Atlas
from gp_core.atlas.sampling import draw_animal
from gp_labeler.autolabel.atlas_agreement import compare_with_atlas, disagreement_text
from gp_labeler.autolabel.labelled_scan import flat_points
from gp_labeler.autolabel.proposal import Guess, most_doubtful_first


@pytest.fixture(scope="module")
def atlas():
    return Atlas.published()


@pytest.fixture(scope="module")
def guesses(atlas):
    """Return guesses as good as usual of an animal of the atlas."""
    rng = np.random.default_rng(3)
    points = flat_points(draw_animal(atlas, rng=rng).sides)
    return [Guess(name, xyz + rng.normal(0, 0.1, 3), 0.4, 0.1, 0.15, 5) for name, xyz in points.items()]


def moved(guesses, name, by, **changed):
    return [replace(g, position=g.position + by, **changed) if g.name == name else g for g in guesses]


def test_guesses_of_an_ordinary_head_agree(guesses, atlas):
    assert all(guess.atlas_distance is None for guess in compare_with_atlas(guesses, atlas))
    assert disagreement_text(compare_with_atlas(guesses, atlas)) == ""


@pytest.mark.parametrize("name", ["CA_L", "RWP_R"])
def test_a_guess_that_lies_elsewhere_is_doubtful_and_both_are_named(guesses, atlas, name):
    told = compare_with_atlas(moved(guesses, name, [0, 0, 3.0]), atlas)
    (found,) = [guess for guess in told if guess.atlas_distance is not None]
    assert found.name == name
    assert found.atlas_distance == pytest.approx(3.0, abs=1.0)
    assert next(g for g in most_doubtful_first(told) if g.name == name).is_doubtful
    text = disagreement_text(told)
    assert "the atlas and the labelled scans disagree" in text
    assert f"{name} by {found.atlas_distance:.1f} mm" in text
    assert found.as_json()["atlasDistance"] == pytest.approx(found.atlas_distance, abs=1e-3)


def test_a_guess_that_says_that_it_is_wide_does_not_disagree(guesses, atlas):
    assert disagreement_text(compare_with_atlas(moved(guesses, "CA_L", [0, 0, 1.5]), atlas))
    wide = moved(guesses, "CA_L", [0, 0, 1.5], radius_95=4.0)
    assert disagreement_text(compare_with_atlas(wide, atlas)) == ""


def test_a_mirrored_file_and_another_scheme_are_no_disagreement(guesses, atlas):
    mirrored = [replace(g, position=g.position * (-1, 1, 1)) for g in guesses]
    assert disagreement_text(compare_with_atlas(mirrored, atlas)) == ""
    own = [replace(g, name=f"own {g.name}") for g in moved(guesses, "CA_L", [0, 0, 9.0])]
    assert disagreement_text(compare_with_atlas(own, atlas)) == ""
    few = guesses[:3]
    assert disagreement_text(compare_with_atlas(moved(few, few[0].name, [0, 0, 5.0]), atlas)) == ""
