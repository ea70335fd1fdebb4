"""Messages out of bytes, however the network cuts them."""

from __future__ import annotations

import contextlib
import struct

import numpy as np
import pyigtl
import pytest
from tracker_cases import pose

from gp_core.errors import GpError
from gp_labeler.tracker.messages import MessageDecoder, hello, pack_transform


def _transform(x: float = 1.0, *, time: float = 12.5, **metadata: str) -> bytes:
    message = pyigtl.TransformMessage(pose(x, 2, 3), device_name="ProbeToTracker", timestamp=time)
    if metadata:
        message.header_version = 2
        message.metadata = metadata
    packed: bytes = message.pack()
    return packed


@pytest.mark.parametrize("size", [1, 3, 57, 58, 59, 100, 100_000])
def test_messages_are_whole_however_they_are_cut(size) -> None:
    image = pyigtl.ImageMessage(np.zeros((4, 50, 50), np.uint8), device_name="Image").pack()
    stream = _transform(1.0) + image + hello() + _transform(2.0, TransformStatus="OK") + _transform(3.0)
    decoder = MessageDecoder()
    read = [m for i in range(0, len(stream), size) for m in decoder.feed(stream[i : i + size], 7.0)]
    assert [m.kind for m in read] == ["TRANSFORM", "IMAGE", "GET_STATUS", "TRANSFORM", "TRANSFORM"]
    assert [m.matrix[0, 3] for m in read if m.matrix is not None] == [1.0, 2.0, 3.0]
    assert read[0].matrix == pytest.approx(pose(1, 2, 3), abs=1e-6)
    assert (read[0].device, read[0].time, read[0].received) == ("ProbeToTracker", 12.5, 7.0)
    assert dict(read[3].metadata) == {"TransformStatus": "OK"}


def test_every_message_of_a_device_is_delivered() -> None:
    stream = b"".join(_transform(float(k), time=10.0 + k) for k in range(50))
    assert [m.time for m in MessageDecoder().feed(stream, 1.0)] == [10.0 + k for k in range(50)]


def test_a_string_is_read() -> None:
    (message,) = MessageDecoder().feed(pyigtl.StringMessage("1", device_name="Button").pack(), 1.0)
    assert (message.kind, message.device, message.text) == ("STRING", "Button", "1")


def test_what_is_not_openigtlink_is_said() -> None:
    web = b"HTTP/1.1 400 Bad Request\r\nContent-Type: text/html\r\nConnection: close\r\n\r\n"
    with pytest.raises(GpError, match="does not use OpenIGTLink"):
        MessageDecoder().feed(web, 1.0)


def test_a_body_that_cannot_be_read_is_named_and_passed_over() -> None:
    short = _with_body(_transform(), _transform()[58:78])
    broken, good = MessageDecoder().feed(short + _transform(2.0), 1.0)
    assert broken.matrix is None
    assert "cannot be read" in broken.problem
    assert good.matrix[0, 3] == 2.0


def _with_body(whole: bytes, body: bytes) -> bytes:
    """Return a message with another body, its size and checksum right."""
    return whole[:42] + struct.pack("> QQ", len(body), pyigtl.messages.CRC64(body)) + body


def test_every_flipped_bit_of_a_body_is_noticed_and_the_next_message_is_read() -> None:
    whole = _transform(1.0, TransformStatus="OK")
    for bit in range(8 * 58, 8 * len(whole)):
        spoilt = bytearray(whole)
        spoilt[bit // 8] ^= 1 << bit % 8
        damaged, good = MessageDecoder().feed(bytes(spoilt) + _transform(2.0), 1.0)
        assert damaged.damaged
        assert damaged.matrix is None
        assert good.matrix[0, 3] == 2.0


@pytest.mark.parametrize("size", [2**63, 2**40, 3_000_000_000])
def test_a_header_that_claims_an_impossible_size_ends_the_connection_in_true_words(size) -> None:
    decoder = MessageDecoder()
    decoder.feed(_transform(), 1.0)
    image = pyigtl.ImageMessage(np.zeros((4, 5, 5), np.uint8), device_name="Image").pack()
    with pytest.raises(GpError, match="damaged: a IMAGE message claims"):
        decoder.feed(image[:42] + struct.pack("> Q", size) + image[50:], 1.1)


@pytest.mark.parametrize("kind", ["TRANSFORM", "IMAGE"])
def test_a_message_that_never_ends_is_given_up(kind) -> None:
    decoder = MessageDecoder()
    header = bytearray(_transform()[:58])
    header[2:14] = kind.encode().ljust(12, b"\0")
    header[42:50] = struct.pack("> Q", 9000)
    decoder.feed(bytes(header), 1.0)
    for k in range(20):
        decoder.feed(_transform(), 1.0 + k / 10)
    with pytest.raises(GpError, match="does not end"):
        decoder.feed(_transform(), 4.1)


def test_a_stream_that_was_understood_and_loses_its_place_is_called_damaged() -> None:
    decoder = MessageDecoder()
    decoder.feed(_transform(), 1.0)
    with pytest.raises(GpError, match="no message begins where one should"):
        decoder.feed(_transform()[7:] + _transform(), 1.1)


def test_a_pose_goes_out_as_pyigtl_reads_it() -> None:
    (message,) = MessageDecoder().feed(pack_transform(pose(4, 5, 6), "T_tracker_cochlea", 99.25), 1.0)
    assert (message.device, message.time) == ("T_tracker_cochlea", 99.25)
    assert message.matrix == pytest.approx(pose(4, 5, 6), abs=1e-6)


def test_the_greeting_has_a_header_of_version_2() -> None:
    assert struct.unpack("> H", hello()[:2]) == (2,)


def test_spoilt_bytes_raise_nothing_unexpected() -> None:
    rng = np.random.default_rng(0)
    string = pyigtl.StringMessage("pressed", device_name="Button").pack()
    whole = _transform(1.0, TransformStatus="OK", TransformValid="1") + string + _transform(2.0)
    for _ in range(2000):
        spoilt = bytearray(whole)
        for place in rng.integers(0, len(whole), rng.integers(1, 6)):
            spoilt[place] = rng.integers(0, 256)
        with contextlib.suppress(GpError):
            MessageDecoder().feed(bytes(spoilt), 1.0)
