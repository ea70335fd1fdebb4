"""The link to a tracker: polled for samples; its state is always known, also as a sentence."""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from gp_labeler.system.openigtlink import POSE_KINDS
from gp_labeler.tracker.address import TrackerAddress
from gp_labeler.tracker.connection import Arrived, Connection, Event, Lost, Opened
from gp_labeler.tracker.messages import TrackerMessage, hello
from gp_labeler.tracker.sample_filter import SampleFilter
from gp_labeler.tracker.samples import Fault, Limits, Sample

__all__ = ["LinkPhase", "LinkState", "TrackerLink"]

_PRESSED = ("1", "ON", "TRUE", "DOWN", "PRESS", "PRESSED")
_SECONDS_BETWEEN_PRESSES = 1.0
_MOST_DEVICES = 100


class LinkPhase(str, Enum):
    """The state of a link."""

    OFF = "off"
    CONNECTING = "connecting"
    CONNECTED = "connected"
    """Messages of the probe come; whether its marker is seen, each sample says."""
    SILENT = "silent"
    """Connected, but no message of the probe arrives."""
    LOST = "lost"
    """It is tried again by itself."""


@dataclass(frozen=True)
class LinkState:
    """The state of a link, and the same as a sentence."""

    phase: LinkPhase
    words: str


