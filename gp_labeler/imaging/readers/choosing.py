"""Which of the scans in a folder is meant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from gp_labeler.imaging.readers.options import ImportOptions
from gp_labeler.imaging.readers.problems import Problem, VolumeError, names

__all__ = ["FEW", "Choice", "choose"]

FEW = 0.1
"""A scan with less than this part of the largest one's slices is no rival to it, but may be asked for."""


@dataclass(frozen=True)
class Choice:
    """One of several scans in a folder.

    Parameters
    ----------
    id : str
        What the option `series` takes.
    text : str
        What a person chooses by.
    n_slices : int
        How many it has.
    """

    id: str
    text: str
    n_slices: int


def choose(
    choices: Sequence[Choice], options: ImportOptions, picked: int | None, folder: Path
) -> tuple[int, tuple[Problem, ...]]:
    """Return the index of the scan that is meant, and the problem that none is, if there are rivals.

    Parameters
    ----------
    choices : sequence of Choice
        The largest first.
    options : ImportOptions
        `series` is an id, or a part of an id or text that no other choice has.
    picked : int, optional
        Of which one a slice was given as the path.
    folder : Path
        To name in errors.

    Raises
    ------
    VolumeError
        `series` fits none, or several.
    """
    if options.series is not None:
        return _asked_for(choices, options.series, folder), ()
    if picked is not None:
        return picked, ()
    rivals = [choice for choice in choices if choice.n_slices >= FEW * choices[0].n_slices]
    if len(rivals) == 1:
        return 0, ()
    text = f"it holds {len(rivals)} scans: {names([choice.text for choice in rivals], 12)}"
    remedy = f"Choose one (--series, with its name or a part of it: {_quoted(rivals[0].id)})."
    return 0, (Problem("several-series", text, remedy=remedy, resolved_by=("series",)),)


def _asked_for(choices: Sequence[Choice], series: str, folder: Path) -> int:
    wanted = series.lower()
    exact = [n for n, choice in enumerate(choices) if choice.id.lower() == wanted]
    fitting = exact or [
        n for n, choice in enumerate(choices) if wanted in f"{choice.id} {choice.text}".lower()
    ]
    if len(fitting) == 1:
        return fitting[0]
    raise VolumeError(
        f"series {series!r} fits {len(fitting)} of its scans",
        file=folder,
        remedy=f"Give one of: {names([f'{_quoted(choice.id)} ({choice.text})' for choice in choices], 12)}.",
    )


def _quoted(text: str) -> str:
    return f'"{text}"' if set(text) & set(" #") else text
