"""The wheel carries the resources; the tests' own settings do what they say."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

_ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.slow
def test_the_wheel_carries_the_resources_and_works(tmp_path: Path) -> None:
    build = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "-w", str(tmp_path), str(_ROOT)]
    done = subprocess.run(build, capture_output=True, text=True, check=False)
    if "No matching distribution found for hatchling" in done.stderr:
        pytest.skip("no network to fetch the build backend")
    assert done.returncode == 0, done.stderr
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        archive.extractall(tmp_path / "site")
    assert "gp_core/resources/features.json" in names
    assert not any(name.startswith(("tests/", "docs/")) for name in names)
    code = "import gp_core; print(gp_core.__file__, gp_core.Atlas.published().n_samples)"
    run = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path / "site"
    )
    assert str(tmp_path) in run.stdout
    assert run.stdout.split()[-1] == "22"


@pytest.mark.parametrize(("module", "passes"), [("gp_core.anything", False), ("numpy.linalg", True)])
def test_a_warning_is_an_error_in_our_modules_only(tmp_path: Path, module: str, passes: bool) -> None:
    warn = f"warnings.warn_explicit('old', DeprecationWarning, 'a.py', 1, module={module!r})"
    file = tmp_path / "test_warning.py"
    file.write_text(f"import warnings\n\ndef test_it():\n    {warn}\n")
    config = ["-c", str(_ROOT / "pyproject.toml"), "--rootdir", str(tmp_path), "-p", "no:cacheprovider"]
    command = [sys.executable, "-m", "pytest", "-q", *config, str(file)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.returncode == (0 if passes else 1), done.stdout


ORDERED = {
    "numpy": ("numpy", "gp_core"),
    "scipy": ("scipy", "gp_core"),
    "pyvista": ("pyvista", "gp_labeler/imaging"),
    "pyvistaqt": ("pyvistaqt", "gp_labeler/views"),
    "qtpy": ("qtpy", "gp_labeler/views"),
    "scikit-image": ("skimage", "gp_labeler/imaging"),
    "SimpleITK": ("SimpleITK", "gp_labeler/imaging"),
}
"""The packages that were ordered, with the module that is imported and the room where it serves first of all.

PySide6, the eighth, comes by qtpy.
"""


def _requirements() -> str:
    text = (_ROOT / "pyproject.toml").read_text(encoding="utf-8")
    return text.partition("\ndependencies = [")[2].partition("\nscanco = ")[0]


def _imported(folder: Path) -> set[str]:
    found: set[str] = set()
    for path in folder.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                found |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                found.add(node.module.split(".")[0])
    return found


@pytest.mark.parametrize("package", ORDERED)
def test_an_ordered_package_is_required_and_serves(package: str) -> None:
    module, room = ORDERED[package]
    assert re.search(rf'^    "{package}>=[\d.]+"', _requirements(), re.MULTILINE)
    assert module in _imported(_ROOT / room)


def test_pyside6_is_the_qt_that_qtpy_takes() -> None:
    assert re.search(r'^    "PySide6-Essentials>=[\d.]+', _requirements(), re.MULTILINE)
    code = "import sys, gp_labeler.views.theme, qtpy; print(qtpy.API_NAME, 'PySide6.QtCore' in sys.modules)"
    environment = {key: value for key, value in os.environ.items() if key != "QT_API"}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment, cwd=_ROOT
    )
    assert done.stdout.split() == ["PySide6", "True"]


def test_qt_is_imported_through_qtpy_alone() -> None:
    assert {"PySide6", "PyQt6", "PyQt5", "PySide2"} & _imported(_ROOT / "gp_labeler" / "views") == set()
