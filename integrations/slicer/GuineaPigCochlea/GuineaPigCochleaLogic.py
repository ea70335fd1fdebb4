"""What the Slicer module computes, on plain data: names and positions in mm, LPS. It needs `gp_core` alone.

In Slicer's Python: ``slicer.util.pip_install("gp-labeler")``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

import gp_core
from gp_core.pose.covariance import radius_95
from gp_core.pose.gate import reasons_of_ambiguity

__all__ = ["check_labels", "estimate", "expected_features"]

Points = Mapping[str, Sequence[float]]
_LPS_RAS = np.diag([-1.0, -1.0, 1.0, 1.0])
_AXIS_MM = 5.0


def estimate(points: Points, side: str) -> dict[str, Any]:
    """Return the pose of the cochlea: ``transform_ras``, ``points`` (CO and a point of the axis), ``text``.

    Raises
    ------
    GpError
        No pose can be estimated, or it must not be used: the side or names may be wrong.
    """
    pose = gp_core.estimate_pose(_touched(points), side)
    reasons = list(reasons_of_ambiguity(pose))
    if reasons:
        raise gp_core.GpError("; ".join(reason.text for reason in reasons), remedy="Touch again.")
    tip = pose.origin + _AXIS_MM * pose.axis
    text = f"95 % within {pose.radius_95:.2f} mm and {np.degrees(pose.cone_95):.1f} degrees" + "".join(
        f"; {warning}" for warning in pose.warnings
    )
    return {
        "transform_ras": (_LPS_RAS @ pose.transform @ _LPS_RAS).tolist(),
        "points": {"CO": pose.origin.tolist(), "axis": tip.tolist()},
        "text": text,
    }


def expected_features(points: Points, side: str) -> dict[str, dict[str, Any]]:
    """Return where the atlas expects the features that are not among the points, with their 95 % radius."""
    atlas = gp_core.Atlas.published()
    landmarks = _landmarks(points, side)
    found = gp_core.predict(atlas, landmarks)
    return {
        code: {"position": mean.tolist(), "radius_95": float(radius_95(covariance))}
        for code, (mean, covariance) in found.items()
    }


def check_labels(points: Points, side: str) -> list[str]:
    """Return a line for each label that may be wrong."""
    found = gp_core.check_side(_landmarks(points, side), gp_core.Atlas.published()).findings
    return [f"{finding.text}. {finding.remedy}" for finding in found if finding.is_problem]


def _landmarks(points: Points, side: str) -> gp_core.LandmarkSet:
    named = {code: np.asarray(position, float) for code, position in points.items() if code in gp_core.CODES}
    return gp_core.LandmarkSet.from_mapping(named, side, frame="scan")


def _touched(points: Points) -> dict[str, np.ndarray]:
    return {
        code: np.asarray(position, float) for code, position in points.items() if code in gp_core.EXTERNAL
    }
