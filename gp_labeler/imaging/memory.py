"""How much memory this machine has to give, and giving back what is free."""

from __future__ import annotations

import ctypes
import os
import sys
from pathlib import Path

__all__ = ["available_memory", "return_freed_memory"]


def available_memory() -> float:
    """Return the bytes of memory that programs can have; infinity where the system does not say."""
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        return 1024.0 * next(int(line.split()[1]) for line in lines if line.startswith("MemAvailable"))
    except (OSError, StopIteration, ValueError):
        pass
    try:
        return float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, ValueError, OSError):
        return float("inf")


def return_freed_memory() -> None:
    """Return to the system what was freed, where the C library keeps it for later use, as glibc does.

    After a large scan was meshed and closed that is about 1 GB. It takes some 0.1 s: call it in a thread.
    """
    if sys.platform != "linux":
        return
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # musl has none
    if trim is not None:
        trim(0)
