"""How long work tells that it gets on, and how it is stopped."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

__all__ = ["Cancelled", "Progress", "Report"]

Progress = Callable[[float], None]
"""Called with the fraction done, 0 to 1, from the thread that works."""


class Cancelled(Exception):  # noqa: N818 - not an error: somebody asked for it
    """The work was stopped because somebody asked for it; nothing was changed."""


@dataclass(frozen=True)
class Report:
    """What a worker calls between two steps.

    Parameters
    ----------
    progress : callable, optional
        Receives the fraction done, 0 to 1.
    cancel : callable, optional
        Returns whether to stop.
    """

    progress: Progress | None = None
    cancel: Callable[[], bool] | None = None

    def __call__(self, fraction: float) -> None:
        """Tell the fraction done, or stop.

        Raises
        ------
        Cancelled
            `cancel` says so.
        """
        self.check()
        if self.progress is not None:
            self.progress(min(max(fraction, 0.0), 1.0))

    def check(self) -> None:
        """Stop where that was asked for, and tell nothing; from any thread."""
        if self.cancel is not None and self.cancel():
            raise Cancelled

    def part(self, start: float, end: float) -> Report:
        """Return a report of a part of the work, which is itself told from 0 to 1."""
        tell = self.progress
        if tell is None:
            return self
        return Report(lambda fraction: tell(start + (end - start) * fraction), self.cancel)
