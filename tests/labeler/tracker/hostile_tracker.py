"""A tracker that fails in every way, on a simulated clock: what is recorded from it, and how wrong that is.

python tests/labeler/tracker/hostile_tracker.py --touches 10000
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, field

import numpy as np
import pyigtl

from gp_core.errors import GpError
from gp_labeler.tracker import Probe, RecordedTouch, TouchRecorder
from gp_labeler.tracker.messages import MessageDecoder
from gp_labeler.tracker.rigid import rotation_of
from gp_labeler.tracker.sample_filter import SampleFilter

TIP = np.array([5.0, -3.0, -120.0])
WRONG_MM = 1.0
MISHAPS = ("jump", "stray", "hide", "freeze", "damage", "clock", "late")
DEVICES = ("Probe", "Head")


@dataclass
class Mishap:
    kind: str
    devices: tuple[str, ...]
    begins: float
    ends: float
    shift: np.ndarray
    seconds: float


@dataclass
class Made:
    """A touch that was recorded: how wrong it is, and what was said of it at once and by the end."""

    hertz: float
    error_mm: float
    segment: int
    flagged_at_once: bool
    flagged: bool = False
    held_back: bool = False
    """Whether another touch of its session is doubtful, so that no pose is sent."""


@dataclass
class Tally:
    """What became of the touches that were tried."""

    tried: int = 0
    made: list[Made] = field(default_factory=list)

    @property
    def wrong(self) -> list[Made]:
        return [m for m in self.made if m.error_mm > WRONG_MM]

    @property
    def silent(self) -> list[Made]:
        """Wrong, and not called doubtful by the end of the session."""
        return [m for m in self.wrong if not (m.flagged_at_once or m.flagged)]

    def __str__(self) -> str:
        lines = [
            f"{self.tried} touches tried, {len(self.made)} recorded, "
            f"{sum(m.flagged_at_once for m in self.made)} of them called doubtful at once, "
            f"{sum(m.flagged_at_once or m.flagged for m in self.made)} by the end of the session",
            f"{len(self.wrong)} wrong by more than {WRONG_MM:g} mm: "
            f"{sum(m.flagged_at_once for m in self.wrong)} called doubtful at once, "
            f"{len(self.wrong) - len(self.silent)} by the end, {len(self.silent)} never",
        ]
        return "\n".join([*lines, *(self._silent_line(made) for made in self.silent)])

    @staticmethod
    def _silent_line(made: Made) -> str:
        sent = "no pose is sent: another touch is doubtful" if made.held_back else "a pose may be sent"
        return f"  never: {made.error_mm:.1f} mm at {made.hertz:g} Hz; {sent}"


class Session:
    """One probe, one head, one connection; a simulated second passes only where somebody steps it."""

    def __init__(self, rng: np.random.Generator, *, smallest_mm: float = 3.0, every_s: float = 2.0) -> None:
        self.rng = rng
        self.now = 0.0
        self.hertz = float(rng.choice([20, 30, 60, 100]))
        self.samples = SampleFilter("Probe", "Head")
        self.recorder = TouchRecorder(Probe(TIP), clock=lambda: self.now)
        self.decoder = MessageDecoder()
        self.outcomes: list[object] = []
        self.made: list[Made] = []
        self._smallest, self._every = smallest_mm, every_s
        self._mishaps: list[Mishap] = []
        self._next = rng.exponential(every_s)
        self._clock_shift = 0.0
        self._queue: list[tuple[float, bytes]] = []
        self._last: dict[str, np.ndarray] = {}
        self._tip, self._way = np.zeros(3), (np.zeros(3), np.zeros(3), 0.0, 1.0)
        self._sway = rng.uniform(0, 6, 6)
        self._tilt = rng.uniform(0, 6, 3)
        self._tremor = np.zeros(3)
        self.connections = 0

    # What is true

    def _head(self, at: float) -> np.ndarray:
        """T_tracker_head: sways by some mm, at most some 20 mm/s."""
        pose = np.eye(4)
        pose[:3, :3] = rotation_of(0.02 * np.sin(0.9 * at + self._sway[:3]))
        pose[:3, 3] = [100, 50, -900] + 12 * np.sin(1.2 * at + self._sway[3:])
        return pose

    def true_tip(self, at: float) -> np.ndarray:
        """(3,) in the head's frame."""
        start, end, begins, seconds = self._way
        s = np.clip((at - begins) / seconds, 0, 1)
        return start + (end - start) * (10 * s**3 - 15 * s**4 + 6 * s**5) + self._tremor

    def _probe(self, at: float) -> np.ndarray:
        """T_tracker_marker."""
        pose = np.eye(4)
        pose[:3, :3] = rotation_of(0.3 * np.sin(0.7 * at + self._tilt))
        pose[:3, 3] = self.true_tip(at) - pose[:3, :3] @ TIP
        return self._head(at) @ pose

    def go(self, place: np.ndarray, seconds: float) -> None:
        self._way = (self.true_tip(self.now), place, self.now, seconds)

    # What the tracker tells

    def step(self) -> None:
        self.now += 1 / self.hertz
        self._tremor = 0.9 * self._tremor + self.rng.normal(0, 0.03, 3)
        while self.now > self._next:
            self._begin_mishap()
        self._mishaps = [m for m in self._mishaps if m.ends >= self.now]
        for device in ("Head", "Probe"):
            true = self._head(self.now) if device == "Head" else self._probe(self.now)
            self._tell(device, true)
        self._deliver()

    def _begin_mishap(self) -> None:
        rng, begins = self.rng, self._next
        kind = str(rng.choice(MISHAPS))
        seconds = float(np.exp(rng.uniform(np.log(0.02), np.log(3.0))))
        direction = rng.standard_normal(3)
        mm = np.exp(rng.uniform(np.log(self._smallest), np.log(80.0)))
        which = DEVICES if rng.random() < 0.2 else (str(rng.choice(DEVICES)),)
        if kind == "clock":
            self._clock_shift += float(rng.choice([-1, 1]) * np.exp(rng.uniform(np.log(0.3), np.log(4000))))
        self.begin(kind, which, seconds, mm * direction / np.linalg.norm(direction), begins)
        self._next += rng.exponential(self._every)

    def begin(
        self, kind: str, devices: tuple[str, ...], seconds: float, shift: np.ndarray, at: float | None = None
    ) -> None:
        """Let something go wrong from now on, or from a moment."""
        begins = self.now if at is None else at
        self._mishaps.append(Mishap(kind, devices, begins, begins + seconds, shift, seconds))

    def _tell(self, device: str, true: np.ndarray) -> None:
        rng = self.rng
        pose = true.copy()
        pose[:3, 3] += rng.normal(0, 0.1, 3)
        pose[:3, :3] = rotation_of(rng.normal(0, 4e-4, 3)) @ pose[:3, :3]
        late, damage, status = 0.0, False, "OK"
        for mishap in (m for m in self._mishaps if device in m.devices):
            if mishap.kind == "jump" or (mishap.kind == "stray" and rng.random() < 0.5):
                pose[:3, 3] += mishap.shift
            elif mishap.kind == "hide":
                status = "MISSING"
            elif mishap.kind == "freeze":
                pose = self._last.get(device, pose)
            elif mishap.kind == "late":
                late = max(late, mishap.seconds)
            elif mishap.kind == "damage":
                damage = rng.random() < 0.5
        self._last[device] = pose
        message = pyigtl.TransformMessage(
            pose, device_name=device, timestamp=10_000 + self.now + self._clock_shift
        )
        message.header_version, message.metadata = 2, {"TransformStatus": status}
        data = bytearray(message.pack())
        if damage:
            place = int(rng.integers(2, len(data)))
            data[place] ^= 1 << int(rng.integers(8))
        self._queue.append((self.now + late, bytes(data)))

    def _deliver(self) -> None:
        due = [data for at, data in self._queue if at <= self.now]
        self._queue = [(at, data) for at, data in self._queue if at > self.now]
        try:
            messages = self.decoder.feed(b"".join(due), self.now)
        except GpError:
            self._connect_again()
            return
        samples = self.samples.take(messages, self.now)
        for sample in samples:
            for made in self.made:
                made.flagged |= sample.segment != made.segment
        self.outcomes += self.recorder.update(samples)

    def _connect_again(self) -> None:
        """As a `TrackerLink` does where the stream is damaged."""
        self.connections += 1
        for made in self.made:  # whether anything was moved meanwhile is not known
            made.flagged = True
        self.decoder = MessageDecoder()
        self.samples = SampleFilter("Probe", "Head")
        self.recorder.cancel()

    # A touch

    def touch(self, place: np.ndarray) -> tuple[object, np.ndarray]:
        """Go to a place, press there, and return what came of it and where the tip truly was."""
        self.go(place, self.rng.uniform(0.6, 1.2))
        arrives = self._way[2] + self._way[3]
        while self.now < arrives + 0.1:
            self.step()
        return self.press()

    def press(self) -> tuple[object, np.ndarray]:
        """Press, and return what came of it and where the tip truly was."""
        self.outcomes.clear()
        self.recorder.press()
        tips, connections = [], self.connections
        while not self.outcomes and connections == self.connections:
            self.step()
            tips.append(self.true_tip(self.now))
        return (self.outcomes or [None])[-1], np.mean(tips, axis=0)


def run(touches: int, seed: int = 0, *, smallest_mm: float = 3.0, per_session: int = 20) -> Tally:
    """Touch again and again; a session ends, and another begins, after some touches."""
    tally, rng = Tally(), np.random.default_rng(seed)
    while tally.tried < touches:
        session = Session(rng, smallest_mm=smallest_mm)
        for _ in range(min(per_session, touches - tally.tried)):
            outcome, truth = session.touch(rng.uniform(-20, 20, 3))
            tally.tried += 1
            if isinstance(outcome, RecordedTouch):
                error = float(np.linalg.norm(outcome.position - truth))
                session.made.append(Made(session.hertz, error, outcome.segment, outcome.segment != 0))
        doubtful = any(made.flagged or made.flagged_at_once for made in session.made)
        for made in session.made:
            made.held_back = doubtful
        tally.made += session.made
    return tally


def main() -> None:
    """Print the tally."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--touches", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--smallest", type=float, default=3.0, help="of the jumps, mm")
    given = parser.parse_args()
    sys.stdout.write(f"{run(given.touches, given.seed, smallest_mm=given.smallest)}\n")


if __name__ == "__main__":
    main()
