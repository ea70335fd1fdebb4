"""A tracked probe, live over OpenIGTLink: its messages checked, its touches recorded. No Qt, no VTK.

`TrackerLink` receives and checks, `TouchRecorder` makes touches of what it delivers, `PivotCollector` gathers
what a pivot calibration needs, `PoseSender` sends the estimate back out. All of them are polled from one
thread; only sockets have threads of their own.
"""

from gp_labeler.tracker.address import TrackerAddress
from gp_labeler.tracker.frame_check import FrameCheck, RepeatedTouch
from gp_labeler.tracker.link import LinkPhase, LinkState, TrackerLink
from gp_labeler.tracker.pose_message import PoseMessage
from gp_labeler.tracker.probe import PivotCollector, Probe
from gp_labeler.tracker.samples import Fault, Limits, Sample
from gp_labeler.tracker.sender import PoseSender
from gp_labeler.tracker.touching import (
    NO_ORIENTATION,
    RecordedTouch,
    RefusedTouch,
    TouchRecorder,
    TouchSettings,
)

__all__ = [
    "NO_ORIENTATION",
    "Fault",
    "FrameCheck",
    "Limits",
    "LinkPhase",
    "LinkState",
    "PivotCollector",
    "PoseMessage",
    "PoseSender",
    "Probe",
    "RecordedTouch",
    "RefusedTouch",
    "RepeatedTouch",
    "Sample",
    "TouchRecorder",
    "TouchSettings",
    "TrackerAddress",
    "TrackerLink",
]
