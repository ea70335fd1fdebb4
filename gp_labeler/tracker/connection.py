"""A TCP connection that is made, lost and made again on a thread of its own."""

from __future__ import annotations

import contextlib
import errno
import selectors
import socket
import threading
import time
from dataclasses import dataclass
from queue import Empty, SimpleQueue

from gp_core.errors import GpError
from gp_labeler.tracker.messages import MessageDecoder, TrackerMessage

__all__ = ["Arrived", "Connection", "Event", "Lost", "Opened", "Waker", "keep_alive"]

_CONNECT_SECONDS = 3.0
_FIRST_PAUSE = 0.25
_LONGEST_PAUSE = 4.0
_GOOD_SECONDS = 2.0
"""A connection that stood longer is tried again without delay; another may never have been any good."""

_BLOCK = 65536
_MOST_WAITING = 2000
_JOIN_SECONDS = 0.25


@dataclass(frozen=True)
class Opened:
    """The connection is established."""


@dataclass(frozen=True)
class Arrived:
    """Messages that came together."""

    messages: list[TrackerMessage]


@dataclass(frozen=True)
class Lost:
    """It does not stand: why, and in how many seconds it is tried again."""

    why: str
    pause: float


Event = Opened | Arrived | Lost


class Waker:
    """Wakes a thread that waits for sockets."""

    def __init__(self) -> None:
        self._read, self._write = socket.socketpair()
        self._read.setblocking(False)
        self._write.setblocking(False)
        self.selector = selectors.DefaultSelector()
        self.selector.register(self._read, selectors.EVENT_READ)

    def wake(self) -> None:
        """Wake it, from any thread."""
        with contextlib.suppress(OSError):
            self._write.send(b"!")

    def wait(self, seconds: float | None) -> list[tuple[selectors.SelectorKey, int]]:
        """Wait for the registered sockets, for a call, or for a time; return what is ready."""
        ready = []
        for key, events in self.selector.select(seconds):
            if key.fileobj is self._read:
                with contextlib.suppress(OSError):
                    self._read.recv(4096)
            else:
                ready.append((key, events))
        return ready

    def close(self) -> None:
        """Close it; only on the thread that waits."""
        self.selector.close()
        self._read.close()
        self._write.close()


