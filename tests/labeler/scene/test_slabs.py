"""Thick slabs and denoised slices against brute force, and that nothing but the picture follows them."""

from __future__ import annotations

import numpy as np
import pytest
from scene_cases import DIRECTIONS, MIDDLE, SPACING
from scipy.ndimage import map_coordinates

from gp_core.errors import GpError
from gp_labeler.imaging.anatomical_frame import SCAN_FRAME
from gp_labeler.imaging.slab import DENOISERS, SLAB_MODES, Slab, denoised
from gp_labeler.imaging.volume import Volume
from gp_labeler.scene.oblique_slab import ObliqueSlab, pixel_grid
from gp_labeler.scene.slices import VolumeSlicer

REDUCE = {"mean": np.mean, "maximum": np.max, "minimum": np.min}


def noise_scan(direction: np.ndarray) -> Volume:
    values = np.random.default_rng(3).integers(0, 60_000, (20, 24, 28)).astype(np.uint16)
    size = np.array(values.shape[::-1])
    return Volume.from_parts(values, SPACING, MIDDLE - direction @ ((size - 1) / 2 * SPACING), direction)


@pytest.mark.parametrize("mode", SLAB_MODES)
@pytest.mark.parametrize("name", ["axial", "sagittal", "coronal"])
@pytest.mark.parametrize("direction", ["straight", "flipped", "permuted"])
def test_a_slab_along_the_voxels_is_that_of_its_layers(direction, name, mode):
    source, plane = VolumeSlicer(noise_scan(DIRECTIONS[direction])), SCAN_FRAME.plane(name)
    middle, step = plane.position_of(MIDDLE), source.step(plane)
    single = source.image(plane, middle)
    slab = Slab(mode, 5 * step)
    layers = [source.image(plane, single.position + n * step).values for n in range(-2, 3)]
    shown = source.image(plane, middle, slab=slab)
    expected = REDUCE[mode](np.stack(layers).astype(float), axis=0)
    assert np.abs(shown.values - expected).max() <= 0.5
    assert shown.values.dtype == single.values.dtype
    assert np.array_equal(shown.origin, single.origin)
    assert shown.position == single.position
    assert source.thickness(plane, slab) == pytest.approx(5 * step)


