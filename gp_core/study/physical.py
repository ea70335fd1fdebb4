"""A touched skull compared with its own CT: the paper's physical test."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from gp_core.argument_types import checks_arguments
from gp_core.atlas.atlas import Atlas
from gp_core.atlas.sampling import draw_animal
from gp_core.constants import DEFINING_FEATURES, METHODS
from gp_core.errors import FeatureError, GpError
from gp_core.landmarks.anatomy import modiolar_axis, with_cochlea_origin
from gp_core.landmarks.features import CODES, EXTERNAL, TRAINING
from gp_core.landmarks.sets import LandmarkSet, Specimen
from gp_core.pose.cochlea_pose import CochleaPose
from gp_core.pose.estimate import estimate_pose
from gp_core.registration.icp_targets import TriangleMesh
from gp_core.registration.result import RegistrationResult
from gp_core.registration.skull import (
    register_by_icp,
    register_by_names,
    register_to_surface,
)
from gp_core.study.scoring import angle_between_deg
from gp_core.study.simulation import SimulationReport, simulate

__all__ = ["PhysicalReport", "PhysicalRow", "physical_simulations", "physical_test"]

_N_DRAWN = 11
"""Number of animals in the paper."""


@dataclass(frozen=True)
class PhysicalRow:
    """Errors of one estimate, relative to the CT under one registration.

    Attributes
    ----------
    registration : str
        ``names``, ``icp`` or ``surface``.
    method : str
        ``robust`` or ``jrmpc``.
    e_co_mm : float
        Distance between true and estimated CO, mm.
    e_ma_deg : float
        Angle between true and estimated modiolar axis, degrees.
    """

    registration: str
    method: str
    e_co_mm: float
    e_ma_deg: float


@dataclass(frozen=True)
class PhysicalReport:
    """A physical test of one side.

    Attributes
    ----------
    side : str
        ``L`` or ``R``.
    registrations : tuple of RegistrationResult
        Of the touched skull to its CT.
    rows : tuple of PhysicalRow
        Every method under every registration.
    warnings : tuple of str
        What to know before using the errors.
    """

    side: str
    registrations: tuple[RegistrationResult, ...]
    rows: tuple[PhysicalRow, ...]
    warnings: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return the report as the JSON file holds it.

        Returns
        -------
        dict
            Plain values for JSON; lengths in mm, angles in degrees.
        """
        return {
            "side": self.side,
            "registrations": [_as_dict(registration) for registration in self.registrations],
            "rows": [asdict(row) for row in self.rows],
            "warnings": list(self.warnings),
        }


def _as_dict(registration: RegistrationResult) -> dict[str, Any]:
    return {
        "way": registration.method,
        "T_scan_tracker": registration.T_scan_tracker.matrix.tolist(),
        "fre_mm": registration.fre_mm,
        "residuals_mm": registration.residuals_mm,
        "suspect": list(registration.suspects),
    }


@checks_arguments
def physical_test(
    touches: LandmarkSet,
    ct: LandmarkSet,
    *,
    atlas: Atlas | None = None,
    specimens: Sequence[Specimen] | None = None,
    bone: TriangleMesh | None = None,
) -> PhysicalReport:
    """Estimate a cochlea from touches of a skull, and compare it with the CT of the same skull.

    Parameters
    ----------
    touches : LandmarkSet
        Probe features, and in `extra` the skull features, tracker frame, mm.
    ct : LandmarkSet
        CA, CB, RWA and RWP, and in `extra` the skull features with the same names, scan frame, mm.
    atlas : Atlas, optional
        For the robust method; by default fitted to `specimens`, or else the published one.
    specimens : sequence of Specimen, optional
        Labelled animals other than this one; without them there is no JRMPC estimate.
    bone : TriangleMesh, optional
        The bone in the CT, scan frame, mm. Touched points in `extra` that the CT does not name are then
        registered to it, starting from the registration by names.

    Returns
    -------
    PhysicalReport
        Errors of every method under every registration.

    Raises
    ------
    GpError
        Fewer than three skull features in common, or collinear ones; a side or a feature that does not match.

    References
    ----------
    Usevitch et al., "Estimating the pose of a guinea-pig cochlea without medical imaging", 2021, Figure 6.
    """
    if touches.side is not ct.side:
        raise GpError(
            f"the touches are of the {touches.side.word} side, the CT of the {ct.side.word}",
            remedy="Give the landmarks of the side that was touched.",
        )
    for code in DEFINING_FEATURES:
        if code not in ct:
            raise FeatureError(
                f"the CT landmarks have no {code}, which defines the true cochlea",
                landmark=code,
                remedy="Label CA, CB, RWA and RWP in the CT.",
            )
    poses = _estimates(touches, atlas, specimens)
    by_names = register_by_names(touches, ct)
    registrations = [by_names, register_by_icp(touches, ct)]
    if bone is not None:
        unnamed = [point for name, point in touches.extra.items() if name not in ct.extra]
        registrations.append(register_to_surface(unnamed, bone, by_names.T_scan_tracker))
    true = with_cochlea_origin(ct)
    rows = [_row(registration, pose, true) for registration in registrations for pose in poses]
    return PhysicalReport(
        touches.side.value, tuple(registrations), tuple(rows), tuple(_warnings(registrations, poses))
    )


