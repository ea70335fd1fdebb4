"""Registration by named points: known motions come back, and the promised errors are those that occur."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from gp_core.errors import GeometryError, GpError
from gp_core.frames import RigidTransform
from gp_core.registration.fiducials import register_fiducials
from gp_core.registration.procrustes import fit_rigid, rms_without_each
from gp_core.registration.result import RegistrationResult
from gp_core.validation import FloatArray

TARGETS = np.array([[3.0, -25.0, 8.0], [0.0, 0.0, 0.0], [40.0, 5.0, -3.0]])


def motion(rng: np.random.Generator) -> RigidTransform:
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return RigidTransform.from_parts(
        q * np.sign(np.linalg.det(q)), 80 * rng.normal(size=3), dst="tracker", src="scan"
    )


def named(points: FloatArray) -> dict[str, FloatArray]:
    return {f"S{i + 1}": point for i, point in enumerate(points)}


def _lists(n: int, noise: float, seed: int, wrong: float) -> tuple[FloatArray, FloatArray, RigidTransform]:
    """Points of the scan, as they were touched, and where the scan is in the tracker's frame."""
    rng = np.random.default_rng(seed)
    scan = np.random.default_rng(1).uniform(-1, 1, (n, 3)) * (12, 20, 9)
    T = motion(rng)
    points = T.apply(scan) + noise * rng.normal(size=(n, 3))
    points[1] += wrong * np.array([0.6, 0.0, 0.8])
    return scan, points, T


def touched(
    n: int, noise: float, seed: int, *, wrong: float = 0.0
) -> tuple[RegistrationResult, RigidTransform]:
    scan, points, T = _lists(n, noise, seed, wrong)
    return register_fiducials(named(points), {**named(scan), "other": np.zeros(3)}), T.inverse()


def test_a_known_motion_comes_back() -> None:
    found, T_scan_tracker = touched(5, 0.0, 0)
    np.testing.assert_allclose(found.T_scan_tracker.matrix, T_scan_tracker.matrix, atol=1e-9)
    assert (found.T_scan_tracker.dst, found.T_scan_tracker.src) == ("scan", "tracker")
    assert found.names == ("S1", "S2", "S3", "S4", "S5")
    assert found.fre_mm < 1e-9
    assert (found.tre_95_mm(TARGETS) < 1e-8).all()


@pytest.mark.parametrize("n", [3, 4, 8])
def test_errors_at_targets_are_as_expected(n: int) -> None:
    noise, squared, promised, points = 0.2, [], [], []
    for seed in range(500):
        found, T_scan_tracker = touched(n, noise, seed)
        if found.suspects:
            continue
        away = found.T_scan_tracker.apply(T_scan_tracker.inverse().apply(TARGETS)) - TARGETS
        squared.append((away**2).sum(axis=1))
        promised.append(found.tre_mm(TARGETS) ** 2)
        points.append(found.fle_mm**2)
    np.testing.assert_allclose(np.mean(promised, axis=0), np.mean(squared, axis=0), rtol=0.15)
    assert np.mean(points) == pytest.approx(3 * noise**2, rel=0.1)


@pytest.mark.parametrize("n", [3, 4, 8])
def test_the_upper_bound_holds_for_95_in_100(n: int) -> None:
    bounds = [touched(n, 0.2, seed)[0].fle_95_mm for seed in range(500)]
    assert 0.93 < np.mean(np.array(bounds) > 0.2 * np.sqrt(3)) < 0.97


@pytest.mark.parametrize("n", [3, 5, 12])
def test_the_bound_is_that_of_chi_square(n: int) -> None:
    found = touched(n, 0.2, 0)[0]
    freedom = 3 * n - 6
    assert found.fle_95_mm / found.fle_mm == pytest.approx(
        (freedom / chi2.ppf(0.05, freedom)) ** 0.5, rel=0.05
    )


