"""The estimated pose of a cochlea: plain data, with its uncertainty and its files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from functools import cached_property
from os import PathLike
from typing import Any

import numpy as np

from gp_core.argument_types import checks_arguments
from gp_core.disk import write_text
from gp_core.errors import GpError
from gp_core.frames import RigidTransform, quaternion_xyzw
from gp_core.html_tables import html_table
from gp_core.io.pose_export import pose_text, write_csv, write_landmarks
from gp_core.io.tfm import write_tfm
from gp_core.landmarks.features import Side
from gp_core.landmarks.repeats import RepeatedTouches
from gp_core.pose.covariance import cone_95, radius_95
from gp_core.pose.estimate_inputs import EstimateInputs
from gp_core.pose.mixture import UNDECIDED, Hypothesis, axis_part, mixture_radius_95, origin_part
from gp_core.validation import FloatArray, check_option, freeze_arrays

__all__ = ["HYPOTHESIS_STATES", "ROUND_WINDOWS", "CochleaPose"]

ROUND_WINDOWS = ("touched", "expected")
"""Which round window y of the cochlea frame points to: the touched one, or that of the fitted atlas."""

HYPOTHESIS_STATES = ("clear", "undecided", "wrong", "unchecked")
"""Other hypotheses: all ruled out; some not ruled out; one fits far better; not checked by the method."""


@dataclass(frozen=True)
class CochleaPose:
    """Position and orientation of a cochlea, in the frame of the touches.

    Attributes
    ----------
    side : Side
        Side of the head.
    method : str
        ``robust`` or ``jrmpc``.
    atlas : str
        Name of the atlas, or of the specimens, behind it.
    transform_to_touches : RigidTransform
        ``T_tracker_cochlea`` (or scan): origin CO, x the modiolar axis CB->CA on both sides, y towards the
        middle of the round window, z = x × y.
    covariance : (6, 6) array
        Of the origin (mm) and of a small rotation vector about it (rad), both in the frame of the touches.
    residuals : dict of str to float
        Distance of each touched point from the registered mean, mm.
    suspects : tuple of str
        Touched points that contradict the others.
    warnings : tuple of str
        What the user should know before using the pose.
    probe_noise : float or None
        Scale of the touch errors that was estimated or given, mm per coordinate.
    T_touches_atlas : RigidTransform or None
        The registered atlas, for a left side; for a right side, from the atlas mirrored in x.
    round_window : str
        Which round window y points to: ``touched`` or ``expected``.
    swapped : (str, str) or None
        Two touched features whose names look, or may be, exchanged.
    side_state, names_state : str
        One of `HYPOTHESIS_STATES`: whether the touches may be those of the other ear, and whether the names
        of two of them may be exchanged. Only a pose with both ``clear`` is for a robot; see
        `gp_core.pose.gate.PoseGate`.
    shared_error : float or None
        RMS length of the offset common to all touches that the regions allow for, mm; None: not considered.
    probability : float
        Of the touches as they are named, among all hypotheses.
    hypotheses : tuple of Hypothesis
        Other hypotheses that are not ruled out, the likeliest first.
    repeats : mapping of str to RepeatedTouches
        The touches of each feature that was touched more than once.
    of_both_ears : bool
        Whether its axis was made of both ears' (`gp_core.fuse_ears`).
    other_ear : mapping of str to object
        What the comparison with the other ear gave, as `gp_core.EarComparison.as_dict` returns it: whether
        it ``agrees``, the finding as ``text``, and its figures; empty where none was made. A pose whose ears
        disagree is not for a robot.
    stamp : str
        When it was estimated, ISO 8601 in UTC; empty where that is not known.
    inputs : EstimateInputs or None
        All that it was estimated from; `gp_core.estimate_again` runs it again.
    """

    side: Side
    method: str
    atlas: str
    transform_to_touches: RigidTransform
    covariance: FloatArray
    residuals: dict[str, float]
    suspects: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    probe_noise: float | None = None
    T_touches_atlas: RigidTransform | None = field(default=None, repr=False)
    round_window: str = "expected"
    swapped: tuple[str, str] | None = None
    side_state: str = "unchecked"
    names_state: str = "unchecked"
    shared_error: float | None = None
    probability: float = 1.0
    hypotheses: tuple[Hypothesis, ...] = ()
    repeats: Mapping[str, RepeatedTouches] = field(default_factory=dict)
    of_both_ears: bool = False
    other_ear: Mapping[str, Any] = field(default_factory=dict)
    stamp: str = field(default="", compare=False)
    inputs: EstimateInputs | None = field(default=None, repr=False, compare=False)

    def __post_init__(self) -> None:
        given = self.covariance
        shape = given.shape if isinstance(given, np.ndarray) else type(given).__name__
        if shape != (6, 6):
            raise GpError(f"the covariance of a pose must be a (6, 6) array, got {shape}")
        freeze_arrays(self)
        check_option(self.side_state, "state of the side", HYPOTHESIS_STATES)
        check_option(self.names_state, "state of the names", HYPOTHESIS_STATES)

    @property
    def origin(self) -> FloatArray:
        """(3,) cochlea origin CO, mm."""
        return self.transform_to_touches.translation

    @property
    def axis(self) -> FloatArray:
        """(3,) unit modiolar axis, from the base CB to the apex CA."""
        return self.transform_to_touches.rotation[:, 0]

    @property
    def transform(self) -> FloatArray:
        """(4, 4) homogeneous matrix ``T_tracker_cochlea``, mm."""
        return self.transform_to_touches.matrix

    @property
    def quaternion(self) -> FloatArray:
        """(4,) rotation of ``T_tracker_cochlea`` as a unit quaternion x, y, z, w, with w >= 0."""
        return quaternion_xyzw(self.transform_to_touches.rotation)

    @property
    def ears_disagree(self) -> bool:
        """Whether it was compared with the other ear, and the two contradict each other."""
        return bool(self.other_ear) and not self.other_ear["agrees"]

    @property
    def state(self) -> str:
        """The states, such as ``side undecided, names clear``; with ``ears disagree`` where they do."""
        ears = ", ears disagree" if self.ears_disagree else ""
        return f"side {self.side_state}, names {self.names_state}{ears}"

    @cached_property
    def radius_95(self) -> float:
        """Radius of the ball about the origin that contains CO with 95 %, over all hypotheses, mm."""
        if not self.hypotheses:
            return self.plain_radius_95
        return mixture_radius_95([origin_part(p, o, self.origin, c) for p, o, _, c in self._all_hypotheses()])

    @cached_property
    def cone_95(self) -> float:
        """Half-angle of the cone that contains the true axis with 95 %, over all hypotheses, rad."""
        if not self.hypotheses:
            return self.plain_cone_95
        parts = [axis_part(p, a, self.axis, c) for p, _, a, c in self._all_hypotheses()]
        return min(mixture_radius_95(parts), np.pi)

    @property
    def plain_radius_95(self) -> float:
        """The 95 % radius if the touches are named correctly, mm."""
        return radius_95(self.covariance)

    @property
    def plain_cone_95(self) -> float:
        """The 95 % cone if the touches are named correctly, rad."""
        return cone_95(self.covariance, self.axis)

    @property
    def is_multimodal(self) -> bool:
        """Whether the 95 % region covers other hypotheses that are not ruled out."""
        return any(h.probability >= UNDECIDED for h in self.hypotheses)

    @property
    def other_side_probability(self) -> float:
        """How likely the touches are those of the other ear, 0 to 1."""
        return sum(h.probability for h in self.hypotheses if h.exchanged is None)

    @property
    def likelier_hypothesis(self) -> Hypothesis | None:
        """A hypothesis that is likelier than the touches as they are named; None if there is none."""
        best = next(iter(self.hypotheses), None)
        return best if best is not None and best.probability > self.probability else None

    def _all_hypotheses(self) -> Iterator[tuple[float, FloatArray, FloatArray, FloatArray]]:
        yield self.probability, self.origin, self.axis, self.covariance
        for h in self.hypotheses:
            yield h.probability, h.origin, h.axis, h.covariance

    def _repr_html_(self) -> str:
        """Return the pose for a notebook."""
        origin = "  ".join(f"{value:.3f}" for value in self.origin)
        axis = "  ".join(f"{value:.4f}" for value in self.axis)
        rows = [
            ("origin CO", f"{origin} mm", f"95 % within {self.radius_95:.2f} mm"),
            ("axis CB->CA", axis, f"95 % within {np.degrees(self.cone_95):.1f} deg"),
            ("state", self.state, str(self.other_ear["text"]) if self.ears_disagree else ""),
            *(("warning", warning, "") for warning in self.warnings),
        ]
        title = f"Cochlea, {self.side.word} side, method {self.method}, atlas {self.atlas}"
        return html_table(title, rows)

    def as_dict(self) -> dict[str, Any]:
        """Return the pose itself as the JSON file holds it; `content` adds what it was made from.

        Returns
        -------
        dict
            Plain values for JSON; lengths in mm, angles in degrees.
        """
        content = {
            "gpPose": 1,
            "method": self.method,
            "side": self.side.value,
            "atlas": self.atlas,
            "frame": self.transform_to_touches.dst,
            "cochlea_origin_mm": self.origin.tolist(),
            "modiolar_axis": self.axis.tolist(),
            "transform": self.transform.tolist(),
            "quaternion_xyzw": self.quaternion.tolist(),
            "covariance": self.covariance.tolist(),
            "radius_95_mm": self.radius_95,
            "cone_95_deg": float(np.degrees(self.cone_95)),
            "plain_radius_95_mm": self.plain_radius_95,
            "plain_cone_95_deg": float(np.degrees(self.plain_cone_95)),
            "shared_error_mm": self.shared_error,
            "residuals_mm": self.residuals,
            "probe_noise_mm": self.probe_noise,
            "round_window": self.round_window,
            "suspect": list(self.suspects),
            "swapped": None if self.swapped is None else list(self.swapped),
            "state": self.state,
            "side_state": self.side_state,
            "names_state": self.names_state,
            "probability": self.probability,
            "hypotheses": [h.as_dict() for h in self.hypotheses],
            "warnings": list(self.warnings),
            "registered_atlas": None
            if self.T_touches_atlas is None
            else self.T_touches_atlas.matrix.tolist(),
        }
        if self.of_both_ears:
            content["axis_of_both_ears"] = True
        if self.other_ear:
            content["other_ear"] = dict(self.other_ear)
        if self.repeats:
            content["repeated_touches"] = {code: one.as_dict() for code, one in self.repeats.items()}
        return content

    def content(self) -> dict[str, Any]:
        """Return all that the JSON file holds: the pose, when it was estimated, and what from.

        Returns
        -------
        dict
            `as_dict`, ``stamp`` (ISO 8601, UTC), ``stamp_unix_s`` and ``inputs``, where these are known.
        """
        about: dict[str, Any] = {}
        if self.stamp:
            about = {"stamp": self.stamp, "stamp_unix_s": datetime.fromisoformat(self.stamp).timestamp()}
        if self.inputs is not None:
            about["inputs"] = self.inputs.as_dict()
        return {**self.as_dict(), **about}

    @checks_arguments
    def save(self, path: str | PathLike[str]) -> None:
        """Write the pose as JSON, with all that is needed to estimate it again.

        Parameters
        ----------
        path : path-like
            Where to write.

        Raises
        ------
        GpError
            The file cannot be written.
        """
        write_text(path, pose_text(self.content()))

    @checks_arguments
    def save_tfm(self, path: str | PathLike[str]) -> None:
        """Write the pose as an ITK transform file; see `gp_core.io.tfm.write_tfm`.

        Parameters
        ----------
        path : path-like
            Where to write.

        Raises
        ------
        GpError
            The file cannot be written.
        """
        write_tfm(path, self.transform_to_touches)

    @checks_arguments
    def save_csv(self, path: str | PathLike[str]) -> None:
        """Write the 4x4 matrix as plain numbers; see `gp_core.io.pose_export.write_csv`.

        Parameters
        ----------
        path : path-like
            Where to write.

        Raises
        ------
        GpError
            The file cannot be written.
        """
        write_csv(path, self)

    @checks_arguments
    def save_landmarks(self, path: str | PathLike[str]) -> None:
        """Write CO and axis as Slicer markups; see `gp_core.io.pose_export.write_landmarks`.

        Parameters
        ----------
        path : path-like
            Where to write.

        Raises
        ------
        GpError
            The file cannot be written.
        """
        write_landmarks(path, self)
