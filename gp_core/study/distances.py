"""Distances between all features, over the labelled sides: Figure 2 of the paper."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gp_core.argument_types import checks_arguments
from gp_core.disk import write_text
from gp_core.errors import GpError
from gp_core.landmarks.features import CODES
from gp_core.landmarks.sets import Specimen
from gp_core.validation import FloatArray, freeze_arrays

__all__ = ["DistanceTable", "distances"]


@dataclass(frozen=True)
class DistanceTable:
    """Mean and spread of the distance of every pair of features.

    Attributes
    ----------
    mean, sd : (20, 20) arrays, mm
        Symmetric, in the feature table's order; NaN where no (for `sd`: fewer than two) sides have the pair.
        The standard deviation is that of a sample (n - 1).
    counts : (20, 20) int array
        How many sides have both features.
    n_sides : int
        How many sides there are.
    """

    mean: FloatArray
    sd: FloatArray
    counts: NDArray[np.int64]
    n_sides: int

    def __post_init__(self) -> None:
        freeze_arrays(self)

    def pairs(self) -> list[dict[str, Any]]:
        """Return one row for each pair of features.

        Returns
        -------
        list of dict
            Features, mean and SD in mm (None where unknown), number of sides.
        """
        return [
            {
                "feature_a": CODES[i],
                "feature_b": CODES[j],
                "mean_mm": _or_none(self.mean[i, j]),
                "sd_mm": _or_none(self.sd[i, j]),
                "n_sides": int(self.counts[i, j]),
            }
            for i in range(len(CODES))
            for j in range(i)
        ]

    def typical_sd(self) -> dict[str, float]:
        """Return, for each feature, the median SD of its distances to the others.

        Returns
        -------
        dict of str to float
            In mm, smallest first.
        """
        off = np.where(np.eye(len(CODES), dtype=bool), np.nan, self.sd)
        known = [i for i in range(len(CODES)) if np.isfinite(off[i]).any()]
        medians = {CODES[i]: float(np.nanmedian(off[i])) for i in known}
        return dict(sorted(medians.items(), key=lambda item: item[1]))

    def as_dict(self) -> dict[str, Any]:
        """Return the table as the JSON file holds it.

        Returns
        -------
        dict
            Plain values for JSON; lengths in mm, angles in degrees.
        """
        return {"n_sides": self.n_sides, "pairs": self.pairs(), "typical_sd_mm": self.typical_sd()}

    @checks_arguments
    def save_csv(self, path: str | PathLike[str]) -> None:
        """Write one line for each pair: features, mean and SD in mm, number of sides; with full precision.

        Parameters
        ----------
        path : path-like
            Where to write.

        Raises
        ------
        GpError
            The file cannot be written.
        """
        lines = ["feature_a,feature_b,mean_mm,sd_mm,n_sides"]
        lines += [",".join("" if v is None else str(v) for v in row.values()) for row in self.pairs()]
        write_text(path, "\n".join(lines) + "\n")


@checks_arguments
def distances(specimens: Sequence[Specimen]) -> DistanceTable:
    """Measure the distances of all pairs of features over both sides of all animals.

    Parameters
    ----------
    specimens : sequence of Specimen
        One or both sides of each; some features may be missing.

    Returns
    -------
    DistanceTable
        Means and standard deviations, mm.

    Raises
    ------
    GpError
        No side is labelled.

    Examples
    --------
    >>> from gp_core.landmarks.sets import LandmarkSet, Specimen
    >>> from gp_core.landmarks.features import Side
    >>> left = LandmarkSet.from_mapping({"CA": [0, 0, 0], "CB": [3, 4, 0]}, "L")
    >>> table = distances([Specimen("GP01", {Side.LEFT: left})])
    >>> float(table.mean[CODES.index("CA"), CODES.index("CB")])
    5.0
    """
    sides = [landmarks.points for specimen in specimens for landmarks in specimen.sides.values()]
    if not sides:
        raise GpError("no labelled sides were given", remedy="Name landmark files, or folders of them.")
    points = np.array(sides)
    lengths = np.linalg.norm(points[:, :, None] - points[:, None, :], axis=3)
    counts = np.isfinite(lengths).sum(axis=0)
    total = np.nansum(lengths, axis=0)
    mean = np.divide(total, counts, out=np.full_like(total, np.nan), where=counts > 0)
    squares = np.nansum((lengths - mean) ** 2, axis=0)
    variance = np.divide(squares, counts - 1, out=np.full_like(total, np.nan), where=counts > 1)
    return DistanceTable(mean, np.sqrt(variance), counts, len(sides))


def _or_none(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
