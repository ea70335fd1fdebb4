"""Register a touched skull to its CT: by names, by ICP as in the paper, or to the bone surface."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from gp_core.errors import GeometryError
from gp_core.frames import RigidTransform
from gp_core.landmarks.sets import LandmarkSet
from gp_core.registration.fiducials import register_fiducials
from gp_core.registration.icp import icp
from gp_core.registration.icp_targets import Cloud, TriangleMesh
from gp_core.registration.result import RegistrationResult
from gp_core.validation import FloatArray, as_points

__all__ = ["register_by_icp", "register_by_names", "register_to_surface"]

_FEWEST = 3


def register_by_names(touches: LandmarkSet, ct: LandmarkSet) -> RegistrationResult:
    """Register the skull features by their names; outliers are left out.

    Parameters
    ----------
    touches, ct : LandmarkSet
        With the skull features in `extra`, mm; tracker and scan frame.

    Returns
    -------
    RegistrationResult
        ``T_scan_tracker``, method ``names``.

    Raises
    ------
    GpError
        Fewer than three features in common, or collinear ones.
    """
    names, touched, labelled = _common(touches, ct)
    return register_fiducials(dict(zip(names, touched, strict=True)), dict(zip(names, labelled, strict=True)))


def register_by_icp(touches: LandmarkSet, ct: LandmarkSet) -> RegistrationResult:
    """Register the skull features by iterative closest point, without their names, as the paper does.

    Parameters
    ----------
    touches, ct : LandmarkSet
        With the skull features in `extra`, mm; tracker and scan frame.

    Returns
    -------
    RegistrationResult
        ``T_scan_tracker``, method ``icp``.

    Raises
    ------
    GpError
        Fewer than three features in common, or collinear ones.
    """
    names, touched, labelled = _common(touches, ct)
    found = icp(touched, Cloud(labelled), dst="scan", src="tracker")
    residuals = _residuals(found.transform, names, touched, labelled)
    rms = float(np.sqrt(np.mean(np.square(list(residuals.values())))))
    return RegistrationResult(found.transform, tuple(names), residuals, rms, fiducials=labelled, method="icp")


def register_to_surface(points: ArrayLike, bone: TriangleMesh, start: RigidTransform) -> RegistrationResult:
    """Register points touched anywhere on the bone to its surface.

    Parameters
    ----------
    points : (N, 3) array_like, mm, tracker frame
        Spread over the skull; names are not needed.
    bone : TriangleMesh
        From the CT, mm, scan frame.
    start : RigidTransform
        ``T_scan_tracker`` to within some millimetres and ten degrees, such as `register_by_names` gives for a
        few features.

    Returns
    -------
    RegistrationResult
        ``T_scan_tracker``, method ``surface``.

    Raises
    ------
    GeometryError
        Fewer than three points, or collinear ones.
    """
    touched = as_points(np.reshape(points, (-1, 3)), "points on the bone")
    if len(touched) < _FEWEST:
        raise GeometryError(
            f"a registration to bone needs at least {_FEWEST} touched points that the CT does not name, "
            f"got {len(touched)}",
            remedy="Touch more, spread over the skull.",
        )
    found = icp(touched, bone, start=start, dst=start.dst, src=start.src)
    residuals = {f"point {i + 1}": distance for i, distance in enumerate(found.distances.tolist())}
    return RegistrationResult(
        found.transform,
        tuple(residuals),
        residuals,
        found.rms,
        fiducials=found.transform.apply(touched),
        method="surface",
    )


def _common(touches: LandmarkSet, ct: LandmarkSet) -> tuple[list[str], FloatArray, FloatArray]:
    names = [name for name in touches.extra if name in ct.extra]
    if len(names) < _FEWEST:
        raise GeometryError(
            f"touches and CT must have at least {_FEWEST} skull features by the same names, got {len(names)}"
            f" (touched: {' '.join(touches.extra) or 'none'}; CT: {' '.join(ct.extra) or 'none'})",
            remedy="Name them alike in both files, such as S1 to S8.",
        )
    touched, labelled = (np.array([s.extra[name] for name in names]) for s in (touches, ct))
    return names, touched, labelled


def _residuals(
    transform: RigidTransform, names: Sequence[str], touched: FloatArray, labelled: FloatArray
) -> dict[str, float]:
    lengths = np.linalg.norm(transform.apply(touched) - labelled, axis=1)
    return dict(zip(names, lengths.tolist(), strict=True))
