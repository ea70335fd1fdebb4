"""The physical test on simulated skulls: known pose, noise, a wrong point, and points on bone."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np
import pytest
from matplotlib.axes import Axes
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation
from study_cases import cohort

from gp_core import PROBE, GpError, RigidTransform
from gp_core.landmarks.sets import LandmarkSet
from gp_core.registration.icp_targets import TriangleMesh
from gp_core.registration.skull import register_by_icp, register_by_names
from gp_core.study import figures
from gp_core.study.physical import PhysicalReport, PhysicalRow, physical_simulations, physical_test

COHORT = cohort(6, seed=3)
SKULL_MM = np.array([18.0, 25.0, 14.0])


def skull(
    *, noise: float = 0.0, wrong: float = 0.0, seed: int = 0
) -> tuple[LandmarkSet, LandmarkSet, RigidTransform]:
    """Touches (tracker), CT landmarks (scan) and T_scan_tracker of an animal that is not in the cohort."""
    rng = np.random.default_rng(seed)
    animal = cohort(1, seed=100 + seed)[0].side("R")
    features = {f"S{i}": SKULL_MM * rng.uniform(-1, 1, 3) for i in range(1, 9)}
    ct_points = animal.as_mapping(("CA", "CB", "RWA", "RWP"))
    ct = LandmarkSet.from_mapping(ct_points, "R", frame="scan")
    ct = LandmarkSet(ct.points, ct.side, "scan", extra=MappingProxyType(features))
    rotation = Rotation.random(random_state=rng).as_matrix()
    T_tracker_scan = RigidTransform.from_parts(rotation, 100 * rng.normal(size=3), dst="tracker", src="scan")
    touched = LandmarkSet.from_mapping(animal.as_mapping(PROBE), "R", frame="scan")
    touched = LandmarkSet(touched.points, "R", "scan", extra=MappingProxyType(features))  # type: ignore[arg-type]
    touched = touched.moved(T_tracker_scan)
    extra = {name: point + noise * rng.normal(size=3) for name, point in touched.extra.items()}
    extra["S4"] = extra["S4"] + wrong * np.array([0.6, 0.0, 0.8])
    points = touched.points + noise * rng.normal(size=(20, 3))
    touches = LandmarkSet(points, "R", "tracker", extra=MappingProxyType(extra))  # type: ignore[arg-type]
    return touches, ct, T_tracker_scan.inverse()


def rows(report: PhysicalReport) -> dict[tuple[str, str], PhysicalRow]:
    return {(row.registration, row.method): row for row in report.rows}


def test_known_pose_is_found_both_ways() -> None:
    touches, ct, T_scan_tracker = skull()
    for registration in (register_by_names(touches, ct), register_by_icp(touches, ct)):
        np.testing.assert_allclose(registration.T_scan_tracker.matrix, T_scan_tracker.matrix, atol=1e-6)
        assert registration.fre_mm < 1e-6
        assert registration.suspects == ()


def test_errors_are_those_of_the_estimate() -> None:
    touches, ct, _ = skull()
    report = physical_test(touches, ct, specimens=COHORT)
    found = rows(report)
    assert found.keys() == {(w, m) for w in ("names", "icp") for m in ("robust", "jrmpc")}
    for row in found.values():
        assert 0.01 < row.e_co_mm < 1.0
        assert 0.1 < row.e_ma_deg < 20.0
    assert found["names", "robust"].e_co_mm == pytest.approx(found["icp", "robust"].e_co_mm, abs=1e-6)


def test_without_animals_there_is_no_jrmpc() -> None:
    touches, ct, _ = skull()
    assert {row.method for row in physical_test(touches, ct).rows} == {"robust"}


@pytest.mark.parametrize("seed", range(4))
def test_noise_shows_as_registration_error(seed: int) -> None:
    touches, ct, T_scan_tracker = skull(noise=0.3, seed=seed)
    registration = register_by_names(touches, ct)
    assert 0.2 < registration.fre_mm < 0.8
    centre = T_scan_tracker.inverse().apply([[0, 0, 0]])
    off = np.linalg.norm(registration.T_scan_tracker.apply(centre))
    assert off < 0.6


@pytest.mark.parametrize("seed", range(4))
def test_a_wrong_point_is_named_and_left_out(seed: int) -> None:
    touches, ct, T_scan_tracker = skull(noise=0.1, wrong=4.0, seed=seed)
    by_names, by_icp = register_by_names(touches, ct), register_by_icp(touches, ct)
    assert by_names.suspects == ("S4",)
    assert by_names.residuals_mm["S4"] == pytest.approx(4.0, abs=0.6)
    assert by_names.fre_mm < 0.4 < by_icp.fre_mm
    centre = T_scan_tracker.inverse().apply([[0, 0, 0]])
    assert np.linalg.norm(by_names.T_scan_tracker.apply(centre)) < 0.3
    report = physical_test(touches, ct)
    assert any("S4 does not fit" in warning for warning in report.warnings)


def test_points_anywhere_on_the_bone_register_too() -> None:
    touches, ct, T_scan_tracker = skull(noise=0.2)
    rng = np.random.default_rng(5)
    unit = rng.normal(size=(600, 3))
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    vertices = unit * (1 + 0.2 * np.sin(4 * unit[:, :1]) * np.cos(3 * unit[:, 1:2])) * SKULL_MM
    bone = TriangleMesh(vertices, ConvexHull(unit).simplices)
    on_bone = T_scan_tracker.inverse().apply(vertices[:60])
    extra = {**touches.extra, **{f"bone {i}": point for i, point in enumerate(on_bone)}}
    touches = LandmarkSet(touches.points, touches.side, "tracker", extra=MappingProxyType(extra))
    report = physical_test(touches, ct, bone=bone)
    surface = report.registrations[2]
    assert surface.method == "surface"
    assert surface.fre_mm < 0.01
    np.testing.assert_allclose(surface.T_scan_tracker.matrix, T_scan_tracker.matrix, atol=0.02)
    assert {row.registration for row in report.rows} == {"names", "icp", "surface"}
    with pytest.raises(GpError, match="at least 3 touched points that the CT does not name, got 0"):
        physical_test(skull()[0], ct, bone=bone)


def test_report_as_json() -> None:
    content = physical_test(*skull()[:2]).as_dict()
    assert content.keys() == {"side", "registrations", "rows", "warnings"}
    assert content["registrations"][0].keys() == {
        "way", "T_scan_tracker", "fre_mm", "residuals_mm", "suspect",
    }  # fmt: skip
    assert content["rows"][0].keys() == {"registration", "method", "e_co_mm", "e_ma_deg"}


def test_what_cannot_be_tested_is_refused() -> None:
    touches, ct, _ = skull()
    with pytest.raises(GpError, match=r"at least 3 skull features by the same names, got 0 \(touched: none"):
        physical_test(LandmarkSet(touches.points, "R", "tracker"), ct)  # type: ignore[arg-type]
    for code in ("CA", "CB", "RWA", "RWP"):
        with pytest.raises(GpError, match=f"CT landmarks have no {code}"):
            physical_test(touches, ct.with_point(code, None))
    left = LandmarkSet(ct.points, "L", "scan", extra=ct.extra)  # type: ignore[arg-type]
    with pytest.raises(GpError, match="touches are of the right side, the CT of the left"):
        physical_test(touches, left)
    line = {f"S{i}": np.array([i, 0.0, 0.0]) for i in range(4)}
    both = [LandmarkSet(s.points, "R", s.frame, extra=MappingProxyType(line)) for s in (touches, ct)]  # type: ignore[arg-type]
    with pytest.raises(GpError, match="on one line"):
        physical_test(*both)


def marks(ax: Axes) -> list[tuple[float, float]]:
    """Where the skull's marks stand; boxes have no such colour."""
    lines = [line for line in ax.lines if line.get_markeredgecolor() == figures.ACCENT]
    return [(float(np.ravel(line.get_xdata())[0]), float(np.ravel(line.get_ydata())[0])) for line in lines]


