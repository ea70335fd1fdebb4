"""The wheel carries the resources; the tests' own settings do what they say."""

from __future__ import annotations

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
