"""Where labels go so that they hide neither each other nor the marks."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gp_core.validation import FloatArray

__all__ = ["lines_within", "place_labels"]

_SIDES = np.array([[1, -0.6], [-1, -0.6], [1, 0.6], [-1, 0.6], [0, -1], [0, 1], [1, 0], [-1, 0]])
"""Directions from a mark in which its label may lie, the preferred first."""

_RINGS = (1.0, 2.6)
_STEPS = np.concatenate([ring * _SIDES for ring in _RINGS])
_SHARES = np.tile((np.sign(_SIDES) - 1) / 2, (len(_RINGS), 1))
"""From a mark to the corners of the boxes around it: in gaps, and in sizes of the box."""

_RELUCTANCE = 0.02
_MARK_WEIGHT = 0.5
"""Covering a mark a little is better than covering a word."""

_COVERED_AT_MOST = 0.35
"""A label covered more than this is left out rather than drawn into a heap ..."""

_COVERED_AT_MOST_MINOR = 0.05
"""... and one of a negative rank sooner."""


def place_labels(
    anchors: ArrayLike, sizes: ArrayLike, view: tuple[int, int], *, gaps: ArrayLike, ranks: ArrayLike
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Place labels beside their marks, one after the other, each where it covers least.

    Parameters
    ----------
    anchors : (N, 2) array_like
        Pixels of the marks.
    sizes : (N, 2) array_like
        Width and height of the labels, pixels.
    view : (2,) tuple of int
        Width and height of the view.
    gaps : (N,) array_like
        Distance between each mark and its label, pixels.
    ranks : (N,) array_like
        Labels of a higher rank are placed earlier; one of a positive rank is never left out, and those of a
        negative one only fill free room. None is cut off by the edge of a view that is as long as it.

    Returns
    -------
    corners : (N, 2) float array
        Top left corners.
    shown : (N,) bool array
        Which labels have room.
    """
    marks, size = (np.asarray(a, dtype=np.float64).reshape(-1, 2) for a in (anchors, sizes))
    gap, rank = np.asarray(gaps, dtype=np.float64), np.asarray(ranks, dtype=np.float64)
    inside: NDArray[np.bool_] = np.all((marks > 0) & (marks < np.array(view)), axis=1)
    corners, shown = np.zeros((len(marks), 2)), np.zeros(len(marks), dtype=bool)
    half = gap[inside, None] / 2
    own_places = np.concatenate([marks[inside] - half, marks[inside] + half], axis=1)
    placed = np.flatnonzero(inside & size.all(axis=1))  # what has no size only keeps its place free
    boxes = _pushed_inside(_candidates(marks[placed], size[placed], gap[placed]), view)
    bad = _MARK_WEIGHT * _covered(boxes, own_places).sum(axis=2) + _outside(boxes, view)
    area, reluctance = size[placed].prod(axis=1), _RELUCTANCE * np.arange(boxes.shape[1])
    for row in np.argsort(-rank[placed], kind="stable"):
        n, share = placed[row], bad[row] / area[row]
        best = int((share + reluctance).argmin())
        allowed = _COVERED_AT_MOST if rank[n] >= 0 else _COVERED_AT_MOST_MINOR
        if share[best] <= allowed or rank[n] > 0:
            corners[n], shown[n] = boxes[row, best, :2], True
            bad += _covered(boxes, boxes[row, [best]])[..., 0]
    return corners, shown


def lines_within(text: str, width: float, measure: Callable[[str], float]) -> list[str]:
    """Break a text between words into lines that a view is wide enough for.

    Parameters
    ----------
    text : str
    width : float
        Of the view, pixels.
    measure : callable
        Returns the width of a text, pixels.
    """
    if not text or measure(text) <= width:
        return [text]
    lines: list[str] = []
    for word in text.split():
        if lines and measure(f"{lines[-1]} {word}") <= width:
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    return [line.removeprefix(_DOT).removesuffix(_DOT).strip() for line in lines]


_DOT = "\N{MIDDLE DOT}"


def _candidates(marks: FloatArray, sizes: FloatArray, gaps: FloatArray) -> FloatArray:
    """(P, C, 4) boxes (left, top, right, bottom) around P marks: each side, near and then farther off."""
    corners = marks[:, None] + gaps[:, None, None] * _STEPS + _SHARES * sizes[:, None]
    return np.concatenate([corners, corners + sizes[:, None]], axis=2)


def _pushed_inside(boxes: FloatArray, view: tuple[int, int]) -> FloatArray:
    """Return boxes moved so far that they lie inside the view; one too long for it begins at its edge."""
    room = np.maximum(np.array(view) - (boxes[..., 2:] - boxes[..., :2]), 0)
    shift = np.clip(boxes[..., :2], 0, room) - boxes[..., :2]
    return boxes + np.tile(shift, 2)


def _covered(boxes: FloatArray, taken: FloatArray) -> FloatArray:
    """(P, C, T) areas that P by C boxes share with T others."""
    left, top, right, bottom = (boxes[..., None, side] for side in range(4))
    wide = np.minimum(right, taken[:, 2]) - np.maximum(left, taken[:, 0])
    tall = np.minimum(bottom, taken[:, 3]) - np.maximum(top, taken[:, 1])
    areas: FloatArray = np.maximum(wide, 0) * np.maximum(tall, 0)
    return areas


def _outside(boxes: FloatArray, view: tuple[int, int]) -> FloatArray:
    """(P, C) areas that lie outside the view."""
    whole = np.array([[0.0, 0.0, *view]])
    areas: FloatArray = (boxes[..., 2:] - boxes[..., :2]).prod(axis=-1) - _covered(boxes, whole)[..., 0]
    return areas
