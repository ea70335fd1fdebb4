"""What is compiled is kept for the next process, until a file that it was made of changes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from gp_core.registration import compiling, jrmpc_kernels, student_t_fit_compiled

_RUN = """
from gp_core.registration.outer import outer
print(outer(3), sum(outer.stats.cache_hits.values()))
"""


@pytest.fixture
def package(tmp_path: Path) -> Path:
    folder = tmp_path / "gp_core" / "registration"
    folder.mkdir(parents=True)
    for each in (folder, folder.parent):  # or the installed package would be found instead
        (each / "__init__.py").write_text("")
    (folder / "compiling.py").write_text(Path(compiling.__file__).read_text(encoding="utf-8"))
    (folder / "inner.py").write_text("def inner(x):\n    return x + 1\n")
    (folder / "outer.py").write_text(
        "from gp_core.registration import inner as plain\n"
        "from gp_core.registration.compiling import compiled, compiled_together\n"
        "inner = compiled_together([plain.inner], vars(plain))['inner']\n"
        "@compiled('int64(int64)', cache=True)\n"
        "def outer(x):\n"
        "    return 10 * inner(x)\n"
    )
    return tmp_path


def _run(package: Path) -> list[int]:
    elsewhere = {**os.environ, "PYTHONPATH": str(package), "NUMBA_CACHE_DIR": str(package / "kept")}
    words = [sys.executable, "-c", _RUN]
    done = subprocess.run(words, check=True, capture_output=True, text=True, cwd=package, env=elsewhere)
    return [int(word) for word in done.stdout.split()]


def test_a_kernel_is_compiled_again_when_the_file_of_one_it_calls_changes(package: Path) -> None:
    assert _run(package) == [40, 0]
    assert _run(package) == [40, 1]
    (package / "gp_core" / "registration" / "inner.py").write_text("def inner(x):\n    return x + 2\n")
    assert _run(package) == [50, 0]


@pytest.mark.parametrize(
    ("kernel", "own"),
    [
        (jrmpc_kernels.maximise, "jrmpc_kernels.py"),
        (student_t_fit_compiled.fit_student_t, "student_t_fit.py"),
    ],
)
def test_both_fits_are_made_of_the_one_solver(kernel: object, own: str) -> None:
    files = {Path(file).name for file in compiling.source_files(kernel.py_func)}
    assert {own, "rotation.py", "compiling.py"} <= files


def test_plain_functions_stay_as_they_are() -> None:
    def plain(x: float) -> float:
        return 2 * x

    fast = compiling.compiled_together([plain], {})["plain"]
    assert fast is not plain
    assert fast(2.0) == plain(2.0)
    assert not hasattr(plain, "py_func")
