"""First labels of a scan: guesses, each with its radius, and how they were found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gp_core.landmarks.features import Side
from gp_core.landmarks.suggestion import Suggestion
from gp_core.validation import FloatArray
from gp_labeler.autolabel.labelled_scan import side_and_code

__all__ = ["Guess", "Proposal", "most_doubtful_first", "scans_text"]

_DOUBTFUL = 2.0
"""A guess is doubtful from the start where its radius is so many times the median radius."""


@dataclass(frozen=True, eq=False)
class Guess:
    """Where one landmark may be; not an observation.

    Parameters
    ----------
    name : str
        ``CA_L``, ``IN``, or a name of the lab's own scheme.
    position : (3,) array, LPS mm
        In the scan.
    radius_95 : float or None
        mm; None where one labelled scan alone is there, which says nothing of errors.
    spread : float or None
        How the templates differ, mm, root mean square; None of one template.
    history : float or None
        How far such guesses were off in the labelled scans, mm, root mean square.
    n_templates : int
        How many labelled scans have the landmark.
    is_doubtful : bool
        Whether it needs a closer look than the others.
    atlas_distance : float or None
        From where the atlas expects it, given the other guesses of its side, mm; None where they agree.
    """

    name: str
    position: FloatArray
    radius_95: float | None
    spread: float | None
    history: float | None
    n_templates: int
    is_doubtful: bool = False
    atlas_distance: float | None = None

    @property
    def uncertainty(self) -> float:
        """How far off it may be, mm: its radius or its distance from the atlas, the larger one."""
        return max(self.radius_95 or 0.0, self.atlas_distance or 0.0)

    def as_json(self) -> dict[str, Any]:
        """Return the guess as JSON values."""
        return {
            "name": self.name,
            "position": np.round(self.position, 4).tolist(),
            "radius95": _rounded(self.radius_95),
            "spread": _rounded(self.spread),
            "history": _rounded(self.history),
            "templates": self.n_templates,
            "doubtful": self.is_doubtful,
            "atlasDistance": _rounded(self.atlas_distance),
        }


@dataclass(frozen=True, eq=False)
class Proposal:
    """First labels of one scan.

    Parameters
    ----------
    guesses : tuple of Guess
        The most doubtful first.
    scheme : tuple of str
        All landmarks, in the order of the labelled scans.
    outside : tuple of str
        Landmarks that are expected beyond the edge of the scan.
    templates : tuple of str
        Names of the labelled scans that they come from, the most similar first.
    score : float
        Of the head's pose, 0 to 1; beyond 0.57 there would be no proposal.
    engine : str
        ``greedy`` or ``demons``.
    left : str
        What left and right were taken from, in words.
    warnings : tuple of str
        What a person should look at.
    """

    guesses: tuple[Guess, ...]
    scheme: tuple[str, ...]
    outside: tuple[str, ...]
    templates: tuple[str, ...]
    score: float
    engine: str
    left: str
    warnings: tuple[str, ...] = ()

    @property
    def positions(self) -> dict[str, FloatArray]:
        """Positions by name, LPS mm."""
        return {guess.name: guess.position for guess in self.guesses}

    @property
    def source(self) -> str:
        """What suggests, in words: ``5 labelled scans``."""
        return scans_text(len(self.templates))

    def suggestion(self, guess: Guess) -> Suggestion:
        """Return a guess as a suggestion for a person to confirm."""
        x, y, z = guess.position.tolist()
        return Suggestion((x, y, z), guess.radius_95, self.source, guess.atlas_distance, guess.is_doubtful)

    def suggestions(self) -> dict[Side, dict[str, Suggestion]]:
        """Return the guesses of the guinea pig's features by side and code, the most doubtful first."""
        found: dict[Side, dict[str, Suggestion]] = {side: {} for side in Side}
        for guess in self.guesses:
            known = side_and_code(guess.name)
            if known is not None:
                found[known[0]][known[1]] = self.suggestion(guess)
        return found

    def as_json(self) -> dict[str, Any]:
        """Return the proposal as JSON values."""
        return {
            "guesses": [guess.as_json() for guess in self.guesses],
            "outside": list(self.outside),
            "templates": list(self.templates),
            "score": round(self.score, 4),
            "engine": self.engine,
            "left": self.left,
            "warnings": list(self.warnings),
        }


def scans_text(n: int) -> str:
    """Return a number of labelled scans in words: ``1 labelled scan``."""
    return "1 labelled scan" if n == 1 else f"{n} labelled scans"


def most_doubtful_first(guesses: Sequence[Guess]) -> tuple[Guess, ...]:
    """Return guesses, the most doubtful first, marked where they need a closer look."""
    radii = [guess.radius_95 for guess in guesses if guess.radius_95 is not None]
    limit = _DOUBTFUL * float(np.median(radii)) if radii else np.inf
    marked = [_marked(guess, limit) for guess in guesses]
    return tuple(sorted(marked, key=lambda guess: -guess.uncertainty))


def _marked(guess: Guess, limit: float) -> Guess:
    is_wide = guess.radius_95 is not None and guess.radius_95 > limit
    return replace(guess, is_doubtful=guess.is_doubtful or is_wide)


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 4)
