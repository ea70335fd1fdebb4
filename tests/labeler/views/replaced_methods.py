"""Methods of Qt's classes that a test replaces for a while."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def replaced(kind: type, name: str, new: Callable[..., Any]) -> Iterator[None]:
    """Replace a method of a class, and put back what was there.

    What a class holds is put back, not what it returns: PyQt6 returns what is bound to nothing, so that later
    calls would lack their object.
    """
    getattr(kind, name)  # bindings fill in their classes at the first use
    before = vars(kind)[name]
    setattr(kind, name, new)
    try:
        yield
    finally:
        setattr(kind, name, before)
