"""A machine that lacks something: one line that says what and the remedy, status 2, never a traceback."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest

from gp_labeler.cli.subcommands import SUBCOMMANDS
from gp_labeler.system.installation import explain_import
from gp_labeler.system.libraries import NEEDS, Need, advice, missing, packages_of
from gp_labeler.system.qt_binding import BINDINGS, choose_binding
from gp_labeler.system.requirements import Requirement, requirements_of

pytestmark = pytest.mark.machine

ROOT = Path(__file__).resolve().parents[3]
NO_LIBRARY = "libEGL.so.1: cannot open shared object file: No such file or directory"
COMMANDS = (
    ["--demo"],
    ["--offscreen", "demo", "--output", "out"],
    ["mesh", "head.nrrd", "-o", "head.ply"],
    ["simulate-tracker", "--port", "0"],
)

_BLOCK = """
import sys
class Block:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {blocked!r}:
            {action}
sys.meta_path.insert(0, Block())
"""


def run(folder: Path, *words: str, blocked: tuple[str, ...] = (), library: bool = False, **env: str):
    """Run gp-labeler where some packages, or a library of theirs, are missing."""
    error = f"ImportError({NO_LIBRARY!r})" if library else "ModuleNotFoundError('No module', name=name)"
    (folder / "sitecustomize.py").write_text(_BLOCK.format(blocked=blocked, action=f"raise {error}"))
    (folder / "head.nrrd").write_text("")
    kept = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM")}
    path = os.pathsep.join([str(folder), str(ROOT)])
    return subprocess.run(
        [sys.executable, "-m", "gp_labeler", *words],
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
        cwd=folder,
        env={**kept, "PYTHONPATH": path, "XDG_STATE_HOME": str(folder), **env},
    )


def refused(done, *words: str) -> None:
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("\n") == 1, done.stderr
    for word in words:
        assert word in done.stderr


@pytest.mark.parametrize("command", COMMANDS, ids=lambda words: words[0])
def test_without_the_extra_it_says_how_to_install_it(command, tmp_path) -> None:
    blocked = ("PySide6", "SimpleITK", "vtkmodules", "pyigtl", "psygnal", "platformdirs")
    done = run(tmp_path, *command, blocked=blocked, DISPLAY=":0")
    refused(done, "is not installed", 'pip install "gp-labeler[app]"')


def test_a_missing_system_library_is_named_with_what_brings_it(tmp_path) -> None:
    done = run(tmp_path, "--demo", blocked=tuple(BINDINGS.values()), library=True, DISPLAY=":0")
    refused(done, "the system library libEGL.so.1 is missing")


@pytest.mark.parametrize(
    ("asked", "blocked", "words"),
    [
        ("pyqt5", (), ("QT_API=pyqt5: the window needs Qt 6", "pyside6 or pyqt6")),
        ("nonesuch", (), ("QT_API=nonesuch",)),
        ("PyQt6", ("PyQt6",), ("QT_API=pyqt6: the package PyQt6 is not installed", "unset QT_API")),
    ],
)
def test_a_qt_binding_that_cannot_be_used_is_one_line(asked, blocked, words, tmp_path) -> None:
    for command in (["--demo"], ["--offscreen", "demo", "--output", "out"]):
        refused(run(tmp_path, *command, blocked=blocked, DISPLAY=":0", QT_API=asked), *words)


@pytest.mark.parametrize(
    ("installed", "chosen"), [(("PySide6", "PyQt6"), "pyside6"), (("PyQt6",), "pyqt6"), ((), "pyside6")]
)
def test_the_binding_is_pyside6_unless_only_another_is_installed(installed, chosen, monkeypatch) -> None:
    monkeypatch.delenv("QT_API", raising=False)
    for package in ("PySide6", "PyQt6"):
        monkeypatch.delitem(sys.modules, package, raising=False)
    monkeypatch.setattr(
        "gp_labeler.system.qt_binding.find_spec", lambda name: name if name in installed else None
    )
    assert choose_binding() == os.environ["QT_API"] == chosen


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="elsewhere there is always a display")
@pytest.mark.parametrize(
    ("env", "words"),
    [
        ({"QT_QPA_PLATFORM": "nonesuch"}, 'the Qt platform plugin "nonesuch"'),
        ({"QT_QPA_PLATFORM": "xcb", "DISPLAY": ":987"}, "QT_QPA_PLATFORM=xcb"),
        ({"DISPLAY": ":987"}, "DISPLAY=:987"),
        ({"QT_QPA_PLATFORM": "offscreen", "QT_QPA_PLATFORM_PLUGIN_PATH": "/nowhere"}, None),
    ],
)
def test_a_display_that_cannot_be_used_is_one_line(env, words, tmp_path) -> None:
    if words is None:  # Qt finds its own plugins as well; should it not, it must not abort
        assert run(tmp_path, "doctor", **env).returncode in (0, 2)
        return
    refused(run(tmp_path, "--demo", **env), words)


def test_a_display_that_cannot_be_used_is_none_to_a_script(tmp_path) -> None:
    (tmp_path / "none.toml").write_text('[[step]]\ndo = "nonesuch"\n')
    done = run(tmp_path, "--offscreen", "none.toml", "--output", "out", DISPLAY=":987")
    assert "nonesuch" in done.stderr
    assert ":987" not in done.stderr


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (
            ModuleNotFoundError("No module named 'vtkmodules'", name="vtkmodules.util"),
            "package vtkmodules is",
        ),
        (ImportError("libfoo.so.3: cannot open shared object file: No such file"), "library libfoo.so.3 is"),
        (ImportError("cannot import name 'a' from 'PySide6'", name="PySide6"), "damaged or too old"),
        (ImportError("DLL load failed while importing QtCore"), "damaged or too old"),
    ],
)
def test_every_failed_import_has_a_line(error, words) -> None:
    text = str(explain_import(error))
    assert words in text
    assert "\n" not in text


@pytest.mark.parametrize("command", ["core", "labeler"])
def test_a_damaged_numpy_is_one_line(command, tmp_path) -> None:
    (tmp_path / "numpy.py").write_text("raise ImportError('cannot load its C library\\nread this page')")
    code = f"import sys; from gp_labeler.cli.start import {command}; sys.exit({command}())"
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=env, check=False)
    refused(done, "the installation is damaged (cannot load its C library)")


@pytest.mark.parametrize(
    ("command", "how"),
    [
        ("gp-core", ["-c", "from gp_labeler.cli.start import core; core()"]),
        ("gp-labeler", ["-c", "from gp_labeler.cli.start import labeler; labeler()"]),
        ("gp-labeler", ["-m", "gp_labeler"]),
    ],
)
def test_ctrl_c_is_one_line_while_packages_are_imported(command, how, tmp_path) -> None:
    (tmp_path / "numpy.py").write_text(
        "import os, signal\nos.kill(os.getpid(), signal.SIGINT)\nwhile True: 0"
    )
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])}
    told = ["env", "--default-signal=INT", sys.executable, *how]
    done = subprocess.run(told, capture_output=True, text=True, env=env, check=False, timeout=100)
    assert (done.returncode, done.stderr) == (130, f"{command}: stopped\n")


def test_the_doctor_finds_nothing_wrong_where_the_tests_run(tmp_path) -> None:
    done = run(tmp_path, "doctor")
    assert done.returncode == 0, done.stdout
    for heading in ("Machine", "Packages", "System libraries", "Display", "Fonts", "OpenGL", "State folder"):
        assert f"\n{heading}\n" in f"\n{done.stdout}"
    assert done.stdout.endswith("No problems found\n")
    assert done.stderr == ""


def test_the_doctor_says_all_that_is_wrong(tmp_path) -> None:
    (tmp_path / "file").write_text("")
    done = run(tmp_path, "doctor", QT_QPA_PLATFORM="nonesuch", XDG_STATE_HOME=str(tmp_path / "file"))
    assert done.returncode == 2
    wrong = done.stdout.partition("\nProblems\n")[2].splitlines()
    assert len(wrong) == 2, done.stdout
    assert "nonesuch" in wrong[0]
    assert "Make it writable" in wrong[1]
    assert "Traceback" not in done.stderr


def test_the_doctor_works_without_the_extra(tmp_path) -> None:
    done = run(tmp_path, "doctor", blocked=("PySide6", "SimpleITK", "vtkmodules", "platformdirs", "psygnal"))
    assert done.returncode == 2
    assert "pip install" in done.stdout
    assert "Traceback" not in done.stderr + done.stdout


def test_help_needs_no_extra_for_any_command(tmp_path) -> None:
    outside = tuple(set(metadata.packages_distributions()) - {"gp_core", "gp_labeler", "numpy", "scipy"})
    for command in ([], *([name] for name in SUBCOMMANDS)):
        done = run(tmp_path, *command, "--help", blocked=outside)
        assert (done.returncode, done.stderr) == (0, ""), command


@pytest.mark.parametrize(
    ("line", "needed"),
    [
        ("numpy>=2.1", ("numpy", ">=2.1")),
        ("vtk>=9.7; extra == 'app'", ("vtk", ">=9.7")),
        ('vtk >=9.7 ; extra == "app"', ("vtk", ">=9.7")),
        ("dask[distributed]>=1; extra == 'cluster'", None),
        ("pyside6<6.12,>=6.8.1; (python_version >= '3.10') and extra == 'app'", ("pyside6", "<6.12,>=6.8.1")),
        ("tomli>=2; (python_version < '3.10') and extra == 'app'", None),
        ("tomli; python_version > '3.9.1' and extra == 'app'", ("tomli", "")),
    ],
)
def test_what_is_asked_for_is_read_as_packaging_reads_it(line, needed) -> None:
    found = [(each.name, each.bounds) for each in requirements_of([line], ["app"])]
    assert found == ([] if needed is None else [needed])
    asked = pytest.importorskip("packaging.requirements").Requirement(line)
    assert (needed is not None) == (not asked.marker or asked.marker.evaluate({"extra": "app"}))
    for version in ("0.1", "2.1", "2.1.0", "6.8", "6.11.9", "6.12", "9.7.0", "9.10"):
        assert Requirement(asked.name, str(asked.specifier)).allows(version) == (version in asked.specifier)


def fake(folder: Path, name: str, script: str) -> None:
    (folder / name).write_text(f"#!/bin/sh\n{script}\n")
    (folder / name).chmod(0o755)


GLIB = Need("libnonesuch.so.0", ("libglib2.0-0t64", "libglib2.0-0"))


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux is asked")
@pytest.mark.parametrize(
    ("policy", "package"),
    [
        ("libglib2.0-0t64:\n  Candidate: 2.84\nlibglib2.0-0:\n  Candidate: (none)", "libglib2.0-0t64"),
        ("libglib2.0-0:\n  Candidate: 2.74", "libglib2.0-0"),
        ("", "libglib2.0-0"),
    ],
)
def test_a_package_has_the_name_that_apt_knows(policy, package, tmp_path, monkeypatch) -> None:
    fake(tmp_path, "apt-cache", f"printf '%s\\n' '{policy}'")
    fake(tmp_path, "apt-get", "exit 1")
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    assert not GLIB.is_there()
    assert packages_of([GLIB, GLIB]) == [package]
    assert advice([GLIB]).endswith(f"apt-get install --no-install-recommends {package}")


def test_a_frozen_program_needs_nothing_that_makes_environments(monkeypatch) -> None:
    need = Need("module nonesuch", ("python3-nonesuch",), "")
    assert not need.is_there()
    monkeypatch.setattr(sys, "frozen", True, raising=False)
    assert need.is_there()


def test_where_there_is_no_apt_the_libraries_are_named(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert advice([GLIB]) == "install what brings libnonesuch.so.0"
    assert {need.name for need in missing(["test"])} >= {"xvfb-run", "xauth", "xdotool"}
    assert len({need.name for need in NEEDS}) == len(NEEDS)


_PYTHON = """
case "$*" in
  *--say) [ -e installed ] || echo "as root, run: apt-get install libegl1" ;;
  *libraries.py*) [ -e installed ] || echo libegl1 ;;
  *venv*) mkdir -p .venv/bin; cp "$0" .venv/bin/python ;;
  *pip\\ install*) echo "pip is noisy" >&2; touch with-pip ;;
