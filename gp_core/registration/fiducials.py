"""Register a tracker to a scan by named points, and say what error that leaves at a target."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gp_core.errors import GeometryError, GpError
from gp_core.frames import RigidTransform
from gp_core.landmarks.features import feature
from gp_core.landmarks.sets import LandmarkSet
from gp_core.registration.procrustes import RigidFit, fit_rigid, rms_without_each
from gp_core.stats import NORMAL_95, chi_square_share
from gp_core.validation import FloatArray, as_points

__all__ = ["FiducialRegistration", "named_points", "register_fiducials"]

_FEWEST = 3
_FEWEST_TO_DOUBT = 6
_TELLING = 0.5
"""A point is wrong if the others fit twice as well without it; of eight good ones, 0.3 % are called so."""

_EXACT_MM = 1e-6
_FEW = 6


@dataclass(frozen=True)
class FiducialRegistration:
    """A rigid registration by named points.

    Attributes
    ----------
    T_scan_tracker : RigidTransform
        From the touched points to those of the scan; its own frames are those that were asked for.
    names : tuple of str
        The points in both lists.
    residuals_mm : dict of str to float
        Distance of each from its fellow after registration, mm.
    fre_mm : float
        Fiducial registration error: root mean square of the residuals, but for the suspects'.
    suspects : tuple of str
        Points that the others contradict; they have no part in the transform.
    fiducials : (n, 3) array
        The points that made the transform, in the scan, mm.
    """

    T_scan_tracker: RigidTransform
    names: tuple[str, ...]
    residuals_mm: dict[str, float]
    fre_mm: float
    suspects: tuple[str, ...]
    fiducials: FloatArray = field(repr=False)

    @property
    def fle_mm(self) -> float:
        """Expected error of one point (fiducial localisation error, root mean square), mm.

        Both lists' errors together. The fit uses up part of it: FLE^2 = FRE^2 n / (n - 2).
        """
        n = len(self.fiducials)
        return float(self.fre_mm * np.sqrt(n / (n - 2)))

    @property
    def fle_95_mm(self) -> float:
        """What that error stays below with 95 %, mm; far above `fle_mm` where points are few.

        The sum of squared residuals is chi-square with 3 n - 6 degrees of freedom; its quantile is
        Wilson and Hilferty's (1931, doi:10.1073/pnas.17.12.684), a little on the safe side with three points.
        """
        freedom = 3 * len(self.fiducials) - 6
        return float(self.fle_mm / chi_square_share(freedom, -NORMAL_95) ** 0.5)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to know before trusting the registration."""
        found = [f"{name} does not fit the other points: left out" for name in self.suspects]
        n = len(self.fiducials)
        if n < _FEW:
            factor = self.fle_95_mm / self.fle_mm if self.fle_mm else 1.0
            found.append(
                f"only {n} points: a wrong one cannot be told, and the true error may well be "
                f"{factor:.1f} times the expected one"
                if factor > 1
                else f"only {n} points: a wrong one cannot be told"
            )
        return tuple(found)

    def tre_mm(self, points: ArrayLike) -> FloatArray:
        """Return the target registration error to expect (root mean square) at points of the scan.

        TRE^2(r) = FLE^2 / n (1 + 1/3 sum_k d_k^2 / f_k^2), with d_k the distance of the target from the
        k-th principal axis of the fiducials, and f_k the root mean square distance of the fiducials from it.
        Errors are taken as independent and alike in all directions.

        Parameters
        ----------
        points : (N, 3) array_like, mm, scan frame

        Returns
        -------
        (N,) array, mm

        Raises
        ------
        GpError
            Not points.

        References
        ----------
        Fitzpatrick, West and Maurer, "Predicting error in rigid-body point-based registration", IEEE TMI
        17(5), 1998. https://doi.org/10.1109/42.736021
        """
        return self.fle_mm * self._error_shares(points)

    def tre_95_mm(self, points: ArrayLike) -> FloatArray:
        """Return the same (N,) with the error of the points at its upper 95 % bound, `fle_95_mm`."""
        return self.fle_95_mm * self._error_shares(points)

    def _error_shares(self, points: ArrayLike) -> FloatArray:
        """Return TRE / FLE at each point."""
        targets = as_points(points, "targets")
        centre = self.fiducials.mean(axis=0)
        _, _, axes = np.linalg.svd(self.fiducials - centre, full_matrices=False)
        own, theirs = (_squared_from_axes(cloud - centre, axes) for cloud in (self.fiducials, targets))
        shares: FloatArray = np.sqrt((1 + (theirs / own.mean(axis=0)).sum(axis=1) / 3) / len(own))
        return shares

    def as_dict(self) -> dict[str, Any]:
        """Return the registration as the JSON file holds it."""
        transform = self.T_scan_tracker
        return {
            "gpRegistration": 1,
            "destination": transform.dst,
            "source": transform.src,
            "transform": transform.matrix.tolist(),
            "fre_mm": self.fre_mm,
            "fle_mm": self.fle_mm,
            "fle_95_mm": self.fle_95_mm,
            "residuals_mm": self.residuals_mm,
            "suspect": list(self.suspects),
            "warnings": list(self.warnings),
        }


