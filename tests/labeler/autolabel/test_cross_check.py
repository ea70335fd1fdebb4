"""A library is compared with itself: planted mistakes are found, and sound labels are left alone."""

from dataclasses import replace

import numpy as np
import pytest

from gp_labeler.autolabel import LabelledScan
from gp_labeler.autolabel.cross_check import check_predictions
from gp_labeler.autolabel.prediction import Prediction
from gp_labeler.imaging.volume import Volume

SCAN = Volume.from_parts(np.zeros((2, 2, 2), np.int16), [1.0] * 3)
NAMES = tuple(f"{code}_{side}" for side in "LR" for code in ("CA", "CB", "OI", "OS", "RWA", "RWP", "MN"))


def library(n=6, noise=0.15):
    """Return labelled heads whose predictions are off by the noise, and these predictions."""
    rng = np.random.default_rng(5)
    mean = {name: rng.uniform(-8, 8, 3) for name in NAMES}
    scans, predictions = [], {}
    for number in range(n):
        points = {name: xyz + rng.normal(0, 1.0, 3) for name, xyz in mean.items()}
        scans.append(LabelledScan(f"GP{number}", points, volume=SCAN))
        carried = {
            f"from {k}": {name: xyz + rng.normal(0, noise, 3) for name, xyz in points.items()}
            for k in range(4)
        }
        predictions[f"GP{number}"] = Prediction(carried, None)
    return scans, predictions


def with_labels(scans, **moved):
    """Return the library with other labels in the head GP2."""
    scans = list(scans)
    scans[2] = replace(scans[2], points={**scans[2].points, **moved})
    return scans


def test_sound_labels_are_left_alone():
    check = check_predictions(*library())
    assert check.findings == ()
    assert len(check.checked) == 6


def test_any_two_exchanged_labels_are_found():
    scans, predictions = library()
    points = scans[2].points
    for n, a in enumerate(NAMES):
        b = NAMES[(n + 3) % len(NAMES)]
        check = check_predictions(with_labels(scans, **{a: points[b], b: points[a]}), predictions)
        (found,) = check.findings
        assert found.kind == "exchanged"
        assert set(found.names) == {a, b}
        assert f"{found.names[0]} and {found.names[1]} seem to be exchanged" in found.text


def test_a_label_far_off_is_named_with_its_distance():
    scans, predictions = library()
    check = check_predictions(
        with_labels(scans, MN_L=scans[2].points["MN_L"] + np.array([0, 0, 2.0])), predictions
    )
    (found,) = check.findings
    assert (found.kind, found.names, found.specimen) == ("far", ("MN_L",), "GP2")
    assert abs(found.distance - 2.0) < 0.4


def test_exchanged_sides_and_another_animal_are_one_finding_each():
    scans, predictions = library()
    points = scans[2].points
    other = {name: points[f"{name[:-1]}{'R' if name[-1] == 'L' else 'L'}"] for name in NAMES}
    (found,) = check_predictions(with_labels(scans, **other), predictions).findings
    assert found.kind == "sides exchanged"
    strange = {name: xyz + np.array([4.0, 3.0, 0.0]) for name, xyz in points.items()}
    (found,) = check_predictions(with_labels(scans, **strange), predictions).findings
    assert found.kind == "other scan"
    assert found.as_json()["specimen"] == "GP2"


@pytest.mark.filterwarnings("error")
def test_labels_that_equal_their_predictions_agree_and_one_that_does_not_is_still_named():
    scans, predictions = library(noise=0.0)
    assert check_predictions(scans, predictions).findings == ()
    moved = {"MN_L": scans[2].points["MN_L"] + np.array([0, 0, 2.0])}
    (found,) = check_predictions(with_labels(scans, **moved), predictions).findings
    assert (found.kind, found.names) == ("far", ("MN_L",))
    tiny = {"MN_L": scans[2].points["MN_L"] + np.array([0, 0, 0.05])}
    assert check_predictions(with_labels(scans, **tiny), predictions).findings == ()


def test_a_head_that_was_not_found_is_not_checked():
    scans, predictions = library()
    del predictions["GP0"]
    check = check_predictions(scans, predictions)
    assert check.unchecked == ("GP0",)
    assert check.of("GP1") == ()
