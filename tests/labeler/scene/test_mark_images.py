"""The pictures of landmarks: as large as asked, in the middle, told apart by shape as well as by colour."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from gp_labeler.scene.mark_images import mark_image

SHAPES = ("ball", "diamond", "triangle")


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("diameter", [6.0, 10.5, 40.0])
def test_a_mark_is_as_large_as_asked_and_in_the_middle(shape: str, diameter: float) -> None:
    image = mark_image(shape, "#F39C1F", diameter)
    assert image.shape[0] % 2 == 1
    middle = image.shape[0] // 2
    assert image[middle, middle, 3] == 1
    assert image[[0, -1], :, 3].max() == image[:, [0, -1], 3].max() == 0  # nothing is cut off
    columns = np.flatnonzero(image[..., 3].max(axis=0) > 0.5)
    assert np.ptp(columns) + 1 == pytest.approx(diameter, abs=0.3 * diameter + 1)
    np.testing.assert_allclose(image[..., 3], image[:, ::-1, 3], atol=1e-6)
    if shape == "ball":
        assert image[..., 3].sum() == pytest.approx(np.pi / 4 * diameter**2, rel=0.05)


def test_marks_are_lit_rimmed_and_faint_where_asked() -> None:
    image, middle = mark_image("ball", "#F39C1F", 20.0), 16
    assert image.shape[0] // 2 == middle
    assert image[middle - 4, middle - 3, :3].mean() > image[middle + 4, middle + 3, :3].mean() + 0.1
    assert image[middle, middle - 9, :3].mean() < 0.75 * image[middle, middle, :3].mean()
    np.testing.assert_allclose(
        mark_image("ball", "#F39C1F", 20.0, 0.3)[..., 3], 0.3 * image[..., 3], atol=1e-6
    )
    outlines = [mark_image(shape, "#FFFFFF", 20.0)[..., 3] > 0.5 for shape in SHAPES]
    assert all((one != other).sum() > 60 for one, other in pairwise(outlines))
    assert mark_image("ball", "#FFFFFF", 1e6).shape[0] < 700  # a point does not fill memory


@pytest.mark.parametrize("diameter", [10.0, 13.5, 40.0])
def test_a_frame_shows_what_lies_beneath_it(diameter: float) -> None:
    image = mark_image("frame", "#5CB8F5", diameter)[..., 3]
    middle = image.shape[0] // 2
    assert image[middle, middle] == 0  # what a person has to judge
    assert image[[0, -1]].max() == image[:, [0, -1]].max() == 0  # nothing is cut off
    columns = np.flatnonzero(image.max(axis=0) > 0.5)
    assert np.ptp(columns) + 1 == pytest.approx(1.1 * diameter, abs=0.15 * diameter + 1)
    corner = middle + int(0.45 * diameter)
    assert image[corner, corner] > 0.5  # square: no ball reaches there
