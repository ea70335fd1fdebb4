"""Every code block of the tutorials does what the page says."""

from __future__ import annotations

from pathlib import Path

import pytest
from tutorial_blocks import run_page

_PAGES = Path(__file__).resolve().parents[1] / "docs" / "tutorials"


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(path.stem for path in _PAGES.glob("*.md")))
def test_every_block_does_what_the_page_says(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run_page(_PAGES / f"{name}.md") > 0
