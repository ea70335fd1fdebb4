"""Signals of the document, the models and the jobs: a listener that fails does not stop the others."""

from __future__ import annotations

import sys
from functools import partial

import psygnal

__all__ = ["Signal"]


class _ReachesAll(psygnal.SignalInstance):
    """Reports the error of a listener as Qt does for its own slots, and goes on with the next one.

    A panel of an installed package may listen too. What comes after it, such as the table of labels or the
    recorder of scripts, must not miss the edit at which it failed.
    """

    def _run_emit_loop_immediate(self) -> None:  # psygnal's own stops at the first error
        args = self._emit_queue.popleft()
        for listener in tuple(self._slots):
            if listener.dereference() is None:  # it was let go by one before it
                continue
            try:
                listener.cb(args)
            except RecursionError:
                raise
            except Exception as error:
                sys.excepthook(type(error), error, error.__traceback__)


Signal = partial(psygnal.Signal, signal_instance_class=_ReachesAll)
"""Makes a signal, to be declared in a class, of the types of its arguments."""
