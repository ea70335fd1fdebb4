"""How much memory this machine has to give, and giving back what is free."""

from __future__ import annotations

import ctypes
import os
import sys
from pathlib import Path

__all__ = ["available_memory", "group_memory", "return_freed_memory", "share_freed_memory"]

_ARENA_MAX = -8
"""The option of `mallopt` for the number of places in which threads allocate, in glibc's ``malloc.h``."""

_GROUP_FILES = {
    1: ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_"),
    2: ("memory.max", "memory.current", ""),
}
"""Of a control group by its version: its limit, what it has taken, and how names begin in its statistics."""


def available_memory() -> float:
    """Return the bytes of memory that this process can have; infinity where the system does not say."""
    return min(_of_the_machine(), group_memory())


def _of_the_machine() -> float:
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        return 1024.0 * next(int(line.split()[1]) for line in lines if line.startswith("MemAvailable"))
    except (OSError, StopIteration, ValueError):
        pass
    try:
        return float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, ValueError, OSError):
        return float("inf")


def group_memory(root: Path = Path("/")) -> float:
    """Return the bytes that the control groups of this process leave to it: on a cluster, in a container.

    Parameters
    ----------
    root : Path
        Of the file system.

    Returns
    -------
    float
        Infinity where no group has a limit. Pages of files count as free, for the system takes them back.

    References
    ----------
    https://docs.kernel.org/admin-guide/cgroup-v2.html, https://docs.kernel.org/admin-guide/cgroup-v1/memory.html
    """
    try:
        lines = (root / "proc/self/cgroup").read_text(encoding="utf-8").splitlines()
    except OSError:
        return float("inf")
    free = [float("inf")]
    for _, controllers, path in (line.split(":", 2) for line in lines if line.count(":") >= 2):
        if controllers and "memory" not in controllers.split(","):
            continue
        top = root / "sys/fs/cgroup" / ("memory" if controllers else "")
        group = top / path.strip("/")
        free += [_left_in(each) for each in (group, *group.parents) if each.is_relative_to(top)]
    return min(free)


def _left_in(group: Path) -> float:
    """Return what a control group, of version 2 or 1, leaves; infinity where it has no limit."""
    version = 2 if (group / "memory.max").exists() else 1
    limit, used, prefix = _GROUP_FILES[version]
    try:
        most, taken = (int((group / name).read_text(encoding="ascii")) for name in (limit, used))
        stat = (group / "memory.stat").read_text(encoding="ascii").splitlines()
    except (OSError, ValueError):  # "max" is no number
        return float("inf")
    numbers = {name: int(number) for name, _, number in (line.partition(" ") for line in stat)}
    files = numbers.get(f"{prefix}inactive_file", 0) + numbers.get(f"{prefix}active_file", 0)
    return float(max(0, most - taken + files))


def share_freed_memory() -> None:
    """Have all threads allocate in one place, where the C library is glibc: each reuses what others freed.

    By default, threads allocate apart from each other, and gaps remain in each part. Call it before threads
    start; later it has no effect.
    """
    set_option = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if set_option is not None:
        set_option(_ARENA_MAX, 1)


def return_freed_memory() -> None:
    """Return to the system what was freed, where the C library keeps it for later use, as glibc does.

    After a large scan was meshed and closed that is about 1 GB. It takes some 0.1 s: call it in a thread.
    """
    if sys.platform != "linux":
        return
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # musl has none
    if trim is not None:
        trim(0)
