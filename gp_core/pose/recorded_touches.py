"""Touches extracted from a recorded probe: the places where its tip rested, in the order of their names."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from gp_core.errors import GeometryError, GpError
from gp_core.io.tracker_recordings import Recording
from gp_core.validation import FloatArray

__all__ = ["recorded_touches", "resting_places"]

_RADIUS_MM = 1.0
"""A resting tip stays within this distance of its mean position."""

_REST_S = 0.5
_FEWEST = 8
"""Shortest rest that is a touch: seconds, or samples where the recording has no times."""

_AWAY_MM = 3.0
"""Two rests are one touch if the tip stayed within this distance between them."""

_SHORTEST_TIP_MM = 1.0


def recorded_touches(
    recording: Recording, tip_offset: ArrayLike, names: Sequence[str]
) -> dict[str, FloatArray]:
    """Return where the tip of a probe rested, by the names of what it touched.

    Parameters
    ----------
    recording : Recording
        ``T_tracker_marker`` over time.
    tip_offset : (3,) array_like
        The tip in the marker's frame, mm; zeros where the recorded poses are those of the tip itself.
    names : sequence of str
        What was touched, in the order of the touches; a feature may be there several times.

    Returns
    -------
    dict of str to (3,) or (n, 3) array
        Median position of the tip during each rest, mm, tracker frame; a row for each touch of a feature that
        is named several times.

    Raises
    ------
    GpError
        The tip offset is not three numbers.
    GeometryError
        The number of rests differs from the number of names, or only the inverted poses rest as often.
    """
    places = resting_places(recording, tip_offset)
    if len(places) != len(names):
        _check_direction(recording, tip_offset, len(names))
        where = "; ".join(f"{x:.1f} {y:.1f} {z:.1f}" for x, y, z in places[:12])
        raise GeometryError(
            f"the tip rested {len(places)} times ({where} mm), but {len(names)} touches are named",
            remedy=f"A touch is {_REST_S:g} s within {_RADIUS_MM:g} mm; name as many, in their order.",
        )
    touched: dict[str, list[FloatArray]] = {name: [] for name in names}
    for name, place in zip(names, places, strict=True):
        touched[name].append(place)
    return {
        name: np.squeeze(positions, 0) if len(positions) == 1 else np.array(positions)
        for name, positions in touched.items()
    }


def _check_direction(recording: Recording, tip_offset: ArrayLike, n_touches: int) -> None:
    """Reject poses of the tracker in the marker's frame: only inverted they keep the tip at rest."""
    inverted = np.full_like(recording.poses, np.nan)
    seen = np.isfinite(recording.poses).all(axis=(1, 2))
    inverted[seen] = np.linalg.inv(recording.poses[seen])
    if len(resting_places(replace(recording, poses=inverted), tip_offset)) == n_touches:
        raise GeometryError(
            f"the tip rests {n_touches} times only if every pose is inverted: "
            "the poses seem to be those of the tracker in the marker's frame",
            remedy="Give marker to tracker: invert each matrix.",
        )


def resting_places(recording: Recording, tip_offset: ArrayLike) -> FloatArray:
    """Return the places where the tip rested for half a second or longer.

    Parameters
    ----------
    recording : Recording
        ``T_tracker_marker`` over time.
    tip_offset : (3,) array_like
        The tip in the marker's frame, mm.

    Returns
    -------
    (N, 3) array, mm, tracker frame
        In the order of time.

    Raises
    ------
    GpError
        The tip offset is not three numbers.
    """
    offset = np.asarray(tip_offset, dtype=np.float64)
    if offset.shape != (3,) or not np.isfinite(offset).all():
        raise GpError(f"the tip offset must be three finite numbers in mm, got {offset.tolist()}")
    if 0 < np.linalg.norm(offset) < _SHORTEST_TIP_MM:
        length = np.linalg.norm(offset)
        raise GpError(
            f"the tip lies only {length:.2g} mm from its marker", remedy="Give it in mm, not in metres."
        )
    tips: FloatArray = recording.poses[:, :3, :3] @ offset + recording.poses[:, :3, 3]
    places: list[FloatArray] = []
    left = 0
    for first, end in _rests(tips):
        if _is_long(recording, first, end):
            margin = (end - first) // 5  # the tip arrives, and leaves
            place = np.median(tips[first + margin : end - margin], axis=0)
            if not places or _was_away(tips[left:end], places[-1]):
                places.append(place)
            left = end
    return np.array(places).reshape(-1, 3)


def _was_away(tips: FloatArray, place: FloatArray) -> bool:
    """Whether the tip left a place, or was not visible for a while."""
    return bool((~(np.linalg.norm(tips - place, axis=1) <= _AWAY_MM)).any())


def _rests(tips: FloatArray) -> Iterator[tuple[int, int]]:
    """Yield the longest spans (first, end) in which the tip stays together; a lost marker ends a span."""
    first = 0
    while first < len(tips):
        end = first
        while end < len(tips) and _stays(tips[first : end + 1]):
            end += 1
        if end - first >= _FEWEST:
            yield first, end
            first = end
        else:
            first += 1


def _stays(span: FloatArray) -> bool:
    if not np.isfinite(span[-1]).all():
        return False
    middle = span.mean(axis=0)
    return bool(np.linalg.norm(span[[0, -1]] - middle, axis=1).max() <= _RADIUS_MM)


def _is_long(recording: Recording, first: int, end: int) -> bool:
    if recording.times is None:
        return end - first >= _FEWEST
    return bool(recording.times[end - 1] - recording.times[first] >= _REST_S)
