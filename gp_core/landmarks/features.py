"""The table of the 20 features, read from ``resources/features.json``, and the two sides of the head."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from functools import cache

from gp_core.argument_types import is_scalar_array
from gp_core.errors import FeatureError
from gp_core.resources import resource_path
from gp_core.validation import near_matches

__all__ = [
    "CODES",
    "EXTERNAL",
    "FEATURES",
    "PROBE",
    "RECOMMENDED",
    "TRAINING",
    "Feature",
    "Side",
    "check_codes",
    "feature",
    "index_of",
    "named_set",
]


class Side(str, Enum):
    """Left or right side of the head."""

    LEFT = "L"
    RIGHT = "R"

    @classmethod
    def parse(cls, text: str | Side) -> Side:
        """Return the side that ``L``, ``R``, ``left`` or ``right`` names.

        Parameters
        ----------
        text : str or Side
            In any letter case.

        Returns
        -------
        Side
            The side.

        Raises
        ------
        FeatureError
            Something else was given.
        """
        if isinstance(text, cls):
            return text
        word = str(getattr(text, "value", text)).strip().lower()
        for side in cls:
            if word in (side.value.lower(), side.word):
                return side
        raise FeatureError(f"side must be L or R, got {text!r}")

    @property
    def word(self) -> str:
        """``left`` or ``right``."""
        return "left" if self is Side.LEFT else "right"

    @property
    def other(self) -> Side:
        """The opposite side."""
        return Side.RIGHT if self is Side.LEFT else Side.LEFT


@dataclass(frozen=True)
class Feature:
    """One anatomical feature: a row of the feature table.

    Attributes
    ----------
    code : str
        Short name, such as ``RWA``.
    name : str
        Full name.
    definition : str
        Where exactly it lies.
    where : str
        How to find it.
    view : str
        The view in which it is found.
    external : bool
        Whether a probe can touch it.
    on_bone : bool
        Whether it lies on the surface of a bone or tooth; CA and CB lie in the spaces of the cochlea.
    shared : bool
        Whether both sides have it in common (IN).
    computed : bool
        Whether it is computed from others (CO).
    mistakes : str
        What often goes wrong when it is placed, in this project's words; the paper lists no mistakes.
    """

    code: str
    name: str
    definition: str
    where: str
    view: str
    external: bool
    on_bone: bool
    shared: bool
    computed: bool
    mistakes: str


@cache
def _table() -> dict[str, object]:
    content: dict[str, object] = json.loads(resource_path("features.json").read_text(encoding="utf-8"))
    return content


def _load_features() -> tuple[Feature, ...]:
    rows = _table()["features"]
    assert isinstance(rows, list)
    return tuple(Feature(**row) for row in rows)


def named_set(name: str) -> tuple[str, ...]:
    """Return a list of feature codes that the table names.

    Parameters
    ----------
    name : str
        Such as ``"training"`` or ``"probe"``.

    Returns
    -------
    tuple of str
        Codes, in the order of the table's list.
    """
    sets = _table()["named_sets"]
    assert isinstance(sets, dict)
    return tuple(sets[name])


FEATURES: tuple[Feature, ...] = _load_features()
CODES: tuple[str, ...] = tuple(f.code for f in FEATURES)
EXTERNAL: tuple[str, ...] = tuple(f.code for f in FEATURES if f.external)
TRAINING: tuple[str, ...] = named_set("training")
PROBE: tuple[str, ...] = named_set("probe")
RECOMMENDED: tuple[str, ...] = (*PROBE, "IN")
"""Recommended touches: the paper's six, and IN, far from their plane; ZL where IN cannot be reached."""

_INDEX = {code: i for i, code in enumerate(CODES)}


def feature(code: str) -> Feature:
    """Return the feature with a given code.

    Parameters
    ----------
    code : str
        In any letter case; surrounding spaces are ignored.

    Returns
    -------
    Feature
        Its row of the table.

    Raises
    ------
    FeatureError
        No such feature; the message suggests similar codes.
    """
    return FEATURES[index_of(code)]


def index_of(code: str) -> int:
    """Return the row of a feature in the table's order.

    Parameters
    ----------
    code : str
        In any letter case; surrounding spaces are ignored.

    Returns
    -------
    int
        Row, from 0 to 19.

    Raises
    ------
    FeatureError
        No such feature; the message suggests similar codes.
    """
    if isinstance(code, str) and code in _INDEX:  # nearly always, and asked for thousands of times
        return _INDEX[code]
    if not isinstance(code, str):
        raise FeatureError(f"a feature is named by its code, such as RWA, got {type(code).__name__}")
    key = code.strip().upper()
    if key not in _INDEX:
        raise FeatureError(
            f"unknown feature {code!r}{near_matches(key, CODES)}",
            landmark=code,
            remedy=f"The features are {' '.join(CODES)}.",
        )
    return _INDEX[key]


def check_codes(
    codes: Iterable[str], name: str, *, allowed: Iterable[str] | None = None, at_least: int = 1
) -> tuple[str, ...]:
    """Return feature codes as the table spells them, in the order given.

    Parameters
    ----------
    codes : iterable of str
        The requested codes.
    name : str
        What the message calls them.
    allowed : iterable of str, optional
        The permitted features; by default all 20.
    at_least : int
        Required number.

    Returns
    -------
    tuple of str
        Codes as the table spells them.

    Raises
    ------
    FeatureError
        Unknown, named twice, not allowed here, or too few.
    """
    if isinstance(codes, str | bytes) or not isinstance(codes, Iterable) or is_scalar_array(codes):
        raise FeatureError(f"{name} must be a list of features, got {codes!r}")
    found = tuple(feature(code).code for code in codes)
    permitted = tuple(CODES if allowed is None else allowed)
    for code in found:
        if found.count(code) > 1:
            raise FeatureError(f"{name} names {code} twice", landmark=code)
        if code not in permitted:
            raise FeatureError(
                f"{name} must not contain {code}; allowed are {' '.join(permitted)}", landmark=code
            )
    if len(found) < at_least:
        raise FeatureError(
            f"{name} must hold at least {at_least} features, got {len(found)}: {' '.join(found)}"
        )
    return found
