"""The house: what may import what, how long things may be, what every public name explains."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

_ROOT = Path(__file__).resolve().parents[1]
_SOURCES = sorted(p for package in ("gp_core", "gp_labeler") for p in (_ROOT / package).rglob("*.py"))
_LONGEST_FILE = 700
_LONGEST_FUNCTION = 60


def _functions(tree: ast.AST) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef]:
    for node in ast.walk(tree):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            yield node


def _body_lines(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    body = function.body[1:] if ast.get_docstring(function) else function.body
    return body[-1].end_lineno - body[0].lineno + 1 if body else 0  # type: ignore[operator]


@pytest.mark.parametrize("path", _SOURCES, ids=lambda p: str(p.relative_to(_ROOT)))
def test_files_and_functions_keep_their_size(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert text.count("\n") <= _LONGEST_FILE
    for function in _functions(ast.parse(text)):
        assert _body_lines(function) <= _LONGEST_FUNCTION, f"{function.name}, line {function.lineno}"


def test_the_drawn_imports_of_the_core_are_the_real_ones() -> None:
    command = [sys.executable, "tools/import-diagram", "gp_core"]
    drawn = subprocess.run(command, capture_output=True, text=True, check=True, cwd=_ROOT).stdout
    assert drawn in (_ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")


def _imports(path: Path, modules: set[str]) -> set[str]:
    """Return the modules that a file imports anywhere in it, but for types alone."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            node.body = [ast.Pass()]
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            for name in node.names:
                inner = f"{node.module}.{name.name}"
                found.add(inner if inner in modules else node.module)
        elif isinstance(node, ast.Import):
            found |= {name.name for name in node.names}
    return found & modules


@pytest.mark.parametrize("package", ["gp_core", "gp_labeler"])
def test_no_module_imports_in_a_circle(package: str) -> None:
    files = {
        ".".join(path.relative_to(_ROOT).with_suffix("").parts).removesuffix(".__init__"): path
        for path in _SOURCES
        if package in path.parts
    }
    graph = {name: _imports(path, set(files)) - {package} for name, path in files.items()}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(f"import cycle: {' <- '.join(error.args[1])}")


def test_the_glossary_and_the_page_of_typical_changes_name_what_exists() -> None:
    modules = {".".join(path.relative_to(_ROOT).with_suffix("").parts[1:]): path for path in _SOURCES}
    glossary = (_ROOT / "docs/glossary.md").read_text()
    for name in re.findall(r"\| `([a-z_.]+\.[A-Za-z_]+)` \|$", glossary, re.MULTILINE):
        module, _, member = name.rpartition(".")
        defined = rf"^(class |def )?{member}\b"
        assert name in modules or module in modules, name
        assert name in modules or re.search(defined, modules[module].read_text(), re.MULTILINE), name
    tests = {path.name for path in (_ROOT / "tests").rglob("test_*.py")}
    assert set(re.findall(r"\btest_\w+\.py", (_ROOT / "docs/where.md").read_text())) <= tests


def test_one_name_is_one_class() -> None:
    names = [
        node.name
        for path in _SOURCES
        for node in ast.parse(path.read_text()).body
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_")
    ]
    assert [name for name, many in Counter(names).items() if many > 1] == []


def test_the_project_speaks_the_words_of_the_field() -> None:
    command = [sys.executable, "tools/words"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=_ROOT)
    assert done.returncode == 0, done.stdout


def test_the_core_brings_no_window_with_it() -> None:
    heavy = (
        "PySide6",
        "PyQt6",
        "qtpy",
        "vtk",
        "vtkmodules",
        "pyvista",
        "SimpleITK",
        "skimage",
        "numba",
        "scipy",
    )
    code = (
        "import sys, gp_core, gp_core.cli;"
        f"print([m for m in sys.modules if m.split('.')[0] in {(*heavy, 'matplotlib')}])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=_ROOT)
    assert done.stdout.strip() == "[]"


def test_no_real_data_is_shipped() -> None:
    listed = subprocess.run(["git", "ls-files"], capture_output=True, text=True, check=False, cwd=_ROOT)
    odd = [f for f in listed.stdout.split() if f.endswith((".mat", ".dat", ".nii", ".gz", ".nrrd", ".dcm"))]
    assert odd == []


@pytest.mark.parametrize("path", sorted((_ROOT / "benchmarks").glob("*.py")), ids=lambda p: p.name)
def test_every_benchmark_finds_what_it_imports(path: Path) -> None:
    code = f"import runpy; runpy.run_path({str(path)!r}, run_name='imported')"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=_ROOT
    )
    assert done.returncode == 0, done.stderr[-500:]


def test_files_of_tests_have_names_of_their_own() -> None:
    """Pytest imports test files and their helpers by their mere names: of two it would collect neither."""
    files = [path.name for path in (_ROOT / "tests").rglob("*.py") if path.name != "conftest.py"]
    assert sorted(files) == sorted(set(files))


def test_scripts_without_an_ending_are_linted_too() -> None:
    scripts = [path for path in (_ROOT / "tools").rglob("*") if path.is_file() and not path.suffix]
    python = [path for path in scripts if "python" in path.read_text(encoding="utf-8").partition("\n")[0]]
    settings = (_ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert python
    for path in python:
        assert f'"{path.relative_to(_ROOT).as_posix()}"' in settings
