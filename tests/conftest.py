"""Fixtures that all tests share. Real data is read in place and never copied; absent, its tests skip."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from gp_core import Specimen
from gp_core.io import read_authors_mat

_ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real data beside the checkout."""
    folder = Path(os.environ.get("GP_SHARED_DATA", _ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"real data not found at {folder}")
    return folder


@pytest.fixture(scope="session")
def real_specimens(shared_data: Path) -> list[Specimen]:
    """The authors' 11 labelled animals, each side in its own CO frame."""
    folder = shared_data / "usevitch2021"
    (left,), (right,) = folder.glob("*_L_CO.mat"), folder.glob("*_R_CO.mat")
    return read_authors_mat(left, right)
