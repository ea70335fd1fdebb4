"""Steps that ask the atlas: fit one, estimate a cochlea from touches, draw it, check the labels."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from gp_core import (
    PROBE,
    Atlas,
    CochleaPose,
    RigidTransform,
    Specimen,
    check_specimen,
    estimate_pose,
    fit_atlas,
    load_specimens,
    read_touches,
)
from gp_core.checks import FloatArray
from gp_core.errors import GpError
from gp_core.landmarks.anatomy import modiolar_axis
from gp_core.landmarks.features import Side, check_codes
from gp_core.landmarks.files import write_text
from gp_core.registration.procrustes import fit_rigid
from gp_labeler.offscreen.rig import Rig
from gp_labeler.offscreen.step import Step, Triple
from gp_labeler.scene.planes import Plane
from gp_labeler.scene.pose_data import DrawnPose, PoseScene
from gp_labeler.views.pose_overlay import PoseOverlay

__all__ = ["Check", "Estimate", "Estimated", "Fit", "Overlay"]

_HARMLESS = ("missing", "unseen")


@dataclass(frozen=True, eq=False)
class Estimated:
    """A cochlea, and how it lies in the scan.

    Parameters
    ----------
    pose : CochleaPose
        In the tracker's frame.
    T_scan_tracker : RigidTransform, optional
        Where the touches lie in the scan; None where nothing says it.
    truth : (origin (3,), axis (3,)), optional
        Of the phantom, scan frame.
    """

    pose: CochleaPose
    T_scan_tracker: RigidTransform | None = None
    truth: tuple[FloatArray, FloatArray] | None = None

    @property
    def drawn(self) -> DrawnPose:
        """The cochlea in the scan."""
        if self.T_scan_tracker is None:
            raise GpError(
                "nothing says where the touches lie in the scan",
                remedy="Label three of the touched features of that side first.",
            )
        return DrawnPose.of(
            self.pose,
            self.T_scan_tracker,
            key=self.pose.side.value,
            label=f"CO ±{self.pose.radius_95:.1f} mm",
        )

    @property
    def error_mm(self) -> float | None:
        """Distance of the estimated from the true origin, mm."""
        return None if self.truth is None else float(np.linalg.norm(self.drawn.origin - self.truth[0]))

    @property
    def error_deg(self) -> float | None:
        """Angle between the estimated and the true axis, degrees."""
        if self.truth is None:
            return None
        return float(np.degrees(np.arccos(np.clip(self.drawn.axis @ self.truth[1], -1, 1))))


@dataclass(frozen=True)
class Fit(Step):
    """Fit an atlas to labelled animals.

    Parameters
    ----------
    specimens : text or texts
        Landmark files, or folders of them.
    path : str
        The atlas file.
    """

    do: ClassVar[str] = "fit"
    specimens: tuple[str, ...]
    path: str = "atlas.json"

    def run(self, rig: Rig) -> str:  # noqa: D102
        specimens = load_specimens([rig.to_read(each) for each in self.specimens])
        atlas, file = fit_atlas(specimens), rig.to_write(self.path)
        atlas.save(file)
        return f"{rig.wrote(file)}, {len(specimens)} animals"


@dataclass(frozen=True)
class Estimate(Step):
    """Estimate the pose of a cochlea from touches.

    Parameters
    ----------
    side : L or R
        Side of the head.
    touches : str or table of positions
        A file of touches; positions by feature code, tracker frame, mm; or ``simulated``: features of the
        phantom (else as labelled), with noise, somewhere else in space.
    features : text or texts
        What is touched in a simulation; by default the paper's six.
    noise : float
        Standard deviation of a simulated touch, mm a coordinate.
    seed : int
        Of the simulation.
    atlas : str
        ``published``, or an atlas file.
    path : str
        Where the pose is written.
    """

    do: ClassVar[str] = "estimate"
    says: ClassVar[tuple[str, ...]] = ("side",)
    side: Side
    touches: str | dict[str, Triple] = "simulated"
    features: tuple[str, ...] = PROBE
    noise: float = 0.1
    seed: int = 0
    atlas: str = "published"
    path: str = "pose.json"

    def run(self, rig: Rig) -> str:  # noqa: D102
        atlas = Atlas.published() if self.atlas == "published" else Atlas.load(rig.to_read(self.atlas))
        is_simulated = self.touches == "simulated"
        touched, T_scan_tracker = self._simulated(rig) if is_simulated else self._given(rig)
        pose = estimate_pose(touched, self.side, atlas)
        estimated = Estimated(pose, T_scan_tracker, _truth(rig, self.side) if T_scan_tracker else None)
        rig.poses[self.side] = estimated
        file = rig.to_write(self.path)
        pose.save(file)
        text = (
            f"{rig.wrote(file)}, 95 % within {pose.radius_95:.2f} mm and {np.degrees(pose.cone_95):.1f} deg"
        )
        if estimated.error_mm is None:
            return text
        return f"{text}, off by {estimated.error_mm:.2f} mm and {estimated.error_deg:.1f} deg"

    def _simulated(self, rig: Rig) -> tuple[dict[str, FloatArray], RigidTransform]:
        """Touch features in a tracker's frame that is turned and far from the scan's."""
        rng, codes = np.random.default_rng(self.seed), check_codes(self.features, "features", at_least=3)
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        turn *= np.sign(np.linalg.det(turn))
        T_tracker_scan = RigidTransform.from_parts(turn, rng.uniform(-200, 200, 3), dst="tracker", src="scan")
        touched = {}
        for code in codes:
            there = rig.truth(self.side, code) if rig.desk.truth else rig.placed(self.side, code)
            if there is None:
                raise GpError(
                    f"{code} {self.side.word} is not placed, so it cannot be touched", landmark=code
                )
            touched[code] = T_tracker_scan.apply(there[None])[0] + rng.normal(0, self.noise, 3)
        return touched, T_tracker_scan.inverse()

    def _given(self, rig: Rig) -> tuple[dict[str, FloatArray], RigidTransform | None]:
        """Take touches as they are, and lay them on the labels of the same names where there are three."""
        if isinstance(self.touches, str):
            landmarks = read_touches(rig.to_read(self.touches), self.side)
            touched = {code: landmarks[code] for code in landmarks.placed}
        else:
            touched = {code: np.array(position) for code, position in self.touches.items()}
        labels = {code: there for code in touched if (there := rig.placed(self.side, code)) is not None}
        if len(labels) < 3:
            return touched, None
        aims, points = np.array(list(labels.values())), np.array([touched[code] for code in labels])
        return touched, fit_rigid(points, aims, dst="scan", src="tracker").transform


@dataclass(frozen=True)
class Overlay(Step):
    """Draw the estimated cochleae over the bone and the slices.

    Parameters
    ----------
    visible : bool
        Whether to draw them, or to take them away again.
    """

    do: ClassVar[str] = "overlay"
    visible: bool = True

    def run(self, rig: Rig) -> None:  # noqa: D102
        if self.visible and not rig.poses:
            raise GpError("no pose was estimated", remedy="Let an estimate step come first.")
        drawn = [estimated.drawn for estimated in rig.poses.values()] if self.visible else []
        shown = PoseScene(poses=tuple(drawn))
        rig.scene.scene.pose.show(shown)
        rig.scene.redraw()
        for plane in Plane:
            view = rig.window.grid.slice_views[plane]
            overlay = view.findChild(PoseOverlay) or PoseOverlay(view)
            overlay.show(shown)
        if drawn:
            rig.bring(drawn[0].origin)


@dataclass(frozen=True)
class Check(Step):
    """Report labels that are missing, doubtful or exchanged.

    Parameters
    ----------
    path : str, optional
        Where to write what was found, JSON.
    strict : bool
        Fail where a label is doubtful.
    """

    do: ClassVar[str] = "check"
    path: str | None = None
    strict: bool = False

    def run(self, rig: Rig) -> str:  # noqa: D102
        state = rig.desk.session.state
        sides = {side: state.side(side) for side in Side if state.side(side).placed}
        findings = check_specimen(Specimen(state.specimen, sides), Atlas.published())
        doubtful = [finding for finding in findings if finding.kind not in _HARMLESS]
        if self.path is not None:
            file, rows = rig.to_write(self.path), [_row(finding) for finding in findings]
            write_text(file, json.dumps(rows, indent=1) + "\n")
            rig.wrote(file)
        text = " ".join(f"{finding.side.word}: {finding.text}." for finding in doubtful)
        if doubtful and self.strict:
            raise GpError(text)
        return text or f"{len(findings)} not placed, none doubtful"


def _row(finding: Any) -> Mapping[str, Any]:
    names = ("kind", "landmarks", "text")
    return {"side": finding.side.value, **{name: getattr(finding, name) for name in names}}


def _truth(rig: Rig, side: Side) -> tuple[FloatArray, FloatArray] | None:
    if rig.desk.truth is None:
        return None
    ca, cb, co = (rig.truth(side, code) for code in ("CA", "CB", "CO"))
    return co, modiolar_axis(ca, cb)
