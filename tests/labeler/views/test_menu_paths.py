"""Menu paths and buttons that pages and messages name are in the window, under the names of today."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from qtpy.QtWidgets import QMenu

from gp_labeler.commands.actions import MENUS

_ROOT = Path(__file__).resolve().parents[3]
_PAGES = [_ROOT / "README.md", *sorted((_ROOT / "docs").rglob("*.md"))]
_MENU = f"(?:{'|'.join(MENUS)})"


def _on_pages() -> Iterator[tuple[str, str]]:
    """Return each page with each path on it, such as ``*File > Export landmarks*``."""
    for page in _PAGES:
        text = " ".join(page.read_text(encoding="utf-8").split())
        for path in re.findall(rf"\*({_MENU} > [^*]+)\*", text):
            yield page.stem, path


def _in_messages() -> Iterator[tuple[str, str]]:
    """Return each module with each of its texts that names a path, from the path on."""
    for module, text in _texts():
        for found in re.finditer(rf"\b{_MENU} > ", text):
            yield module, text[found.start() :]


def _texts() -> Iterator[tuple[str, str]]:
    """Return each module with each text in it."""
    for file in sorted((_ROOT / "gp_labeler").rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                yield file.stem, node.value


def _title(text: str) -> str:
    return text.replace("&", "").rstrip("…")


@pytest.fixture
def entries(window) -> dict[str, list[str]]:
    """The titles of what each menu has, by its own title; those of the bar by an empty one."""
    bar = window.menuBar()
    menus = bar.findChildren(QMenu)  # PySide6 6.8 takes those of `QAction.menu` for gone
    named = {
        _title(menu.title()): [_title(action.text()) for action in menu.actions() if action.text()]
        for menu in menus
    }
    return {**named, "": list(MENUS)}


def _missing(entries: dict[str, list[str]], path: str) -> str | None:
    """Return the first name of a path that is not in the menus; what follows a command is in its dialog."""
    menu = ""
    for name in path.split(" > "):
        found = max((each for each in entries[menu] if name.startswith(each)), key=len, default=None)
        if found is None:
            return name
        if found not in entries:
            return None
        menu = found
    return None


def test_every_path_on_a_page_is_in_the_menus(entries) -> None:
    paths = list(_on_pages())
    assert len(paths) > 20
    missing = [(page, path) for page, path in paths if _missing(entries, path)]
    assert not missing, missing


def test_every_path_in_a_message_is_in_the_menus(entries) -> None:
    paths = list(_in_messages())
    assert len(paths) > 5
    missing = [(module, path) for module, path in paths if _missing(entries, path)]
    assert not missing, missing


def test_every_button_on_a_page_is_in_the_window() -> None:
    """Those with an ellipsis: other words in italics need not be buttons."""
    texts = {text for _, text in _texts()}
    pages = {page.stem: " ".join(page.read_text(encoding="utf-8").split()) for page in _PAGES}
    named = [
        (page, name) for page, text in pages.items() for name in re.findall(r"\*([A-Z][^*>.]*…)\*", text)
    ]
    assert len(named) > 20
    missing = [(page, name) for page, name in named if name not in texts]
    assert not missing, missing
