"""Histograms for the threshold slider, grey presets, previews with their sides, and typed voxel sizes."""

from __future__ import annotations

import numpy as np
import pytest

from gp_core.errors import GpError
from gp_labeler.imaging.histogram import histogram_of, window_presets
from gp_labeler.imaging.preview import preview_planes
from gp_labeler.imaging.typed_spacing import spacing_in, typed_spacing
from gp_labeler.imaging.volume import Volume


def volume_of(array: np.ndarray, **rest) -> Volume:
    return Volume.from_parts(array, (0.1, 0.1, 0.2), **rest)


@pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.uint16, np.float32])
def test_two_grey_values_stand_where_they_are(dtype):
    array = np.full((20, 20, 20), 30, dtype)
    array[5:10] = 200
    array[0, 0, 0], array[0, 0, 1] = 0, 230
    histogram = histogram_of(volume_of(array))
    filled = histogram.edges[:-1][histogram.heights > 0.2]
    assert np.abs(filled - 30).min() < 3
    assert np.abs(filled - 200).min() < 3
    assert histogram.low == 0
    assert histogram.heights.max() <= 1.0 + 1e-9


def test_whole_numbers_fall_into_equal_bins():
    array = np.tile(np.arange(120, dtype=np.uint8), 100).reshape(10, 10, 120)
    heights = histogram_of(volume_of(array)).heights
    assert np.ptp(heights[1:-2]) < 0.05


def test_fraction_and_value_are_each_others_inverse_within_a_step():
    histogram = histogram_of(volume_of(np.random.default_rng(0).normal(500, 90, (20, 20, 20))))
    for value in (300.0, 512.0, 700.0):
        assert histogram.value(histogram.fraction(value)) == pytest.approx(value, abs=histogram.step)
    assert histogram.fraction(-1e9) == 0.0
    assert histogram.fraction(1e9) == 1.0


def test_one_grey_and_holes_are_no_reason_to_fail():
    assert histogram_of(volume_of(np.full((3, 3, 3), 7, np.uint8))).high > 7
    array = np.full((4, 4, 4), np.nan, np.float32)
    array[0, 0, 0] = 1.0
    assert np.isfinite(histogram_of(volume_of(array)).edges).all()


def test_presets_of_bone_lie_above_those_of_soft_tissue():
    array = np.random.default_rng(1).integers(0, 1000, (20, 20, 20)).astype(np.int16)
    presets = window_presets(volume_of(array), 600.0)
    assert presets["Bone"][0] > 600 > presets["Soft"][0]
    assert min(width for _, width in presets.values()) > 0
    assert set(window_presets(volume_of(array), None)) == {"Full"}


def marked(direction: np.ndarray) -> Volume:
    """A volume whose one bright voxel lies left and superior in the patient, however it is stored."""
    array = np.zeros((12, 12, 12), np.uint8)
    volume = Volume.from_parts(array, (1.0,) * 3, direction=direction)
    middle = volume.voxel_to_scan([[5.5, 5.5, 5.5]])[0]
    i, j, k = np.rint(volume.scan_to_voxel(np.add(middle, [4.5, 0.5, 4.5])[None])[0]).astype(int)
    bright = array.copy()
    bright[k, j, i] = 255
    return Volume.from_parts(bright, (1.0,) * 3, direction=direction)


@pytest.mark.parametrize(
    "direction",
    [
        np.eye(3),
        np.diag([-1.0, 1.0, 1.0]),
        np.diag([1.0, -1.0, -1.0]),
        np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]),
    ],
)
def test_a_preview_shows_left_at_the_right_and_superior_at_the_top_however_it_is_stored(direction):
    _, coronal = preview_planes(marked(direction))
    rows, columns = np.nonzero(coronal.grey)
    assert coronal.letters == "RLIS"
    assert (rows < 6).all()
    assert (columns > 5).all()


def test_a_preview_knows_the_shape_of_its_pixels():
    axial, coronal = preview_planes(volume_of(np.zeros((4, 5, 6), np.uint8)))
    assert axial.grey.shape == (5, 6)
    assert (axial.aspect, coronal.aspect) == pytest.approx((1.0, 2.0))


@pytest.mark.parametrize(
    ("texts", "unit", "spacing"),
    [
        (("0.035",) * 3, "mm", (0.035,) * 3),
        (("35", "35", "70,5"), "µm", (0.035, 0.035, 0.0705)),
        (("", " ", ""), "mm", None),
    ],
)
def test_typed_voxel_sizes(texts, unit, spacing):
    assert typed_spacing(texts, unit) == (None if spacing is None else pytest.approx(spacing))


@pytest.mark.parametrize(
    "texts", [("1", "", "1"), ("a", "a", "a"), ("0", "0", "0"), ("-1",) * 3, ("nan",) * 3]
)
def test_what_is_no_voxel_size_is_refused(texts):
    with pytest.raises(GpError):
        typed_spacing(texts, "mm")


def test_a_voxel_size_in_another_unit():
    assert spacing_in((0.035, 0.035, 0.07), "µm") == ("35", "35", "70")
