"""The command ``gp-labeler doctor``: what this machine has, what it lacks, and what to do about it."""

from __future__ import annotations

import argparse
import json
import os
import platform
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any

from gp_core import __version__
from gp_core.command_line import CommandParser
from gp_core.errors import GpError
from gp_labeler.system.installation import INSTALL, check_display, explain_import
from gp_labeler.system.libraries import advice, missing
from gp_labeler.system.qt_binding import BINDINGS, choose_binding
from gp_labeler.system.requirements import Requirement, requirements_of

__all__ = ["Examination", "examine", "make_doctor_parser", "run_doctor"]

_EXTRAS = ("app",)
_ENOUGH_BYTES = 200e6
_PROBE_SECONDS = 120.0
_CAPABILITIES = {"OpenGL version string": "version", "OpenGL renderer string": "renderer"}


@dataclass
class Examination:
    """What was found, heading by heading, and what is wrong."""

    found: dict[str, list[str]] = field(default_factory=dict)
    wrong: list[str] = field(default_factory=list)

    def note(self, heading: str, *lines: str) -> None:
        """Add lines beneath a heading."""
        self.found.setdefault(heading, []).extend(lines)

    def lines(self) -> list[str]:
        """Return all of it for a terminal."""
        text: list[str] = []
        for heading, found in self.found.items():
            text += [heading, *(f"  {line}" for line in found)]
        if not self.wrong:
            return [*text, "No problems found"]
        return [
            *text,
            "Problems",
            *(f"  {number}. {line}" for number, line in enumerate(self.wrong, start=1)),
        ]


def make_doctor_parser() -> argparse.ArgumentParser:
    """Return the parser of ``gp-labeler doctor``."""
    return CommandParser(
        prog="gp-labeler doctor",
        description="Check this machine and report problems: versions, system libraries, display, OpenGL, "
        "fonts and the state folder. The exit status is 2 if there is a problem.",
    )


def run_doctor(arguments: Sequence[str]) -> int:
    """Run the command.

    Returns
    -------
    int
        0; 2 where something is wrong.
    """
    make_doctor_parser().parse_args(arguments)
    found = examine()
    sys.stdout.write("\n".join(found.lines()) + "\n")
    return 2 if found.wrong else 0


def examine() -> Examination:
    """Return what this machine has and lacks. What may end a process is tried in another."""
    found = Examination()
    _machine(found)
    _binding(found)
    _packages(found)
    _libraries(found)
    if not found.wrong:  # a probe would only say it again
        _display(found)
        _opengl(found)
    _state_folder(found)
    return found


def _machine(found: Examination) -> None:
    try:
        system = platform.freedesktop_os_release()["PRETTY_NAME"]
    except (OSError, KeyError):
        system = platform.system()
    found.note(
        "Machine",
        f"gp-labeler {__version__}, Python {platform.python_version()} ({sys.executable})",
        f"{system}, {platform.machine()}, {os.cpu_count()} processors",
    )


def _binding(found: Examination) -> None:
    """Say which Qt binding the window would use."""
    try:
        package = BINDINGS[choose_binding()]
    except GpError as error:
        found.wrong.append(str(error))
        return
    distributions = (package, f"{package}-Essentials")  # either brings PySide6
    versions = [version for name in distributions if (version := Requirement(name, "").installed())]
    found.note("Machine", f"Qt binding {package} {versions[0] if versions else '(not installed)'}")


def _packages(found: Examination) -> None:
    """Compare what is installed with what the distribution asks for."""
    absent = []
    unused = () if os.environ.get("QT_API") == "pyside6" else ("pyside6-essentials",)  # another Qt is used
    for asked in requirements_of(_asked_for(found), _EXTRAS):
        version = asked.installed()
        found.note("Packages", f"{asked.name:24} {version or 'missing'}")
        if version is None and asked.name not in unused:
            absent.append(asked.name)
        elif version is not None and not asked.allows(version):
            wanted = f"{asked.name}{asked.bounds}"
            found.wrong.append(f'{asked.name} {version} does not fit. Run pip install "{wanted}"')
    if absent:
        are = "is" if len(absent) == 1 else "are"
        found.wrong.append(f"{', '.join(absent)} {are} not installed. Run {INSTALL}")


def _asked_for(found: Examination) -> list[str]:
    try:
        return metadata.requires("gp-labeler") or []
    except metadata.PackageNotFoundError:  # a folder of its own (tools/freeze), or the source alone
        found.note("Packages", "not known: gp-labeler is not installed as a package")
        return []


