"""A tracker that is not there: a pyigtl server that serves a simulated probe and does what commands say."""

from __future__ import annotations

import heapq
import signal
import socket
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from queue import Empty, SimpleQueue
from typing import Any

import numpy as np
import pyigtl

from gp_core.errors import GpError
from gp_core.validation import FloatArray
from gp_labeler.system.openigtlink import DEFAULT_PORT
from gp_labeler.tracker.pose_bodies import PoseBody, ToolPose
from gp_labeler.tracker.simulated_probe import Reading, SimulatedProbe

__all__ = ["Simulator"]

_LONGEST_S, _FARTHEST_MM = 3600.0, 1000.0
"""What a command can ask for."""

_BAD = ("nan", "scale", "mirror", "repeat", "back")


class _Server(pyigtl.OpenIGTLinkServer):  # type: ignore[misc]
    """pyigtl's server, which notices that a client has gone, and keeps no old messages for the next."""

    def __init__(self, port: int) -> None:
        self._stopping = False
        self._gone = False
        super().__init__(port=port, local_server=True)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)  # it takes these for itself
        signal.signal(signal.SIGINT, signal.default_int_handler)

    @property
    def communication_thread_stop_requested(self) -> bool:
        """What ends the loop that serves one client."""
        return self._stopping or self._gone

    @communication_thread_stop_requested.setter
    def communication_thread_stop_requested(self, stop: bool) -> None:
        self._stopping = stop

    def finish_request(self, request: Any, client_address: Any) -> None:
        """Serve one client until it goes."""
        with self.lock_outgoing_messages:
            self.outgoing_messages.clear()
        self._gone = False
        super().finish_request(request, client_address)
        self._connected = False

    def _receive_message_from_socket(self, ssocket: socket.socket) -> bool:
        try:
            self._gone = not ssocket.recv(1, socket.MSG_PEEK)
        except TimeoutError:
            return False
        except OSError:
            self._gone = True
        return not self._gone and bool(super()._receive_message_from_socket(ssocket))

    def _send_queued_message_from_socket(self, ssocket: socket.socket) -> bool:
        try:
            return bool(super()._send_queued_message_from_socket(ssocket))
        except OSError:
            self._gone = True
            return False