esac
"""
"""Stands for Python where a library is missing until the file ``installed`` is there."""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="for Debian")
@pytest.mark.parametrize(
    ("user", "sudo", "status"),
    [
        ("0", None, 0),
        ("1000", None, 2),
        ("1000", 'case "$1" in -n) shift; exec "$@" ;; *) sleep 600 ;; esac', 0),
        ("1000", 'case "$1" in -n) echo "a password is required" >&2; exit 1 ;; *) sleep 600 ;; esac', 2),
    ],
    ids=["root", "no sudo", "sudo", "sudo with a password"],
)
def test_the_set_up_never_asks_and_ends_with_one_line(user, sudo, status, tmp_path) -> None:
    programs, project = tmp_path / "bin", tmp_path / "project"
    programs.mkdir()
    (project / "tools").mkdir(parents=True)
    (project / "tools" / "setup").write_text((ROOT / "tools" / "setup").read_text())
    fake(programs, "python3", _PYTHON)
    fake(programs, "id", f"echo {user}")
    fake(programs, "apt-get", 'echo noise; case "$*" in *" install "*) touch installed ;; esac')
    for name in ("bash", "dirname", "mktemp", "rm", "mkdir", "cp", "touch", "cat", "sleep"):
        (programs / name).symlink_to(f"/bin/{name}" if Path(f"/bin/{name}").exists() else f"/usr/bin/{name}")
    if sudo is not None:
        fake(programs, "sudo", sudo)
    command = ["bash", str(project / "tools" / "setup"), "app"]
    env = {"PATH": str(programs)}
    done = subprocess.run(command, capture_output=True, text=True, timeout=600, env=env, check=False)
    assert done.returncode == status, done.stderr
    assert (project / "with-pip").exists(), "what works without the libraries is set up all the same"
    assert done.stdout == ""
    assert done.stderr == ("" if status == 0 else "as root, run: apt-get install libegl1\n")
