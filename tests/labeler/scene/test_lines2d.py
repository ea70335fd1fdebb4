"""Ribbons of lines in pixels: straight at open ends, smooth where a line runs round."""

from __future__ import annotations

import numpy as np
import pytest

from gp_labeler.scene.lines2d import _across, _corners


def _ring(n: int) -> np.ndarray:
    turn = np.linspace(0.0, 2 * np.pi, n)
    return 30.0 * np.stack([np.cos(turn), np.sin(turn)], axis=1)


def test_a_ring_is_as_wide_where_it_closes_as_elsewhere() -> None:
    ring = _ring(33)
    across = _across(ring, np.array([0]), np.array([32]))
    outwards = np.abs((across * ring).sum(axis=1)) / 30.0
    np.testing.assert_allclose(outwards, 1.0, atol=1e-9)


def test_lines_one_after_the_other_do_not_bend_each_other() -> None:
    line, ring = np.array([[0.0, 0.0], [10.0, 0.0], [20.0, 0.0]]), _ring(17)
    together = _across(np.concatenate([line, ring]), np.array([0, 3]), np.array([2, 19]))
    np.testing.assert_allclose(together[:3], _across(line, np.array([0]), np.array([2])), atol=1e-12)
    np.testing.assert_allclose(together[3:], _across(ring, np.array([0]), np.array([16])), atol=1e-12)
    np.testing.assert_allclose(np.abs(together[:3]), [[0.0, 1.0]] * 3, atol=1e-12)


@pytest.mark.parametrize("width", [1.0, 3.0, 8.0])
def test_a_ribbon_is_as_wide_as_asked_with_a_soft_edge_of_a_pixel(width: float) -> None:
    line = np.array([[0.0, 0.0], [10.0, 0.0]])
    corners = _corners(line, _across(line, np.array([0]), np.array([1])), np.full(2, width))
    across = np.sort(corners.reshape(2, 4, 2)[:, :, 1], axis=1)
    inner, outer = (width - 1) / 2, (width + 1) / 2
    np.testing.assert_allclose(across, [[-outer, -inner, inner, outer]] * 2, atol=1e-12)
