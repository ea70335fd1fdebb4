"""Modules that have moved are still imported by their earlier names, and say where they are now."""

from __future__ import annotations

import importlib
import subprocess
import sys

import pytest

import gp_core


def test_what_a_lab_imported_before_is_the_same_object() -> None:
    with pytest.warns(DeprecationWarning, match=r"gp_core.landmarks.files is gp_core.io now"):
        from gp_core.landmarks.files import read_landmarks  # type: ignore[import-not-found]
    assert read_landmarks is gp_core.read_landmarks


def test_every_earlier_module_has_a_successor() -> None:
    for successor in gp_core.MOVED_MODULES.values():
        importlib.import_module(successor)


@pytest.mark.parametrize("name", ["gp_core.landmarks.file", "gp_core.no_such_module"])
def test_any_other_name_stays_unknown(name: str) -> None:
    with pytest.raises(ModuleNotFoundError):
        importlib.import_module(name)


def test_the_phantom_is_found_where_it_was() -> None:
    pytest.importorskip("SimpleITK")
    code = "from gp_labeler.imaging.phantom.phantom import make_phantom; print(make_phantom.__module__)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "gp_labeler.phantom.phantom"
