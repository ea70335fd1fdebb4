"""Bodies of the OpenIGTLink messages that carry poses of several tools, or positions, beside TRANSFORM.

A TDATA or QTDATA message carries a pose for each tool, with the tool's name; POSITION (and its alias QTRANS)
one pose, with or without an orientation; POINT named positions. Lengths are mm. Layouts are those of the
protocol, version 3 (https://github.com/openigtlink/OpenIGTLink/tree/master/Documents/Protocol).
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pyigtl
from scipy.spatial.transform import Rotation

from gp_core.errors import GpError
from gp_core.validation import FloatArray
from gp_labeler.system.openigtlink import KINDS

__all__ = ["PoseBody", "ToolPose", "read_tools"]

_TDATA = struct.Struct("> 20s B B 12f")
_QTDATA = struct.Struct("> 20s B B 7f")
_POINT = struct.Struct("> 64s 32s 4B 3f f 20s")

_FLOATS_OF_POSITION = (3, 6, 7)
"""Position alone; with x, y, z of the quaternion; with all of it."""

_SIX_DEGREES, _THREE_DEGREES = 2, 3
"""Type of a TDATA element: a 6D tool; a position only."""


class ToolPose(NamedTuple):
    """The pose of one tool: its name, empty where the message tells none, a (4, 4) matrix, mm.

    Without an orientation (`oriented` is False) the rotation of the matrix is the identity and means nothing.
    """

    name: str
    matrix: FloatArray
    oriented: bool = True


def read_tools(kind: str, content: bytes) -> list[ToolPose]:
    """Return the poses in the content of a message.

    Raises
    ------
    ValueError
        The length is wrong, a quaternion has no length, or a name is not UTF-8.
    """
    if kind in ("POSITION", "QTRANS"):
        return [_position(content)]
    layout, make = {"TDATA": (_TDATA, _tdata), "QTDATA": (_QTDATA, _qtdata), "POINT": (_POINT, _point)}[kind]
    if len(content) % layout.size:
        raise ValueError(f"its length is no multiple of {layout.size} bytes")
    return [make(values) for values in layout.iter_unpack(content)]


def _tdata(values: tuple[object, ...]) -> ToolPose:
    name, kind, _, *numbers = values
    matrix = np.eye(4)
    matrix[:3] = np.array(numbers, dtype=np.float64).reshape(4, 3).T  # column by column, as in TRANSFORM
    return ToolPose(_text(name), matrix, kind != _THREE_DEGREES)


def _qtdata(values: tuple[object, ...]) -> ToolPose:
    name, kind, _, *numbers = values
    floats = np.array(numbers, dtype=np.float64)
    if kind == _THREE_DEGREES:
        return ToolPose(_text(name), _placed(floats[:3]), oriented=False)
    return ToolPose(_text(name), _turned(floats[:3], floats[3:]))


def _point(values: tuple[object, ...]) -> ToolPose:
    return ToolPose(_text(values[0]), _placed(np.array(values[6:9], dtype=np.float64)), oriented=False)


def _position(content: bytes) -> ToolPose:
    count = len(content) // 4
    if len(content) % 4 or count not in _FLOATS_OF_POSITION:
        raise ValueError("its length is not 12, 24 or 28 bytes")
    floats = np.array(struct.unpack(f"> {count}f", content), dtype=np.float64)
    if count == 3:
        return ToolPose("", _placed(floats), oriented=False)
    quaternion = floats[3:]
    if count == 6:
        quaternion = np.append(quaternion, np.sqrt(max(1.0 - float(quaternion @ quaternion), 0.0)))
    return ToolPose("", _turned(floats[:3], quaternion))


def _placed(position: FloatArray) -> FloatArray:
    matrix = np.eye(4)
    matrix[:3, 3] = position
    return matrix


def _turned(position: FloatArray, quaternion: FloatArray) -> FloatArray:
    length = float(np.linalg.norm(quaternion))
    if not 0.9 < length < 1.1:
        raise ValueError(f"a quaternion has the length {length:.3g}")
    matrix = _placed(position)
    matrix[:3, :3] = Rotation.from_quat(quaternion).as_matrix()
    return matrix


def _text(value: object) -> str:
    assert isinstance(value, bytes)
    return value.partition(b"\0")[0].decode().strip()


class PoseBody(pyigtl.MessageBase):  # type: ignore[misc]
    """A message of one of `gp_labeler.system.openigtlink.KINDS`, to be sent.

    Parameters
    ----------
    kind : str
        The type of the message.
    tools : sequence of ToolPose
        What it carries; POSITION carries the first.
    device : str
        Device name of the message.
    time : float
        Time stamp, s.
    version : int
        Of the header: 1, or 2 for metadata.
    metadata : mapping of str to str
        With a header of version 2.

    Raises
    ------
    GpError
        The kind is another one.
    """

    def __init__(
        self,
        kind: str,
        tools: Sequence[ToolPose],
        *,
        device: str,
        time: float,
        version: int = 1,
        metadata: Mapping[str, str] | None = None,
    ) -> None:
        super().__init__(timestamp=time, device_name=device)
        if kind not in KINDS:
            raise GpError(f"the kind of a message must be one of {', '.join(KINDS)}, got {kind!r}")
        self._message_type = kind
        self._valid_message = True
        self._tools = tuple(tools)
        self.header_version = version
        self.metadata = dict(metadata or {})

    def _pack_content(self) -> bytes:
        return b"".join(self._packed())

    def _packed(self) -> Iterator[bytes]:
        for tool in self._tools:
            name, position = tool.name.encode(), tool.matrix[:3, 3]
            kind = _SIX_DEGREES if tool.oriented else _THREE_DEGREES
            quaternion = _quaternion(tool.matrix)
            match self._message_type:
                case "TDATA":
                    yield _TDATA.pack(name, kind, 0, *tool.matrix[:3].T.ravel())
                case "QTDATA":
                    yield _QTDATA.pack(name, kind, 0, *position, *quaternion)
                case "POINT":
                    yield _POINT.pack(name, b"", 255, 255, 0, 255, *position, 0.0, b"")
                case _:
                    numbers = (*position, *quaternion) if tool.oriented else position
                    yield struct.pack(f"> {len(numbers)}f", *numbers)
                    return


def _quaternion(matrix: FloatArray) -> FloatArray:
    """Return x, y, z, w of a rotation; one that is spoilt on purpose is sent as it is read, not a number."""
    try:
        quaternion: FloatArray = Rotation.from_matrix(matrix[:3, :3]).as_quat()
    except ValueError:
        return np.full(4, np.nan)
    return quaternion
