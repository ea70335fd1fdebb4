"""The clock of a tracker against that of this computer: which messages are late, when it was set."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gp_labeler.tracker.samples import Fault

__all__ = ["DeviceClock"]

_DRIFT = 1e-3
"""How fast two clocks may run apart, seconds a second."""

_AHEAD_S = 0.5
"""A message that seems to have taken that much less than the quickest has a time stamp that is wrong."""

_ADOPT_S = 1.5
"""How long time stamps must agree with each other before they are taken for a clock that was set again."""

_AGREE_S = 0.05


@dataclass
class _Run:
    """Messages in a row whose time stamps disagree with the clock so far."""

    first_time: float
    first_received: float
    last_time: float
    quickest: float

    def goes_on(self, time: float, received: float) -> bool:
        """Whether another message fits: later, and by as much as this computer's clock says."""
        steady = abs((time - self.first_time) - (received - self.first_received)) <= _AGREE_S
        return steady and time > self.last_time


class DeviceClock:
    """Checks the time stamps of one device.

    The two clocks need not agree: only how long messages *seem* to take is compared with the quickest of
    them. A clock that is set back or forward is noticed, and adopted once its time stamps have been steady
    for 1.5 s; a single damaged time stamp changes nothing.

    Parameters
    ----------
    late_s : float
        How much longer than the quickest a message may take.
    """

    def __init__(self, late_s: float) -> None:
        self.late_s = late_s
        self.changes = 0
        """How often a clock that was set again has been adopted."""
        self._quickest = np.inf
        self._time = -np.inf
        self._received = -np.inf
        self._run: _Run | None = None

    def check(self, time: float, received: float) -> tuple[Fault, str]:
        """Return the fault of a time stamp, and that in words.

        Parameters
        ----------
        time, received : float
            The sender's time stamp and this computer's monotonic clock, seconds.
        """
        if time == self._time:
            return Fault.REPEATED, "a message with the same time stamp arrived before"
        if np.isfinite(self._received):
            self._quickest += _DRIFT * max(received - self._received, 0.0)
        self._received = received
        excess = 0.0 if np.isinf(self._quickest) else (received - time) - self._quickest
        if -_AHEAD_S <= excess <= self.late_s:
            return self._in_time(time, received)
        if self._adopted(time, received):
            return Fault.NONE, ""
        return self._words(time, excess)

    def _in_time(self, time: float, received: float) -> tuple[Fault, str]:
        self._run = None
        if time < self._time:
            return Fault.BACKWARDS, f"it is {self._time - time:.3f} s older than an earlier one"
        self._time = time
        self._quickest = min(self._quickest, received - time)
        return Fault.NONE, ""

    def _adopted(self, time: float, received: float) -> bool:
        """Whether the clock was set again: its new time stamps have been steady for long enough."""
        run = self._run
        if run is None or not run.goes_on(time, received):
            self._run = _Run(time, received, time, received - time)
            return False
        run.last_time, run.quickest = time, min(run.quickest, received - time)
        if received - run.first_received < _ADOPT_S:
            return False
        self._quickest, self._time, self._run = run.quickest, time, None
        self.changes += 1
        return True

    def _words(self, time: float, excess: float) -> tuple[Fault, str]:
        if excess < 0:
            return Fault.CLOCK, f"the tracker's clock is {-excess:.1f} s ahead of its earlier time"
        if time < self._time and self._run is not None and self._run.last_time > self._run.first_time:
            return Fault.CLOCK, f"the tracker's clock is {excess:.1f} s behind its earlier time"
        if time < self._time:
            return Fault.BACKWARDS, f"it is {self._time - time:.3f} s older than an earlier one"
        return Fault.LATE, f"it arrived {excess:.2f} s late"
