"""The atlas: mean positions of the features of a left side, and how they vary together."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gp_core.argument_types import check_fields, checks_arguments
from gp_core.atlas.labelling_error import LabellingError
from gp_core.atlas.published import published_shape
from gp_core.constants import DEFINING_FEATURES
from gp_core.disk import read_head, read_json, write_text
from gp_core.errors import FeatureError, FileFormatError, GpError
from gp_core.html_tables import html_table
from gp_core.landmarks.anatomy import cochlea_frame, cochlea_origin
from gp_core.landmarks.features import CODES, FEATURES, check_codes, index_of
from gp_core.landmarks.plausible_size import check_plausible_size
from gp_core.landmarks.sets import LandmarkSet
from gp_core.validation import FloatArray

__all__ = ["PLACED", "SCHEMA_VERSION", "Atlas", "is_atlas_file"]

SCHEMA_VERSION = 1

PLACED = tuple(row.code for row in FEATURES if not row.computed)
"""The features an atlas may hold, in the table's order."""

_LARGEST_VARIANCE_MM2 = 1e4
_HEAD_BYTES = 1000

_FIXED = {"frame": "atlas", "side": "L", "units": "mm"}


@dataclass(frozen=True)
class Atlas:
    """A Gaussian shape model of the placed features of a left side, in the CO frame of its mean.

    It excludes CO, which is computed from other features. A right side is handled as the mirror image in x.

    Parameters
    ----------
    name : str
        What it was made from.
    codes : tuple of str
        Features, in the table's order.
    mean : (n, 3) array, mm, atlas frame
        Mean positions.
    covariance : (3 n, 3 n) array, mm^2, atlas frame
        Of the deviations of all coordinates, feature by feature; of full rank, suitable for weights.
    scatter : (3 n, 3 n) array, mm^2
        The sample covariance: unbiased, hence suitable for error bars, but hardly of full rank.
    n_samples : int
        Number of labelled sides behind it.
    specimens : tuple of str
        Their names, empty where they are not known.
    labelling_error : LabellingError
        Error of the labels that are compared with it, in checks and in the regions of expected features; by
        default an assumed one.

    Raises
    ------
    GpError
        Shapes do not match, values are not finite, or CA, CB, RWA or RWP is missing.
    """

    name: str
    codes: tuple[str, ...]
    mean: FloatArray
    covariance: FloatArray
    scatter: FloatArray
    n_samples: int
    specimens: tuple[str, ...] = field(default=())
    labelling_error: LabellingError = field(default=LabellingError())

    def __post_init__(self) -> None:
        check_fields(self, leaving_out=("codes", "specimens"))
        codes = check_codes(self.codes, "the atlas", allowed=PLACED)
        if list(codes) != sorted(codes, key=index_of):
            raise FeatureError(f"the features of atlas {self.name!r} are out of order: {' '.join(codes)}")
        missing = [code for code in DEFINING_FEATURES if code not in codes]
        if missing:
            raise FeatureError(f"the atlas {self.name!r} lacks {' '.join(missing)}, which define the cochlea")
        object.__setattr__(self, "codes", codes)
        n = len(codes)
        self._freeze("mean", self.mean, (n, 3))
        self._freeze("covariance", self.covariance, (3 * n, 3 * n))
        self._freeze("scatter", self.scatter, (3 * n, 3 * n))
        self._check_covariance("covariance", self.covariance, least=1e-9)
        self._check_covariance("scatter", self.scatter, least=-1e-9)
        if self.n_samples < 1:
            raise GpError(f"the atlas {self.name!r} must be of at least one side, got {self.n_samples}")
        landmarks = LandmarkSet.from_mapping(dict(zip(codes, self.mean, strict=True)), "L")
        check_plausible_size(landmarks, strict=True)
        cochlea_frame(landmarks)  # raises if the four features determine no frame

    def _freeze(self, name: str, value: ArrayLike, shape: tuple[int, ...]) -> None:
        array = np.array(value, dtype=np.float64)
        if array.shape != shape or not np.isfinite(array).all():
            raise GpError(f"the {name} of atlas {self.name!r} must be finite and {shape}, got {array.shape}")
        array.setflags(write=False)
        object.__setattr__(self, name, array)

    def _check_covariance(self, name: str, matrix: FloatArray, *, least: float) -> None:
        """Check magnitude, symmetry and positive definiteness."""
        size = np.abs(matrix).max()
        if size > _LARGEST_VARIANCE_MM2:
            raise GpError(f"the {name} of atlas {self.name!r} is implausibly large")
        if np.abs(matrix - matrix.T).max() > 1e-9 * size:
            raise GpError(f"the {name} of atlas {self.name!r} is not symmetric")
        if np.linalg.eigvalsh(matrix).min() < least * size or not matrix.diagonal().min() > 0:
            raise GpError(f"the {name} of atlas {self.name!r} is not positive")

    @staticmethod
    def published() -> Atlas:
        """Return the atlas rebuilt from the published distance table (Figure 2 of the paper).

        Returns
        -------
        Atlas
            The same object each time.
        """
        with _building:  # otherwise two threads could build it twice
            return _published()

    @classmethod
    @checks_arguments
    def load(cls, path: str | PathLike[str]) -> Atlas:
        """Read an atlas file.

        Parameters
        ----------
        path : path-like
            JSON, as `save` writes it.

        Returns
        -------
        Atlas
            Equal to the saved one to the last bit.

        Raises
        ------
        FileFormatError
            It cannot be read as an atlas of this schema version.
        """
        remedy = "Make it with: gp-core fit SPECIMENS... -o ATLAS"
        return cls._from_content(read_json(path, what="atlas file", remedy=remedy), path, remedy)

    @classmethod
    def _from_content(cls, content: Any, path: str | PathLike[str], remedy: str) -> Atlas:
        version = content.get("gpAtlas") if isinstance(content, dict) else None
        if version != SCHEMA_VERSION:
            problem = (
                "is not an atlas"
                if version is None
                else f"has atlas version {version!r}, not {SCHEMA_VERSION}"
            )
            raise FileFormatError(problem, file=path, remedy=remedy)
        for key, meant in _FIXED.items():
            if content.get(key) != meant:
                raise FileFormatError(
                    f"says {key} {content.get(key)!r}, not {meant!r}", file=path, remedy=remedy
                )
        try:
            return cls(
                name=str(content["name"]),
                codes=tuple(content["features"]),
                mean=content["mean_mm"],
                covariance=content["covariance_mm2"],
                scatter=content["scatter_mm2"],
                n_samples=int(content["n_samples"]),
                specimens=_names(content["specimens"]),
                labelling_error=LabellingError.from_dict(content.get("labelling_error", {})),
            )
        except KeyError as error:
            raise FileFormatError(f"is a damaged atlas: it lacks {error}", file=path, remedy=remedy) from None
        except GpError as error:
            raise FileFormatError(f"is a damaged atlas: {error.problem}", file=path, remedy=remedy) from None
        except (TypeError, ValueError, AttributeError, OverflowError, np.linalg.LinAlgError):
            raise FileFormatError(
                "is a damaged atlas: numbers or names are missing or misplaced", file=path, remedy=remedy
            ) from None

    @checks_arguments
    def _repr_html_(self) -> str:
        """Return the atlas for a notebook."""
        spread = np.sqrt(self.covariance.diagonal().reshape(-1, 3).sum(axis=1))
        rows = [
            (code, *(f"{value:.2f}" for value in mean), f"{sd:.2f}")
            for code, mean, sd in zip(self.codes, self.mean, spread, strict=True)
        ]
        title = f"Atlas {self.name}, {self.n_samples} sides"
        return html_table(title, [("feature", "x mm", "y mm", "z mm", "SD mm"), *rows])

    @checks_arguments
    def save(self, path: str | PathLike[str]) -> None:
        """Write the atlas as JSON, with full precision.

        Parameters
        ----------
        path : path-like
            Where to write.

        Raises
        ------
        GpError
            The file cannot be written.
        """
        write_text(path, json.dumps(self.as_dict(), indent=1) + "\n")

    def as_dict(self) -> dict[str, Any]:
        """Return the atlas as its JSON file holds it, with full precision.

        Returns
        -------
        dict
            Plain values for JSON; lengths in mm.
        """
        content = {
            "gpAtlas": SCHEMA_VERSION,
            "name": self.name,
            **_FIXED,
            "n_samples": self.n_samples,
            "specimens": list(self.specimens),
            "features": list(self.codes),
            "mean_mm": self.mean.tolist(),
            "covariance_mm2": self.covariance.tolist(),
            "scatter_mm2": self.scatter.tolist(),
        }
        if self.labelling_error != LabellingError():
            content["labelling_error"] = self.labelling_error.as_dict()
        return content

    @classmethod
    @checks_arguments
    def from_dict(cls, content: Mapping[str, Any]) -> Atlas:
        """Make an atlas of what `as_dict` returned.

        Parameters
        ----------
        content : mapping
            Plain values.

        Returns
        -------
        Atlas
            Equal to that one to the last bit.

        Raises
        ------
        GpError
            It is no atlas of this schema version.
        """
        return cls._from_content(content, "atlas", "Fit the atlas again.")

    @checks_arguments
    def with_labelling_error(self, error: LabellingError | None) -> Atlas:
        """Return the atlas for labels with another error.

        Parameters
        ----------
        error : LabellingError, optional
            A measured one; by default the assumed one.

        Returns
        -------
        Atlas
            The same shape model.
        """
        wanted = error or LabellingError()
        return self if wanted == self.labelling_error else replace(self, labelling_error=wanted)

    @checks_arguments
    def __getitem__(self, code: str) -> FloatArray:
        """Return the mean position (3,) of a feature, of CO too, in mm."""
        if code == "CO":
            return self.cochlea_origin
        position: FloatArray = self.mean[self._row(code)]
        return position

    @cached_property
    def cochlea_origin(self) -> FloatArray:
        """(3,) mean position of CO, mm: the origin of the atlas frame, up to rounding."""
        return cochlea_origin(*(self.mean[self._row(code)] for code in DEFINING_FEATURES))

    @checks_arguments
    def rows(self, codes: Iterable[str]) -> FloatArray:
        """Return the mean positions of features.

        Parameters
        ----------
        codes : iterable of str
            n features.

        Returns
        -------
        (n, 3) array, mm
            In the atlas frame.

        Raises
        ------
        FeatureError
            The atlas does not hold one of them.
        """
        return self.mean[[self._row(code) for code in codes]]

    @checks_arguments
    def variances(self, codes: Iterable[str]) -> FloatArray:
        """Return the variance of features between animals, averaged over the three coordinates.

        Parameters
        ----------
        codes : iterable of str
            n features.

        Returns
        -------
        (n,) array, mm^2
            Variance of one coordinate.
        """
        diagonal = self.covariance.diagonal()[self.coordinates(codes)]
        mean: FloatArray = diagonal.reshape(-1, 3).mean(axis=1)
        return mean

    @checks_arguments
    def cross_covariance(self, codes: Iterable[str], others: Iterable[str]) -> FloatArray:
        """Return the covariance between the coordinates of two lists of features.

        Parameters
        ----------
        codes, others : iterables of str
            n and m features.

        Returns
        -------
        (3 n, 3 m) array, mm^2
            Coordinates feature by feature.
        """
        return self.covariance[np.ix_(self.coordinates(codes), self.coordinates(others))]

    @checks_arguments
    def coordinates(self, codes: Iterable[str]) -> list[int]:
        """Return the rows of `covariance` that belong to features.

        Parameters
        ----------
        codes : iterable of str
            n features.

        Returns
        -------
        list of int
            3 n rows.
        """
        return [3 * self._row(code) + c for code in codes for c in range(3)]

    def _row(self, code: str) -> int:
        try:
            return self._index[code]
        except KeyError:
            known = f"it holds {' '.join(self.codes)}" if code in CODES else "no such feature"
            raise FeatureError(f"the atlas {self.name!r} lacks {code}; {known}", landmark=code) from None

    @cached_property
    def _index(self) -> dict[str, int]:
        return {code: row for row, code in enumerate(self.codes)}


def is_atlas_file(path: str | PathLike[str]) -> bool:
    """Whether a file identifies itself as an atlas; it may still be damaged.

    Parameters
    ----------
    path : path-like
        Any path.

    Returns
    -------
    bool
        False for folders, and for files that do not exist or cannot be read.
    """
    return b'"gpAtlas"' in read_head(path, _HEAD_BYTES)


def _names(value: Any) -> tuple[str, ...]:
    if not isinstance(value, list) or not all(isinstance(name, str) for name in value):
        raise GpError("its specimens are not a list of names")
    return tuple(value)


_building = threading.Lock()


@cache
def _published() -> Atlas:
    shape = published_shape()
    independent = np.diag(np.repeat(shape.variances, 3))
    return Atlas(
        name="published",
        codes=shape.codes,
        mean=shape.mean,
        covariance=independent,
        scatter=independent,
        n_samples=shape.n_sides,
    )
