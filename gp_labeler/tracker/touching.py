"""Touches out of samples: by a press, or by holding still; averaged with their spread, or refused and why."""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from itertools import pairwise

import numpy as np

from gp_core.errors import GpError
from gp_core.validation import FloatArray
from gp_labeler.tracker.probe import Probe
from gp_labeler.tracker.samples import Fault, Sample

__all__ = ["RecordedTouch", "RefusedTouch", "TouchRecorder", "TouchSettings"]

NO_ORIENTATION = (
    "The tracker reports the position of the marker without its orientation: set the tip to 0, 0, 0 if this "
    "is the tip, or let the server send TRANSFORM"
)
"""What is told of a probe with a tip offset whose messages have no orientation."""

_SECONDS_BETWEEN_LOOKS = 0.015
_INITIAL_SHARE = 0.2
"""The part of the window, at its beginning, in which a tip that comes to rest is not averaged yet."""

_SPOILING = (Fault.JUMP, Fault.FROZEN)
"""Faults that make the samples before them doubtful too: what is frozen is known only after a while."""

_SECONDS_OF_GRACE = 0.3
"""How much longer than its window a press waits for samples."""


@dataclass(frozen=True)
class TouchSettings:
    """What a touch must be like.

    Parameters
    ----------
    window_s : float
        How long the tip must be still; its samples are averaged.
    radius_mm : float
        How far from their average samples may lie.
    drift_mm : float
        How far the tip may wander from the beginning of the window to its end.
    away_mm : float
        How far the tip must move before holding still records again.
    min_samples : int
        The fewest samples of a touch.
    max_gap_s : float
        The longest time without a usable sample.
    good_share : float
        The least share of the readings that must be good and near the others.

    Raises
    ------
    GpError
        A value that is not positive.
    """

    window_s: float = 0.5
    radius_mm: float = 1.0
    drift_mm: float = 0.5
    away_mm: float = 5.0
    min_samples: int = 8
    max_gap_s: float = 0.15
    good_share: float = 0.8

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value > 0):
                raise GpError(f"{name} of a touch must be above 0, got {value!r}")


@dataclass(frozen=True, eq=False)
class RecordedTouch:
    """A touch.

    Parameters
    ----------
    position : (3,) array
        Average of the tip, mm, in the samples' frame.
    spread_mm : float
        Root mean square distance of the averaged samples from it.
    n_samples : int
        How many were averaged; strays are not.
    duration_s : float
        From the first to the last sample.
    time : str
        When it ended, ISO 8601, UTC.
    segment : int
        Counts the jumps that the marker had not taken back: touches of different segments may be in frames
        that differ.
    """

    position: FloatArray
    spread_mm: float
    n_samples: int
    duration_s: float
    time: str
    segment: int = 0


@dataclass(frozen=True)
class RefusedTouch:
    """A press that recorded nothing.

    Parameters
    ----------
    reason : str
        Why, and what to do, for a person.
    fault : Fault
        What was wrong with most samples; `Fault.NONE` where the tip moved or messages were too few.
    """

    reason: str
    fault: Fault = Fault.NONE


