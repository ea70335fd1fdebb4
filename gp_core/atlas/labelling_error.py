"""The error of a placed label: an assumed one, or the one that repeated labelling has measured."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from os import PathLike
from types import MappingProxyType
from typing import Any

import numpy as np

from gp_core.argument_types import checks_arguments
from gp_core.disk import read_json
from gp_core.errors import FileFormatError, GpError
from gp_core.landmarks.features import feature
from gp_core.validation import FloatArray

__all__ = ["LABELLING_NOISE_MM", "LabellingError"]

LABELLING_NOISE_MM = 0.1
"""Standard deviation of a label's error where nothing was measured: about a voxel, mm per coordinate."""

_LARGEST_MM = 5.0
_PRIOR_PAIRS = 10.0
"""Pairs of labels that the error of all features is worth in the estimate of one feature."""


@dataclass(frozen=True)
class LabellingError:
    """Standard deviations of labels, feature by feature.

    Parameters
    ----------
    sd_mm : mapping of str to float
        Standard deviation of one coordinate of a label, mm, by feature.
    other_mm : float
        That of every other feature.
    source : str
        What it was measured on, in a few words.

    Raises
    ------
    GpError
        A value is no length between 0 and 5 mm, or a feature is unknown.

    Examples
    --------
    >>> LabellingError({"CA": 0.2}).of(["CA", "CB"]).tolist()
    [0.2, 0.1]
    """

    sd_mm: Mapping[str, float] = field(default_factory=dict)
    other_mm: float = LABELLING_NOISE_MM
    source: str = ""

    def __post_init__(self) -> None:
        if not isinstance(self.sd_mm, Mapping):
            raise GpError(f"labelling errors must be a mapping of features to mm, got {self.sd_mm!r:.40}")
        named = {feature(code).code: _length(sd, f"of {code}") for code, sd in self.sd_mm.items()}
        object.__setattr__(self, "sd_mm", MappingProxyType(named))
        object.__setattr__(self, "other_mm", _length(self.other_mm, "of other features"))

    def __reduce__(self) -> tuple[object, ...]:
        """Let pickle carry it, though it cannot carry a read-only mapping."""
        return LabellingError, (dict(self.sd_mm), self.other_mm, self.source)

    def __hash__(self) -> int:
        """Return a hash by content."""
        return hash((tuple(self.sd_mm.items()), self.other_mm, self.source))

    @checks_arguments
    def of(self, codes: Iterable[str]) -> FloatArray:
        """Return the standard deviations of features.

        Parameters
        ----------
        codes : iterable of str
            n features.

        Returns
        -------
        (n,) array, mm
            Of one coordinate.

        Raises
        ------
        FeatureError
            A feature is unknown.
        """
        return np.array(
            [self.sd_mm.get(feature(code).code, self.other_mm) for code in codes], dtype=np.float64
        )

    @property
    def text(self) -> str:
        """Such as ``0.14 mm per coordinate, measured on 8 animals, 2 observers``."""
        how = f"measured on {self.source}" if self.source else "assumed"
        return f"{self.other_mm:.2g} mm per coordinate, {how}"

    def as_dict(self) -> dict[str, Any]:
        """Return it for a JSON file.

        Returns
        -------
        dict
            Plain values for JSON; lengths in mm.
        """
        return {"sd_mm": dict(self.sd_mm), "other_mm": self.other_mm, "source": self.source}

    @classmethod
    def from_dict(cls, content: Any) -> LabellingError:
        """Return the error that `as_dict` wrote.

        Parameters
        ----------
        content : mapping
            As it was read.

        Returns
        -------
        LabellingError
            The error.

        Raises
        ------
        GpError
            It is not what it should be.
        """
        if not isinstance(content, Mapping) or not isinstance(content.get("sd_mm", {}), Mapping):
            raise GpError("a labelling error must be a table with sd_mm")
        return cls(
            content.get("sd_mm", {}),
            content.get("other_mm", LABELLING_NOISE_MM),
            str(content.get("source", "")),
        )

    @classmethod
    def from_reliability(cls, report: Mapping[str, Any]) -> LabellingError:
        """Return the error that a report on repeated labels has measured.

        It is that between observers, where several labelled, else that within one. The error of a feature is
        drawn towards that of all features, which counts as 10 pairs of labels: few pairs say little.

        Parameters
        ----------
        report : mapping
            `gp_core.ReliabilityReport.as_dict()`, or the JSON file of ``gp-core reliability``.

        Returns
        -------
        LabellingError
            Feature by feature.

        Raises
        ------
        GpError
            It is no such report.
        """
        try:
            kind = "intra" if report["overall"]["inter"] is None else "inter"
            overall = float(report["overall"][kind]["sd_mm"])
            rows = [(row["feature"], row[kind]) for row in report["features"] if row[kind] is not None]
            sd = {code: _drawn(float(found["sd_mm"]), found["n_pairs"], overall) for code, found in rows}
            n, observers = int(report["n_animals"]), len(report["observers"])
        except (KeyError, TypeError, ValueError, OverflowError, IndexError):
            raise GpError(
                "is not a reliability report",
                remedy="Make it with: gp-core reliability SPECIMENS --json FILE",
            ) from None
        who = f"{observers} observer{'' if observers == 1 else 's'}"
        return cls(sd, overall, f"{n} animal{'' if n == 1 else 's'}, {who}")

    @classmethod
    @checks_arguments
    def read(cls, path: str | PathLike[str]) -> LabellingError:
        """Read the error from the JSON file of ``gp-core reliability``.

        Parameters
        ----------
        path : path-like
            The file.

        Returns
        -------
        LabellingError
            Feature by feature.

        Raises
        ------
        FileFormatError
            It cannot be read, or is no such report.
        """
        content = read_json(path, what="report on repeated labels")
        try:
            return cls.from_reliability(content if isinstance(content, Mapping) else {})
        except GpError as error:
            raise FileFormatError(error.problem, file=path, remedy=error.remedy) from None


def _drawn(sd: float, n_pairs: int, overall: float) -> float:
    mean = (n_pairs * sd**2 + _PRIOR_PAIRS * overall**2) / (n_pairs + _PRIOR_PAIRS)
    return math.sqrt(mean)


def _length(value: Any, what: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float, np.floating)):
        raise GpError(f"the labelling error {what} must be a number, got {value!r:.40}")
    if not 0 < value <= _LARGEST_MM:
        raise GpError(
            f"the labelling error {what} must be above 0 and at most {_LARGEST_MM:g} mm, got {value!r:.40}"
        )
    return float(value)
