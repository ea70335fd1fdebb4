"""Every code block of the tutorials does what the page says."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from tutorial_blocks import run_page

_PAGES = Path(__file__).resolve().parents[1] / "docs" / "tutorials"
_LONG = ("first-labels",)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(path.stem for path in _PAGES.glob("*.md")))
def test_every_block_does_what_the_page_says(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if name in _LONG and not os.environ.get("GP_LONG_TUTORIALS"):
        pytest.skip("it takes a minute: tools/gate-long tutorials runs it")
    monkeypatch.chdir(tmp_path)
    assert run_page(_PAGES / f"{name}.md") > 0
