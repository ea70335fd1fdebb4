"""Fill values leave threshold, histogram, grey values and surface as they were without them."""

from __future__ import annotations

import warnings
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import tifffile
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from gp_core.errors import GpError
from gp_labeler.imaging.fill import Replacement, find_fill, replacement_of
from gp_labeler.imaging.histogram import histogram_of, window_presets
from gp_labeler.imaging.readers import read_volume
from gp_labeler.imaging.surface import extract_isosurface
from gp_labeler.imaging.threshold import propose_threshold
from gp_labeler.imaging.volume import Volume
from gp_labeler.phantom import make_phantom

SPACING = 0.5


@cache
def head() -> np.ndarray:
    """The phantom in Hounsfield-like units: air -1000, bone from some 700."""
    array = make_phantom(0, spacing=SPACING).volume.array.astype(np.float64)
    low, high = np.percentile(array, (5, 99.5))
    return np.clip(-1000 + (array - low) / (high - low) * 3000, -1024, 3071).astype(np.int16)


@cache
def plain() -> tuple[Volume, float, cKDTree]:
    """The head without a fill, its threshold, and its surface."""
    volume = Volume.from_parts(head(), [SPACING] * 3)
    threshold = propose_threshold(volume)
    return volume, threshold, cKDTree(extract_isosurface(volume, threshold, smallest_mm=0).points)


def outside_circle(shape: tuple[int, ...]) -> np.ndarray:
    _, ny, nx = shape
    y, x = np.ogrid[:ny, :nx]
    circle = ((y - ny / 2) / (ny / 2)) ** 2 + ((x - nx / 2) / (nx / 2)) ** 2 > 1
    return np.broadcast_to(circle, shape)


def outside_turned_box(shape: tuple[int, ...]) -> np.ndarray:
    """What a scan that was turned and resampled leaves in the corners."""
    half = np.array(shape) / 2
    grid = np.moveaxis(np.indices(shape), 0, -1) - half
    turned = grid @ Rotation.from_euler("xyz", [12, -9, 17], degrees=True).as_matrix()
    return (np.abs(turned) > 0.93 * half).any(axis=-1)


def lost_slices(shape: tuple[int, ...]) -> np.ndarray:
    lost = np.zeros(shape, dtype=bool)
    lost[:4] = lost[-3:] = True
    return lost


PLACES = {"circle": outside_circle, "turned": outside_turned_box, "slices": lost_slices}
FILLS = [
    *((dtype, value) for dtype in ("int16", "float32") for value in (-2000, -3024, -32768)),
    *(("float32", value) for value in (-1e4, -3.4e38, np.nan, -np.inf, 1e6)),
    ("float64", -1.7e308),
    ("int32", -(2**31)),
    ("int16", 32767),
]


def read(tmp_path: Path, array: np.ndarray) -> Volume:
    tifffile.imwrite(tmp_path / "a.tif", array, metadata=None)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return read_volume(tmp_path / "a.tif", spacing=SPACING)


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize(("dtype", "value"), FILLS)
def test_a_fill_changes_nothing(place: str, dtype: str, value: float, tmp_path: Path) -> None:
    nothing = PLACES[place](head().shape)
    array = head().astype(dtype)
    array[nothing] = value
    volume = read(tmp_path, array)
    measured = head()[~nothing]
    assert any("fill values" in note for note in volume.notes)
    assert volume.fill == volume.array.min() < measured.min()
    np.testing.assert_array_equal(volume.array == volume.fill, nothing)
    np.testing.assert_array_equal(volume.array[~nothing], measured)
    without, expected, surface = plain()
    threshold = propose_threshold(volume)
    assert threshold == pytest.approx(expected, abs=80)
    assert volume.intensity_range == pytest.approx(without.intensity_range, abs=120)
    histogram = histogram_of(volume)
    assert -1100 < histogram.low < histogram.high < 3200
    assert window_presets(volume, threshold)["Full"][1] < 4300
    found = extract_isosurface(volume, threshold).points
    assert surface.query(found)[0].max() < 2 * SPACING  # no bone at the fill's edge


@pytest.mark.parametrize("value", [0, 40, 65535, 30000])
def test_a_constant_around_the_circle_is_a_fill_wherever_it_lies_among_the_values(
    value: int, tmp_path: Path
) -> None:
    nothing = outside_circle(head().shape)
    array = (head().astype(np.int32) + 29000).astype(np.uint16)
    array[nothing] = value
    volume = read(tmp_path, array)
    assert propose_threshold(volume) == pytest.approx(29000 + plain()[1], abs=80)
    assert volume.intensity_range[0] > 27800
    assert volume.intensity_range[1] < 32200


def _noisy(shape: tuple[int, ...], sd: float) -> np.ndarray:
    return np.random.default_rng(4).normal(0, sd, shape)


def masked_skull() -> np.ndarray:
    bone = head() > 700
    return np.where(bone, head() + 1024, 0).astype(np.uint16)


def dry_skull_of_8_bit() -> np.ndarray:
    return np.clip((head().astype(float) - 200) / 8, 0, 255).astype(np.uint8)


def saturated() -> np.ndarray:
    return np.minimum(head(), 900)


NO_FILLS = {
    "plain": head,
    "masked skull": masked_skull,
    "masked skull, air -1024": lambda: np.where(head() > 700, head(), -1024).astype(np.int16),
    "8 bit, air cut off": dry_skull_of_8_bit,
    "bone cut off": saturated,
    "labels": lambda: (head() > 700).astype(np.uint8),
    "three labels": lambda: ((head() > 700) + (head() > -500).astype(int)).astype(np.uint8),
    "ramp": lambda: np.arange(30**3, dtype=np.float32).reshape(30, 30, 30),
    "noise": lambda: _noisy((30, 30, 30), 5.0).astype(np.float32),
}


@pytest.mark.parametrize("name", NO_FILLS)
def test_air_and_bone_are_no_fill(name: str) -> None:
    array = NO_FILLS[name]()
    assert find_fill(array) == ()
    assert replacement_of(array, find_fill(array)) == Replacement()


def test_two_fills_are_both_found(tmp_path: Path) -> None:
    circle, lost = outside_circle(head().shape), lost_slices(head().shape)
    array = head().copy()
    array[circle], array[lost] = -3024, -32768
    volume = read(tmp_path, array)
    np.testing.assert_array_equal(volume.array == volume.fill, circle | lost)


def test_a_type_without_room_below_takes_the_lowest_value(tmp_path: Path) -> None:
    array = dry_skull_of_8_bit()
    nothing = outside_circle(array.shape)
    expected = np.where(nothing, 0, array)
    array = np.where(nothing, 255, array).astype(np.uint8)
    volume = read(tmp_path, array)
    assert volume.fill is None
    np.testing.assert_array_equal(volume.array, expected)


def test_late_errors_name_the_file(tmp_path: Path) -> None:
    flat = read(tmp_path, np.full((30, 30, 30), 7, np.uint8))
    with pytest.raises(GpError, match=r"a\.tif: the volume has no contrast"):
        propose_threshold(flat)
    with pytest.raises(GpError, match=r"a\.tif: no surface in the volume at threshold 99"):
        extract_isosurface(flat, 99)
