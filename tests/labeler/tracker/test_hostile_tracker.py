"""What a tracker that fails in every way gets recorded; the long run is in tools/gate-long."""

from __future__ import annotations

import numpy as np
import pytest
from hostile_tracker import Session, run

from gp_labeler.tracker import RecordedTouch


def test_a_tracker_that_fails_records_next_to_nothing_wrong_without_saying_so() -> None:
    tally = run(120, seed=5)
    assert len(tally.made) >= 40
    assert len(tally.silent) <= 1, str(tally)


def test_a_tracker_that_does_not_fail_records_every_touch_without_a_warning() -> None:
    session = Session(np.random.default_rng(1), every_s=1e9)
    for _ in range(10):
        outcome, truth = session.touch(session.rng.uniform(-20, 20, 3))
        assert isinstance(outcome, RecordedTouch)
        assert outcome.segment == 0
        assert np.linalg.norm(outcome.position - truth) < 0.3


@pytest.mark.parametrize("kind", ["jump", "stray"])
def test_forty_millimetres_for_a_second_and_back_are_not_recorded(kind) -> None:
    """The jump begins and ends while the tip is at rest; the press comes in the middle of it."""
    session = Session(np.random.default_rng(2), every_s=1e9)
    session.touch(np.zeros(3))
    session.begin(kind, ("Probe",), seconds=1.2, shift=np.array([40.0, 0, 0]))
    for _ in range(int(0.3 * session.hertz)):
        session.step()
    outcome, _ = session.press()
    assert not isinstance(outcome, RecordedTouch)
