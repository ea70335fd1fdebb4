"""What the tests of the tracker share: a simulator in another process, and samples made by hand."""

from __future__ import annotations

import contextlib
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from gp_labeler.tracker import Fault, RecordedTouch, Sample, TouchRecorder, TrackerLink
from gp_labeler.tracker.messages import TrackerMessage

DEADLINE = 120.0
"""Seconds: only a failure waits that long."""

TIP = (5.0, -3.0, -120.0)
POINTS = {"RWA": (10.0, 4.0, -3.0), "OS": (13.5, 6.0, 1.0), "MN": (4.0, 22.0, 9.0), "CL": (8.0, 9.0, -8.0)}


def until(true: Callable[[], bool], step: Callable[[], object] = lambda: None, what: str = "") -> None:
    """Step until something is true."""
    end = time.monotonic() + DEADLINE
    while not true():
        assert time.monotonic() < end, f"it never came true: {what or true}"
        step()
        time.sleep(0.004)


class SimulatorProcess:
    """The simulator, told what to do through its input."""

    def __init__(self, folder: Path, *options: str) -> None:
        touches = folder / "touches.csv"
        rows = [f"{name},{x},{y},{z}" for name, (x, y, z) in POINTS.items()]
        touches.write_text("\n".join(["name,x,y,z", *rows]) + "\n", encoding="utf-8")
        command = [sys.executable, "-m", "gp_labeler", "simulate-tracker", "--port", "0", "--live"]
        tip = ["--tip", *map(str, TIP)]
        self._process = subprocess.Popen(
            [*command, "--touches", str(touches), *tip, *options],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            bufsize=1,
        )
        self._lines: queue.Queue[str] = queue.Queue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        self._port = 0

    @property
    def port(self) -> int:
        if not self._port:
            self._port = int(self.wait("listening").rsplit(":", 1)[1])
        return self._port

    def _read(self) -> None:
        with contextlib.suppress(ValueError):
            for line in self._process.stdout or ():
                self._lines.put(line.strip())
            self._lines.put("error: the simulator has ended")

    def wait(self, beginning: str) -> str:
        """Return the next line that begins so."""
        end = time.monotonic() + DEADLINE
        while True:
            line = self._lines.get(timeout=max(end - time.monotonic(), 0.01))
            assert not line.startswith("error"), line
            if line.startswith(beginning):
                return line

    def tell(self, command: str) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(command + "\n")
        self._process.stdin.flush()

    def do(self, command: str) -> None:
        """Tell it, and wait until it is done."""
        assert self.port
        self.tell(command)
        self.wait(f"done {command}")

    def close(self) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with contextlib.suppress(OSError):
            self._process.stdin.close()
        try:
            self._process.wait(timeout=DEADLINE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._reader.join(timeout=DEADLINE)
        self._process.stdout.close()


class Bench:
    """A link, and a recorder that takes what it delivers."""

    def __init__(self, link: TrackerLink, recorder: TouchRecorder) -> None:
        self.link, self.recorder = link, recorder
        self.samples: list[Sample] = []
        self.outcomes: list[object] = []

    def step(self) -> None:
        samples = self.link.poll()
        self.samples += samples
        self.outcomes += self.recorder.update(samples)

    @property
    def touches(self) -> list[RecordedTouch]:
        return [o for o in self.outcomes if isinstance(o, RecordedTouch)]

    def until(self, true: Callable[[], bool], what: str = "") -> None:
        until(true, self.step, what)

    def wait_until_idle(self) -> None:
        """Wait for some good samples in a row."""
        self.samples.clear()
        self.until(lambda: sum(s.usable for s in self.samples[-5:]) == 5, "good samples")

    def press(self) -> object:
        """Press, and return what comes of it."""
        self.outcomes.clear()
        self.recorder.press()
        self.until(lambda: bool(self.outcomes), "an outcome")
        return self.outcomes[-1]

    def touch(self) -> RecordedTouch:
        """Press until a touch is recorded: a busy machine may hold messages up."""
        outcome = self.press()
        end = time.monotonic() + DEADLINE
        while not isinstance(outcome, RecordedTouch):
            assert time.monotonic() < end, outcome
            outcome = self.press()
        return outcome

    def seen(self, fault: Fault) -> list[Sample]:
        return [s for s in self.samples if s.fault is fault]


def pose(x: float = 0.0, y: float = 0.0, z: float = 0.0, *, turn: float = 0.3) -> np.ndarray:
    """A rigid matrix: turned about z, radians, and moved, mm."""
    matrix = np.eye(4)
    matrix[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    matrix[:3, 3] = x, y, z
    return matrix


def message(matrix: np.ndarray, time: float, received: float | None = None, **more: object) -> TrackerMessage:
    given = {"device": "ProbeToTracker", "kind": "TRANSFORM", **more}
    return TrackerMessage(time=time, received=time if received is None else received, matrix=matrix, **given)


def sample(x: float, time: float, fault: Fault = Fault.NONE, detail: str = "") -> Sample:
    return Sample(time, time, pose(x, 2.0, 3.0), fault, detail)
