"""OpenIGTLink messages out of a stream of bytes, however the network cuts it.

pyigtl knows what a message means. Its client is not used: it takes a connection that the other end has
closed for an open one, waits 10 ms for an answer to its call, loses its place in the stream when a header
arrives in two parts, and keeps only the newest message of a device.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np
import pyigtl

from gp_core.checks import FloatArray
from gp_core.errors import GpError

__all__ = ["MessageDecoder", "TrackerMessage", "hello", "pack_transform"]

_HEADER_BYTES = 58
_VERSIONS = (1, 2, 3)
_READ = ("TRANSFORM", "STRING")
_LONGEST_READ = 1_000_000


@dataclass(frozen=True, eq=False)
class TrackerMessage:
    """One message.

    Parameters
    ----------
    device, kind : str
        Device name and message type.
    time : float
        When it was measured, seconds of the sender's clock; 0 where the sender does not say.
    received : float
        When it arrived, seconds of this computer's monotonic clock.
    matrix : (4, 4) array, optional
        Of a TRANSFORM, as sent.
    text : str
        Of a STRING.
    metadata : mapping of str to str
        Of a header of version 2.
    problem : str
        Why its content cannot be read; empty where it can.
    """

    device: str
    kind: str
    time: float
    received: float
    matrix: FloatArray | None = None
    text: str = ""
    metadata: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    problem: str = ""


class MessageDecoder:
    """Cuts a stream into messages. One for each connection."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._skip = 0

    def feed(self, data: bytes, received: float) -> list[TrackerMessage]:
        """Take what has arrived, and return the messages that are now complete.

        Types other than TRANSFORM and STRING come without content.

        Raises
        ------
        GpError
            This is not OpenIGTLink.
        """
        self._buffer += data
        messages: list[TrackerMessage] = []
        while True:
            if self._skip:
                cut = min(self._skip, len(self._buffer))
                del self._buffer[:cut]
                self._skip -= cut
            if len(self._buffer) < _HEADER_BYTES:
                return messages
            header = _read_header(bytes(self._buffer[:_HEADER_BYTES]))
            size = int(header["body_size"])
            if header["message_type"] not in _READ or size > _LONGEST_READ:
                self._skip = _HEADER_BYTES + size
                messages.append(_without_content(header, received))
                continue
            if len(self._buffer) < _HEADER_BYTES + size:
                return messages
            body = bytes(self._buffer[_HEADER_BYTES : _HEADER_BYTES + size])
            self._skip = _HEADER_BYTES + size
            messages.append(_read_body(header, body, received))


def _read_header(data: bytes) -> dict[str, Any]:
    try:
        header: dict[str, Any] = pyigtl.MessageBase.parse_header(data)
        kind = header["message_type"]
        known = header["header_version"] in _VERSIONS and kind.isascii() and kind.isprintable() and kind
    except UnicodeDecodeError:
        known = False
    if not known:
        raise GpError(
            "what answers there does not speak OpenIGTLink",
            remedy="Check the port; PLUS and 3D Slicer listen on 18944 by custom.",
        )
    return header


def _without_content(header: dict[str, Any], received: float, problem: str = "") -> TrackerMessage:
    return TrackerMessage(
        header["device_name"], header["message_type"], header["timestamp"], received, problem=problem
    )


def _read_body(header: dict[str, Any], body: bytes, received: float) -> TrackerMessage:
    message = pyigtl.MessageBase.create_message(header["message_type"])
    try:
        message.unpack(header, body)
    except (
        struct.error,
        ValueError,
        IndexError,
        TypeError,
        KeyError,
    ) as error:  # a TypeError: it raises a str
        return _without_content(header, received, f"it cannot be read ({error})")
    matrix = getattr(message, "matrix", None)
    return TrackerMessage(
        header["device_name"],
        header["message_type"],
        header["timestamp"],
        received,
        matrix=None if matrix is None else np.asarray(matrix, dtype=np.float64),
        text=getattr(message, "string", ""),
        metadata=MappingProxyType(dict(message.metadata)),
    )


class _GetStatus(pyigtl.MessageBase):  # type: ignore[misc]
    def __init__(self) -> None:
        super().__init__(device_name="gp-labeler")
        self._message_type = "GET_STATUS"
        self._valid_message = True
        self.header_version = 2


def hello() -> bytes:
    """Return a question for the status with a header of version 2.

    PLUS answers with the highest header version that it has heard, and only version 2 carries the metadata
    which say whether a marker is seen.
    """
    packed: bytes = _GetStatus().pack()
    return packed


def pack_transform(matrix: FloatArray, device: str, time: float) -> bytes:
    """Return a TRANSFORM message of a (4, 4) matrix, mm."""
    packed: bytes = pyigtl.TransformMessage(matrix, timestamp=time, device_name=device).pack()
    return packed
