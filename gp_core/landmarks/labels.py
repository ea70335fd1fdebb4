"""Labels of points: what they name, on which side, and when two of them name one point."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from gp_core.errors import FeatureError
from gp_core.landmarks.features import CODES, Side
from gp_core.validation import near_matches

__all__ = ["LabelNames", "ParsedLabel", "is_skull_feature", "parse_label", "same_label", "tidy_label"]

_SKULL_FEATURE = re.compile(r"S[0-9]{1,2}", re.IGNORECASE)
_WITH_SIDE = (
    # left CA, L_CA, L-CA, (L) CA
    re.compile(r"[(\[]?(?P<side>l|r|left|right)[)\]]?[\s_.:\-]+(?P<name>\S.*)", re.IGNORECASE),
    # CA_L, CA-left, CA right
    re.compile(r"(?P<name>.*\S)[\s_.:\-]+(?P<side>l|r|left|right)", re.IGNORECASE),
    # CA (L), CA[left]
    re.compile(r"(?P<name>.*\S)[\s_.:\-]*[(\[]\s*(?P<side>l|r|left|right)\s*[)\]]", re.IGNORECASE),
)


class ParsedLabel(NamedTuple):
    """What a label names: the name as it is kept, and the side that the label tells, if it tells one."""

    name: str
    side: Side | None = None


def is_skull_feature(label: str) -> bool:
    """Whether a label names one of the skull's registration features, ``S1``, ``S2``, ..."""
    return _SKULL_FEATURE.fullmatch(label) is not None


def tidy_label(label: str) -> str:
    """Return a label as it is kept: features and skull features in capitals, blanks tidied."""
    text = " ".join(label.split())
    return text.upper() if text.upper() in CODES or is_skull_feature(text) else text


def same_label(one: str, other: str) -> bool:
    """Whether two labels name one point, as ``Bolt`` and ``bolt`` do."""
    return tidy_label(one).casefold() == tidy_label(other).casefold()


def parse_label(label: str) -> ParsedLabel:
    """Return what a label names, and the side that stands before or behind the name of a feature.

    Only names of features and of skull features carry a side: ``Bolt_L`` is a name of its own.

    Examples
    --------
    >>> parse_label("ca_L"), parse_label("right RWA"), parse_label("Bolt_L")
    (ParsedLabel(name='CA', side=<Side.LEFT: 'L'>), ParsedLabel(name='RWA', side=<Side.RIGHT: 'R'>), ParsedLabel(name='Bolt_L', side=None))
    """  # noqa: E501 - a doctest cannot be wrapped
    text = tidy_label(label)
    if _is_known(text):
        return ParsedLabel(text)
    for pattern in _WITH_SIDE:
        match = pattern.fullmatch(text)
        if match and _is_known(name := tidy_label(match["name"])):
            return ParsedLabel(name, Side.parse(match["side"]))
    return ParsedLabel(text)


def _is_known(name: str) -> bool:
    return name in CODES or is_skull_feature(name)


@dataclass(frozen=True)
class LabelNames:
    """The names that a lab has for points, and the codes that stand for them here.

    Parameters
    ----------
    codes : mapping of str to str
        A feature's code, with a side (``CA_L``) or without one, by the lab's own name; an empty text for a
        point that is left out. Letter case and blanks of the lab's names do not count.

    Raises
    ------
    FeatureError
        A code is unknown, or one name stands twice.
    """

    codes: Mapping[str, str]

    def __post_init__(self) -> None:
        known: dict[str, str] = {}
        for theirs, ours in self.codes.items():
            key = _key(theirs)
            if key in known:
                raise FeatureError("has two codes", landmark=theirs[:40], remedy="Keep one of them.")
            if ours.strip() and not _is_known(parse_label(ours).name):
                raise FeatureError(
                    f"cannot stand for {ours[:40]!r}, which is no feature{near_matches(ours[:40], CODES)}",
                    landmark=theirs[:40],
                    remedy=f"The features are {' '.join(CODES)}.",
                )
            known[key] = ours.strip()
        object.__setattr__(self, "codes", known)

    def __iter__(self) -> Iterator[str]:
        return iter(self.codes)

    def __contains__(self, label: str) -> bool:
        return _key(label) in self.codes

    def leaves_out(self, label: str) -> bool:
        """Whether a point is not to be taken."""
        return self.codes.get(_key(label)) == ""

    def translate(self, label: str) -> str:
        """Return the code that stands for a label, or the label itself."""
        return self.codes.get(_key(label)) or label


def _key(label: str) -> str:
    return " ".join(label.split()).casefold()
