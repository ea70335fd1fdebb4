"""A turned cochlea and all that is drawn beside it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gp_core.landmarks.features import Side
from gp_core.validation import FloatArray
from gp_labeler.scene.pose_data import (
    DrawnFeature,
    DrawnPose,
    DrawnTip,
    DrawnTouch,
    DrawnTruth,
    DrawnVector,
    PoseScene,
)

MIDDLE = np.array([14.0, -8.0, 5.0])
TURN = np.array([[0.6, 0.0, -0.8], [0.0, 1.0, 0.0], [0.8, 0.0, 0.6]])
SPREAD = np.diag([0.03, 0.02, 0.01, 0.005, 0.005, 0.005])


def beside(x: float, y: float, z: float) -> FloatArray:
    there: FloatArray = MIDDLE + np.array([x, y, z])
    return there


def placed(turn: FloatArray = TURN, at: FloatArray = MIDDLE) -> FloatArray:
    return np.block([[turn, np.reshape(at, (3, 1))], [np.zeros((1, 3)), 1.0]])


def pose(**changes: object) -> DrawnPose:
    made = DrawnPose("L robust", placed(), SPREAD, float(np.radians(9.0)), label="robust")
    return replace(made, **changes)  # type: ignore[arg-type]


POSE = pose()
SECOND = pose(T_scan_cochlea=placed(at=beside(0.0, 0.0, -2.5)), role="pose_2", style="dotted", label="JRMPC")
TRUTH = DrawnTruth(Side.LEFT, beside(0.0, 0.0, 2.5), TURN[:, 0])
TOUCHES = (
    DrawnTouch("OS", beside(5.0, 0.0, 3.0)),
    DrawnTouch("MN", beside(5.0, 0.0, -3.0), suspect=True),
)
FEATURES = (DrawnFeature("CL", beside(-4.0, 0.0, 3.0)),)
VECTORS = (DrawnVector(beside(-4.0, 0.0, 3.0), beside(-6.0, 0.0, 3.0), "CL"),)
TIP = DrawnTip(
    beside(-4.0, 0.0, -3.0),
    np.array([-1.0, 0.0, 0.0]),
    MIDDLE + np.linspace([-1.0, 0.0, -5.0], [-4.0, 0.0, -3.0], 12),
    label="probe",
)
PATH = MIDDLE + np.linspace([1.0, 0.0, -5.0], [3.0, 0.0, -5.0], 9)
ALL = PoseScene((POSE, SECOND), (TRUTH,), TOUCHES, FEATURES, VECTORS, TIP, (PATH,))

DATA = {
    "truth": "truths",
    "touches": "touches",
    "features": "features",
    "vectors": "vectors",
    "path": "paths",
}
"""Which part shows which data."""


def without(part: str) -> PoseScene:
    """Return the scene that never had what a part shows."""
    return replace(ALL, tip=None) if part == "tip" else replace(ALL, **{DATA[part]: ()})
