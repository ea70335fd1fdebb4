"""What the protocol OpenIGTLink fixes; this module imports nothing, so that help needs no extra."""

from __future__ import annotations

__all__ = ["DEFAULT_PORT", "KINDS", "POSE_KINDS"]

DEFAULT_PORT = 18944
"""The port that OpenIGTLink servers listen on by custom."""

KINDS = ("TDATA", "QTDATA", "POSITION", "QTRANS", "POINT")
"""Message types that carry poses of several tools, or positions."""

POSE_KINDS = ("TRANSFORM", *KINDS)
"""Message types that carry a pose, or a position."""
