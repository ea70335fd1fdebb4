"""The cochlea of one side estimated from its touches, and compared with the scan where there is one.

Nothing here changes: a `SideEstimate` is made again whenever touches, labels, settings or the atlas change.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import cached_property
from typing import Any

import numpy as np

from gp_core.atlas.atlas import Atlas
from gp_core.constants import DEFINING_FEATURES
from gp_core.errors import GpError
from gp_core.frames import RigidTransform, angle_between_deg
from gp_core.landmarks.anatomy import axis_frame
from gp_core.landmarks.features import Side
from gp_core.landmarks.sets import LandmarkSet, Specimen
from gp_core.pose.cochlea_pose import CochleaPose
from gp_core.pose.estimate import estimate_pose
from gp_core.pose.expected_landmarks import expected_features
from gp_core.pose.systematic_error import DEFAULT_SHARED_ERROR_MM
from gp_core.registration.fiducials import register_fiducials
from gp_core.registration.result import RegistrationResult
from gp_core.validation import FloatArray
from gp_labeler.document.state import SpecimenState
from gp_labeler.document.touches import TouchHow

__all__ = [
    "EstimateSettings",
    "PoseInScan",
    "Registered",
    "SideEstimate",
    "apart",
    "make_estimate",
    "verdict_on",
]

REGISTRATIONS = ("auto", "features", "skull")
_DERIVED = ("quaternion_xyzw", "other_ear")
"""What verdicts of earlier versions do not hold, and a pose tells elsewhere too, as `transform`, `state`."""

_SAME_MM, _SAME_DEG = 0.001, 0.01
"""Up to here a pose is the one that was judged: it is computed again each time."""


@dataclass(frozen=True)
class EstimateSettings:
    """What the user chose for an estimate.

    Parameters
    ----------
    side : Side
    methods : tuple of str
        ``robust``, ``jrmpc`` or both; the first is the one that is told and exported.
    probe_noise : float, optional
        Scale of an ordinary touch error, mm per coordinate; None: found from the touches.
    registration : str
        By what touches are registered to the scan: ``features`` labelled and touched, ``skull`` features, or
        ``auto``, the skull's where there are enough.
    round_window : str
        Which round window y of the cochlea frame points to: ``touched`` or ``expected``.
    shared_error : float
        RMS length of one offset that all touches of the session share, mm; the regions allow for it.
    touches_each : int
        How often each feature is asked for; the estimate takes all touches there are.
    both_ears : bool
        Whether the axis is made of both ears', where both were touched and agree.
    midline : tuple of str
        Skull features that lie in the mid-plane of the head, by which the ears are compared.
    """

    side: Side = Side.LEFT
    methods: tuple[str, ...] = ("robust",)
    probe_noise: float | None = None
    registration: str = "auto"
    round_window: str = "touched"
    shared_error: float = DEFAULT_SHARED_ERROR_MM
    touches_each: int = 1
    both_ears: bool = False
    midline: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Registered:
    """How the touches lie in the scan.

    Parameters
    ----------
    way : str
        ``features``, ``skull``, ``placed`` (on the scan itself) or ``known`` (given from elsewhere).
    T_scan_touches : RigidTransform
    fiducials : RegistrationResult, optional
        Where it was found from points.
    """

    way: str
    T_scan_touches: RigidTransform
    fiducials: RegistrationResult | None = None

    @property
    def fre_mm(self) -> float | None:
        """Fiducial registration error, mm; None where nothing was fitted."""
        return None if self.fiducials is None else self.fiducials.fre_mm

    def tre_mm(self, target: FloatArray) -> float | None:
        """Target registration error expected at a (3,) scan position, mm; None where nothing was fitted."""
        return None if self.fiducials is None else float(self.fiducials.tre_mm(target[None])[0])


@dataclass(frozen=True, eq=False)
class PoseInScan:
    """An estimated cochlea in the scan.

    Parameters
    ----------
    pose : CochleaPose
    T_scan_cochlea : RigidTransform
    covariance : (6, 6) array
        Of origin (mm) and rotation vector (rad), scan frame.
    expected : mapping of str to (3,) array
        Where the atlas, moved with this pose, has each of its features, mm, scan frame.
    """

    pose: CochleaPose
    T_scan_cochlea: RigidTransform
    covariance: FloatArray
    expected: Mapping[str, FloatArray]

    @property
    def origin(self) -> FloatArray:
        """(3,) CO, mm, scan frame."""
        return self.T_scan_cochlea.translation

    @property
    def axis(self) -> FloatArray:
        """(3,) unit modiolar axis CB->CA, scan frame."""
        return self.T_scan_cochlea.rotation[:, 0]


@dataclass(frozen=True, eq=False)
class SideEstimate:
    """What is known of the cochlea of one side.

    Parameters
    ----------
    settings : EstimateSettings
    touches : LandmarkSet
        The touches it was made from, in their own frame.
    poses : mapping of str to CochleaPose
        By method, in the frame of the touches.
    problems : mapping of str to str
        Why a method has no pose, or (``registration``) why the touches cannot be registered to the scan.
    registered : Registered, optional
    truth : RigidTransform, optional
        ``T_scan_cochlea`` of the labels, x along the modiolar axis on both sides.
    labels : LandmarkSet
        Of the side, scan frame.
    atlas : Atlas
    """

    settings: EstimateSettings
    touches: LandmarkSet
    poses: Mapping[str, CochleaPose]
    problems: Mapping[str, str]
    registered: Registered | None
    truth: RigidTransform | None
    labels: LandmarkSet
    atlas: Atlas

    @property
    def side(self) -> Side:
        """Side of the head."""
        return self.settings.side

    @property
    def pose(self) -> CochleaPose | None:
        """The pose that is told and exported: of the first method that has one."""
        return next((self.poses[m] for m in self.settings.methods if m in self.poses), None)

    def in_scan(self, method: str | None = None) -> PoseInScan | None:
        """Return the estimate as it lies in the scan; None where there is no pose, or no registration."""
        told = next((m for m in self.settings.methods if m in self.poses), "")
        return self._placed.get(told if method is None else method)

    @cached_property
    def _placed(self) -> dict[str, PoseInScan]:
        """The poses in the scan, by method; panel, views and commands all ask for them."""
        if self.registered is None:
            return {}
        T_scan_touches = self.registered.T_scan_touches
        return {method: self._place(pose, T_scan_touches) for method, pose in self.poses.items()}

    def _place(self, pose: CochleaPose, T_scan_touches: RigidTransform) -> PoseInScan:
        turn = np.kron(np.eye(2), T_scan_touches.rotation)
        expected = expected_features(pose, self.atlas)
        moved = T_scan_touches.apply(list(expected.values())) if expected else ()
        return PoseInScan(
            pose,
            T_scan_touches @ pose.transform_to_touches,
            turn @ pose.covariance @ turn.T,
            dict(zip(expected, moved, strict=True)),
        )

    def errors(self, method: str | None = None) -> tuple[float, float] | None:
        """Return the distance of the origin from the labelled CO (mm) and the angle of the axes (degrees)."""
        placed = self.in_scan(method)
        if placed is None or self.truth is None:
            return None
        return apart(placed.origin, placed.axis, self.truth.translation, self.truth.rotation[:, 0])

    def apart(self) -> tuple[float, float] | None:
        """Return how far the poses of two methods lie apart, mm and degrees; None where there is but one."""
        if len(self.poses) < 2:
            return None
        one, other = (self.poses[method] for method in self.settings.methods[:2])
        return apart(one.origin, one.axis, other.origin, other.axis)

    def as_dict(self) -> dict[str, Any]:
        """Return what a verdict and a report keep of it."""
        out = {} if self.pose is None else self.pose.as_dict()
        if (placed := self.in_scan()) is not None and self.registered is not None:
            out["T_scan_cochlea"] = placed.T_scan_cochlea.matrix.tolist()
            out["registration"] = {
                "way": self.registered.way,
                "T_scan_tracker": self.registered.T_scan_touches.matrix.tolist(),
                "fre_mm": self.registered.fre_mm,
                "tre_mm": self.registered.tre_mm(placed.origin),
            }
        if (errors := self.errors()) is not None:
            out["error_mm"], out["error_deg"] = errors
        return out

    def is_that_of(self, judged: Mapping[str, Any]) -> bool:
        """Whether it is the very estimate that was judged: of the same touches, atlas and settings.

        Parameters
        ----------
        judged : mapping
            `PoseCheck.pose`.
        """
        now = {} if self.pose is None else self.pose.as_dict()
        return all(
            key in judged and _same(judged[key], value) for key, value in now.items() if key not in _DERIVED
        )

    def moved_since(self, judged: Mapping[str, Any]) -> tuple[float, float] | None:
        """Return by how much the cochlea's frame moved, mm, and turned, degrees, since it was judged.

        Parameters
        ----------
        judged : mapping
            `PoseCheck.pose`.

        Returns
        -------
        (float, float) or None
            None where it is the same pose, or what was judged is not known.
        """
        then = np.array(judged.get("transform", ()), dtype=np.float64)
        if self.pose is None or then.shape != (4, 4):
            return None
        now = self.pose.transform
        mm = float(np.linalg.norm(now[:3, 3] - then[:3, 3]))
        turn = (np.trace(then[:3, :3].T @ now[:3, :3]) - 1) / 2
        degrees = float(np.degrees(np.arccos(np.clip(turn, -1, 1))))
        return (mm, degrees) if mm > _SAME_MM or degrees > _SAME_DEG else None


def verdict_on(estimate: SideEstimate, state: SpecimenState) -> str:
    """Return what was said last of this very estimate; empty where nothing was, or it has changed since."""
    last = next((check for check in reversed(state.pose_checks) if check.side is estimate.side), None)
    return "" if last is None or not estimate.is_that_of(last.pose) else last.verdict


def _same(one: Any, other: Any) -> bool:
    """Whether two values of a pose file are equal, lists and tuples alike."""
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return one.keys() == other.keys() and all(_same(one[key], other[key]) for key in one)
    if isinstance(one, list | tuple) and isinstance(other, list | tuple):
        return len(one) == len(other) and all(map(_same, one, other))
    return bool(one == other)


def apart(
    origin: FloatArray, axis: FloatArray, other_origin: FloatArray, other_axis: FloatArray
) -> tuple[float, float]:
    """Return the distance of two (3,) origins, mm, and the angle between two (3,) axes, degrees."""
    return float(np.linalg.norm(origin - other_origin)), float(angle_between_deg(axis, other_axis))


def make_estimate(
    state: SpecimenState,
    settings: EstimateSettings,
    atlas: Atlas,
    specimens: Sequence[Specimen] = (),
    *,
    known: RigidTransform | None = None,
) -> SideEstimate:
    """Estimate the cochlea of one side from the touches in a state.

    Parameters
    ----------
    state : SpecimenState
    settings : EstimateSettings
    atlas : Atlas
        Of the robust method.
    specimens : sequence of Specimen
        Labelled animals, for JRMPC.
    known : RigidTransform, optional
        ``T_scan_tracker`` where it is known from elsewhere (a simulation, a tracked scanner).

    Returns
    -------
    SideEstimate
        With as much as could be found; its `problems` say what could not, and why.
    """
    touches = state.touched(settings.side)
    poses: dict[str, CochleaPose] = {}
    problems: dict[str, str] = {}
    for method in settings.methods:
        try:
            poses[method] = _pose(state, touches, settings, atlas, specimens, method)
        except GpError as error:
            problems[method] = str(error)
    registered = None
    try:
        registered = _registered(state, touches, settings, known)
    except GpError as error:
        problems["registration"] = str(error)
    labels = state.side(settings.side)
    return SideEstimate(
        settings, touches, poses, problems, registered, labelled_cochlea(labels), labels, atlas
    )


def _pose(
    state: SpecimenState,
    touches: LandmarkSet,
    settings: EstimateSettings,
    atlas: Atlas,
    specimens: Sequence[Specimen],
    method: str,
) -> CochleaPose:
    if method == "jrmpc":
        _check_joint(touches, specimens)
    noise = settings.probe_noise if method == "robust" else None
    probe = replace(touches, extra={})
    animals = specimens if method == "jrmpc" else None
    return estimate_pose(
        probe,
        settings.side,
        atlas,
        method=method,
        specimens=animals,
        probe_noise=noise,
        round_window=settings.round_window,
        shared_error=settings.shared_error,
        times=_times(state, settings.side, touches.placed),
    )


def _times(state: SpecimenState, side: Side, codes: Iterable[str]) -> dict[str, float] | None:
    """Return when each feature was touched, s; None unless all were touched with a tracked probe."""
    touches = [state.touches[side, code] for code in codes]
    if not all(touch.how is TouchHow.TRACKED and touch.time for touch in touches):
        return None
    try:
        moments = [datetime.fromisoformat(touch.time).timestamp() for touch in touches]
    except ValueError:  # a file of elsewhere
        return None
    return dict(zip(codes, moments, strict=True))


def _check_joint(touches: LandmarkSet, specimens: Sequence[Specimen]) -> None:
    """Refuse what JRMPC cannot do, with what is to be done about it here rather than in the shell."""
    if not specimens:
        raise GpError("it needs labelled animals", remedy="Fit an atlas to them in the step 3 Atlas.")
    lacking = [code for code in ("RWA", "RWP", "LLI") if code not in touches.placed]
    if lacking:
        what = " and ".join(lacking)
        raise GpError(f"it starts at the round window and needs {what}", remedy=f"Touch {what} too.")


def _registered(
    state: SpecimenState, touches: LandmarkSet, settings: EstimateSettings, known: RigidTransform | None
) -> Registered | None:
    if touches.frame == "scan":
        return Registered("placed", RigidTransform.identity(dst="scan", src="scan"))
    if known is not None:
        return Registered("known", known)
    way = settings.registration
    by_skull = way == "skull" or (way == "auto" and len(touches.extra.keys() & state.skull.keys()) >= 3)
    if by_skull:
        fixed = {name: np.array(position) for name, position in state.skull.items()}
        return _fitted("skull", touches.extra, fixed)
    labelled = state.side(settings.side).as_mapping(touches.placed)
    if not labelled and way == "auto":
        return None
    return _fitted("features", touches.as_mapping(), labelled)


def _fitted(way: str, touched: Mapping[str, FloatArray], fixed: Mapping[str, FloatArray]) -> Registered:
    found = register_fiducials(touched, fixed)
    return Registered(way, found.T_scan_tracker, found)


def labelled_cochlea(labels: LandmarkSet) -> RigidTransform | None:
    """Return ``T_scan_cochlea`` of a labelled side, x along the modiolar axis; None before there is one."""
    if "CO" not in labels or not all(code in labels for code in DEFINING_FEATURES):
        return None
    ca, cb, rwa, rwp = labels.array(DEFINING_FEATURES)
    origin = labels["CO"]
    try:
        return axis_frame(origin, ca - cb, (rwa + rwp) / 2 - origin, dst="scan", src="cochlea")
    except GpError:  # a round window on the axis gives no frame
        return None
