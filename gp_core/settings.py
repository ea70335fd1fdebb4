"""Settings of a user: a small TOML file, and variables of the environment that overrule it.

A setting says how the programs run, never what they compute: two users get the same numbers from the same
files. The command line overrules both.
"""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from gp_core.errors import GpError

__all__ = ["KEYS", "Key", "check_settings", "setting", "settings_file"]

_FILE = "GP_LABELER_SETTINGS"
"""Variable that names the file, which must exist then."""

_MAX_BYTES = 100_000
_TRUE, _FALSE = {"1", "true", "yes", "on"}, {"0", "false", "no", "off"}


@dataclass(frozen=True)
class Key:
    """One setting.

    Parameters
    ----------
    name : str
        Key in the file; the variable is ``GP_LABELER_`` and the name in capitals.
    kind : str
        What its value is: ``"true or false"``, ``"a whole number"``, ``"a path"`` or ``"a word"``.
    meaning : str
        What it does, one sentence.
    choices : tuple of str
        The words that are allowed; empty where any are.
    least, most : int
        Bounds of a whole number.
    """

    name: str
    kind: str
    meaning: str
    choices: tuple[str, ...] = ()
    least: int = 1
    most: int = 1_000_000

    @property
    def variable(self) -> str:
        """The variable of the environment that overrules the file."""
        return f"GP_LABELER_{self.name.upper()}"


KEYS = (
    Key("verbose", "true or false", "Print the files that are read and written."),
    Key("log_file", "a path", "Append all messages, with their times, to this file."),
    Key("workers", "a whole number", "Processes of a study; by default one for each core.", most=4096),
    Key("state", "a path", "Folder where the window keeps unsaved edits and what it remembers."),
    Key("canvas", "a word", "How the 3D view is drawn.", choices=("automatic", "painted", "native")),
    Key("theme", "a word", "Colours of the window, until they are chosen in it.", choices=("dark", "light")),
    Key("cache", "a path", "Folder where large packed scans are unpacked while they are open."),
    Key("cache_gb", "a whole number", "Most that is unpacked there, GB; by default 100.", most=100_000),
    Key("text_size", "a whole number", "Text size in percent, until chosen in it.", least=50, most=300),
)
"""All settings."""

_BY_NAME = {key.name: key for key in KEYS}


def setting(name: str) -> Any:
    """Return the value of a setting: of its variable, or else of the file.

    Parameters
    ----------
    name : str
        Name of one of `KEYS`.

    Returns
    -------
    bool, int, str or None
        None where neither says anything.

    Raises
    ------
    GpError
        The value is not what the key takes, or the file cannot be read or has keys that do not exist.
    """
    key = _BY_NAME[name]
    written = os.environ.get(key.variable)
    if written:
        return _checked(key, written, f"the variable {key.variable}")
    file = settings_file()
    is_named = bool(os.environ.get(_FILE))
    values = _read(file) if is_named or file.is_file() else {}
    return _checked(key, values[name], name, file) if name in values else None


def check_settings() -> None:
    """Check all settings, whether or not they are used.

    Raises
    ------
    GpError
        As for `setting`.
    """
    for key in KEYS:
        setting(key.name)


def settings_file() -> Path:
    """Return where the settings are kept, whether or not the file exists.

    Returns
    -------
    pathlib.Path
        ``GP_LABELER_SETTINGS``, or ``gp-labeler/settings.toml`` in the user's folder for configuration.
    """
    named = os.environ.get(_FILE)
    return Path(named) if named else _configuration_folder() / "gp-labeler" / "settings.toml"


def _configuration_folder() -> Path:
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Application Support"
    return Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config")


def _content(file: Path) -> bytes:
    if file.exists() and not file.is_file():  # opening a pipe waits, and a device may never end
        raise GpError("is not a plain file", file=file, remedy="Name a settings file.")
    with file.open("rb") as opened:
        content = opened.read(_MAX_BYTES + 1)
    if len(content) > _MAX_BYTES:
        raise GpError("is too large for a settings file", file=file)
    return content


@cache
def _read(file: Path) -> Mapping[str, Any]:
    try:
        values: Mapping[str, Any] = _toml_loader()(_content(file).decode("utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        remedy = "Correct it, or delete it: it holds settings only."
        raise GpError(f"the settings cannot be read ({error})", file=file, remedy=remedy) from None
    unknown = sorted(values.keys() - _BY_NAME.keys())
    if unknown:
        known = ", ".join(_BY_NAME)
        raise GpError(f"unknown setting {unknown[0]!r}", file=file, remedy=f"There are: {known}.")
    return values


def _toml_loader() -> Callable[[str], Mapping[str, Any]]:
    for module in ("tomllib", "tomli"):  # Python 3.10 has the second, where it is installed
        try:
            loader: Callable[[str], Mapping[str, Any]] = importlib.import_module(module).loads
        except ModuleNotFoundError:
            continue
        return loader
    raise GpError("settings need Python 3.11 or newer, or tomli", remedy="Run pip install tomli")


def _checked(key: Key, value: Any, what: str, file: Path | None = None) -> Any:
    """Return a value as its key takes it; text stands for it in a variable."""
    found = _as_kind(key, value, written=file is None)
    if found is None or (key.choices and found not in key.choices):
        allowed = f"one of {', '.join(key.choices)}" if key.choices else key.kind
        if key.kind == "a whole number":
            allowed += f" from {key.least} to {key.most}"
        raise GpError(f"{what} must be {allowed}, got {value!r}", file=file, remedy="Correct it.")
    return found


def _as_kind(key: Key, value: Any, *, written: bool) -> Any:
    if key.kind == "true or false":
        if written and value.lower() in _TRUE | _FALSE:
            return value.lower() in _TRUE
        return value if isinstance(value, bool) else None
    if key.kind == "a whole number":
        number = int(value) if written and value.isdecimal() else value
        whole = isinstance(number, int) and not isinstance(number, bool)
        return number if whole and key.least <= number <= key.most else None
    return value if isinstance(value, str) and value else None
