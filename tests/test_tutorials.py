"""Every code block of the tutorials and of the how-to pages does what the page says."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from tutorial_blocks import run_page

_DOCS = Path(__file__).resolve().parents[1] / "docs"
_PAGES = [*sorted((_DOCS / "tutorials").glob("*.md")), *sorted((_DOCS / "howto").glob("*.md"))]
_LONG = ("first-labels",)


@pytest.mark.slow
@pytest.mark.parametrize("page", _PAGES, ids=lambda page: page.stem)
def test_every_block_does_what_the_page_says(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if page.stem in _LONG and not os.environ.get("GP_LONG_TUTORIALS"):
        pytest.skip("it takes a minute: tools/gate-long tutorials runs it")
    monkeypatch.chdir(tmp_path)
    assert run_page(page) > 0
