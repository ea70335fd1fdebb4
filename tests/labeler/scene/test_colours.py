"""The colours of estimates are told apart by everybody, on bone and on both backgrounds."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from gp_labeler.scene.colours import DARK, LIGHT, SceneColours, rgb

THEMES = {"dark": DARK, "light": LIGHT}
VISIONS = {
    "all cones": np.eye(3),
    "no red": [[0.1523, 1.0526, -0.2049], [0.1145, 0.7863, 0.0992], [-0.0039, -0.0481, 1.0520]],
    "no green": [[0.3673, 0.8606, -0.2280], [0.2801, 0.6725, 0.0474], [-0.0118, 0.0429, 0.9689]],
    "no blue": [[1.2555, -0.0767, -0.1788], [-0.0784, 0.9308, 0.1476], [0.0047, 0.6914, 0.3039]],
}
"""Linear RGB as people without one kind of cones see it (Machado et al. 2009, doi 10.1109/TVCG.2009.113)."""

TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


def linear(colour: str) -> np.ndarray:
    c = np.array(rgb(colour))
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def lab(linear_rgb: np.ndarray) -> np.ndarray:
    t = (TO_XYZ @ linear_rgb.clip(0, 1)) / (TO_XYZ @ np.ones(3))
    f = np.where(t > 0.008856, np.cbrt(t), 7.787 * t + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def contrast(one: str, other: str) -> float:
    low, high = sorted(float(TO_XYZ[1] @ linear(colour)) for colour in (one, other))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("theme", THEMES.values(), ids=THEMES)
@pytest.mark.parametrize("role", ["pose", "pose_2", "truth", "touch"])
def test_they_stand_out_from_bone_and_background(theme: SceneColours, role: str) -> None:
    colour = theme.states[role]
    assert contrast(colour, theme.bone) > 2.2
    assert min(contrast(colour, theme.top), contrast(colour, theme.bottom)) > 3.0
    assert contrast(colour, theme.halo) > 3.5  # names are written on it


@pytest.mark.parametrize("theme", THEMES.values(), ids=THEMES)
@pytest.mark.parametrize("vision", VISIONS.values(), ids=VISIONS)
def test_two_estimates_are_told_apart_by_everybody(theme: SceneColours, vision: object) -> None:
    """A difference of 40 is as from orange to green; the labelled axis differs by its shape as well."""
    seen = {
        role: lab(np.asarray(vision) @ linear(theme.states[role])) for role in ("pose", "pose_2", "truth")
    }
    assert np.linalg.norm(seen["pose"] - seen["pose_2"]) > 80
    for one, other in combinations(seen, 2):
        assert np.linalg.norm(seen[one] - seen[other]) > 10
