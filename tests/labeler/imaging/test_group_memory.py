"""How much memory a process may have where its control groups limit it, as on clusters and in containers."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from gp_labeler.imaging.memory import available_memory, group_memory

V1 = ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_")
V2 = ("memory.max", "memory.current", "")


def _group(folder: Path, names: tuple[str, str, str], limit: object, used: int, files: int) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / names[0]).write_text(f"{limit}\n")
    (folder / names[1]).write_text(f"{used}\n")
    stat = f"anon 1\n{names[2]}inactive_file {files}\n{names[2]}active_file 0\n"
    (folder / "memory.stat").write_text(stat)


def _member(root: Path, lines: str) -> None:
    (root / "proc/self").mkdir(parents=True)
    (root / "proc/self/cgroup").write_text(lines)


@pytest.mark.parametrize(
    ("names", "lines", "top"),
    [
        (V2, "0::/user/job\n", "sys/fs/cgroup"),
        (V1, "5:cpu:/else\n4:memory:/user/job\n0::/\n", "sys/fs/cgroup/memory"),
    ],
)
def test_the_narrowest_group_counts_and_pages_of_files_are_free(
    tmp_path: Path, names: tuple[str, str, str], lines: str, top: str
) -> None:
    _member(tmp_path, lines)
    job = tmp_path / top / "user/job"
    _group(job, names, 3000, used=1000, files=400)
    assert group_memory(tmp_path) == 2400
    _group(job.parent, names, 5000, used=4000, files=100)
    assert group_memory(tmp_path) == 1100
    _group(job, names, 900, used=1000, files=0)
    assert group_memory(tmp_path) == 0


def test_a_path_that_is_not_seen_from_within_a_container_leaves_its_top(tmp_path: Path) -> None:
    _member(tmp_path, "0::/docker/abc\n")
    _group(tmp_path / "sys/fs/cgroup", V2, 700, used=100, files=0)
    assert group_memory(tmp_path) == 600


def test_without_a_limit_there_is_no_end(tmp_path: Path) -> None:
    assert group_memory(tmp_path) == math.inf
    _member(tmp_path, "0::/user\nnonsense\n")
    _group(tmp_path / "sys/fs/cgroup/user", V2, "max", used=100, files=0)
    assert group_memory(tmp_path) == math.inf
    assert 0 < available_memory() <= group_memory()