class Connection:
    """A client's connection. Everything about it is told as events; nothing blocks the caller.

    Parameters
    ----------
    host : str
    port : int
    hello : bytes
        What is sent first, on every connection.
    """

    def __init__(self, host: str, port: int, *, hello: bytes = b"") -> None:
        self._host, self._port, self._hello = host, port, hello
        self._events: SimpleQueue[Event] = SimpleQueue()
        self._outgoing: SimpleQueue[bytes] = SimpleQueue()
        self._stop = threading.Event()
        self._waker = Waker()
        self._thread = threading.Thread(target=self._run, name="gp-tracker", daemon=True)
        self._thread.start()

    def events(self) -> list[Event]:
        """Return what has happened since the last call, oldest first."""
        events = []
        with contextlib.suppress(Empty):
            while True:
                events.append(self._events.get_nowait())
        return events

    def send(self, data: bytes) -> None:
        """Send bytes, as soon as the connection is established."""
        self._outgoing.put(data)
        self._waker.wake()

    def close(self) -> None:
        """End the connection and its thread."""
        self._stop.set()
        self._waker.wake()
        self._thread.join(_JOIN_SECONDS)  # looking up a name may take longer; it ends by itself

    def _run(self) -> None:
        pause = _FIRST_PAUSE
        try:
            while not self._stop.is_set():
                try:
                    with self._connect() as sock:
                        begun = time.monotonic()
                        self._events.put(Opened())
                        why = self._serve(sock)
                        if time.monotonic() - begun > _GOOD_SECONDS:
                            pause = _FIRST_PAUSE
                except OSError as error:
                    why = self._why(error)
                if self._stop.is_set():
                    return
                self._events.put(Lost(why, pause))
                self._sleep(pause)
                pause = min(2 * pause, _LONGEST_PAUSE)
        finally:
            self._waker.close()

    def _sleep(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while not self._stop.is_set() and (left := end - time.monotonic()) > 0:
            self._waker.wait(left)

    def _connect(self) -> socket.socket:
        """Return a connected socket.

        Raises
        ------
        OSError
            None of the host's addresses answers; the first one's reason.
        """
        first: OSError | None = None
        found = socket.getaddrinfo(self._host, self._port, type=socket.SOCK_STREAM)
        for family, kind, protocol, _, address in found:
            sock = socket.socket(family, kind, protocol)
            try:
                self._connect_one(sock, address)
                return sock
            except OSError as error:
                sock.close()
                first = first or error
        raise first or OSError(errno.EADDRNOTAVAIL, "no address")

    def _connect_one(self, sock: socket.socket, address: tuple[object, ...]) -> None:
        sock.setblocking(False)
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        keep_alive(sock)
        code = sock.connect_ex(address)
        end = time.monotonic() + _CONNECT_SECONDS
        if code in (errno.EINPROGRESS, errno.EWOULDBLOCK, errno.EALREADY, 10035):  # the last on Windows
            self._waker.selector.register(sock, selectors.EVENT_WRITE)
            try:
                while not self._waker.wait(max(end - time.monotonic(), 0)):
                    if self._stop.is_set() or time.monotonic() >= end:
                        raise TimeoutError(errno.ETIMEDOUT, "no answer")
            finally:
                self._waker.selector.unregister(sock)
            code = sock.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if code:
            raise OSError(code, errno.errorcode.get(code, "error"))

    def _serve(self, sock: socket.socket) -> str:
        """Receive and send until that ends; return why it ended."""
        self._unsent()  # what was meant for the connection before is out of date
        waiting = bytearray(self._hello)
        decoder = MessageDecoder()
        selector = self._waker.selector
        selector.register(sock, selectors.EVENT_READ | selectors.EVENT_WRITE)
        try:
            while not self._stop.is_set():
                for _, ready in self._waker.wait(None):
                    if ready & selectors.EVENT_READ:
                        data = sock.recv(_BLOCK)
                        if not data:
                            return "the server closed the connection"
                        self._tell(decoder.feed(data, time.monotonic()))
                    if ready & selectors.EVENT_WRITE and waiting:
                        del waiting[: sock.send(waiting)]
                waiting += self._unsent()
                wanted = selectors.EVENT_READ | (selectors.EVENT_WRITE if waiting else 0)
                selector.modify(sock, wanted)
            return "closed"
        except GpError as error:
            return str(error).rstrip(".")
        except OSError as error:
            return f"the connection broke ({error.strerror or error})"
        finally:
            selector.unregister(sock)

    def _tell(self, messages: list[TrackerMessage]) -> None:
        """Pass on messages, unless nobody has asked for long: what would wait is out of date."""
        if messages and self._events.qsize() < _MOST_WAITING:
            self._events.put(Arrived(messages))

    def _unsent(self) -> bytes:
        data = bytearray()
        with contextlib.suppress(Empty):
            while True:
                data += self._outgoing.get_nowait()
        return bytes(data)

    def _why(self, error: OSError) -> str:
        where = f"{self._host}:{self._port}"
        if isinstance(error, socket.gaierror):
            return f"there is no computer named {self._host}"
        if error.errno in (errno.ECONNREFUSED, 10061):
            return f"no server listens at {where}"
        if isinstance(error, TimeoutError):
            return f"{where} does not answer: check the address, the network and firewalls"
        return f"{where} cannot be reached ({error.strerror or error})"


def keep_alive(sock: socket.socket) -> None:
    """Have the system notice within some seconds that the other end is gone without a word."""
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for name, value in (("TCP_KEEPIDLE", 3), ("TCP_KEEPINTVL", 1), ("TCP_KEEPCNT", 3)):
        option = getattr(socket, name, None)
        if option is not None:
            with contextlib.suppress(OSError):
                sock.setsockopt(socket.IPPROTO_TCP, option, value)
