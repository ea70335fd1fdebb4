"""Undo and redo: the states before and after, which cost little since they share what is alike."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

__all__ = ["History", "UndoStep"]

S = TypeVar("S")

LIMIT = 1000


@dataclass(frozen=True)
class UndoStep(Generic[S]):
    """One edit that can be undone or redone.

    Parameters
    ----------
    text : str
        What was done, such as ``place FPP left``.
    state : state
        Before it (to undo) or after it (to redo).
    focus : object
        Where the user's attention was then; kept beside the state, not part of it.
    """

    text: str
    state: S
    focus: object = None


class History(Generic[S]):
    """The current state, those before it and those undone.

    Parameters
    ----------
    state : state
        To begin with.
    limit : int
        How many edits can be undone; older ones are forgotten.
    """

    def __init__(self, state: S, *, limit: int = LIMIT) -> None:
        self._state = state
        self._past: deque[UndoStep[S]] = deque(maxlen=limit)
        self._future: deque[UndoStep[S]] = deque(maxlen=limit)

    @property
    def state(self) -> S:
        """The current state."""
        return self._state

    @property
    def to_undo(self) -> UndoStep[S] | None:
        """What undo would take back, with the state before it; None where there is nothing."""
        return self._past[-1] if self._past else None

    @property
    def to_redo(self) -> UndoStep[S] | None:
        """What redo would do again, with the state after it; None where there is nothing."""
        return self._future[-1] if self._future else None

    def push(self, text: str, state: S, *, focus: object = None, merge: bool = False) -> None:
        """Go on to `state`; what was undone is forgotten.

        With `merge`, an edit of the same text as the last becomes one with it, as the steps of a gesture do.
        """
        last = self.to_undo
        if not (merge and last is not None and last.text == text and not self._future):
            self._past.append(UndoStep(text, self._state, focus))
        self._future.clear()
        self._state = state

    def undo(self, *, focus: object = None, state: S | None = None, text: str = "") -> UndoStep[S]:
        """Go back one edit and return the step taken.

        Where nothing is left to undo, `state` and `text` (from a journal, whose writer remembered more) stand
        in.

        Raises
        ------
        LookupError
            Nothing to undo, and no `state`.
        """
        return self._step(self._past, self._future, focus, state, text)

    def redo(self, *, focus: object = None, state: S | None = None, text: str = "") -> UndoStep[S]:
        """Do again what was undone last; the rest as in `undo`."""
        return self._step(self._future, self._past, focus, state, text)

    def _step(
        self,
        source: deque[UndoStep[S]],
        target: deque[UndoStep[S]],
        focus: object,
        state: S | None,
        text: str,
    ) -> UndoStep[S]:
        if source:
            step = source.pop()
        elif state is not None:
            step = UndoStep(text, state)
        else:
            raise LookupError("nothing to undo or redo")
        target.append(UndoStep(step.text, self._state, focus))
        self._state = step.state
        return step

    def change_all(self, change: Callable[[S], S]) -> None:
        """Change the current state and every remembered one: for what undo shall not take back."""
        self._state = change(self._state)
        for steps in (self._past, self._future):
            changed = [replace(step, state=change(step.state)) for step in steps]
            steps.clear()
            steps.extend(changed)
