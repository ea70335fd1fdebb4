"""What of an estimate is drawn: plain data in the scan's frame, the same for the 3D view and the slices."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from gp_core import CochleaPose, Hypothesis, RigidTransform
from gp_core.landmarks.features import Side
from gp_core.pose.covariance import cone_95
from gp_core.validation import FloatArray

__all__ = [
    "AXIS_MM",
    "BEHIND_MM",
    "LONG_MM",
    "METHOD_ROLES",
    "PARTS",
    "DrawnFeature",
    "DrawnPose",
    "DrawnTip",
    "DrawnTouch",
    "DrawnTruth",
    "DrawnVector",
    "PoseScene",
    "error_text",
]

AXIS_MM, BEHIND_MM = 5.0, 1.5
"""How far an axis is drawn before its origin, towards the apex, and behind it."""

LONG_MM = 1.0
"""An error vector longer than this is emphasised."""

PARTS: Mapping[str, str] = MappingProxyType(
    {
        "estimate": "Estimated axis",
        "region": "95 % region",
        "cochlea": "Cochlea outline",
        "truth": "Labelled axis",
        "features": "Atlas features",
        "vectors": "Error vectors",
        "touches": "Touched points",
        "tip": "Probe",
        "path": "Insertion path",
        "names": "Names and errors",
    }
)
"""What can be shown or hidden, and what a menu calls it."""

METHOD_ROLES: Mapping[str, str] = MappingProxyType({"robust": "pose", "jrmpc": "pose_2"})
"""Colour of an estimate (a state of the theme) by its method; `DrawnPose.style` goes with it."""

_CORNERS = 32
_STYLES: Mapping[str, str] = MappingProxyType({"pose": "dashed", "pose_2": "dotted"})


@dataclass(frozen=True, eq=False)
class DrawnPose:
    """An estimated cochlea.

    Parameters
    ----------
    key : str
        Its name among all, such as ``"L robust"``.
    T_scan_cochlea : (4, 4) float array
        Where it lies: origin CO, x the modiolar axis towards the apex on both sides, y towards the round
        window, z = x × y; mm.
    covariance : (6, 6) float array
        Of the origin (mm) and of a small rotation vector about it (rad), scan axes.
    cone : float
        Half-angle of the cone that holds the true axis with 95 %, rad.
    side : Side
        A right ear is coiled as the mirror image of a left one.
    label : str
        What stands beside it.
    role : str
        Its colour: a state of the theme, ``pose`` or ``pose_2``.
    style : str
        How its axis is drawn: ``dashed``, ``dotted`` or ``solid``; by default as its role asks. What is
        labelled is solid, what is estimated broken.
    """

    key: str
    T_scan_cochlea: FloatArray
    covariance: FloatArray
    cone: float
    side: Side = Side.LEFT
    label: str = "CO"
    role: str = "pose"
    style: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "style", self.style or _STYLES.get(self.role, "dashed"))

    @classmethod
    def of(
        cls, pose: CochleaPose, T_scan_touches: RigidTransform, *, key: str = "", label: str = "CO"
    ) -> DrawnPose:
        """Bring an estimate into the scan, in the colour of its method."""
        turn = np.kron(np.eye(2), T_scan_touches.rotation)
        return cls(
            key or f"{pose.side.value} {pose.method}",
            T_scan_touches.matrix @ pose.transform,
            turn @ pose.covariance @ turn.T,
            pose.plain_cone_95,
            pose.side,
            label,
            METHOD_ROLES.get(pose.method, "pose"),
        )

    @classmethod
    def of_reading(cls, reading: Hypothesis, T_scan_touches: RigidTransform) -> DrawnPose:
        """Bring another reading of the touches into the scan, dotted."""
        turn = np.kron(np.eye(2), T_scan_touches.rotation)
        percent = f"{100 * reading.probability:.0f} %" if reading.probability >= 0.01 else "< 1 %"
        return cls(
            f"{reading.side.value} {reading.label}",
            T_scan_touches.matrix @ reading.transform_to_touches.matrix,
            turn @ reading.covariance @ turn.T,
            cone_95(reading.covariance, reading.axis),
            reading.side,
            f"{percent} {reading.label}",
            style="dotted",
        )

    @property
    def origin(self) -> FloatArray:
        """(3,) CO, scan frame, mm."""
        return self.T_scan_cochlea[:3, 3]

    @property
    def axis(self) -> FloatArray:
        """(3,) unit modiolar axis, towards the apex."""
        axis: FloatArray = self.T_scan_cochlea[:3, 0]
        return axis

    @property
    def towards_window(self) -> FloatArray:
        """(3,) unit vector across the axis, from CO towards the middle of the round window."""
        return self.T_scan_cochlea[:3, 1]

    @property
    def up(self) -> FloatArray:
        """(3,) unit vector that points about to the top of the head, for either side."""
        return self.T_scan_cochlea[:3, 2] * (1.0 if self.side is Side.LEFT else -1.0)

    @cached_property
    def tip(self) -> FloatArray:
        """(3,) end of the arrow, mm."""
        end: FloatArray = self.at([AXIS_MM, 0, 0])[0]
        return end

    @cached_property
    def tail(self) -> FloatArray:
        """(3,) where the arrow begins, a little behind the origin, mm."""
        start: FloatArray = self.at([-BEHIND_MM, 0, 0])[0]
        return start

    @cached_property
    def rim(self) -> FloatArray:
        """(N, 3) rim of the cone about the axis, mm."""
        turn = np.linspace(0.0, 2 * np.pi, _CORNERS, endpoint=False)
        circle = self.cone_radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        return self.at(np.column_stack([np.full(_CORNERS, AXIS_MM), circle]))

    @property
    def cone_radius(self) -> float:
        """Radius of the cone at the tip, mm; a cone too wide to draw is cut."""
        return AXIS_MM * float(np.tan(min(self.cone, 1.2)))

    def at(self, points: ArrayLike) -> FloatArray:
        """Return the (N, 3) scan positions of (N, 3) points of the cochlea frame, mm."""
        local = np.asarray(points, dtype=np.float64).reshape(-1, 3)
        moved: FloatArray = local @ self.T_scan_cochlea[:3, :3].T + self.origin
        return moved


@dataclass(frozen=True, eq=False)
class DrawnTruth:
    """The labelled cochlea: what an estimate is judged against.

    Parameters
    ----------
    side : Side
        The estimates of that side are compared with it.
    origin : (3,) float array
        Labelled CO, scan frame, mm.
    axis : (3,) float array
        Unit vector from the labelled CB to the labelled CA.
    label : str
        What stands beside it.
    """

    side: Side
    origin: FloatArray
    axis: FloatArray
    label: str = "labelled"

    @cached_property
    def tip(self) -> FloatArray:
        """(3,) end of the line, mm."""
        end: FloatArray = self.origin + AXIS_MM * self.axis
        return end

    @cached_property
    def tail(self) -> FloatArray:
        """(3,) where the line begins, mm."""
        start: FloatArray = self.origin - BEHIND_MM * self.axis
        return start

    def errors(self, pose: DrawnPose) -> tuple[float, float]:
        """Return how far an estimate is off: mm between the origins, and rad between the axes."""
        off = float(np.linalg.norm(pose.origin - self.origin))
        across = float(np.linalg.norm(np.cross(pose.axis, self.axis)))
        return off, float(np.arctan2(across, pose.axis @ self.axis))


@dataclass(frozen=True, eq=False)
class DrawnTouch:
    """A touched point brought into the scan.

    Parameters
    ----------
    code : str
        Feature code; written beside it.
    position : (3,) float array
        Scan frame, mm.
    suspect : bool
        Whether it does not fit the others.
    used : bool
        False where the estimate was made without it: it is drawn faintly.
    """

    code: str
    position: FloatArray
    suspect: bool = False
    used: bool = True


@dataclass(frozen=True, eq=False)
class DrawnFeature:
    """A mean feature of the atlas, in an estimated pose.

    Parameters
    ----------
    code : str
        Feature code.
    position : (3,) float array
        Scan frame, mm.
    role : str
        Colour, that of its estimate.
    """

    code: str
    position: FloatArray
    role: str = "pose"


@dataclass(frozen=True, eq=False)
class DrawnVector:
    """An error vector: from where a feature is expected to where it was labelled or touched.

    Parameters
    ----------
    start, end : (3,) float array
        Scan frame, mm.
    code : str
        Feature code; written with the length where it is longer than `LONG_MM`.
    role : str
        Colour, that of its estimate.
    """

    start: FloatArray
    end: FloatArray
    code: str = ""
    role: str = "pose"

    @property
    def length(self) -> float:
        """Length, mm."""
        return float(np.linalg.norm(self.end - self.start))

    @property
    def is_long(self) -> bool:
        """Whether it is emphasised."""
        return self.length > LONG_MM


@dataclass(frozen=True, eq=False)
class DrawnTip:
    """The tip of a tracked probe.

    Parameters
    ----------
    position : (3,) float array
        Scan frame, mm; where it was last seen while it is not visible.
    handle : (3,) float array, optional
        Direction from the tip up the shaft; where unknown, only the tip is drawn.
    trail : (N, 3) float array
        Where it was lately, the oldest first, mm.
    visible : bool
        Whether the tracker sees it now; otherwise it is grey.
    label : str
        What stands beside it.
    """

    position: FloatArray
    handle: FloatArray | None = None
    trail: FloatArray = field(default_factory=lambda: np.empty((0, 3)))
    visible: bool = True
    label: str = ""


@dataclass(frozen=True, eq=False)
class PoseScene:
    """All that is drawn of estimates, at one moment.

    Parameters
    ----------
    poses, truths, touches, features, vectors : tuple
        See the classes.
    tip : DrawnTip, optional
        A tracked probe.
    paths : tuple of (N, 3) float array
        Insertion paths, scan frame, mm.
    parts : frozenset of str
        Which of `PARTS` are shown.
    opacity : float
        Of all but names, from 0 to 1.
    """

    poses: tuple[DrawnPose, ...] = ()
    truths: tuple[DrawnTruth, ...] = ()
    touches: tuple[DrawnTouch, ...] = ()
    features: tuple[DrawnFeature, ...] = ()
    vectors: tuple[DrawnVector, ...] = ()
    tip: DrawnTip | None = None
    paths: tuple[FloatArray, ...] = ()
    parts: frozenset[str] = frozenset(PARTS)
    opacity: float = 1.0

    def shows(self, part: str) -> bool:
        """Whether one of `PARTS` is shown."""
        return part in self.parts

    @cached_property
    def seen(self) -> PoseScene:
        """The same without what is hidden; regions, outlines and names hang on the poses and stay."""
        hidden = {
            "truths": "truth",
            "touches": "touches",
            "features": "features",
            "vectors": "vectors",
            "paths": "path",
        }
        changes = {name: () for name, part in hidden.items() if not self.shows(part)}
        tip = self.tip if self.shows("tip") else None
        return replace(self, tip=tip, **changes)  # type: ignore[arg-type]

    def text_of(self, pose: DrawnPose) -> str:
        """Return what is written at an estimate: its label, and its error where the truth is labelled."""
        truth = next((truth for truth in self.truths if truth.side is pose.side), None)
        words = [pose.label] if truth is None else [pose.label, f"off {error_text(*truth.errors(pose))}"]
        return " · ".join(word for word in words if word)


def error_text(off_mm: float, angle: float) -> str:
    """Say an error, such as ``"0.42 mm, 3.1°"``; the angle given in rad."""
    return f"{off_mm:.2f} mm, {np.degrees(angle):.1f}°"