class Simulator:
    """Serves a simulated probe, and does what commands say.

    Parameters
    ----------
    probe : SimulatedProbe
    port : int
        0 lets the system choose.
    names : mapping of str to str
        Device names of ``probe``, ``reference`` and ``button``.
    rate_hz : float
        Readings a second.
    hidden : {"status", "identity", "stop"}
        How a covered marker is told: PLUS does any of the three, by its settings and the client's version.
    kind : str
        Type of the messages of poses, one of `gp_labeler.system.openigtlink.POSE_KINDS`.
    say : callable
        Told what has been done, in one line.
    """

    def __init__(
        self,
        probe: SimulatedProbe,
        *,
        port: int = DEFAULT_PORT,
        names: Mapping[str, str] | None = None,
        rate_hz: float = 60.0,
        hidden: str = "status",
        kind: str = "TRANSFORM",
        say: Callable[[str], None] = lambda line: None,
    ) -> None:
        self.probe = probe
        self._names = {"probe": "ProbeToTracker", "reference": "ReferenceToTracker", "button": "Button"}
        self._names.update(names or {})
        self._period = 1.0 / rate_hz
        self._hidden, self._kind = hidden, kind
        self._say = say
        self._server: _Server | None = _Server(port)
        self.port: int = self._server.server_address[1]
        self._begun = time.monotonic()
        self._epoch = time.time()
        self._commands: list[str] = []
        self._busy_until = 0.0
        self._then: list[tuple[float, int, Callable[[], None]]] = []
        self._held: list[tuple[float, int, Any]] = []
        self._number = 0
        self._late = 0.0
        self._bad = ""
        self._stale_until = 0.0
        self._last: dict[str, Reading] = {}
        self.running = True

    @property
    def now(self) -> float:
        """Seconds since it began."""
        return time.monotonic() - self._begun

    def tell(self, command: str) -> None:
        """Do a command once those before it are done."""
        self._commands.append(command)

    def step(self) -> None:
        """Do what is due now, and send one reading."""
        while self._then and self._then[0][0] <= self.now:
            heapq.heappop(self._then)[2]()
        while self._commands and self.now >= self._busy_until and self.running:
            self._do(self._commands.pop(0))
        self._send_reading()

    def run(self, commands: SimpleQueue[str | None] | None = None, *, loop: Sequence[str] = ()) -> None:
        """Step until told to quit; `loop` is done again and again, None in the queue ends it."""
        due = time.monotonic()
        while self.running:
            if loop and not self._commands and self.now >= self._busy_until:
                self._commands = list(loop)
            if commands is not None:
                self._collect(commands)
            self.step()
            due = max(due + self._period, time.monotonic() - self._period)
            time.sleep(max(due - time.monotonic(), 0.0))

    def close(self) -> None:
        """Close the server."""
        self.running = False
        server, self._server = self._server, None
        if server is not None:
            server.stop()

    def _collect(self, commands: SimpleQueue[str | None]) -> None:
        try:
            while True:
                line = commands.get_nowait()
                if line is None:
                    self.running = False
                    return
                self.tell(line)
        except Empty:
            return

    def _do(self, line: str) -> None:
        words = line.split("#")[0].split()
        if not words:
            return
        action = getattr(self, f"_do_{words[0]}", None)
        try:
            if action is None:
                raise GpError(f"there is no command {words[0]!r}", remedy="See --help.")
            seconds = action(*words[1:]) or 0.0
        except (GpError, TypeError, ValueError) as error:
            self._say(f"error {line.strip()}: {error}")
            return
        self._busy_until = self.now + seconds
        self._later(seconds, lambda: self._say(f"done {line.strip()}"))

    def _do_go(self, name: str, seconds: str = "1") -> float:
        self.probe.go(name, _seconds(seconds), self.now)
        return _seconds(seconds)

    def _do_lift(self, mm: str = "30", seconds: str = "0.5") -> float:
        self.probe.lift(_millimetres(mm), _seconds(seconds), self.now)
        return _seconds(seconds)

    def _do_wait(self, seconds: str) -> float:
        return _seconds(seconds)

    def _do_turn(self, seconds: str = "") -> float:
        lasts = _seconds(seconds) if seconds else 0.0
        self.probe.turn(True)
        if seconds:
            self._later(lasts, self._do_still)
        return lasts

    def _do_still(self) -> None:
        self.probe.turn(False)

    def _do_hide(self, *which: str) -> None:
        self.probe.hidden |= set(which or ("probe",))

    def _do_show(self) -> None:
        self.probe.hidden.clear()

    def _do_jump(self, mm: str, seconds: str = "0") -> None:
        length, lasts = _millimetres(mm), _seconds(seconds)
        aside = self.probe.rng.standard_normal(3)
        self.probe.displaced = length * aside / np.linalg.norm(aside)
        self._later(max(lasts, 0.5 * self._period), self._stay)

    def _stay(self) -> None:
        self.probe.displaced = np.zeros(3)

    def _do_late(self, seconds: str) -> None:
        self._late = _seconds(seconds)

    def _do_bad(self, kind: str) -> None:
        if kind not in _BAD:
            raise GpError(f"bad must be one of {', '.join(_BAD)}, got {kind}")
        self._bad = kind

    def _do_stale(self, seconds: str = "1") -> None:
        self._stale_until = self.now + _seconds(seconds)

    def _do_press(self) -> None:
        self._send(pyigtl.StringMessage("1", device_name=self._names["button"]))
        self._later(0.1, lambda: self._send(pyigtl.StringMessage("0", device_name=self._names["button"])))

    def _do_cut(self, seconds: str = "1") -> None:
        lasts = _seconds(seconds)
        server, self._server = self._server, None
        if server is not None:
            server.stop()
        self._held.clear()
        self._later(lasts, self._come_back)

    def _come_back(self) -> None:
        if self._server is None and self.running:
            self._server = _Server(self.port)
            self._say("back")

    def _do_quit(self) -> None:
        self.running = False

    def _later(self, seconds: float, call: Callable[[], None]) -> None:
        self._number += 1
        heapq.heappush(self._then, (self.now + seconds, self._number, call))

    def _send_reading(self) -> None:
        now = self.now
        readings = self.probe.read(now)
        if now < self._stale_until:
            readings = {**readings, **self._last}
        self._last = readings
        moment = self._epoch + now
        for name, reading in sorted(readings.items(), reverse=True):  # the reference first, as PLUS may
            bad, self._bad = (self._bad, "") if name == "probe" else ("", self._bad)
            for message in self._messages(self._names[name], reading, moment, bad):
                self._number += 1
                heapq.heappush(self._held, (self.now + self._late, self._number, message))
        while self._held and self._held[0][0] <= self.now:
            self._send(heapq.heappop(self._held)[2])

    def _messages(self, device: str, reading: Reading, moment: float, bad: str) -> Iterable[Any]:
        if not reading.seen and self._hidden == "stop":
            return []
        matrix = _spoilt(reading.matrix, bad)
        message = self._message(matrix, device, moment)
        if bad == "back":
            message.timestamp = moment - 0.5
        if self._hidden == "status":
            message.header_version = 2
            message.metadata = {"TransformStatus": "OK" if reading.seen else "OUT_OF_VIEW"}
        return [message, message] if bad == "repeat" else [message]

    def _message(self, matrix: FloatArray, device: str, moment: float) -> Any:
        """Return a message of the chosen type; those of several tools have ``Tracker`` as their device."""
        if self._kind == "TRANSFORM":
            return pyigtl.TransformMessage(matrix, device_name=device, timestamp=moment)
        tool = ToolPose(device, matrix, oriented=self._kind != "POINT")
        of = device if self._kind in ("POSITION", "QTRANS") else "Tracker"
        return PoseBody(self._kind, [tool], device=of, time=moment)

    def _send(self, message: Any) -> None:
        if self._server is not None and self._server.is_connected():
            self._server.send_message(message, wait=False)


def _seconds(text: str) -> float:
    """Return a time of a command."""
    seconds = float(text)
    if not 0 <= seconds <= _LONGEST_S:
        raise GpError(f"seconds must be from 0 to {_LONGEST_S:g}, got {text}")
    return seconds


def _millimetres(text: str) -> float:
    """Return a length of a command."""
    mm = float(text)
    if not 0 <= mm <= _FARTHEST_MM:
        raise GpError(f"millimetres must be from 0 to {_FARTHEST_MM:g}, got {text}")
    return mm


def _spoilt(matrix: FloatArray, bad: str) -> FloatArray:
    spoilt = matrix.copy()
    if bad == "nan":
        spoilt[0, 3] = np.nan
    elif bad == "scale":
        spoilt[:3, :3] *= 1.05
    elif bad == "mirror":
        spoilt[:3, 0] *= -1
    return spoilt
