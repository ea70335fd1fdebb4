"""Where the tracker's messages come from, and what its devices are called there."""

from __future__ import annotations

import re
from dataclasses import dataclass

from gp_core.errors import GpError
from gp_labeler.system.openigtlink import DEFAULT_PORT

__all__ = ["TrackerAddress", "check_device", "check_host", "check_port"]

_LONGEST_DEVICE = 20
_FROM_TO = re.compile(r"(?P<of>.+)To(?P<frame>[A-Z].*)")


@dataclass(frozen=True)
class TrackerAddress:
    """An OpenIGTLink server, and the devices to listen to.

    Parameters
    ----------
    host : str
        Name or address of the computer.
    port : int
        1 to 65535.
    probe : str
        Device name of the probe's marker: a TRANSFORM from the marker to the tracker, mm.
    reference : str, optional
        Device name of the marker on the animal's head. Named, all positions are in its frame.
    button : str, optional
        Device name of STRING messages that serve as a foot switch: ``1``, ``on`` or ``pressed``.

    Raises
    ------
    GpError
        A value cannot be one; with what was got, what is allowed and what to do.
    """

    host: str = "127.0.0.1"
    port: int = DEFAULT_PORT
    probe: str = "ProbeToTracker"
    reference: str | None = None
    button: str | None = None

    def __post_init__(self) -> None:
        check_host(self.host)
        check_port(self.port)
        check_device(self.probe, "the probe")
        devices = [self.probe]
        for name, what in ((self.reference, "the reference"), (self.button, "the button")):
            if name is not None:
                check_device(name, what)
                devices.append(name)
        if len(set(devices)) < len(devices):
            raise GpError(
                f"probe, reference and button must be different devices, got {', '.join(devices)}",
                remedy="Leave the reference empty where there is none.",
            )
        self._check_frames()

    def _check_frames(self) -> None:
        """Both must lead to the same frame, as PLUS names them: or a motion is taken off twice."""
        probe = _FROM_TO.fullmatch(self.probe)
        reference = _FROM_TO.fullmatch(self.reference or "")
        if probe and reference and probe["frame"] != reference["frame"]:
            raise GpError(
                f"{self.probe} leads to the frame {probe['frame']}, {self.reference} "
                f"to {reference['frame']}: they must lead to the same",
                remedy=f"Use {probe['of']}To{reference['frame']}, or leave the reference empty.",
            )

    def __str__(self) -> str:
        return f"{self.host}:{self.port}"


def check_host(host: str) -> None:
    """Raise `GpError` unless `host` can name a computer."""
    remedy = "Give a name such as 127.0.0.1 or tracker.local."
    if not isinstance(host, str) or not host.strip():
        raise GpError("the tracker's host is empty", remedy=remedy)
    if host.count(":") == 1:
        raise GpError(f"the host must be without the port, got {host!r}", remedy="Give the port separately.")
    if host != host.strip() or re.search(r"[\s/]", host):
        raise GpError(f"the host must be one name without spaces or slashes, got {host!r}", remedy=remedy)


def check_port(port: int) -> None:
    """Raise `GpError` unless `port` is a TCP port."""
    if isinstance(port, bool) or not isinstance(port, int) or not 1 <= port <= 65535:
        raise GpError(
            f"the port must be a whole number from 1 to 65535, got {port!r}",
            remedy=f"OpenIGTLink servers use {DEFAULT_PORT} by default.",
        )


def check_device(name: str, what: str) -> None:
    """Raise `GpError` unless `name` fits the 20 characters that OpenIGTLink has for it."""
    if not isinstance(name, str) or not name.strip():
        raise GpError(f"the device name of {what} is empty", remedy="Such as ProbeToTracker.")
    if name != name.strip() or not name.isascii() or not name.isprintable():
        raise GpError(f"the device name of {what} must be plain ASCII, got {name!r}")
    if len(name) > _LONGEST_DEVICE:
        raise GpError(
            f"the device name of {what} has {len(name)} characters, {name!r}; OpenIGTLink carries 20",
            remedy=f"The messages arrive as {name[:_LONGEST_DEVICE]!r}: use that, or a shorter name.",
        )
