"""With few points an estimate says what it cannot tell."""

from __future__ import annotations

import numpy as np
import pytest
from atlas_cases import draw_side

from gp_core import Atlas, CochleaPose, estimate_pose

ORDER = ("OS", "CL", "MN", "RWA", "LLI", "RWP")


def _pose(n: int, *, wrong: float = 0.0) -> CochleaPose:
    touches = draw_side(Atlas.published(), np.random.default_rng(1)).as_mapping(ORDER[:n])
    touches["MN"] = touches["MN"] + wrong
    return estimate_pose(touches, "L")


def _said(pose: CochleaPose) -> list[str]:
    return [warning for warning in pose.warnings if warning.startswith("only ")]


@pytest.mark.parametrize("n", [3, 4])
def test_up_to_four_points_a_mistouch_cannot_be_detected(n: int) -> None:
    assert _said(_pose(n)) == [f"only {n} points: a mistouch cannot be distinguished from an unusual animal"]


@pytest.mark.parametrize("n", [5, 6])
def test_from_five_points_on_it_can(n: int) -> None:
    assert _said(_pose(n)) == []


def test_a_suspect_says_enough() -> None:
    pose = _pose(4, wrong=6.0)
    assert pose.suspects
    assert _said(pose) == []
    assert any("not fit" in warning for warning in pose.warnings)
