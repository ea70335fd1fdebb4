"""What the name of a landmark file tells: the specimen, the side, and more."""

from __future__ import annotations

import re
from os import PathLike
from pathlib import Path

from gp_core.landmarks.features import Side

__all__ = [
    "is_named_suggested",
    "labelling_named",
    "landmark_file_name",
    "name_parts",
    "named_side",
    "natural_key",
    "specimen_named",
]

_SUGGESTED_ENDING = re.compile(r"[ _.\-]+suggested$", re.IGNORECASE)
_MARKS = " _.-"
_LABELLING = re.compile(r"(?P<specimen>.+)_(?P<observer>[^_]+)_r(?P<round>[1-9][0-9]{0,3})", re.IGNORECASE)
"""GP01_AB_r2: specimen, observer, round."""
# left_GP01, GP01_L_final, GP01 (R): a whole word, wherever it stands
_SIDE_WORDS = tuple(
    re.compile(rf"(?<![^ _.\-])[(\[]?(?P<side>{words})[)\]]?(?![^ _.\-])", re.IGNORECASE)
    for words in ("left|right", "l|r")
)


def landmark_file_name(
    specimen: str, side: Side, *, suggested: bool = False, observer: str = "", round_: int | None = None
) -> str:
    """Return the name of the file for one side of a specimen, or for its suggestions.

    With a round, it is the file of one of several labellings.

    Parameters
    ----------
    specimen : str
        Name of the animal.
    side : Side
        Which side.
    suggested : bool
        Whether the file holds suggestions only.
    observer : str
        Who labelled it.
    round_ : int, optional
        Which of the observer's labellings, from 1.

    Returns
    -------
    str
        A file name.

    Examples
    --------
    >>> landmark_file_name("GP01", Side.LEFT), landmark_file_name("GP01", Side.LEFT, observer="AB", round_=2)
    ('GP01_L.mrk.json', 'GP01_AB_r2_L.mrk.json')
    """
    if round_ is not None:
        who = re.sub(r"[^\w\-]+|_", "-", observer).strip("-") or "unnamed"
        specimen = f"{specimen}_{who}_r{round_}"
    return f"{specimen}_{side.value}{'_suggested' if suggested else ''}.mrk.json"


def labelling_named(path: str | PathLike[str], suffix: str) -> tuple[str, int]:
    """Return the observer and the round in the name of a file.

    Parameters
    ----------
    path : path-like
        Such as ``GP01_AB_r2_L.mrk.json``.
    suffix : str
        Its suffix, such as ``.mrk.json``.

    Returns
    -------
    observer : str
        Empty where the name has none.
    round_ : int
        1 where the name has none.
    """
    match = _LABELLING.fullmatch(name_parts(path, suffix)[0])
    return (match["observer"], int(match["round"])) if match else ("", 1)


def specimen_named(path: str | PathLike[str], suffix: str) -> str:
    """Return the specimen in the name of a file.

    Parameters
    ----------
    path : path-like
        Such as ``GP01_AB_r2_L.mrk.json``.
    suffix : str
        Its suffix, such as ``.mrk.json``.

    Returns
    -------
    str
        ``GP01`` for ``GP01_L`` and for ``GP01_AB_r2_L``.
    """
    name = name_parts(path, suffix)[0]
    match = _LABELLING.fullmatch(name)
    return match["specimen"] if match else name


def is_named_suggested(path: str | PathLike[str], suffix: str) -> bool:
    """Return whether a file is named as one that holds suggestions.

    Parameters
    ----------
    path : path-like
        Such as ``GP01_L_suggested.mrk.json``.
    suffix : str
        Its suffix, such as ``.mrk.json``.

    Returns
    -------
    bool
        Whether the name ends in ``suggested``.
    """
    return _SUGGESTED_ENDING.search(Path(path).name[: -len(suffix)]) is not None


def name_parts(path: str | PathLike[str], suffix: str) -> tuple[str, Side | None]:
    """Return the specimen and the side in the name of a file.

    The side is a word of the name, at any position: ``left`` or ``right``, or else ``L`` or ``R``. A name
    with both gives no side.

    Parameters
    ----------
    path : path-like
        A file.
    suffix : str
        Its suffix, such as ``.mrk.json``.

    Returns
    -------
    specimen : str
        The rest of the name.
    side : Side or None
        None where the name gives none.

    Examples
    --------
    >>> name_parts("scans/LG.J_7-left.mrk.json", ".mrk.json")
    ('LG.J_7', <Side.LEFT: 'L'>)
    >>> name_parts("GP01_R_suggested.mrk.json", ".mrk.json")
    ('GP01', <Side.RIGHT: 'R'>)
    >>> name_parts("Left ear GP01.fcsv", ".fcsv")
    ('ear GP01', <Side.LEFT: 'L'>)
    """
    name = Path(path).name
    stem = _SUGGESTED_ENDING.sub("", name[: len(name) - len(suffix)])
    for pattern in _SIDE_WORDS:
        found = list(pattern.finditer(stem))
        sides = {Side.parse(word["side"]) for word in found}
        if len(sides) == 1:
            return _without(stem, found[-1]) or stem, sides.pop()
        if sides:
            break
    return stem, None


def _without(stem: str, word: re.Match[str]) -> str:
    """Return a name without one of its words, and without the marks that are left over."""
    before, after = stem[: word.start()], stem[word.end() :]
    kept = before if not after.strip(_MARKS) else f"{before.rstrip(_MARKS)}{after}" if before else after
    return kept.strip(_MARKS)


def named_side(path: str | PathLike[str]) -> Side | None:
    """Return the side in the name of a file.

    Parameters
    ----------
    path : path-like
        A file.

    Returns
    -------
    Side or None
        None where the name gives none, or both.

    Examples
    --------
    >>> named_side("SkullA_Left_new.dat")
    <Side.LEFT: 'L'>
    """
    words = {word for word in re.split(r"[^a-z0-9]+", Path(path).name.lower()) if word}
    told = {side for side in Side if words & {side.word, side.value.lower()}}
    return told.pop() if len(told) == 1 else None


def natural_key(name: str) -> tuple[tuple[int, str], ...]:
    """Return a sorting key that puts GP2 before GP10 and ignores letter case.

    Parameters
    ----------
    name : str
        A name.

    Returns
    -------
    tuple
        The key.
    """
    parts = re.split(r"([0-9]+)", name.casefold())
    # Odd parts are digits: without leading zeros, the longer one is the larger number.
    tidy = [part.lstrip("0") if i % 2 else part for i, part in enumerate(parts)]
    return tuple((len(part) if i % 2 else 0, part) for i, part in enumerate(tidy))
