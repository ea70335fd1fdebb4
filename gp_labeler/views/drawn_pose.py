"""What of a workspace's estimate is drawn over bone and slices, before a view makes pixels of it."""

from __future__ import annotations

from gp_core.constants import METHOD_NAMES
from gp_core.pose.mixture import UNDECIDED
from gp_core.validation import FloatArray
from gp_labeler.document.touches import Touches
from gp_labeler.models.estimate import SideEstimate
from gp_labeler.models.pose import OverlayOptions
from gp_labeler.models.pose_exports import InsertionPath
from gp_labeler.models.workspace import Workspace
from gp_labeler.scene.pose_data import (
    METHOD_ROLES,
    PARTS,
    DrawnFeature,
    DrawnPose,
    DrawnTip,
    DrawnTouch,
    DrawnTruth,
    DrawnVector,
    PoseScene,
)

__all__ = ["pose_scene"]


def pose_scene(workspace: Workspace, *, tip: DrawnTip | None = None) -> PoseScene:
    """Return what is drawn of the current estimate; nothing of it where it cannot be registered to the scan.

    Parameters
    ----------
    workspace : Workspace
        With the estimate, and the options of what to draw.
    tip : DrawnTip, optional
        The tracked probe.
    """
    options, estimate = workspace.pose.overlay, workspace.pose.estimate
    parts, opacity = _parts(options), options.opacity
    if not options.visible:
        return PoseScene(parts=parts, opacity=opacity)
    if estimate is None or estimate.registered is None:
        return PoseScene(tip=tip, parts=parts, opacity=opacity)
    return PoseScene(
        poses=_poses(estimate),
        truths=_truths(estimate),
        touches=_touches(estimate, workspace.document.state.touches),
        features=_features(estimate),
        vectors=_vectors(estimate),
        tip=tip,
        paths=_paths(workspace.pose.path, estimate),
        parts=parts,
        opacity=opacity,
    )


def _parts(options: OverlayOptions) -> frozenset[str]:
    return frozenset(part for part in PARTS if getattr(options, part))


def _poses(estimate: SideEstimate) -> tuple[DrawnPose, ...]:
    assert estimate.registered is not None
    many, T_scan_touches = len(estimate.poses) > 1, estimate.registered.T_scan_touches
    drawn = [
        DrawnPose.of(
            pose,
            T_scan_touches,
            label=METHOD_NAMES[method] if many else f"CO ±{pose.radius_95:.1f} mm",
        )
        for method, pose in estimate.poses.items()
    ]
    robust = estimate.poses.get("robust")
    if robust is not None and robust.is_multimodal:  # its 95 % region is where all of these are
        drawn += [
            DrawnPose.of_reading(reading, T_scan_touches)
            for reading in robust.hypotheses
            if reading.probability >= UNDECIDED
        ]
    return tuple(drawn)


def _truths(estimate: SideEstimate) -> tuple[DrawnTruth, ...]:
    truth = estimate.truth
    if truth is None:
        return ()
    return (DrawnTruth(estimate.side, truth.translation, truth.rotation[:, 0]),)


def _touches(estimate: SideEstimate, touches: Touches) -> tuple[DrawnTouch, ...]:
    assert estimate.registered is not None
    T_scan_touches = estimate.registered.T_scan_touches
    suspects = () if estimate.pose is None else estimate.pose.suspects
    return tuple(
        DrawnTouch(name, T_scan_touches.apply([touch.position])[0], name in suspects, not touch.left_out)
        for (side, name), touch in touches.items()
        if side is estimate.side
    )


def _paths(path: InsertionPath | None, estimate: SideEstimate) -> tuple[FloatArray, ...]:
    carried = None if path is None else path.in_scan(estimate)
    return () if carried is None else (carried,)


def _features(estimate: SideEstimate) -> tuple[DrawnFeature, ...]:
    return tuple(
        DrawnFeature(code, position, METHOD_ROLES[method])
        for method in estimate.poses
        if (placed := estimate.in_scan(method)) is not None
        for code, position in placed.expected.items()
    )


def _vectors(estimate: SideEstimate) -> tuple[DrawnVector, ...]:
    """Return the errors of the first estimate's features against the labels."""
    placed = estimate.in_scan()
    if placed is None:
        return ()
    labels, role = estimate.labels, METHOD_ROLES[placed.pose.method]
    return tuple(
        DrawnVector(position, labels[code], code, role)
        for code, position in placed.expected.items()
        if code in labels
    )
