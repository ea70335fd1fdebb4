"""Labels of points: what they name, on which side, and when two of them name the same point."""

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
_MARK = r"[\s_.:,;/|\-–—]"  # noqa: RUF001 - dashes of word processors
_WITH_SIDE = (
    # left CA, L_CA, L-CA, (L) CA
    re.compile(rf"[(\[]?(?P<side>l|r|left|right)[)\]]?{_MARK}+(?P<name>\S.*)", re.IGNORECASE),
    # CA_L, CA-left, CA right, CA__R, CA/L
    re.compile(rf"(?P<name>\S.*?){_MARK}+(?P<side>l|r|left|right)", re.IGNORECASE),
    # CA (L), CA[left]
    re.compile(rf"(?P<name>\S.*?){_MARK}*[(\[]\s*(?P<side>l|r|left|right)\s*[)\]]", re.IGNORECASE),
)


class ParsedLabel(NamedTuple):
    """What a label names: the stored name, and the side, if the label tells one."""

    name: str
    side: Side | None = None


def is_skull_feature(label: str) -> bool:
    """Whether a label names one of the skull's registration features, ``S1``, ``S2``, ...

    Parameters
    ----------
    label : str
        A label, in any letter case.

    Returns
    -------
    bool
        True for S and a number of one or two digits.
    """
    return _SKULL_FEATURE.fullmatch(label) is not None


def tidy_label(label: str) -> str:
    """Return a label as it is stored: features and skull features in capitals, single blanks.

    Parameters
    ----------
    label : str
        As typed, or read from a file.

    Returns
    -------
    str
        The stored form.
    """
    text = " ".join(label.split())
    return text.upper() if text.upper() in CODES or is_skull_feature(text) else text


def same_label(one: str, other: str) -> bool:
    """Whether two labels name the same point, as ``Bolt`` and ``bolt`` do.

    Parameters
    ----------
    one, other : str
        Labels.

    Returns
    -------
    bool
        Letter case and blanks do not count.
    """
    return tidy_label(one).casefold() == tidy_label(other).casefold()


def parse_label(label: str) -> ParsedLabel:
    """Return what a label names, and the side before or after the name of a feature.

    Only names of features and of skull features carry a side: ``Bolt_L`` is a name of its own.

    Parameters
    ----------
    label : str
        As typed, or read from a file.

    Returns
    -------
    ParsedLabel
        Name and side.

    Examples
    --------
    >>> parse_label("ca_L")
    ParsedLabel(name='CA', side=<Side.LEFT: 'L'>)
    >>> parse_label("right RWA")
    ParsedLabel(name='RWA', side=<Side.RIGHT: 'R'>)
    >>> parse_label("Bolt_L")
    ParsedLabel(name='Bolt_L', side=None)
    """
    text = tidy_label(label)
    if _is_known(text):
        return ParsedLabel(text)
    parted = (ParsedLabel(tidy_label(name), side) for name, side in _with_side(text))
    return next((one for one in parted if _is_known(one.name)), ParsedLabel(text))


def _with_side(text: str) -> Iterator[tuple[str, Side]]:
    """Yield the ways to read a label as a name and a side before or after it."""
    for pattern in _WITH_SIDE:
        match = pattern.fullmatch(text)
        if match:
            yield match["name"], Side.parse(match["side"])


def _is_known(name: str) -> bool:
    return name in CODES or is_skull_feature(name)


@dataclass(frozen=True)
class LabelNames:
    """A lab's own names of points, and the feature codes that they stand for.

    Parameters
    ----------
    codes : mapping of str to str
        For each of the lab's names, a feature's code, with a side (``CA_L``) or without; an empty text for a
        point that is left out. Letter case and blanks of the lab's names do not count. A label may have a
        side before or after such a name, as features may (``left Apex``).

    Raises
    ------
    FeatureError
        A code is unknown, or a name occurs twice.
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
        """Whether a point is to be left out.

        Parameters
        ----------
        label : str
            The lab's name of the point.

        Returns
        -------
        bool
            True where the lab's table gives it an empty code.
        """
        return self._code(label)[0] == ""

    def translate(self, label: str) -> str:
        """Return the code that stands for a label, or the label itself.

        Parameters
        ----------
        label : str
            The lab's name of the point.

        Returns
        -------
        str
            A feature's code, perhaps with a side.
        """
        code, side = self._code(label)
        if not code:
            return label
        name, own = parse_label(code)
        if own not in (None, side or own):  # left of a name that stands for a point of the right
            return label
        return code if side is None else f"{name}_{side.value}"

    def _code(self, label: str) -> tuple[str | None, Side | None]:
        """Return the code of a label, None where it is not in the table, and the side that the label adds."""
        if _key(label) in self.codes:
            return self.codes[_key(label)], None
        parted = ((_key(name), side) for name, side in _with_side(" ".join(label.split())))
        return next(((self.codes[key], side) for key, side in parted if key in self.codes), (None, None))


def _key(label: str) -> str:
    return " ".join(label.split()).casefold()
