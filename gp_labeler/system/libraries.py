"""What the window needs of the system: shared libraries, programs, and the Debian packages that bring them.

Only Linux is asked; the wheels for other systems carry all they need. The file imports the standard library
alone, for ``tools/setup`` runs it by itself before anything is installed::

    python3 -I gp_labeler/system/libraries.py app,test          the packages that are missing
    python3 -I gp_labeler/system/libraries.py app,test --say    the line that tells a person of them
"""

from __future__ import annotations

import ctypes
import importlib.util
import os
import shutil
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

__all__ = ["NEEDS", "Need", "advice", "missing", "packages_of"]


@dataclass(frozen=True)
class Need:
    """One thing that the system must bring.

    Parameters
    ----------
    name : str
        A shared library, a program, ``module NAME`` of Python or ``fonts``.
    packages : tuple of str
        The Debian packages that bring it, newest name first: names differ between releases.
    extra : str
        The extra of ``pyproject.toml`` that needs it: app, or test; empty where every part does.
    """

    name: str
    packages: tuple[str, ...]
    extra: str = "app"

    def is_there(self) -> bool:
        """Whether this machine has it."""
        if self.name == "fonts":
            return any(Path("/usr/share/fonts").rglob("*.[to]tf"))
        if self.name.startswith("module "):  # they set up environments, which a frozen program does not
            return hasattr(sys, "frozen") or importlib.util.find_spec(self.name.split()[1]) is not None
        if ".so." not in self.name:
            return shutil.which(self.name) is not None
        try:
            ctypes.CDLL(self.name)
        except OSError:
            return False
        return True


_DRAWING = {
    "libglib-2.0.so.0": ("libglib2.0-0t64", "libglib2.0-0"),
    "libEGL.so.1": ("libegl1",),
    "libGL.so.1": ("libgl1",),
    "libX11.so.6": ("libx11-6",),
    "libXcursor.so.1": ("libxcursor1",),  # VTK complains without it, display or not
    "libfontconfig.so.1": ("libfontconfig1",),
    "libfreetype.so.6": ("libfreetype6",),
    "libdbus-1.so.3": ("libdbus-1-3",),
    "libxkbcommon.so.0": ("libxkbcommon0",),
    "fonts": ("fonts-dejavu-core",),
}
_DISPLAY = {
    "libX11-xcb.so.1": ("libx11-xcb1",),
    "libxcb-cursor.so.0": ("libxcb-cursor0",),
    "libxcb-icccm.so.4": ("libxcb-icccm4",),
    "libxcb-image.so.0": ("libxcb-image0",),
    "libxcb-keysyms.so.1": ("libxcb-keysyms1",),
    "libxcb-randr.so.0": ("libxcb-randr0",),
    "libxcb-render-util.so.0": ("libxcb-render-util0",),
    "libxcb-shape.so.0": ("libxcb-shape0",),
    "libxcb-sync.so.1": ("libxcb-sync1",),
    "libxcb-util.so.1": ("libxcb-util1",),
    "libxcb-xfixes.so.0": ("libxcb-xfixes0",),
    "libxcb-xkb.so.1": ("libxcb-xkb1",),
    "libxkbcommon-x11.so.0": ("libxkbcommon-x11-0",),
}
_TESTS = {"xvfb-run": ("xvfb",), "xauth": ("xauth",), "xdotool": ("xdotool",)}

NEEDS = (
    Need("module ensurepip", ("python3-venv",), ""),
    *(Need(name, packages) for name, packages in (_DRAWING | _DISPLAY).items()),
    *(Need(name, packages, "test") for name, packages in _TESTS.items()),
)
"""All of them. What a package listed here brings with it is not listed again."""


def missing(extras: Iterable[str]) -> list[Need]:
    """Return what this machine lacks for these extras."""
    if not sys.platform.startswith("linux"):
        return []
    return [need for need in NEEDS if need.extra in {"", *extras} and not need.is_there()]


def packages_of(needs: Iterable[Need]) -> list[str]:
    """Return the Debian packages of these needs, each by the name that this machine's apt knows.

    Where apt has no lists yet, by the oldest name, which newer releases still take.
    """
    needs = list(needs)
    known = _known_to_apt([package for need in needs for package in need.packages])
    chosen = [next((p for p in need.packages if p in known), need.packages[-1]) for need in needs]
    return list(dict.fromkeys(chosen))


def advice(needs: Iterable[Need]) -> str:
    """Return what to do about what is missing, as a phrase."""
    needs = list(needs)
    if shutil.which("apt-get") is None:
        return f"install what brings {', '.join(need.name for need in needs)}"
    return f"as root, run: apt-get install --no-install-recommends {' '.join(packages_of(needs))}"


def _known_to_apt(packages: list[str]) -> set[str]:
    """Those that apt could install, or has installed."""
    if not packages or shutil.which("apt-cache") is None:
        return set()
    policy = ["apt-cache", "policy", *packages]
    plain = {**os.environ, "LC_ALL": "C"}
    told = subprocess.run(policy, capture_output=True, text=True, check=False, env=plain).stdout
    known, name = set(), ""
    for line in told.splitlines():
        if not line.startswith(" "):
            name = line.rstrip(":")
        elif line.strip().startswith("Candidate:") and "(none)" not in line:
            known.add(name)
    return known


def _main(extras: str, how: str = "") -> None:
    lacking = missing(extras.split(","))
    if lacking and how == "--say":
        sys.stdout.write(f"System packages are missing; {advice(lacking)}\n")
    elif lacking:
        sys.stdout.write(" ".join(packages_of(lacking)) + "\n")


if __name__ == "__main__":
    _main(*sys.argv[1:])