def register_fiducials(
    touches: Mapping[str, ArrayLike],
    scan: Mapping[str, ArrayLike],
    *,
    dst: str = "scan",
    src: str = "tracker",
) -> FiducialRegistration:
    """Register points by the names they have in common; one that the others contradict is left out.

    Parameters
    ----------
    touches, scan : mapping of str to (3,) array_like
        Named points in the tracker and in the scan, mm. Names in one of them only do not count.
    dst, src : str
        Frames of `scan` and of `touches`.

    Raises
    ------
    GeometryError
        Fewer than three names in common, or points on one line.
    GpError
        A position is not three finite numbers.

    Examples
    --------
    >>> corners = {"A": [0, 0, 0], "B": [9, 0, 0], "C": [0, 7, 0], "D": [0, 0, 5]}
    >>> found = register_fiducials(corners, {name: np.add(p, 1.0) for name, p in corners.items()})
    >>> found.T_scan_tracker.translation.round(9)
    array([1., 1., 1.])
    """
    names = _shared_names(touches, scan, dst=dst, src=src)
    pairs = _Pairs(names, _rows(touches, names, src), _rows(scan, names, dst), dst, src)
    suspects = _suspects(pairs)
    kept = [i for i in range(len(names)) if i not in suspects]
    fit = pairs.fit(kept)
    lengths = np.linalg.norm(fit.transform.apply(pairs.touched) - pairs.aims, axis=1)
    return FiducialRegistration(
        T_scan_tracker=fit.transform,
        names=names,
        residuals_mm=dict(zip(names, lengths.tolist(), strict=True)),
        fre_mm=fit.rms,
        suspects=tuple(names[i] for i in suspects),
        fiducials=pairs.aims[kept],
    )


def named_points(landmarks: LandmarkSet) -> dict[str, FloatArray]:
    """Return every point of a set by its name, features and others; not CO, which is only computed."""
    placed = landmarks.as_mapping(code for code in landmarks.placed if not feature(code).computed)
    return {**placed, **landmarks.extra}


@dataclass(frozen=True)
class _Pairs:
    """Points by the same names in two frames."""

    names: tuple[str, ...]
    touched: FloatArray
    aims: FloatArray
    dst: str
    src: str

    def fit(self, kept: Sequence[int]) -> RigidFit:
        names = [self.names[i] for i in kept]
        return fit_rigid(self.touched[kept], self.aims[kept], names=names, dst=self.dst, src=self.src)


def _suspects(pairs: _Pairs) -> list[int]:
    """Return the points without which the others fit much better, worst first."""
    kept = list(range(len(pairs.names)))
    found: list[int] = []
    rms = pairs.fit(kept).rms
    while len(kept) >= _FEWEST_TO_DOUBT and rms > _EXACT_MM:
        without = rms_without_each(pairs.touched[kept], pairs.aims[kept])
        best = int(without.argmin())
        if without[best] > _TELLING * rms:
            break
        found.append(kept.pop(best))
        rms = without[best]
    return found


def _shared_names(
    touches: Mapping[str, ArrayLike], scan: Mapping[str, ArrayLike], *, dst: str, src: str
) -> tuple[str, ...]:
    names = tuple(name for name in touches if name in scan)
    if len(names) < _FEWEST:
        raise GeometryError(
            f"a registration needs at least {_FEWEST} points by the same names, got {len(names)} "
            f"({src}: {_listed(touches)}; {dst}: {_listed(scan)})",
            remedy="Name them alike in both, or add points.",
        )
    return names


def _listed(points: Mapping[str, ArrayLike]) -> str:
    names = list(points)
    return (" ".join(names[:20]) or "none") + (" ..." if len(names) > 20 else "")


def _rows(points: Mapping[str, ArrayLike], names: Sequence[str], frame: str) -> FloatArray:
    rows = np.empty((len(names), 3))
    for row, name in enumerate(names):
        try:
            rows[row] = as_points(np.asarray(points[name])[None], "position")
        except (GpError, TypeError, ValueError):
            raise GpError(
                f"position in the {frame} frame must be three finite numbers in mm, got {points[name]!r}",
                landmark=name,
                remedy="Leave the point out if it was not seen.",
            ) from None
    return rows


def _squared_from_axes(arms: FloatArray, axes: FloatArray) -> FloatArray:
    """Return the squared distance (N, 3) of arms (N, 3) from each of the lines along three unit axes."""
    along = (arms @ axes.T) ** 2
    squared: FloatArray = along.sum(axis=1, keepdims=True) - along
    return squared
