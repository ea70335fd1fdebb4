"""gp-labeler on a desktop: its entry in the menu of programs, its icon, and the files that it opens.

As freedesktop.org lays down: `desktop entries <https://specifications.freedesktop.org/desktop-entry-spec/latest/>`_
and `shared MIME types <https://specifications.freedesktop.org/shared-mime-info-spec/latest/>`_, for one user.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

from gp_core.disk import write_text
from gp_core.errors import GpError
from gp_core.resources import resource_path

__all__ = ["desktop_file", "install_desktop", "remove_desktop"]

_ENTRY = """[Desktop Entry]
Type=Application
Version=1.1
Name=gp-labeler
GenericName=Landmark editor
Comment=Label guinea-pig head micro-CT, and estimate the pose of the cochlea
Exec={command} %f
Icon=gp-labeler
Terminal=false
Categories=Science;MedicalSoftware;Qt;
Keywords=micro-CT;landmarks;cochlea;atlas;
MimeType=application/x-gp-specimen+json;application/x-nrrd;
StartupWMClass=gp-labeler
"""

_MIME = """<?xml version="1.0" encoding="UTF-8"?>
<mime-info xmlns="http://www.freedesktop.org/standards/shared-mime-info">
  <mime-type type="application/x-gp-specimen+json">
    <comment>gp-labeler specimen</comment>
    <sub-class-of type="application/json"/>
    <icon name="gp-labeler"/>
    <glob pattern="*.gpspecimen.json" weight="70"/>
  </mime-type>
  <mime-type type="application/x-nrrd">
    <comment>NRRD scan</comment>
    <glob pattern="*.nrrd"/>
    <glob pattern="*.nhdr"/>
  </mime-type>
</mime-info>
"""

_RESERVED = re.compile(r"[\s\"'\\><~|&;$*?#()`]")


def install_desktop() -> list[Path]:
    """Add the program to the user's desktop, or bring what is there up to date.

    Returns
    -------
    list of Path
        The files that were written.

    Raises
    ------
    GpError
        This system has no such desktop, or a file cannot be written.
    """
    _check_system()
    contents = {
        "entry": desktop_file(),
        "icon": resource_path("icons/gp-labeler.svg").read_text(encoding="utf-8"),
        "mime": _MIME,
    }
    for name, path in _paths().items():
        path.parent.mkdir(parents=True, exist_ok=True)
        write_text(path, contents[name])
    _refresh()
    return list(_paths().values())


def remove_desktop() -> list[Path]:
    """Take the program off the user's desktop.

    Returns
    -------
    list of Path
        The files that were removed.

    Raises
    ------
    GpError
        This system has no such desktop.
    """
    _check_system()
    found = [path for path in _paths().values() if path.exists()]
    for path in found:
        path.unlink()
    _refresh()
    return found


def desktop_file() -> str:
    """Return the desktop entry; it starts this very installation."""
    frozen = getattr(sys, "frozen", False)
    words = [sys.executable] if frozen else [sys.executable, "-m", "gp_labeler"]
    return _ENTRY.format(command=" ".join(_quoted(word) for word in words))


def _quoted(word: str) -> str:
    """Quote a word of a command line, first as a shell does, then as a value of a desktop entry."""
    if "\n" in word:
        raise GpError("a desktop entry cannot contain a line break", file=word)
    if _RESERVED.search(word):
        word = '"' + re.sub(r"([\"`$\\])", r"\\\1", word) + '"'
    return word.replace("\\", "\\\\").replace("%", "%%")


def _paths() -> dict[str, Path]:
    named = os.environ.get("XDG_DATA_HOME")
    data = Path(named) if named else Path.home() / ".local" / "share"
    return {
        "entry": data / "applications" / "gp-labeler.desktop",
        "icon": data / "icons" / "hicolor" / "scalable" / "apps" / "gp-labeler.svg",
        "mime": data / "mime" / "packages" / "gp-labeler.xml",
    }


def _refresh() -> None:
    """Tell the desktop, where it has the programs for it; it finds new files by itself at the next log-in."""
    paths = _paths()
    for program, folder in (
        ("update-mime-database", paths["mime"].parents[1]),
        ("update-desktop-database", paths["entry"].parent),
    ):
        found = shutil.which(program)
        if found and folder.is_dir():
            subprocess.run([found, str(folder)], capture_output=True, check=False)


def _check_system() -> None:
    if sys.platform in ("win32", "darwin"):
        raise GpError(
            "desktop entries can be installed only on Linux",
            remedy="Make a shortcut to gp-labeler-window instead.",
        )
