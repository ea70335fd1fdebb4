"""The Qt binding that qtpy loads: the one that ``QT_API`` names, else PySide6, else PyQt6."""

from __future__ import annotations

import os
import sys
from importlib.util import find_spec

from gp_core.errors import GpError

__all__ = ["BINDINGS", "choose_binding"]

BINDINGS = {"pyside6": "PySide6", "pyqt6": "PyQt6"}
"""Package of each value of ``QT_API`` that the window works with; the first is the default."""

_DEFAULT = "pyside6"


def choose_binding() -> str:
    """Set ``QT_API`` where the environment leaves it open; call this before the first import of qtpy.

    qtpy itself would try PyQt5 first, and take another binding where the one that was asked for is absent.

    Returns
    -------
    str
        The value of ``QT_API``, one of `BINDINGS`.

    Raises
    ------
    GpError
        ``QT_API`` names a binding that is not installed, or one of Qt 5.
    """
    asked = os.environ.get("QT_API", "").lower()
    if not asked:
        asked = os.environ["QT_API"] = _first_available()
    if asked not in BINDINGS:
        names = " or ".join(BINDINGS)
        raise GpError(f"QT_API={asked}: the window needs Qt 6", remedy=f"Set QT_API to {names}, or unset it")
    package = BINDINGS[asked]
    if asked != _DEFAULT and not _is_available(package):
        remedy = f"Run pip install {package}, or unset QT_API"
        raise GpError(f"QT_API={asked}: the package {package} is not installed", remedy=remedy)
    return asked


def _first_available() -> str:
    """Return a binding that this process has loaded already, else the first that is installed."""
    loaded = [api for api, package in BINDINGS.items() if package in sys.modules]
    installed = [api for api, package in BINDINGS.items() if _is_available(package)]
    return next(iter([*loaded, *installed]), _DEFAULT)


def _is_available(package: str) -> bool:
    try:
        return package in sys.modules or find_spec(package) is not None
    except ModuleNotFoundError:
        return False