class TouchRecorder:
    """Makes touches of samples.

    A press begins a window: the samples of the next half second are the touch. With `dwell`, holding still
    that long records too, once, until the tip has moved away.

    Parameters
    ----------
    probe : Probe
        Where the tip is.
    settings : TouchSettings
    dwell : bool
        Whether holding still records.
    clock : callable
        This computer's monotonic clock, which `Sample.received` tells.
    """

    def __init__(
        self,
        probe: Probe,
        settings: TouchSettings | None = None,
        *,
        dwell: bool = False,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.probe = probe
        self.settings = settings or TouchSettings()
        self.dwell = dwell
        self._clock = clock
        self._recent: deque[Sample] = deque(maxlen=5000)
        self._pressed_at: float | None = None
        self._touched: FloatArray | None = None
        self._looked = -np.inf
        self.progress = 0.0
        """How much of the window has passed while the tip is still, 0 to 1; for showing."""

    @property
    def recording(self) -> bool:
        """Whether a press is being recorded."""
        return self._pressed_at is not None

    @property
    def armed(self) -> bool:
        """Whether holding still would record: not again where it has just recorded."""
        return self.dwell and self._touched is None

    def press(self) -> None:
        """Record the tip from now on; it should be still. A press during a recording begins it again."""
        self._pressed_at = self._clock()
        self.progress = 0.0

    def cancel(self) -> None:
        """Forget a press and what has been received so far."""
        self._pressed_at = None
        self._recent.clear()
        self.progress = 0.0

    def update(self, samples: Iterable[Sample] = ()) -> list[RecordedTouch | RefusedTouch]:
        """Take samples, and return what they have completed; call it also where none have come.

        Returns
        -------
        list of RecordedTouch or RefusedTouch
            Mostly empty. Only a press can be refused: holding still begins again instead.
        """
        done: list[RecordedTouch | RefusedTouch] = []
        for sample in samples:
            self._recent.append(sample)
            self._rearm(sample)
            outcome = self._after(sample)
            if outcome is not None:
                done.append(outcome)
        overdue = self._overdue()
        if overdue is not None:
            done.append(overdue)
        return done

    def _after(self, sample: Sample) -> RecordedTouch | RefusedTouch | None:
        if self._pressed_at is not None:
            self.progress = min(max(sample.received - self._pressed_at, 0.0) / self.settings.window_s, 1.0)
            return self._close_press() if self.progress >= 1.0 else None
        if self.armed and sample.received - self._looked >= _SECONDS_BETWEEN_LOOKS:
            self._looked = sample.received
            return self._dwell(sample)
        return None

    def _close_press(self) -> RecordedTouch | RefusedTouch:
        begun = self._pressed_at if self._pressed_at is not None else -np.inf
        window = [s for s in self._recent if begun <= s.received]
        self._pressed_at = None
        self.progress = 0.0
        return self._finish(self._average(window))

    def _overdue(self) -> RecordedTouch | RefusedTouch | None:
        """End a press that waits for samples which do not come."""
        if self._pressed_at is None:
            return None
        late = self._clock() - self._pressed_at > self.settings.window_s + _SECONDS_OF_GRACE
        return self._close_press() if late else None

    def _dwell(self, sample: Sample) -> RecordedTouch | None:
        window = self._still_since(sample)
        self.progress = min(_seconds(window) / self.settings.window_s, 1.0)
        if self.progress < 1.0:
            return None
        at_rest = window[0].time + _INITIAL_SHARE * self.settings.window_s
        outcome = self._average([s for s in window if s.time >= at_rest])
        if isinstance(outcome, RefusedTouch):
            return None
        self._finish(outcome)
        return outcome

    def _still_since(self, sample: Sample) -> list[Sample]:
        """Return the latest samples, back to one window, up to where the tip was elsewhere or in doubt."""
        tip = self.probe.tip(sample)
        if not sample.usable or tip is None:
            return []
        window = [sample]
        for earlier in reversed(self._recent):
            since = window[-1].time - earlier.time  # below 0 where the tracker came back with another clock
            if not 0 <= since <= self.settings.max_gap_s or earlier.fault in _SPOILING:
                break
            there = self.probe.tip(earlier) if earlier.usable else None
            if there is None or earlier is sample:
                continue
            if np.linalg.norm(there - tip) > 2 * self.settings.radius_mm:
                break
            window.append(earlier)
            if _seconds(window[::-1]) >= self.settings.window_s:
                break
        return window[::-1]

    def _rearm(self, sample: Sample) -> None:
        tip = self.probe.tip(sample)
        if self._touched is None or tip is None or not sample.usable:
            return
        if np.linalg.norm(tip - self._touched) > self.settings.away_mm:
            self._touched = None

    def _finish(self, outcome: RecordedTouch | RefusedTouch) -> RecordedTouch | RefusedTouch:
        if isinstance(outcome, RecordedTouch):
            self._touched = outcome.position
            self._recent.clear()
            self.progress = 0.0
        return outcome

    def _average(self, window: Sequence[Sample]) -> RecordedTouch | RefusedTouch:
        """Average a window of samples, or say why not."""
        usable = [s for s in window if s.usable]
        if any(map(self.probe.lacks_orientation, usable)):
            return RefusedTouch(f"{NO_ORIENTATION}.")
        refusal = self._too_little(window, usable)
        if refusal is not None:
            return refusal
        tips = np.array([self.probe.tip(s) for s in usable])
        position, kept = _robust_mean(tips)
        if kept.mean() < self.settings.good_share:
            strays = f"{len(kept) - kept.sum()} of {len(kept)} readings are outliers"
            return RefusedTouch(f"{strays}. Touch again.")
        distances = np.linalg.norm(tips[kept] - position, axis=1)
        third = len(tips) // 3 + 1
        drift = float(np.linalg.norm(np.median(tips[-third:], axis=0) - np.median(tips[:third], axis=0)))
        limits = ((float(distances.max()), self.settings.radius_mm), (drift, self.settings.drift_mm))
        for moved, allowed in limits:
            if moved > allowed:
                return RefusedTouch(
                    f"The tip moved by {moved:.1f} mm ({allowed:g} is allowed). Hold it still."
                )
        spread = float(np.sqrt(np.mean(distances**2)))
        seconds = usable[-1].time - usable[0].time
        return RecordedTouch(position, spread, int(kept.sum()), seconds, _utc_now(), usable[-1].segment)

    def _too_little(self, window: Sequence[Sample], usable: Sequence[Sample]) -> RefusedTouch | None:
        faults = Counter(s.fault for s in window if not s.usable)
        for fault in _SPOILING:
            if faults[fault]:
                return RefusedTouch(f"{_detail(window, fault)} Touch again.", fault)
        settings = self.settings
        lacking = settings.window_s - _seconds(usable)
        gap = max([lacking / 2, *(b.time - a.time for a, b in pairwise(usable))])
        enough = len(usable) >= max(settings.min_samples, settings.good_share * len(window))
        if gap <= settings.max_gap_s and enough:
            return None
        if faults:
            fault = faults.most_common(1)[0][0]
            return RefusedTouch(f"{_detail(window, fault)} Touch again.", fault)
        if not usable:
            return RefusedTouch(
                "No message of the marker arrived. Check that it is visible and the tracker connected."
            )
        if gap > settings.max_gap_s:
            return RefusedTouch(f"No reading arrived for {gap:.2f} s. Touch again.")
        few = f"Only {len(usable)} readings arrived in {settings.window_s:g} s"
        return RefusedTouch(f"{few}, {settings.min_samples} are needed. Touch again.")


def _seconds(window: Sequence[Sample]) -> float:
    """How long samples took, by both clocks: what was held up and comes all at once took no time."""
    if not window:
        return 0.0
    first, last = window[0], window[-1]
    return min(last.time - first.time, last.received - first.received)


def _detail(window: Sequence[Sample], fault: Fault) -> str:
    detail = next(s.detail for s in window if s.fault is fault)
    return f"{detail[:1].upper()}{detail[1:]}."


def _robust_mean(points: FloatArray) -> tuple[FloatArray, np.ndarray[tuple[int, ...], np.dtype[np.bool_]]]:
    """Return the mean of (N, 3) points without strays, and which points it is of.

    A stray is farther from the median than three standard deviations, as the median distance tells them.
    """
    distances = np.linalg.norm(points - np.median(points, axis=0), axis=1)
    # the median distance of a normal cloud in 3D is 1.54 standard deviations of a coordinate
    kept = distances <= max(3 * np.sqrt(3) * float(np.median(distances)) / 1.54, 1e-9)
    mean: FloatArray = points[kept].mean(axis=0)
    return mean, kept


def _utc_now() -> str:
    return datetime.now(timezone.utc).isoformat(timespec="seconds")
