"""Sends the estimated pose and its state over OpenIGTLink, to a robot or to 3D Slicer."""

from __future__ import annotations

import contextlib
import os
import socket
import threading
import time

from gp_core.errors import GpError
from gp_core.pose.gate import GateReason
from gp_labeler.tracker.address import check_device, check_host
from gp_labeler.tracker.connection import Connection, Lost, Opened, keep_alive
from gp_labeler.tracker.pose_message import PoseMessage

__all__ = ["PoseSender"]

_BACKLOG = 8
_MOST_WAITING = 1_000_000


_SILENT = GateReason("stale", "gp-labeler does not respond")
_STOPPED = GateReason("stopped", "sending was stopped")


class PoseSender:
    """Sends the state of the pose repeatedly, and the pose itself while it may be used.

    It has a thread of its own. Where a message is to be renewed and is not, because the program hangs, it
    withdraws the pose by itself.

    As a server it serves any number of clients; as a client it connects to a server (3D Slicer's, a
    robot's) and comes back by itself.

    Parameters
    ----------
    port : int
        0 lets the system choose, as a server.
    host : str, optional
        The server to connect to. Without it, this is the server.
    device : str
        Device name of the messages.
    interface : str
        As a server: the address to listen at; ``0.0.0.0`` for other computers too.
    period_s : float
        How often the pose is sent.

    Raises
    ------
    GpError
        A value is none, or the port is taken.
    """

    def __init__(
        self,
        port: int = 18945,
        *,
        host: str | None = None,
        device: str = "T_tracker_cochlea",
        interface: str = "127.0.0.1",
        period_s: float = 0.1,
    ) -> None:
        check_device(device, "the pose")
        lowest = 0 if host is None else 1
        if isinstance(port, bool) or not isinstance(port, int) or not lowest <= port <= 65535:
            raise GpError(f"the port must be a whole number from {lowest} to 65535, got {port!r}")
        if host is not None:
            check_host(host)
        self.device = device
        self._message = PoseMessage()
        self._ends = float("inf")
        self._period_s = period_s
        self._stop = threading.Event()
        self._status = "Waiting for a pose."
        self._peers = 0
        self._connection = None if host is None else Connection(host, port)
        self._server = _PoseServer(interface, port) if host is None else None
        self.port = port if self._server is None else self._server.port
        """Where it listens, or connects to."""
        self._thread = threading.Thread(target=self._run, name="gp-pose-sender", daemon=True)
        self._thread.start()

    @property
    def peers(self) -> int:
        """How many receive."""
        return self._peers

    @property
    def words(self) -> str:
        """The state of the sending, as a sentence."""
        if self._connection is not None:
            return self._status
        to = "no client connected" if not self._peers else f"{self._peers} listening"
        what = f"sending {self.device}" if self._message.usable else "sending no pose"
        return f"Port {self.port}: {what}, {to}."

    def send(self, message: PoseMessage, *, renew_s: float | None = None) -> None:
        """Send this from now on.

        Parameters
        ----------
        message : PoseMessage
            A pose that may be used, or why none may.
        renew_s : float, optional
            Withdraw the pose where `send` is not called again within so many seconds.
        """
        self._ends = float("inf") if renew_s is None else time.monotonic() + renew_s
        self._message = message

    def close(self) -> None:
        """Stop sending, and end the connections and threads."""
        self._stop.set()
        self._thread.join()
        if self._connection is not None:
            self._connection.close()
        if self._server is not None:
            self._server.close()

    def _run(self) -> None:
        while not self._stop.wait(self._period_s):
            message, ends = self._message, self._ends
            if message.usable and time.monotonic() > ends:
                message = message.held_back_for(_SILENT)
            data = message.pack(self.device, time.time())
            if self._server is not None:
                self._peers = self._server.serve(data)
            else:
                self._send_as_client(data)

        self._withdraw()

    def _withdraw(self) -> None:
        """Say a last time that no pose may be used, before the connections end."""
        data = self._message.held_back_for(_STOPPED).pack(self.device, time.time())
        if self._server is not None:
            self._server.serve(data)
        else:
            self._send_as_client(data)

    def _send_as_client(self, data: bytes) -> None:
        assert self._connection is not None
        for event in self._connection.events():
            if isinstance(event, Opened):
                self._peers, self._status = 1, f"Sending {self.device}."
            elif isinstance(event, Lost):
                self._peers = 0
                self._status = f"{event.why[:1].upper()}{event.why[1:]}. Trying again in {event.pause:g} s."
        if data and self._peers:
            self._connection.send(data)


class _PoseServer:
    """Serves whoever connects; what they say is not read."""

    def __init__(self, interface: str, port: int) -> None:
        self._listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        try:
            if os.name == "posix":  # elsewhere the option would let two servers share a port
                self._listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._listening.bind((interface, port))
            self._listening.listen(_BACKLOG)
        except OSError as error:
            self._listening.close()
            raise GpError(
                f"cannot listen at {interface}:{port} ({error.strerror or error})",
                remedy="Another program may listen there: choose another port.",
            ) from None
        self._listening.setblocking(False)
        self._clients: dict[socket.socket, bytearray] = {}
        self.port: int = self._listening.getsockname()[1]

    def serve(self, data: bytes) -> int:
        """Let new clients in, send, let go of those that are gone; return how many there are."""
        with contextlib.suppress(OSError):
            while True:
                client, _ = self._listening.accept()
                client.setblocking(False)
                keep_alive(client)
                self._clients[client] = bytearray()
        for client, waiting in list(self._clients.items()):
            waiting += data
            if not _alive(client) or not _sent(client, waiting):
                del self._clients[client]
                client.close()
        return len(self._clients)

    def close(self) -> None:
        for client in self._clients:
            client.close()
        self._clients.clear()
        self._listening.close()


def _alive(client: socket.socket) -> bool:
    try:
        return bool(client.recv(65536))
    except BlockingIOError:
        return True
    except OSError:
        return False


def _sent(client: socket.socket, waiting: bytearray) -> bool:
    """Send what can be sent now; a client that takes nothing for long is given up."""
    try:
        del waiting[: client.send(waiting)]
    except BlockingIOError:
        return len(waiting) < _MOST_WAITING
    except OSError:
        return False
    return True
