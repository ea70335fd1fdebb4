"""Numbers as people read them."""

from __future__ import annotations

import math

import pytest

from gp_core.landmarks.suggestion import Suggestion
from gp_labeler.views.formatting import degrees_text, mm_text, number_text, suggestion_text
from gp_labeler.views.panels.pose.wording import triple


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [(-0.004, 2, "0.00"), (-0.0, 1, "0.0"), (-0.006, 2, "\N{MINUS SIGN}0.01"), (12.345, 1, "12.3")],
)
def test_a_zero_has_no_sign_and_a_minus_is_a_true_one(value, digits, text) -> None:
    assert number_text(value, digits) == text


@pytest.mark.parametrize(
    ("value", "text"), [(-0.04, "0.0"), (0.0, "0.0"), (0.06, "+0.1"), (-0.8, "\N{MINUS SIGN}0.8")]
)
def test_the_place_of_a_slice_has_a_sign_unless_it_is_zero(value, text) -> None:
    assert number_text(value, 1, signed=True) == text


def test_lengths_angles_and_positions_write_their_numbers_so() -> None:
    assert mm_text(-1e-5) == "0.000 mm"
    assert degrees_text(math.radians(-0.01)) == "0.0°"
    assert triple((-0.001, -2, 3)) == "0.00   \N{MINUS SIGN}2.00   3.00"


@pytest.mark.parametrize(
    ("suggestion", "text"),
    [
        (Suggestion((1, 2, 3)), ""),
        (Suggestion((1, 2, 3), 0.86, "atlas"), "atlas, 95 % within 0.86 mm"),
        (
            Suggestion((1, 2, 3), 0.4, "5 labelled scans", 1.25),
            "5 labelled scans, 95 % within 0.40 mm, the atlas expects it 1.2 mm away",
        ),
    ],
)
def test_a_suggestion_says_who_suggests_it_and_who_contradicts_it(suggestion, text) -> None:
    assert suggestion_text(suggestion) == text