def physical_simulations(
    touches: LandmarkSet,
    *,
    specimens: Sequence[Specimen] | None = None,
    atlas: Atlas | None = None,
    n: int = 1000,
    noise: float = 0.0,
    rng: np.random.Generator,
    executor: Executor | None = None,
) -> tuple[SimulationReport, ...]:
    """Simulate sides that are touched as this skull was, for comparison with its errors (Figure 6 C and D).

    Parameters
    ----------
    touches : LandmarkSet
        Which features were touched.
    specimens : sequence of Specimen, optional
        Labelled animals: both methods are then simulated from their scatter. Without them, only the robust
        one is, from eleven animals drawn from the atlas.
    atlas : Atlas, optional
        By default the published one.
    n, noise, rng, executor
        As for `gp_core.study.simulation.simulate`.

    Returns
    -------
    tuple of SimulationReport
        One for each method.

    Raises
    ------
    GpError
        As for `gp_core.study.simulation.simulate`.
    """
    probe = [code for code in touches.placed if code in EXTERNAL and code in TRAINING]
    methods = METHODS if specimens else METHODS[:1]
    if not specimens:
        whole = atlas if atlas is not None and len(atlas.codes) == len(CODES) - 1 else Atlas.published()
        specimens = [draw_animal(whole, rng=rng, name=f"{i}") for i in range(_N_DRAWN)]
    return tuple(
        simulate(specimens, n=n, rng=rng, method=method, probe=probe, noise=noise, executor=executor)
        for method in methods
    )


def _estimates(
    touches: LandmarkSet, atlas: Atlas | None, specimens: Sequence[Specimen] | None
) -> list[CochleaPose]:
    methods = METHODS if specimens else METHODS[:1]
    probe = LandmarkSet(touches.points, touches.side, touches.frame)
    return [
        estimate_pose(probe, touches.side, atlas, method=method, specimens=specimens) for method in methods
    ]


def _row(registration: RegistrationResult, pose: CochleaPose, true: LandmarkSet) -> PhysicalRow:
    T_scan_tracker = registration.T_scan_tracker
    origin = T_scan_tracker.apply(pose.origin[None])[0]
    axis = T_scan_tracker.apply_vector(pose.axis)
    return PhysicalRow(
        registration.method,
        pose.method,
        float(np.linalg.norm(origin - true["CO"])),
        float(angle_between_deg(axis, modiolar_axis(true["CA"], true["CB"]))),
    )


def _warnings(registrations: Sequence[RegistrationResult], poses: Sequence[CochleaPose]) -> list[str]:
    by_names, by_icp = registrations[:2]
    found = [
        f"skull feature {name} does not fit the others: left out of the registration by names"
        for name in by_names.suspects
    ]
    if by_icp.fre_mm > 2 * by_names.fre_mm and not by_names.suspects:
        found.append("ICP pairs skull features differently from their names")
    found += [f"{pose.method}: {warning}" for pose in poses for warning in pose.warnings]
    return found
