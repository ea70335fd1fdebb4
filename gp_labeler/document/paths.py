"""Where the program keeps what outlives it: journals and locks, in one folder for each user."""

from __future__ import annotations

import hashlib
import os
from os import PathLike
from pathlib import Path
from uuid import uuid4

from platformdirs import user_state_path

from gp_core.errors import GpError
from gp_core.settings import setting

__all__ = [
    "UNSAVED",
    "absolute_path",
    "default_directory",
    "journal_folder",
    "journal_path",
    "lock_path",
    "volume_lock_path",
]

UNSAVED = "unsaved-"
"""Journals whose name begins so belong to one window only, which was never saved."""


def default_directory() -> Path:
    """Return the user's state directory, of the settings or the system; tests and scripts give their own."""
    named = setting("state")
    return Path(named).expanduser() if named else user_state_path("gp-labeler", appauthor=False)


def absolute_path(path: str | PathLike[str]) -> Path:
    """Return a path from the root, links followed; raises `GpError` for one that no system can hold."""
    try:
        return Path(path).resolve()
    except (OSError, ValueError, RuntimeError) as error:
        raise GpError(f"is not a valid path ({error})", file=path, remedy="Give another.") from None


def journal_folder(directory: Path) -> Path:
    """Return the folder of the journals."""
    return directory / "journals"


def journal_path(directory: Path, specimen_file: Path | None) -> Path:
    """Return where the journal of a specimen is: the same for a file, a new one for what is not saved."""
    name = f"{UNSAVED}{uuid4().hex[:16]}" if specimen_file is None else _named_for(specimen_file)
    return journal_folder(directory) / f"{name}.jsonl"


def lock_path(journal: Path) -> Path:
    """Return the lock beside a journal."""
    return journal.with_suffix(".lock")


def volume_lock_path(directory: Path, volume: str | PathLike[str]) -> Path:
    """Return the lock by which a second window on the same scan is noticed."""
    return directory / "volumes" / f"{_named_for(Path(volume))}.lock"


def _named_for(path: Path) -> str:
    whole = os.path.normcase(os.path.realpath(path))
    stem = "".join(c if c.isalnum() else "-" for c in path.name.split(".")[0])[:40]
    return f"{stem}-{hashlib.blake2b(whole.encode(errors='surrogateescape'), digest_size=8).hexdigest()}"
