"""From models to widgets: connections that end with the widget, and errors shown to the user."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Protocol

from qtpy.QtCore import QObject, QSignalBlocker, QTimer

from gp_core.errors import GpError

__all__ = ["OncePerTurn", "attempt", "blocked", "follow"]


class Teller(Protocol):
    """What errors are told to: a `Workspace`."""

    def say(self, text: str, level: str = "info") -> None:
        """Tell the user."""
        ...


def follow(owner: QObject, signal: Any, slot: Callable[..., object]) -> None:
    """Connect a psygnal signal to a method of a Qt object, for as long as `owner` exists.

    Neither end is kept alive by this.

    Parameters
    ----------
    owner : QObject
        Whose end ends the connection, usually the object itself.
    signal : psygnal.SignalInstance
        What to listen to.
    slot : bound method
        What to call.
    """
    signal.connect(slot)
    method = weakref.WeakMethod(slot)  # a strong one would keep a widget alive that nobody holds

    def let_go() -> None:
        _let_go.discard(let_go)
        living = method()
        if living is not None:
            signal.disconnect(living, missing_ok=True)

    _let_go.add(let_go)
    owner.destroyed.connect(let_go)


_let_go: set[Callable[[], None]] = set()
"""Keeps these functions out of the garbage: PyQt would call one that the collector has cleared already."""


class OncePerTurn(QTimer):
    """Calls a method once for all that is announced in one turn of the event loop, after the turn.

    Parameters
    ----------
    call : bound method
        What to call; it may be called earlier, and then calls `stop`.
    parent : QObject
        Whose method it is.
    """

    def __init__(self, call: Callable[[], object], parent: QObject) -> None:
        super().__init__(parent, singleShot=True, interval=0)
        self.timeout.connect(call)

    def soon(self, *_: object) -> None:
        """Call after this turn; a slot for any signal."""
        if not self.isActive():
            self.start()


def attempt(teller: Teller, action: Callable[[], object]) -> bool:
    """Do what a user asked for, and tell them where it cannot be done; return whether it was."""
    try:
        action()
    except GpError as error:
        teller.say(str(error), "error")
        return False
    return True


@contextmanager
def blocked(*objects: QObject) -> Iterator[None]:
    """Change widgets without their signals."""
    blockers = [QSignalBlocker(each) for each in objects]
    try:
        yield
    finally:
        for blocker in blockers:
            blocker.unblock()
