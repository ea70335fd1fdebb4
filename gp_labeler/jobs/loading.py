"""Imports that take long, made by one thread at a time."""

from __future__ import annotations

import importlib
import threading

__all__ = ["load_modules"]

_LOADING = threading.Lock()


def load_modules(*modules: str) -> None:
    """Import what takes long, one thread at a time: two that import SciPy at once may find it half made."""
    with _LOADING:
        for module in modules:
            importlib.import_module(module)
