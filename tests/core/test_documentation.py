"""Every public function of `gp_core` has a complete numpydoc docstring, and its examples are true."""

from __future__ import annotations

import ast
import doctest
import importlib
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

_ROOT = Path(__file__).resolve().parents[2]
_FILES = sorted((_ROOT / "gp_core").rglob("*.py"))
_ENTRY = re.compile(r"^(\*{0,2}\w+(?:, \*{0,2}\w+)*)(?: : .*)?$", re.MULTILINE)
_FIELDS = ("Parameters", "Attributes")


def _public(
    node: ast.Module | ast.ClassDef, prefix: str = ""
) -> Iterator[tuple[str, ast.FunctionDef | ast.ClassDef]]:
    for child in node.body:
        if isinstance(child, (ast.FunctionDef, ast.ClassDef)) and not child.name.startswith("_"):
            yield prefix + child.name, child
            if isinstance(child, ast.ClassDef):
                yield from _public(child, f"{child.name}.")


def _sections(docstring: str) -> dict[str, str]:
    parts = re.split(r"^(\w[\w ]*)\n-{3,}$", docstring, flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def _named(section: str) -> set[str]:
    return {name for entry in _ENTRY.findall(section) for name in re.split(", ", entry)}


def _function_gaps(function: ast.FunctionDef) -> Iterator[str]:
    sections = _sections(ast.get_docstring(function) or "")
    arguments = function.args
    names = {a.arg for a in (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs)} - {
        "self",
        "cls",
    }
    names |= {f"*{a.arg}" for a in (arguments.vararg,) if a} | {f"**{a.arg}" for a in (arguments.kwarg,) if a}
    if missing := names - _named(sections.get("Parameters", "")):
        yield f"parameters {sorted(missing)}"
    decorators = {ast.unparse(d) for d in function.decorator_list}
    result = ast.unparse(function.returns) if function.returns else "None"
    is_property = decorators & {"property", "cached_property"}
    if result not in ("None", "NoReturn") and not is_property and not sections.keys() & {"Returns", "Yields"}:
        yield "what it returns"
    raises = any(isinstance(n, ast.Raise) and n.exc is not None for n in ast.walk(function))
    if raises and "Raises" not in sections and not is_property:
        yield "what it raises"


def _class_gaps(node: ast.ClassDef) -> Iterator[str]:
    """Fields of a data class that its docstring does not explain."""
    if not any("dataclass" in ast.unparse(d) for d in node.decorator_list):
        return
    fields = {
        a.target.id for a in node.body if isinstance(a, ast.AnnAssign) and isinstance(a.target, ast.Name)
    }
    sections = _sections(ast.get_docstring(node) or "")
    named = {name for key in _FIELDS for name in _named(sections.get(key, ""))}
    if missing := {f for f in fields if not f.startswith("_")} - named:
        yield f"fields {sorted(missing)}"


@pytest.mark.parametrize("path", _FILES, ids=lambda p: str(p.relative_to(_ROOT)))
def test_every_public_name_is_documented_in_full(path: Path) -> None:
    gaps = []
    for name, node in _public(ast.parse(path.read_text(encoding="utf-8"))):
        found = _class_gaps(node) if isinstance(node, ast.ClassDef) else _function_gaps(node)
        gaps += [f"{name}: {gap}" for gap in found]
    assert gaps == []


@pytest.mark.parametrize("path", _FILES, ids=lambda p: str(p.relative_to(_ROOT)))
def test_examples_are_true(path: Path) -> None:
    if ">>>" not in path.read_text(encoding="utf-8"):
        return
    name = ".".join(path.relative_to(_ROOT).with_suffix("").parts).removesuffix(".__init__")
    assert doctest.testmod(importlib.import_module(name)).failed == 0
