"""OpenIGTLink messages out of a stream of bytes, however the network cuts it.

pyigtl knows what a message means. Its client is not used: it takes a connection that the other end has
closed for an open one, waits 10 ms for an answer to its call, loses its place in the stream when a header
arrives in two parts, and keeps only the newest message of a device.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np
import pyigtl

from gp_core.errors import GpError
from gp_core.validation import FloatArray
from gp_labeler.system.openigtlink import KINDS, POSE_KINDS
from gp_labeler.tracker.pose_bodies import read_tools

__all__ = ["MessageDecoder", "TrackerMessage", "hello", "pack_transform"]

_HEADER_BYTES = 58
_VERSIONS = (1, 2, 3)
_READ = (*POSE_KINDS, "STRING")

_LARGEST = {"TRANSFORM": 10_000, "STRING": 1_000_000, "STATUS": 1_000_000} | dict.fromkeys(KINDS, 100_000)
"""Bytes that a message of a type can have, metadata included."""

_LARGEST_OTHER = 2_000_000_000
"""The same for an image or a mesh."""

_LONGEST_S = 3.0
"""A message that is still incomplete after that time has a header with a wrong size."""


@dataclass(frozen=True, eq=False)
class TrackerMessage:
    """One message.

    Parameters
    ----------
    device, kind : str
        Device name and message type; in messages of several tools, the name of the tool, where it has one.
    time : float
        When it was measured, seconds of the sender's clock; 0 where the sender does not say.
    received : float
        When it arrived, seconds of this computer's monotonic clock.
    matrix : (4, 4) array, optional
        Of a message of one of `gp_labeler.system.openigtlink.POSE_KINDS`, as sent.
    oriented : bool
        Whether the rotation of the matrix was sent; else only the position was.
    text : str
        Of a STRING.
    metadata : mapping of str to str
        Of a header of version 2.
    problem : str
        Why its content cannot be read; empty where it can.
    damaged : bool
        Whether its bytes are not those that were sent, as its checksum tells.
    """

    device: str
    kind: str
    time: float
    received: float
    matrix: FloatArray | None = None
    text: str = ""
    metadata: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    problem: str = ""
    damaged: bool = False
    oriented: bool = True


class MessageDecoder:
    """Cuts a stream into messages. One for each connection."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._skip = 0
        self._begun: float | None = None
        self._understood = False

    def feed(self, data: bytes, received: float) -> list[TrackerMessage]:
        """Take what has arrived, and return the messages that are now complete.

        A message of several tools gives one for each. Types that are not read come without content; so does a
        body whose checksum is wrong.

        Raises
        ------
        GpError
            This is not OpenIGTLink, or the stream is damaged: where the next message begins is not known.
        """
        self._buffer += data
        messages: list[TrackerMessage] = []
        while True:
            self._pass_over()
            header = self._header() if len(self._buffer) >= _HEADER_BYTES else None
            if header is None:
                return self._wait(messages, received)
            size = _HEADER_BYTES + int(header["body_size"])
            if header["message_type"] in _READ:
                if len(self._buffer) < size:
                    return self._wait(messages, received)
                messages += _read_body(header, bytes(self._buffer[_HEADER_BYTES:size]), received)
            else:
                messages.append(_without_content(header, received))
            self._skip, self._begun = size, None

    def _pass_over(self) -> None:
        cut = min(self._skip, len(self._buffer))
        del self._buffer[:cut]
        self._skip -= cut

    def _wait(self, messages: list[TrackerMessage], received: float) -> list[TrackerMessage]:
        """Return what is complete; raise GpError where the rest of a message does not come."""
        unfinished = self._skip or self._buffer
        self._begun = None if not unfinished else received if self._begun is None else self._begun
        if self._begun is not None and received - self._begun > _LONGEST_S:
            raise _damaged("a message does not end")
        return messages

    def _header(self) -> dict[str, Any]:
        """Return the header that the buffer begins with.

        Raises
        ------
        GpError
            It is none, or one that cannot be true.
        """
        try:
            header = _read_header(bytes(self._buffer[:_HEADER_BYTES]))
        except GpError:
            if self._understood:
                raise _damaged("no message begins where one should") from None
            raise
        kind, size = header["message_type"], int(header["body_size"])
        if size > _LARGEST.get(kind, _LARGEST_OTHER):
            raise _damaged(f"a {kind} message claims {size} bytes")
        self._understood = True
        return header


def _damaged(what: str) -> GpError:
    return GpError(f"the data that arrive are damaged: {what}", remedy="Check the network and the server.")


def _read_header(data: bytes) -> dict[str, Any]:
    try:
        header: dict[str, Any] = pyigtl.MessageBase.parse_header(data)
        header["crc"] = int.from_bytes(data[-8:], "big")
        kind = header["message_type"]
        known = header["header_version"] in _VERSIONS and kind.isascii() and kind.isprintable() and kind
    except UnicodeDecodeError:
        known = False
    if not known:
        raise GpError(
            "the server does not use OpenIGTLink",
            remedy="Check the port; PLUS and 3D Slicer use 18944 by default.",
        )
    return header


def _without_content(header: dict[str, Any], received: float, problem: str = "") -> TrackerMessage:
    return TrackerMessage(
        header["device_name"], header["message_type"], header["timestamp"], received, problem=problem
    )


def _read_body(header: dict[str, Any], body: bytes, received: float) -> list[TrackerMessage]:
    if pyigtl.messages.CRC64(body) != header["crc"]:
        return [replace(_without_content(header, received, "its checksum is wrong"), damaged=True)]
    try:
        return (
            _tools(header, body, received)
            if header["message_type"] in KINDS
            else [_one(header, body, received)]
        )
    except (
        struct.error,
        ValueError,
        IndexError,
        TypeError,
        KeyError,
    ) as error:  # a TypeError: it raises a str
        return [_without_content(header, received, f"it cannot be read ({error})")]


def _tools(header: dict[str, Any], body: bytes, received: float) -> list[TrackerMessage]:
    """Return a message for each tool; one that has no name has that of the device."""
    message = _Content()
    message.unpack(header, body)
    told = _without_content(header, received)
    metadata = MappingProxyType(dict(message.metadata))
    return [
        replace(
            told,
            device=tool.name or told.device,
            matrix=tool.matrix,
            oriented=tool.oriented,
            metadata=metadata,
        )
        for tool in read_tools(header["message_type"], message.content)
    ]


class _Content(pyigtl.MessageBase):  # type: ignore[misc]
    """The content of a message, without header, extended header and metadata."""

    content = b""

    def _unpack_content(self, content: bytes) -> None:
        self.content = bytes(content)


def _one(header: dict[str, Any], body: bytes, received: float) -> TrackerMessage:
    message = pyigtl.MessageBase.create_message(header["message_type"])
    message.unpack(header, body)
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
