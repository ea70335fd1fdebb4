"""What a robot is told of the pose: the transform while it may be used, and always its state.

Before the TRANSFORM go a STATUS message, whose code is 1 only while the pose may be used, and a STRING
message with the same in JSON. Each has a device name of its own, for some clients keep one message a name.
All have headers of version 1, which every OpenIGTLink client reads.
"""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass

import numpy as np
import pyigtl

from gp_core.frames import RigidTransform
from gp_core.pose.cochlea_pose import CochleaPose
from gp_core.pose.gate import GateReason
from gp_core.validation import FloatArray
from gp_labeler.tracker.messages import pack_transform

__all__ = ["HELD_BACK", "NO_POSE", "STATE_DEVICE", "STATUS_DEVICE", "PoseMessage"]

STATE_DEVICE, STATUS_DEVICE = "CochleaPoseState", "CochleaPoseStatus"
"""Device names of the STRING and of the STATUS message, which carry the state of the pose."""

HELD_BACK = "HELD_BACK"
NO_POSE = "NO_POSE"

_OK, _NOT_READY = 1, 13
"""Codes of a STATUS message."""


@dataclass(frozen=True, eq=False)
class PoseMessage:
    """The pose as it is sent, or why none is.

    Parameters
    ----------
    matrix : (4, 4) array or None
        ``T_tracker_cochlea``, mm; None where no pose may be used.
    reasons : tuple of GateReason
        Why none may be used; empty where one may.
    side : str
        ``L`` or ``R``; empty without an estimate.
    radius_95_mm, cone_95_deg : float or None
        The region that holds the origin, and the axis, with 95 %.

    Raises
    ------
    FrameError
        The matrix is not rigid.
    """

    matrix: FloatArray | None = None
    reasons: tuple[GateReason, ...] = (GateReason("no pose", "there is no estimate"),)
    side: str = ""
    radius_95_mm: float | None = None
    cone_95_deg: float | None = None

    def __post_init__(self) -> None:
        if self.matrix is not None:
            RigidTransform(self.matrix, "tracker", "cochlea")

    @classmethod
    def of(cls, pose: CochleaPose, reasons: tuple[GateReason, ...]) -> PoseMessage:
        """Return the message of an estimate; it carries no transform where a reason speaks against it."""
        return cls(
            None if reasons else pose.transform,
            reasons,
            pose.side.value,
            round(pose.radius_95, 4),
            round(float(np.degrees(pose.cone_95)), 3),
        )

    @property
    def usable(self) -> bool:
        """Whether it carries a pose."""
        return self.matrix is not None and not self.reasons

    def held_back_for(self, reason: GateReason) -> PoseMessage:
        """Return the same without its transform, for one more reason."""
        return PoseMessage(None, (*self.reasons, reason), self.side, self.radius_95_mm, self.cone_95_deg)

    def pack(self, device: str, time: float) -> bytes:
        """Return the bytes of its messages; the transform comes last, and only where it may be used."""
        packed: bytes = _pack_status(self, time)
        packed += pyigtl.StringMessage(self._json(), timestamp=time, device_name=STATE_DEVICE).pack()
        if self.usable:
            assert self.matrix is not None
            packed += pack_transform(self.matrix, device, time)
        return packed

    @property
    def words(self) -> str:
        """Why none may be used, in one clause; empty where one may."""
        return "; ".join(reason.text for reason in self.reasons)

    def _json(self) -> str:
        told = {
            "state": "ok" if self.usable else "held back",
            "reasons": [reason.code for reason in self.reasons],
            "side": self.side,
            "radius_95_mm": self.radius_95_mm,
            "cone_95_deg": self.cone_95_deg,
        }
        return json.dumps(told)


def _pack_status(message: PoseMessage, time: float) -> bytes:
    """Return a STATUS message: code, subcode, name of the error, and the error in words."""
    code = _OK if message.usable else _NOT_READY
    name = "" if message.usable else NO_POSE if not message.side else HELD_BACK
    text = message.words.encode("ascii", "replace") + b"\0"
    body = struct.pack("> H q 20s", code, 0, name.encode()) + text
    seconds = int(time)
    fraction = int((time - seconds) * 2**32)
    size_and_sum = (len(body), pyigtl.messages.CRC64(body))
    header = struct.pack(
        "> H 12s 20s II QQ", 1, b"STATUS", STATUS_DEVICE.encode(), seconds, fraction, *size_and_sum
    )
    return header + body