@pytest.mark.parametrize("mode", SLAB_MODES)
def test_an_oblique_slab_is_that_of_the_slices_in_it(mode):
    volume = noise_scan(np.eye(3))
    source = VolumeSlicer(volume)
    plane = SCAN_FRAME.plane("axial").rotated([1.0, 0.4, 0.2], 0.5, MIDDLE)
    middle, layer = plane.position_of(MIDDLE), source.step(plane)
    shown = source.image(plane, middle, slab=Slab(mode, 3 * layer + 1e-6))
    height, width = shown.values.shape
    down, right = np.mgrid[height // 2 - 5 : height // 2 + 5, width // 2 - 5 : width // 2 + 5]
    flat = shown.origin + shown.step * np.stack([right.ravel(), down.ravel()], axis=1)
    layers = []
    for offset in (-layer, 0.0, layer):
        index = volume.scan_to_voxel(plane.scan(flat, middle + offset))
        layers.append(map_coordinates(volume.array.astype(float), index.T[::-1], order=1))
    expected = REDUCE[mode](np.stack(layers), axis=0)
    assert np.abs(shown.values[down.ravel(), right.ravel()] - expected).max() < 3
    single = source.image(plane, middle)  # the next slice is a single one again
    assert not np.array_equal(single.values, shown.values)


@pytest.mark.parametrize("mode", SLAB_MODES)
def test_an_oblique_slab_is_the_same_whether_its_layers_were_kept_or_not(mode):
    volume = noise_scan(np.eye(3))
    scrolled, plane = VolumeSlicer(volume), SCAN_FRAME.plane("axial").rotated([1.0, 0.4, 0.2], 0.5, MIDDLE)
    step, slab = scrolled.step(plane), Slab(mode, 5 * scrolled.step(plane))
    low, high = scrolled.limits(plane)
    where = [*np.arange(low, high, step), low + 3.3 * step, low + 4.3 * step, high - 0.2 * step]
    for position in where:  # up to both ends, where layers lie beyond the scan, and between slices
        kept = scrolled.image(plane, position, slab=slab)
        fresh = VolumeSlicer(volume).image(plane, position, slab=slab)
        assert np.array_equal(kept.origin, fresh.origin)
        assert kept.values.shape == fresh.values.shape
        off = np.abs(kept.values.astype(float) - fresh.values)
        assert (off > 1).mean() < 0.02  # of pixels on the very edge


def test_a_step_through_an_oblique_slab_samples_one_layer():
    volume = noise_scan(np.eye(3))
    plane = SCAN_FRAME.plane("axial").rotated([1.0, 0.4, 0.2], 0.5, MIDDLE)
    asked = []

    def sample(position, grid, beyond):
        asked.append(position)
        return np.full((grid[3], grid[2]), 100 * len(asked), np.uint16)

    slab = ObliqueSlab(
        volume,
        plane,
        Slab("mean", 1.0),
        step=0.1,
        scroll=0.1,
        n_between=2,
        grid=pixel_grid(plane.flat([MIDDLE]) + np.array([[-1.0], [1.0]]), 0.1),
        sample=sample,
    )
    middle, part = (
        plane.position_of(MIDDLE),
        pixel_grid(plane.flat([MIDDLE]) + np.array([[-0.2], [0.1]]), 0.1),
    )
    shown = slab.values(middle, part)
    assert asked == pytest.approx(middle + 0.2 * np.arange(-2, 3))
    assert shown.shape == (part[3], part[2])
    assert np.all(shown == 300)
    for n in (1, 2, 3, 4):
        del asked[:]
        slab.values(middle + 0.1 * n, part)
        assert len(asked) == (5 if n == 1 else 1)  # those in between, and then one for each slice
    del asked[:]
    slab.values(middle + 0.437, part)
    assert len(asked) == 5  # it lies between the others


def test_a_slab_thinner_than_a_voxel_is_the_slice_itself():
    source, plane = VolumeSlicer(noise_scan(np.eye(3))), SCAN_FRAME.plane("axial")
    middle = plane.position_of(MIDDLE)
    shown = source.image(plane, middle, slab=Slab("maximum", 0.1))
    assert np.array_equal(shown.values, source.image(plane, middle).values)


def test_at_the_end_of_the_scan_a_slab_has_what_layers_there_are():
    source, plane = VolumeSlicer(noise_scan(np.eye(3))), SCAN_FRAME.plane("axial")
    low, _ = source.limits(plane)
    step = source.step(plane)
    layers = [source.image(plane, low + n * step).values for n in range(3)]
    assert np.array_equal(
        source.image(plane, low, slab=Slab("minimum", 5 * step)).values, np.min(layers, axis=0)
    )


@pytest.mark.parametrize(("mode", "mm"), [("mean", 0.05), ("mean", 2.1), ("mean", np.nan), ("sum", 1.0)])
def test_other_slabs_are_refused(mode, mm):
    with pytest.raises(GpError, match="slab"):
        Slab(mode, mm)


@pytest.mark.parametrize("kind", DENOISERS)
@pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.uint16, np.float32, np.int32])
def test_denoising_lowers_noise_and_leaves_what_has_none(kind, dtype):
    rng = np.random.default_rng(0)
    flat = np.full((64, 64), 100.0)
    noisy = (flat + rng.normal(0, 8, flat.shape)).astype(dtype)
    smooth = denoised(noisy, kind)
    assert smooth.dtype == dtype
    assert smooth.astype(float).std() < 0.7 * noisy.astype(float).std()
    assert abs(smooth.mean() - noisy.mean()) < 1.0
    assert np.array_equal(denoised(flat.astype(dtype), kind), flat.astype(dtype))


def test_the_bilateral_filter_keeps_edges_that_the_gaussian_blurs():
    rng = np.random.default_rng(0)
    step = np.where(np.arange(64) < 32, 0.0, 1000.0)[None, :] + rng.normal(0, 20, (64, 64)) + 5000
    noisy = step.astype(np.uint16)
    off = {kind: np.abs(denoised(noisy, kind)[:, 31].mean() - noisy[:, 31].mean()) for kind in DENOISERS}
    assert off["bilateral"] < 15 < 150 < off["gaussian"]
