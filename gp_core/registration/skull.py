"""Register a touched skull to its CT: by names, by ICP as in the paper, or to the surface of the bone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gp_core.errors import GeometryError
from gp_core.frames import RigidTransform
from gp_core.landmarks.sets import LandmarkSet
from gp_core.registration.fiducials import register_fiducials
from gp_core.registration.icp import icp
from gp_core.registration.icp_targets import Cloud, Surface
from gp_core.validation import FloatArray, as_points

__all__ = ["SkullRegistration", "register_by_icp", "register_by_names", "register_to_surface"]

_FEWEST = 3


@dataclass(frozen=True)
class SkullRegistration:
    """A touched skull registered to its CT.

    Attributes
    ----------
    way : str
        ``names``, ``icp`` or ``surface``.
    T_scan_tracker : RigidTransform
    fre_mm : float
        Fiducial registration error: root mean square distance between the touched features and those of the
        same names in the CT, of all but the suspects; of ``surface``, from the touches to the bone.
    residuals_mm : dict of str to float
        The distance of each feature.
    suspects : tuple of str
        Features that the others contradict; left out by ``names``, kept by ``icp``, as in the paper.
    """

    way: str
    T_scan_tracker: RigidTransform
    fre_mm: float
    residuals_mm: dict[str, float]
    suspects: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Return the registration as the JSON file holds it."""
        return {
            "way": self.way,
            "T_scan_tracker": self.T_scan_tracker.matrix.tolist(),
            "fre_mm": self.fre_mm,
            "residuals_mm": self.residuals_mm,
            "suspect": list(self.suspects),
        }


def register_by_names(touches: LandmarkSet, ct: LandmarkSet) -> SkullRegistration:
    """Register the skull features by their names; a feature that the others contradict is left out.

    Raises
    ------
    GpError
        Fewer than three features in common, or on one line.
    """
    names, touched, labelled = _common(touches, ct)
    found = register_fiducials(
        dict(zip(names, touched, strict=True)), dict(zip(names, labelled, strict=True))
    )
    return SkullRegistration("names", found.T_scan_tracker, found.fre_mm, found.residuals_mm, found.suspects)


def register_by_icp(touches: LandmarkSet, ct: LandmarkSet) -> SkullRegistration:
    """Register the skull features by iterative closest point, without their names, as the paper does.

    Raises
    ------
    GpError
        Fewer than three features in common, or on one line.
    """
    names, touched, labelled = _common(touches, ct)
    found = icp(touched, Cloud(labelled), dst="scan", src="tracker")
    residuals = _residuals(found.transform, names, touched, labelled)
    rms = float(np.sqrt(np.mean(np.square(list(residuals.values())))))
    return SkullRegistration("icp", found.transform, rms, residuals)


def register_to_surface(points: ArrayLike, bone: Surface, start: RigidTransform) -> SkullRegistration:
    """Register points touched anywhere on the bone to its surface.

    Parameters
    ----------
    points : (N, 3) array_like, mm, tracker frame
        Spread over the skull; names are not needed.
    bone : Surface
        From the CT, mm, scan frame.
    start : RigidTransform
        ``T_scan_tracker`` within some millimetres and ten degrees, such as `register_by_names` of a few
        features gives.

    Raises
    ------
    GeometryError
        Fewer than three points, or on one line.
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
    return SkullRegistration("surface", found.transform, found.rms, residuals)


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
