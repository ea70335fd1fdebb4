"""Scan positions as people type them."""

from __future__ import annotations

import numpy as np
import pytest

from gp_core.errors import GpError
from gp_labeler.models.typed_position import typed_position


@pytest.mark.parametrize(
    "text",
    [
        "L 4.6 P 9.1 S 12.4",
        "l4.6p9.1s12.4 mm",
        "S 12.4, L 4.6, P 9.1",
        "R -4.6 A -9.1 I -12.4",
        "L 4,6  P 9,1  S 12,4",
        "4.6 9.1 12.4",
        " 4.6, 9.1, 12.4 mm",
        "4.6,9.1,12.4",
        "4,6 9,1 12,4",
        "4,6; 9,1; 12,4",
        "[4.6, 9.1, 12.4]",
        "+4.6 9.1 12.40",
    ],
)
def test_every_way_of_writing_it_is_the_same_place(text):
    assert np.allclose(typed_position(text), [4.6, 9.1, 12.4])


@pytest.mark.parametrize(
    "text",
    [
        "",
        "4.6 9.1",
        "1 2 3 4",
        "L 4.6 R 9.1 S 12.4",
        "L 4.6 P 9.1",
        "X 1 P 2 S 3",
        "nan 1 2",
        "inf 1 2",
        "a b c",
    ],
)
def test_anything_else_is_refused(text):
    with pytest.raises(GpError, match="is not a position"):
        typed_position(text)
