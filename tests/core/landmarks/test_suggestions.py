"""Laws of suggested landmarks: whatever means "observation" leaves them out, until a person confirms them."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from gp_core.atlas.atlas import Atlas
from gp_core.atlas.prediction import predict
from gp_core.errors import FeatureError, GpError
from gp_core.frames import RigidTransform
from gp_core.landmarks.anatomy import with_cochlea_origin
from gp_core.landmarks.features import FEATURES, Side
from gp_core.landmarks.sets import LandmarkSet, Status
from gp_core.landmarks.suggestion import Suggestion

PLACED = ("CA", "OS", "RWP")


def _labelled(codes: tuple[str, ...] = PLACED) -> LandmarkSet:
    atlas = Atlas.published()
    return LandmarkSet.from_mapping({code: atlas[code] for code in codes}, "L")


def _with_suggestions(landmarks: LandmarkSet) -> LandmarkSet:
    """Suggest, a millimetre from the truth, every feature that is to do."""
    atlas = Atlas.published()
    codes = [f.code for f in FEATURES if not f.computed and f.code not in landmarks]
    return landmarks.with_suggestions({c: Suggestion(atlas[c] + 0.6, 0.9, "atlas") for c in codes})


def test_no_accessor_that_means_observation_sees_a_suggestion() -> None:
    alone, crowded = _labelled(), _with_suggestions(_labelled())
    assert len(crowded.suggested) == 16
    np.testing.assert_array_equal(crowded.points, alone.points)
    assert crowded.placed == crowded.keys() == tuple(crowded) == PLACED
    assert crowded.as_mapping().keys() == set(PLACED)
    assert "RWA" not in crowded
    assert np.isnan(crowded["RWA"]).all()
    with pytest.raises(FeatureError, match=r"has no RWA, it is only suggested\. Confirm it"):
        crowded.array(["RWA"])
    assert "CO" not in with_cochlea_origin(crowded)


def test_suggestions_change_no_prediction() -> None:
    alone = predict(Atlas.published(), _labelled())
    crowded = predict(Atlas.published(), _with_suggestions(_labelled()))
    for code, (mean, covariance) in alone.items():
        np.testing.assert_array_equal(crowded[code][0], mean)
        np.testing.assert_array_equal(crowded[code][1], covariance)


def test_a_person_decides_over_a_suggestion() -> None:
    suggested = LandmarkSet.empty("L").with_suggestions({"oS": Suggestion((1, 2, 3))})
    assert suggested.status("OS") is Status.SUGGESTED
    assert suggested.with_unseen("OS").status("OS") is Status.UNSEEN
    assert suggested.with_point("OS", None).status("OS") is Status.TO_DO
    placed = suggested.with_point("OS", (4, 5, 6))
    assert placed.status("OS") is Status.PLACED
    assert not placed.suggested
    assert not placed.with_suggestions({"OS": Suggestion((1, 2, 3))}).suggested
    assert not suggested.with_unseen("OS").with_suggestions({"OS": Suggestion((1, 2, 3))}).suggested
    assert suggested.with_point("CA", (4, 5, 6)).status("OS") is Status.SUGGESTED


def test_only_a_suggestion_can_be_confirmed() -> None:
    landmarks = _with_suggestions(_labelled())
    confirmed = landmarks.confirmed(["RWA", "in"])
    assert set(confirmed.placed) == {*PLACED, "RWA", "IN"}
    np.testing.assert_array_equal(confirmed["RWA"], landmarks.suggested["RWA"].position)
    assert "RWA" not in confirmed.suggested
    with pytest.raises(FeatureError, match="landmark CA: the left side has no suggestion for CA"):
        landmarks.confirmed(["RWM", "CA"])


def test_suggestions_move_with_their_frame_and_travel_to_other_processes() -> None:
    T_scan_tracker = RigidTransform.from_parts(np.eye(3), (1, 0, 0), dst="scan", src="tracker")
    touched = LandmarkSet.empty("R", frame="tracker").with_suggestions(
        {"OS": Suggestion((0, 0, 1), 0.5, "x")}
    )
    moved = pickle.loads(pickle.dumps(touched.moved(T_scan_tracker)))
    assert moved.side is Side.RIGHT
    assert dict(moved.suggested) == {"OS": Suggestion((1, 0, 1), 0.5, "x")}


def test_what_is_computed_is_never_suggested() -> None:
    with pytest.raises(FeatureError, match="CO is computed"):
        LandmarkSet.empty("L").with_suggestions({"CO": Suggestion((1, 2, 3))})


@pytest.mark.parametrize("position", [(1, 2), (1, 2, np.nan), "abc", None])
def test_a_suggestion_is_somewhere(position: object) -> None:
    with pytest.raises(GpError, match="three finite numbers"):
        Suggestion(position)  # type: ignore[arg-type]


@pytest.mark.parametrize("radius", [0.0, -1.0, np.nan, np.inf, "wide"])
def test_a_radius_is_a_positive_number(radius: object) -> None:
    with pytest.raises(GpError, match="95 % radius"):
        Suggestion((1, 2, 3), radius)  # type: ignore[arg-type]
    with pytest.raises(GpError, match="distance from the atlas"):
        Suggestion((1, 2, 3), atlas_distance=radius)  # type: ignore[arg-type]


def test_the_uncertainty_is_the_radius_or_the_distance_from_the_atlas() -> None:
    """Where no radius is known, all are uncertain, and first those with which the atlas disagrees."""
    told = {"radius": (0.4, None), "atlas": (0.3, 1.2), "wide": (2.0, 1.0), "none": (None, None)}
    told |= {"none, atlas": (None, 1.0)}
    suggestions = {name: Suggestion((1, 2, 3), r, "x", away) for name, (r, away) in told.items()}
    order = sorted(suggestions, key=lambda name: suggestions[name].uncertainty, reverse=True)
    assert order == ["none, atlas", "none", "wide", "atlas", "radius"]