def test_the_skull_is_drawn_on_the_simulated_sides() -> None:
    touches, ct, _ = skull(noise=0.2)
    report = physical_test(touches, ct, specimens=COHORT)
    simulated = physical_simulations(touches, specimens=COHORT, n=20, rng=np.random.default_rng(0))
    assert [each.method for each in simulated] == ["robust", "jrmpc"]
    assert set(simulated[0].probe) == set(PROBE)
    figure = figures.draw_physical(report, simulated)
    for ax, error in zip(figure.axes, ("e_ma_deg", "e_co_mm"), strict=True):
        assert [text.get_text() for text in ax.get_xticklabels()] == 2 * ["left", "right", "pooled"]
        values = [getattr(row, error) for row in sorted(report.rows, key=lambda row: row.method == "jrmpc")]
        assert [y for _, y in marks(ax)] == pytest.approx(values)
        assert [round(x) for x, _ in marks(ax)] == [2, 2, 6, 6]  # on the right side's boxes
        assert ax.get_ylim()[1] > max(values)


def test_without_animals_those_of_the_atlas_are_simulated() -> None:
    touches, ct, _ = skull()
    report = physical_test(touches, ct)
    simulated = physical_simulations(touches, n=10, noise=0.1, rng=np.random.default_rng(0))
    assert [each.method for each in simulated] == ["robust"]
    assert len(marks(figures.draw_physical(report, simulated[0]).axes[0])) == 2
    alone = figures.draw_physical(report)
    assert [text.get_text() for text in alone.axes[0].get_xticklabels()] == ["right"]
    assert len(marks(alone.axes[1])) == 2
