"""Whether landmarks are in millimetres, judged by the published distances between features."""

from __future__ import annotations

import csv
import math
from functools import cache, lru_cache
from os import PathLike

import numpy as np
from numpy.typing import NDArray

from gp_core.errors import GeometryError
from gp_core.landmarks.features import CODES, index_of
from gp_core.landmarks.sets import LandmarkSet
from gp_core.resources import resource_path
from gp_core.validation import FloatArray

__all__ = ["check_plausible_size"]

IndexArray = NDArray[np.intp]

_MIN_PAIRS = 3
_TOLERANCE = 0.2  # of the decimal logarithm: animals differ by a tenth, mistaken units by ten times
_LARGEST_FACTOR = 2.5  # animals differ by a tenth, and rough touches of few features by more
_UNITS = {-6: "kilometres", -3: "metres", -1: "centimetres", 3: "micrometres", 6: "nanometres"}


@cache
def _published_mm() -> FloatArray:
    """Return the (20, 20) mean distances of the published table in mm, NaN on the diagonal."""
    expected = np.full((len(CODES), len(CODES)), np.nan)
    with resource_path("published_distances.csv").open(encoding="utf-8", newline="") as stream:
        for row in csv.DictReader(stream):
            a, b = index_of(row["feature_a"]), index_of(row["feature_b"])
            expected[a, b] = expected[b, a] = float(row["mean_mm"])
    expected.setflags(write=False)
    return expected


@lru_cache(maxsize=64)
def _pairs(codes: tuple[str, ...]) -> tuple[IndexArray, IndexArray, FloatArray]:
    """Return rows of the first and the second feature of all pairs, and their mean distance, mm."""
    rows = np.array([index_of(code) for code in codes], dtype=np.intp)
    i, j = np.triu_indices(len(rows), k=1)
    first, second = rows[i], rows[j]
    return first, second, _published_mm()[first, second]


def check_plausible_size(
    landmarks: LandmarkSet, file: str | PathLike[str] | None = None, *, strict: bool = False
) -> None:
    """Reject landmarks whose size is a power of ten too small or too large for a guinea pig.

    The size is the median ratio, over all pairs of placed features, of their distance to the published mean
    distance (Usevitch et al. 2021, Figure 2). Fewer than three pairs always pass.

    Parameters
    ----------
    landmarks : LandmarkSet
        Landmarks of one side, in any frame, mm.
    file : path-like, optional
        Where they come from, for the message.
    strict : bool
        Reject any size off by a factor of more than 2.5, power of ten or not: no pose should be estimated
        from it.

    Raises
    ------
    GeometryError
        The coordinates look like metres, micrometres or the like; the remedy names the factor.
    """
    first, second, published = _pairs(landmarks.placed)
    if len(published) < _MIN_PAIRS:
        return
    with np.errstate(over="ignore", invalid="ignore"):
        apart = landmarks.points[first] - landmarks.points[second]
        ratios = np.sort(np.sqrt((apart * apart).sum(axis=1)) / published)
    ratio = float(ratios[(len(ratios) - 1) // 2] + ratios[len(ratios) // 2]) / 2
    if not (math.isfinite(ratio) and ratio > 0):
        return
    power = round(math.log10(ratio))
    if abs(math.log10(ratio)) < math.log10(_LARGEST_FACTOR):
        return
    if power == 0 or abs(math.log10(ratio) - power) > _TOLERANCE:
        if not strict:
            return
        raise GeometryError(
            f"the distances between its landmarks are {ratio:.2g} times those in a guinea pig",
            file=file,
            remedy=f"Check the unit, which must be mm{_inches(ratio)}, and the names of the points.",
        )
    raise GeometryError(_problem(power), file=file, remedy=_remedy(power))


def _inches(ratio: float) -> str:
    return " (these look like inches)" if abs(math.log10(ratio * 25.4)) < _TOLERANCE else ""


def _problem(power: int) -> str:
    much = f"10^{abs(power)}" if abs(power) > 6 else f"{10 ** abs(power)}"
    size = "smaller" if power < 0 else "larger"
    unit = f"; coordinates look like {_UNITS[power]}" if power in _UNITS else ""
    return f"the distances between its landmarks are {much} times {size} than in a guinea pig{unit}"


def _remedy(power: int) -> str:
    verb = "multiply" if power < 0 else "divide"
    much = f"10^{abs(power)}" if abs(power) > 6 else f"{10 ** abs(power)}"
    return f"Coordinates must be in mm: {verb} them by {much}."
