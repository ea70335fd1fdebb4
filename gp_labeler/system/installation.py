"""What an installation lacks, as the one line of a `GpError`: packages, system libraries, a display."""

from __future__ import annotations

import os
import re
import subprocess
import sys

from gp_core.errors import GpError
from gp_labeler.system.libraries import NEEDS, advice, missing

__all__ = ["INSTALL", "check_display", "explain_import"]

INSTALL = 'pip install "gp-labeler[app]"'
"""What brings every package that the window needs."""

_LIBRARY = re.compile(r"(\S+\.so[.\d]*): cannot open shared object file")
_HARMLESS = {"offscreen", "minimal"}
"""Platforms of Qt that ask nothing of the machine."""

_PROBE = """
import resource, sys
resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
from qtpy.QtGui import QGuiApplication
app = QGuiApplication([])
sys.exit(None if app.primaryScreen() else "there is no screen")
"""
_PROBE_SECONDS = 30.0


def explain_import(error: ImportError) -> GpError:
    """Return what a failed import means for the person who started the program."""
    if type(error).__name__ == "QtBindingsNotFoundError" and isinstance(error.__context__, ImportError):
        return explain_import(error.__context__)  # qtpy hides why the binding could not be imported
    library = _LIBRARY.search(str(error))
    if library is not None:
        return _lacks_library(library[1])
    package = (error.name or "").partition(".")[0]
    if isinstance(error, ModuleNotFoundError) and package not in {"gp_core", "gp_labeler"}:
        return GpError(f"the package {package} is not installed", remedy=f"Run {INSTALL}")
    mend = INSTALL.replace("install", "install --upgrade --force-reinstall")
    return GpError(f"the installation is damaged or too old ({error})", remedy=f"Run {mend}")


def check_display() -> None:
    """See whether Qt can draw where the environment tells it to; where it cannot, Qt ends the process.

    So another process tries it first.

    Raises
    ------
    GpError
        It cannot; with Qt's reason and the remedy.
    """
    asked = os.environ.get("QT_QPA_PLATFORM", "")
    elsewhere = {"QT_PLUGIN_PATH", "QT_QPA_PLATFORM_PLUGIN_PATH"} & os.environ.keys()
    if not sys.platform.startswith("linux") or (asked in _HARMLESS and not elsewhere):
        return
    try:
        tried = subprocess.run(
            [sys.executable, "-c", _PROBE],
            capture_output=True,
            text=True,
            errors="replace",
            timeout=_PROBE_SECONDS,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise GpError(f"{_where(asked)} does not answer", remedy=_other_display(asked)) from None
    if tried.returncode != 0:
        raise GpError(
            f"Qt cannot draw on {_where(asked)} ({_reason(tried.stderr)})", remedy=_other_display(asked)
        )


def _lacks_library(library: str) -> GpError:
    if not any(need.name == library for need in NEEDS):
        remedy = "Install the system package that brings it."
    else:
        remedy = _sentence(advice(missing(["app"])))
    return GpError(f"the system library {library} is missing", remedy=remedy)


def _where(asked: str) -> str:
    if asked:
        return f"QT_QPA_PLATFORM={asked}"
    named = [f"{name}={os.environ[name]}" for name in ("WAYLAND_DISPLAY", "DISPLAY") if os.environ.get(name)]
    return " or ".join(named) or "this machine"


def _reason(told: str) -> str:
    """Return the first of Qt's lines, without its category, or Python's last."""
    lines = [line.strip() for line in told.splitlines() if line.strip()]
    if not lines:
        return "it gives no reason"
    if lines[0].startswith("Traceback"):
        return lines[-1]
    return re.sub(r"^qt\.[\w.]+: ", "", lines[0]).rstrip(".")


def _other_display(asked: str) -> str:
    lacking = missing(["app"])
    if lacking:
        return _sentence(advice(lacking))
    mend = "Unset QT_QPA_PLATFORM" if asked else "Log in to a session with a display"
    return f"{mend}, or use gp-labeler --offscreen SCRIPT|demo --output DIR"


def _sentence(phrase: str) -> str:
    return phrase[:1].upper() + phrase[1:]
