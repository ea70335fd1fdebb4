"""The table of the 20 features, read from ``resources/features.json``, and the two sides of the head."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from functools import cache

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

        Raises
        ------
        FeatureError
            Something else was given.
        """
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

    `on_bone` features lie on the surface of a bone or tooth; CA and CB lie in the cochlea's spaces.
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


@cache
def _table() -> dict[str, object]:
    content: dict[str, object] = json.loads(resource_path("features.json").read_text(encoding="utf-8"))
    return content


def _load_features() -> tuple[Feature, ...]:
    rows = _table()["features"]
    assert isinstance(rows, list)
    return tuple(Feature(**row) for row in rows)


def named_set(name: str) -> tuple[str, ...]:
    """Return a list of feature codes that the table names, such as ``"training"`` or ``"probe"``."""
    sets = _table()["named_sets"]
    assert isinstance(sets, dict)
    return tuple(sets[name])


FEATURES: tuple[Feature, ...] = _load_features()
CODES: tuple[str, ...] = tuple(f.code for f in FEATURES)
EXTERNAL: tuple[str, ...] = tuple(f.code for f in FEATURES if f.external)
TRAINING: tuple[str, ...] = named_set("training")
PROBE: tuple[str, ...] = named_set("probe")
RECOMMENDED: tuple[str, ...] = (*PROBE, "IN")
"""What to touch: the paper's six, and IN, far from their plane. Where IN cannot be reached, ZL."""

_INDEX = {code: i for i, code in enumerate(CODES)}


def feature(code: str) -> Feature:
    """Return the feature with this code (any case, spaces around it ignored).

    Raises
    ------
    FeatureError
        No such feature; near matches are named.
    """
    return FEATURES[index_of(code)]


def index_of(code: str) -> int:
    """Return the row of a feature in the table's order; see `feature`."""
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
        What was asked for.
    name : str
        What the caller calls them; stands in the message.
    allowed : iterable of str, optional
        The features that may be named, by default all 20.
    at_least : int
        How many there must be.

    Raises
    ------
    FeatureError
        Unknown, named twice, not allowed here, or too few.
    """
    found = tuple(feature(code).code for code in codes)
    permitted = tuple(CODES if allowed is None else allowed)
    for code in found:
        if found.count(code) > 1:
            raise FeatureError(f"{name} names {code} twice", landmark=code)
        if code not in permitted:
            raise FeatureError(
                f"{name} may not hold {code}; allowed are {' '.join(permitted)}", landmark=code
            )
    if len(found) < at_least:
        raise FeatureError(
            f"{name} must hold at least {at_least} features, got {len(found)}: {' '.join(found)}"
        )
    return found
