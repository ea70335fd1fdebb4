"""Sending the estimated pose to a robot: what is sent, and what prevents it."""

from __future__ import annotations

from gp_core.pose.cochlea_pose import CochleaPose
from gp_core.pose.gate import GateReason, PoseGate
from gp_labeler.document.signals import Signal
from gp_labeler.document.state import SpecimenState
from gp_labeler.models.estimate import SideEstimate, verdict_on
from gp_labeler.tracker import PoseMessage, PoseSender

__all__ = ["PoseSending"]


class PoseSending:
    """Sends the pose while the gate allows it, and otherwise the reasons why not."""

    changed = Signal()
    """Whether it sends, to whom, or what holds the pose back changed."""
    held_back = Signal(str)
    """A pose is held back from now on, and why."""

    def __init__(self) -> None:
        self.gate = PoseGate()
        """The limits within which a pose is sent."""
        self._sender: PoseSender | None = None
        self._held: tuple[str, ...] = ()

    @property
    def on(self) -> bool:
        """Whether anything is sent."""
        return self._sender is not None

    @property
    def words(self) -> str:
        """The state of the sending, as a sentence; empty where nothing is sent."""
        if self._sender is None:
            return ""
        return (
            f"{self._sender.words} Held back: {'; '.join(self._held)}." if self._held else self._sender.words
        )

    @property
    def port(self) -> int | None:
        """Where it listens, or connects to."""
        return None if self._sender is None else self._sender.port

    def start(self, port: int, host: str | None, device: str) -> None:
        """Send from now on; raises `GpError` where the port is taken."""
        self.stop()
        self._sender = PoseSender(port, host=host, device=device)

    def stop(self) -> None:
        """Send nothing any more."""
        sender, self._sender, self._held = self._sender, None, ()
        if sender is not None:
            sender.close()
            self.changed.emit()

    def update(
        self,
        estimate: SideEstimate | None,
        state: SpecimenState,
        doubtful: tuple[str, ...],
        reference_age_s: float | None,
        file_warnings: tuple[GateReason, ...] = (),
    ) -> None:
        """Send the current pose, or why it must not be used.

        Parameters
        ----------
        estimate : Estimate or None
        state : SpecimenState
            Holds what persons said of estimates.
        doubtful : tuple of str
            Touches that may be in a different frame from the current readings of the tracker.
        reference_age_s : float or None
            How long ago the reference was read, seconds; None where no touch hangs on one.
        file_warnings : tuple of GateReason
            What the names of the touches' files say against the side.
        """
        if self._sender is None:
            return
        pose = None if estimate is None else estimate.pose
        if estimate is None or pose is None:
            self._hold(())
            self._sender.send(PoseMessage())
            return
        reasons = (
            *self.gate.reasons(
                pose, accepted=verdict_on(estimate, state) == "accept", reference_age_s=reference_age_s
            ),
            *_reasons_of_touches(pose, doubtful),
            *file_warnings,
        )
        if verdict_on(estimate, state) == "reject":
            reasons = (
                GateReason("rejected", "it was rejected"),
                *(r for r in reasons if r.code != "not accepted"),
            )
        self._hold(tuple(reason.text for reason in reasons))
        renew_s = None if reference_age_s is None else self.gate.max_age_s
        self._sender.send(PoseMessage.of(pose, reasons), renew_s=renew_s)

    def _hold(self, why: tuple[str, ...]) -> None:
        """Hold the pose back, or no longer, and say so: whoever waits for it may not see the dialog."""
        kinds = [_without_numbers(reason) for reason in self._held]
        new = [reason for reason in why if _without_numbers(reason) not in kinds]
        changed, self._held = len(why) != len(self._held) or bool(new), why
        if new:
            self.held_back.emit(new[0])
        if changed:
            self.changed.emit()


def _reasons_of_touches(pose: CochleaPose, doubtful: tuple[str, ...]) -> tuple[GateReason, ...]:
    if pose.transform_to_touches.dst != "tracker":
        return (GateReason("not tracked", "it was touched on the scan, not with a tracker"),)
    if doubtful:
        text = f"{', '.join(doubtful)} may be in a different frame from the current readings of the tracker"
        return (GateReason("frame", text),)
    return ()


def _without_numbers(text: str) -> str:
    """Return the kind of a reason: its age in seconds is no news."""
    return "".join(letter for letter in text if not letter.isdigit())
