"""Whether the state directory can be written, and what can take its place."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from gp_core.disk import write_bytes
from gp_core.errors import GpError

__all__ = ["fallback_directory", "write_problem"]

_NEEDED_BYTES = 200_000  # some journals
_PROBE = "can-be-written"


def write_problem(directory: Path) -> str:
    """Return why journals cannot be kept in a folder, which is made if need be; empty where they can."""
    probe = directory / _PROBE
    try:
        directory.mkdir(parents=True, exist_ok=True, mode=0o700)
        write_bytes(probe, bytes(_NEEDED_BYTES))
        probe.unlink()
    except GpError as error:
        return error.problem
    except OSError as error:
        return f"cannot be made ({error.strerror})"
    return ""


def fallback_directory() -> Path | None:
    """Return a folder of this user for temporary files that can be written; None where there is none."""
    user = os.getuid() if hasattr(os, "getuid") else "user"
    folder = Path(tempfile.gettempdir(), f"gp-labeler-{user}")
    if write_problem(folder):
        return None
    is_ours = not hasattr(os, "getuid") or (not folder.is_symlink() and folder.stat().st_uid == os.getuid())
    return folder if is_ours else None