def test_the_error_grows_away_from_the_points_and_moves_with_them() -> None:
    found = touched(8, 0.2, 3)[0]
    centre = found.fiducials.mean(axis=0)
    out = centre + np.outer([0, 10, 20, 40], [0.6, 0.0, 0.8])
    assert (np.diff(found.tre_mm(out)) > 0).all()
    assert found.tre_mm(centre[None])[0] == pytest.approx(found.fle_mm / np.sqrt(8))


@pytest.mark.parametrize("seed", range(4))
def test_a_wrong_point_is_named_and_left_out(seed: int) -> None:
    found, _ = touched(8, 0.1, seed, wrong=4.0)
    assert found.suspects == ("S2",)
    assert found.residuals_mm["S2"] == pytest.approx(4.0, abs=0.6)
    assert found.fre_mm < 0.3
    assert len(found.fiducials) == 7
    assert "S2 does not fit" in found.warnings[0]


def test_what_the_others_fit_twice_as_well_without_is_named() -> None:
    """Law: a suspect is named exactly where leaving it out halves the error, or more."""
    shares, named_ones = [], []
    for seed in range(40):
        for wrong in (0.7, 1.0, 1.3, 1.6):
            found, _ = touched(8, 0.2, seed, wrong=wrong)
            scan, tracker, _ = _lists(8, 0.2, seed, wrong)
            whole = fit_rigid(tracker, scan, dst="scan", src="tracker").rms
            shares.append(rms_without_each(tracker, scan).min() / whole)
            named_ones.append(bool(found.suspects))
    assert named_ones == [bool(share <= 0.5) for share in shares]
    assert sum(0.4 < share <= 0.5 for share in shares) > 5 < sum(0.5 < share < 0.6 for share in shares)


def test_few_points_say_what_they_cannot_tell() -> None:
    found = touched(3, 0.2, 0)[0]
    (warning,) = found.warnings
    assert warning.startswith("only 3 points: a wrong one cannot be detected")
    assert found.fle_95_mm > 2.5 * found.fle_mm
    assert touched(8, 0.2, 0)[0].warnings == ()
    assert touched(3, 0.0, 0)[0].warnings


def test_what_makes_no_registration_is_refused() -> None:
    square = named(np.array([[0, 0, 0], [5, 0, 0], [0, 5, 0], [0, 0, 5.0]]))
    with pytest.raises(GeometryError, match=r"at least 3 .* got 2 \(tracker: S1 S2 X; scan: S1 S2 S3 S4\)"):
        register_fiducials({"S1": [0, 0, 0], "S2": [1, 2, 3], "X": [0, 1, 0]}, square)
    line = named(np.outer(np.arange(4.0), [1.0, 2.0, 3.0]))
    with pytest.raises(GeometryError, match=r"on one line.*S1, S2, S3, S4"):
        register_fiducials(line, line)
    for wrong in ([1, 2], [np.nan, 0, 0], ["a", 0, 0], [1, [2], 3], None):
        with pytest.raises(GpError, match="landmark S2: position in the tracker frame must be three finite"):
            register_fiducials({**square, "S2": wrong}, square)  # type: ignore[dict-item]


@pytest.mark.parametrize("factor", [1e-3, 0.1, 10.0, 25.4, 1e3])
def test_points_of_another_unit_are_no_registration(factor: float) -> None:
    scan, points, _ = _lists(8, 0.2, 5, 0.0)
    found, targets = named(points), named(factor * scan)
    larger = "scan" if factor > 1 else "tracker"
    with pytest.raises(GeometryError, match=rf"points of the {larger} are .* times as far apart.*in mm"):
        register_fiducials(found, targets)


def test_one_touch_far_away_is_no_wrong_unit() -> None:
    scan, points, _ = _lists(8, 0.2, 5, 400.0)
    assert register_fiducials(named(points), named(scan)).suspects == ("S2",)


def test_as_json() -> None:
    content = touched(6, 0.1, 0)[0].as_dict()
    assert content.keys() >= {"transform", "fre_mm", "fle_mm", "fle_95_mm", "residuals_mm", "suspect"}
    assert (content["destination"], content["source"]) == ("scan", "tracker")
