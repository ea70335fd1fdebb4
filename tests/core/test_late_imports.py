"""What a program does not use is not imported: studies, and the other commands of ``gp-core``."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import gp_core

TOUCHES = Path(__file__).parents[2] / "docs" / "example" / "touches.csv"
LOADED = "print(*(name for name in sys.modules if name.startswith(('gp_core.study', 'http.server'))))"


def _loaded_after(*lines: str) -> list[str]:
    done = subprocess.run(
        [sys.executable, "-c", "\n".join(["import sys", *lines, LOADED])],
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.splitlines()[-1].split()


def test_studies_are_imported_when_they_are_first_asked_for() -> None:
    assert _loaded_after("import gp_core") == []
    assert "gp_core.study.simulation" in _loaded_after("import gp_core", "gp_core.simulate")
    assert "gp_core.study.simulation" in _loaded_after("from gp_core import *")


def test_an_estimate_imports_no_other_command() -> None:
    run = f"gp_core.cli.main(['estimate', {str(TOUCHES)!r}, '--side', 'L'])"
    assert _loaded_after("import gp_core.cli", run) == []


def test_every_name_is_listed_and_no_other_is_there() -> None:
    assert set(gp_core.__all__) <= set(dir(gp_core))
    for name in gp_core.__all__:
        assert getattr(gp_core, name) is getattr(gp_core, name)
    with pytest.raises(AttributeError, match="has no attribute 'simulated'"):
        gp_core.simulated  # noqa: B018
