"""Pivot calibration: simulated tips come back, motions of the tracker do not matter, bad frames are named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gp_core.errors import FileFormatError, GeometryError, GpError
from gp_core.io.tracker_recordings import read_marker_poses
from gp_core.registration.pivot import calibrate_pivot
from gp_core.validation import FloatArray

TIP = np.array([12.0, -4.0, 163.0])
PIVOT = np.array([-80.0, 240.0, -900.0])


def recorded(
    n: int = 200, *, noise: float = 0.0, tilt: float = 30.0, spin: float = 60.0, seed: int = 0
) -> FloatArray:
    """Poses of a marker whose tip rests, tilted and spun at random (degrees), its place off by noise (mm)."""
    rng = np.random.default_rng(seed)
    way = rng.uniform(0, 2 * np.pi, n)
    axes = np.column_stack([np.cos(way), np.sin(way), np.zeros(n)])
    tilted = Rotation.from_rotvec(np.radians(tilt) * np.sqrt(rng.uniform(0, 1, (n, 1))) * axes)
    spun = Rotation.from_rotvec(np.radians(spin) * rng.uniform(-1, 1, (n, 1)) * [0, 0, 1])
    base = Rotation.from_rotvec([2.0, -0.4, 1.1])
    rotations = (base * tilted * spun).as_matrix()
    poses = np.tile(np.eye(4), (n, 1, 1))
    poses[:, :3, :3] = rotations
    poses[:, :3, 3] = PIVOT - rotations @ TIP + noise * rng.normal(size=(n, 3))
    return poses


def test_a_known_tip_comes_back() -> None:
    found = calibrate_pivot(recorded())
    np.testing.assert_allclose(found.tip_offset, TIP, atol=1e-8)
    np.testing.assert_allclose(found.pivot, PIVOT, atol=1e-8)
    assert found.rms_mm < 1e-8
    assert (found.left_out, found.unseen, found.warnings) == ((), (), ())
    assert found.n_frames == 200


def test_errors_are_what_the_covariance_says() -> None:
    away, squared = [], []
    for seed in range(150):
        found = calibrate_pivot(recorded(60, noise=0.25, seed=seed))
        away.append(found.tip_offset - TIP)
        squared.append(found.covariance)
        assert found.standard_error_mm == pytest.approx(np.trace(found.covariance) ** 0.5)
        assert found.rms_mm == pytest.approx(0.25 * 3**0.5, rel=0.25)
    np.testing.assert_allclose(np.cov(np.transpose(away)), np.mean(squared, axis=0), atol=0.004)
    assert np.abs(np.mean(away, axis=0)).max() < 0.05


@settings(max_examples=20, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**32 - 1))
def test_motions_of_tracker_and_marker_do_not_matter(seed: int) -> None:
    rng = np.random.default_rng(seed)
    poses = recorded(40, noise=0.2, seed=seed)
    moved, turned = np.eye(4), np.eye(4)
    for T in (moved, turned):
        T[:3, :3], T[:3, 3] = Rotation.random(random_state=rng).as_matrix(), 300 * rng.normal(size=3)
    here = calibrate_pivot(poses)
    there = calibrate_pivot(moved @ poses)
    np.testing.assert_allclose(there.tip_offset, here.tip_offset, atol=1e-6)
    np.testing.assert_allclose(there.pivot, moved[:3, :3] @ here.pivot + moved[:3, 3], atol=1e-6)
    assert there.rms_mm == pytest.approx(here.rms_mm)
    other = calibrate_pivot(poses @ turned)  # another marker on the same probe
    np.testing.assert_allclose(turned[:3, :3] @ other.tip_offset + turned[:3, 3], here.tip_offset, atol=1e-6)


def test_the_order_of_frames_does_not_matter() -> None:
    poses = recorded(50, noise=0.2)
    order = np.random.default_rng(1).permutation(50)
    np.testing.assert_allclose(
        calibrate_pivot(poses[order]).tip_offset, calibrate_pivot(poses).tip_offset, atol=1e-9
    )


@pytest.mark.parametrize("seed", range(5))
def test_bad_frames_are_named_and_do_no_harm(seed: int) -> None:
    rng = np.random.default_rng(seed)
    poses = recorded(200, noise=0.2, seed=seed)
    bad = rng.choice(200, 40, replace=False)
    poses[bad, :3, 3] += rng.normal(size=(40, 3)) * rng.choice([5.0, 50.0, 500.0], (40, 1)) + 4.0
    unseen = np.setdiff1d(np.arange(0, 200, 19), bad)
    poses[unseen] = np.nan
    found = calibrate_pivot(poses)
    assert found.unseen == tuple(unseen)
    assert len(set(bad) - set(found.left_out)) <= 3  # some errors are small by chance
    assert len(set(found.left_out) - set(bad)) <= 1
    assert np.linalg.norm(found.tip_offset - TIP) < 0.4
    assert found.rms_mm < 0.5
    assert f"{len(found.left_out)} of 200 frames do not fit" in found.warnings[0]


def test_many_frames_off_to_one_side_do_no_harm() -> None:
    """Plain least squares would be drawn so far off that no frame stood out."""
    poses = recorded(200, noise=0.2)
    poses[:70, :3, 3] += [30.0, 0.0, 10.0]
    found = calibrate_pivot(poses)
    assert found.left_out == tuple(range(70))
    assert np.linalg.norm(found.tip_offset - TIP) < 0.3


def test_matrices_that_are_not_rigid_are_left_out() -> None:
    poses = recorded(60, noise=0.1)
    poses[3] = 0.0
    poses[4] *= 2.0
    poses[5, :3, :3] = -poses[5, :3, :3]
    poses[6, :3, 3] = 1e30
    found = calibrate_pivot(poses)
    assert found.left_out == (3, 4, 5, 6)
    assert np.linalg.norm(found.tip_offset - TIP) < 0.2


def test_more_rotation_shows_in_spread_and_error() -> None:
    wide, narrow = (calibrate_pivot(recorded(100, noise=0.2, tilt=tilt, spin=5)) for tilt in (40.0, 15.0))
    assert wide.spread_deg > 1.5 * narrow.spread_deg
    assert wide.standard_error_mm < narrow.standard_error_mm


def test_too_little_rotation_is_refused() -> None:
    for poses in (
        recorded(tilt=3.0),
        recorded(tilt=0.0, spin=170.0),  # about the shaft only: the tip may be anywhere along it
        np.tile(recorded(1), (50, 1, 1)),
    ):
        with pytest.raises(GeometryError, match=r"turned too little, or about one axis only.*Tilt the probe"):
            calibrate_pivot(poses)


def test_a_tip_that_did_not_rest_is_refused() -> None:
    poses = recorded(100)
    poses[:60, :3, 3] += 100 * np.random.default_rng(0).normal(size=(60, 3))
    with pytest.raises(GeometryError, match=r"the tip was not at rest.*Keep the tip"):
        calibrate_pivot(poses)
    slipping = recorded(100)
    slipping[:, 0, 3] += np.linspace(0, 8, 100)
    assert "may have slipped" in calibrate_pivot(slipping).warnings[0]


def test_what_is_no_recording_is_refused() -> None:
    poses = recorded(30)
    with pytest.raises(GeometryError, match="at least 10 frames, got 9"):
        calibrate_pivot(poses[:9])
    poses[8:] = np.nan
    with pytest.raises(GeometryError, match="at least 10 frames, got 8, and 22 without the marker"):
        calibrate_pivot(poses)
    wrongs: list[Any] = [np.eye(4), [], "tip", np.zeros((20, 4, 3))]
    for wrong in wrongs:
        with pytest.raises(GpError, match="marker poses must"):
            calibrate_pivot(wrong)
    with pytest.raises(GeometryError, match="none of the 30 poses is a rigid motion"):
        calibrate_pivot(np.zeros((30, 4, 4)))


def test_metres_are_refused() -> None:
    poses = recorded()
    poses[:, :3, 3] /= 1000
    with pytest.raises(GeometryError, match=r"seem to be in metres.*Give them in mm"):
        calibrate_pivot(poses)


def _text(rows: NDArray[Any], mark: str) -> str:
    return "\n".join(mark.join(repr(float(v)) for v in row) for row in rows) + "\n"


@pytest.mark.parametrize("mark", [",", ";", "\t", " "])
def test_poses_are_read_in_every_layout(mark: str, tmp_path: Path) -> None:
    poses, file = recorded(12, noise=0.1), tmp_path / "poses.csv"
    flat = poses.reshape(12, 16)
    stamped = np.column_stack([np.arange(12), flat])
    for text in (
        _text(flat, mark),
        mark.join("abcdefghijklmnop") + "\n" + _text(flat, mark),
        _text(flat[:, :12], mark),
        _text(stamped, mark),
        _text(stamped[:, :13], mark),
        "# recorded\n" + _text(poses.reshape(-1, 4), mark),
    ):
        file.write_text(text)
        np.testing.assert_array_equal(read_marker_poses(file), poses)


def test_frames_without_the_marker_are_nan(tmp_path: Path) -> None:
    file = tmp_path / "poses.csv"
    file.write_text(_text(recorded(2).reshape(2, 16), ",") + "," * 15 + "\n" + ",".join(["NaN"] * 16))
    poses = read_marker_poses(file)
    assert np.isnan(poses[2:]).all()
    assert np.isfinite(poses[:2]).all()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        ("a,b,c\n", "0 rows of no columns"),
        ("1,2,3\n4,5,6\n", "2 rows of 3 columns"),
        ("1,2,3,4\n" * 5, "5 rows of 4 columns"),
        (",".join("1" * 16) + "\n1,2\n", "2 rows of 16 columns and others"),
        (",".join("1" * 16) + "\nx" + ",1" * 15, "line 2 must hold numbers only"),
    ],
)
def test_other_tables_are_refused(text: str, message: str, tmp_path: Path) -> None:
    file = tmp_path / "poses.csv"
    file.write_text(text)
    with pytest.raises(FileFormatError, match=rf"poses\.csv.*{message}"):
        read_marker_poses(file)
