"""A ghost is as sure as it says, though users confirm what lies near it.

`benchmarks/suggestions.py` measures the same on 100 animals.
"""

from __future__ import annotations

from suggestion_users import measured, mirrored


def test_ghosts_keep_their_coverage_while_they_are_accepted_and_confirmed() -> None:
    found = measured(8, seed=5)
    assert found.n_confirmed > 40  # many were selected because they lay near
    assert 0.90 <= found.whole <= 0.99


def test_ghosts_mirrored_from_the_other_side_are_as_sure_as_they_say() -> None:
    found = mirrored(40, seed=5)
    assert set(found.by_stage) == {1, 2}
    assert 0.90 <= found.whole <= 0.99