class TrackerLink:
    """Receives a probe's messages, checks them, and comes back by itself where the connection is lost.

    Nothing of it blocks: call `poll` from a timer, 30 to 60 times a second, always on the same thread.

    Parameters
    ----------
    address : TrackerAddress
    limits : Limits, optional
        What is believed.
    silent_s : float
        Without a message of the probe for that long, the link is silent.
    clock : callable
        What tells the time, s; tests have their own.

    Examples
    --------
    >>> link = TrackerLink(TrackerAddress(port=18944, probe="StylusToTracker"))
    >>> link.state.phase.value
    'off'
    """

    def __init__(
        self,
        address: TrackerAddress,
        limits: Limits | None = None,
        *,
        silent_s: float = 0.5,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.address = address
        self.limits = limits or Limits()
        self.latest: Sample | None = None
        """The newest sample of this connection."""
        self.faults: Counter[Fault] = Counter()
        """How many samples had what fault, since the link was opened."""
        self.devices: dict[str, str] = {}
        """What this connection has carried: message type by device name."""
        self._silent_s = silent_s
        self._clock = clock
        self._connection: Connection | None = None
        self._phase = LinkPhase.OFF
        self._stands = False
        self._why = ""
        self._presses = 0
        self.connections = 0
        """How often a connection was made: nobody knows what was moved between two of them."""
        self._begin()

    def _begin(self) -> None:
        """Forget the connection before: clocks, positions and names may all be others."""
        self._filter = SampleFilter(self.address.probe, self.address.reference, self.limits)
        self._heard = self._clock()
        self._arrivals: deque[float] = deque(maxlen=400)
        self._told_hz, self._told_at = 0.0, self._clock()
        self._button_at = float("-inf")
        self._button_on = False
        self.latest = None
        self.devices = {}

    def set_limits(self, limits: Limits) -> None:
        """Use other limits from now on, also after a reconnection."""
        self.limits = limits
        self._filter.set_limits(limits)

    @property
    def state(self) -> LinkState:
        """How it stood at the last poll."""
        return LinkState(self._phase, self._words())

    @property
    def rate_hz(self) -> float:
        """Messages of the probe in the last second."""
        now = self._clock()
        return float(sum(now - at <= 1.0 for at in self._arrivals))

    @property
    def reference_age_s(self) -> float:
        """How long ago the last good reading of the reference came, seconds; infinite where none has."""
        seen = self._filter.reference_seen
        return float("inf") if seen is None else self._clock() - seen

    def open(self) -> None:
        """Connect, in the background; does nothing where it is open already."""
        if self._connection is None:
            self._begin()
            self.faults.clear()
            self._phase = LinkPhase.CONNECTING
            self._connection = Connection(self.address.host, self.address.port, hello=hello())

    def close(self) -> None:
        """End the connection and its thread."""
        connection, self._connection = self._connection, None
        self._phase = LinkPhase.OFF
        self._stands = False
        self.latest = None
        self._presses = 0
        if connection is not None:
            connection.close()

    def poll(self) -> list[Sample]:
        """Return the samples that have come since the last call, oldest first, good and bad."""
        if self._connection is None:
            return []
        samples: list[Sample] = []
        for event in self._connection.events():
            samples += self._take(event)
        if self._stands:
            samples += self._filter.take([], self._clock())
            self._listen()
        for sample in samples:
            if sample.fault:
                self.faults[sample.fault] += 1
        if samples:
            self.latest = samples[-1]
        return samples

    def take_presses(self) -> int:
        """Return how often the button was pressed since the last call."""
        presses, self._presses = self._presses, 0
        return presses

    def _take(self, event: Event) -> list[Sample]:
        match event:
            case Opened():
                self._begin()
                self.connections += 1
                self._stands = True
            case Lost(why, pause):
                self._phase = LinkPhase.LOST
                self._stands = False
                self._why = f"{why}. Trying again in {pause:g} s."
                self.latest = None
            case Arrived(messages):
                for message in messages:
                    self._note(message)
                return self._filter.take(messages, messages[-1].received)
        return []

    def _listen(self) -> None:
        """Tell silence from messages; a new connection has as long for its first."""
        if self._clock() - self._heard > self._silent_s:
            self._phase = LinkPhase.SILENT
        elif self._arrivals:
            self._phase = LinkPhase.CONNECTED
        if self._clock() - self._told_at >= 1.0:  # not oftener: whoever shows it need not flicker
            self._told_at, self._told_hz = self._clock(), self.rate_hz

    def _note(self, message: TrackerMessage) -> None:
        if message.device in self.devices or len(self.devices) < _MOST_DEVICES:
            self.devices[message.device] = message.kind
        if message.device == self.address.probe and message.kind in POSE_KINDS:
            self._heard = message.received
            self._arrivals.append(message.received)
        elif message.device == self.address.button and message.kind == "STRING":
            self._note_button(message)

    def _note_button(self, message: TrackerMessage) -> None:
        """Count a press once, whether the state is repeated in every frame or told once a press."""
        on = message.text.strip().upper() in _PRESSED
        paused = message.received - self._button_at > _SECONDS_BETWEEN_PRESSES
        if on and (paused or not self._button_on):
            self._presses += 1
        self._button_on, self._button_at = on, message.received

    def _words(self) -> str:
        where, probe = self.address, self.address.probe
        match self._phase:
            case LinkPhase.OFF:
                return "Not connected."
            case LinkPhase.CONNECTING:
                return f"Connecting to {where} …"
            case LinkPhase.LOST:
                return f"{self._why[:1].upper()}{self._why[1:]}"
            case LinkPhase.SILENT:
                quiet = max(round(self._clock() - self._heard), 1)
                return f"Connected to {where}, but no {probe} for {quiet} s: {self._why_silent()}"
            case _:
                often = f", {self._told_hz:.0f} a second" if self._told_hz else ""
                return f"Receiving {probe}{often}."

    def _why_silent(self) -> str:
        probe = self.address.probe
        kind = self.devices.get(probe)
        if kind in POSE_KINDS:
            return "its marker is hidden, or the tracker is paused."
        if kind is not None:
            return f"it arrives as {kind}; let the server send it as TRANSFORM."
        others = [name for name, kind in self.devices.items() if kind in POSE_KINDS and name]
        if others:
            return f"the server sends {', '.join(sorted(others)[:6])}; check the name."
        return "its marker is hidden, or the server uses another name."