def _libraries(found: Examination) -> None:
    lacking = missing(["app"])
    if not lacking:
        found.note("System libraries", "all present")
        return
    found.note("System libraries", *(f"{need.name:24} missing" for need in lacking))
    found.wrong.append(f"System libraries are missing; {advice(lacking)}")


def _display(found: Examination) -> None:
    try:
        if any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM")):
            check_display()
    except GpError as error:
        found.note("Display", "cannot be used")
        found.wrong.append(str(error))
        return
    told = _in_another_process("qt_facts", found, "Qt")
    if told is not None:
        found.note("Display", *told["display"])
        found.note("Fonts", *told["fonts"])
        if not told["families"]:
            found.wrong.append("There are no fonts. Install one, such as Debian's fonts-dejavu-core")


def _opengl(found: Examination) -> None:
    told = _in_another_process("opengl_facts", found, "OpenGL")
    if told is not None:
        found.note("OpenGL", *told["opengl"])


def _in_another_process(facts: str, found: Examination, what: str) -> dict[str, Any] | None:
    """Return what one of the functions below finds; where its process dies of it, that is what is wrong."""
    code = f"import json; from gp_labeler.cli import doctor; print(json.dumps(doctor.{facts}()))"
    command = [sys.executable, "-X", "faulthandler", "-c", code]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, errors="replace", timeout=_PROBE_SECONDS, check=False
        )
    except subprocess.TimeoutExpired:
        found.wrong.append(f"{what} does not answer within {_PROBE_SECONDS:.0f} s")
        return None
    if done.returncode == 0:
        told: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
        return told
    said = [line.strip() for line in done.stderr.splitlines() if line.strip()]
    last = said[-1] if "Traceback" in done.stderr else (said or ["it gives no reason"])[0]
    found.note(what, "cannot be used")
    found.wrong.append(f"{what} cannot be used (status {done.returncode}): {last}")
    return None


def qt_facts() -> dict[str, Any]:
    """Return what Qt draws on and with, where the window would; asked in a process of its own."""
    from qtpy.QtGui import QFontDatabase, QFontInfo, QGuiApplication

    from gp_labeler.views.application import make_application
    from gp_labeler.views.fonts import base_font

    app = make_application()
    screens = [
        f"screen {screen.name()} {screen.size().width()} x {screen.size().height()}, ".replace("  ", " ")
        + f"scale {100 * screen.devicePixelRatio():.0f} %"
        for screen in app.screens()
    ]
    families = QFontDatabase.families()
    shown = QFontInfo(base_font())
    return {
        "display": [f"Qt's platform {QGuiApplication.platformName()}", *screens],
        "fonts": [f"{shown.family()} {shown.pixelSize()} px, of {len(families)} families"],
        "families": len(families),
    }


def opengl_facts() -> dict[str, Any]:
    """Return what VTK draws with; asked in a process of its own."""
    from gp_labeler.scene.target import RenderTarget

    target = RenderTarget.offscreen(64, 48)
    target.render()
    lines = (line.partition(":") for line in target.window.ReportCapabilities().splitlines())
    told = {
        _CAPABILITIES[name.strip()]: value.strip()
        for name, _, value in lines
        if name.strip() in _CAPABILITIES
    }
    kind = target.window.GetClassName().removeprefix("vtk").removesuffix("RenderWindow")
    target.close()
    return {"opengl": [f"{kind}: {told.get('renderer', 'unknown')}, OpenGL {told.get('version', 'unknown')}"]}


def _state_folder(found: Examination) -> None:
    try:
        from gp_labeler.document.paths import default_directory
    except ImportError as error:
        found.note("State folder", "unknown")
        if not any(error.name and error.name in line for line in found.wrong):
            found.wrong.append(str(explain_import(error)))
        return
    folder = default_directory()
    there = next(path for path in (folder, *folder.parents) if path.exists())
    try:
        with tempfile.TemporaryFile(dir=there):
            free = shutil.disk_usage(there).free
    except OSError as error:
        found.note("State folder", f"{folder}: cannot be written")
        found.wrong.append(
            f"{there}: {error.strerror}; edits would be lost if the program ended. Make it writable"
        )
        return
    found.note("State folder", f"{folder}: {_journals(folder)}, {free / 1e9:.1f} GB free")
    if free < _ENOUGH_BYTES:
        found.wrong.append(
            f"{there}: only {free / 1e6:.0f} MB are free; every edit is written there. Make room"
        )


def _journals(folder: Path) -> str:
    count = len(list((folder / "journals").glob("*.jsonl")))
    return f"{count} journal{'' if count == 1 else 's'}"
