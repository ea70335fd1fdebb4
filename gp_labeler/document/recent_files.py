"""The list of files opened last."""

from __future__ import annotations

import json
from os import PathLike
from pathlib import Path

from gp_core.disk import read_json, write_text
from gp_core.errors import GpError
from gp_labeler.document.paths import absolute_path

__all__ = ["RecentFiles"]


class RecentFiles:
    """Files opened last, newest first, kept in a small file of the state directory.

    A list that cannot be read counts as empty, and errors of writing it are ignored: it is a convenience.

    Parameters
    ----------
    directory : Path
        The state directory.
    limit : int
        How many to remember.
    """

    def __init__(self, directory: Path, *, limit: int = 12) -> None:
        self._path = directory / "recent.json"
        self._limit = limit

    def all(self) -> tuple[Path, ...]:
        """Return the remembered files, also those that are gone now."""
        try:
            content = read_json(self._path)
        except GpError:
            return ()
        paths = content.get("files") if isinstance(content, dict) else None
        if not isinstance(paths, list):
            return ()
        return tuple(Path(p) for p in paths if isinstance(p, str) and p)[: self._limit]

    def add(self, path: str | PathLike[str]) -> None:
        """Put a file at the top."""
        newest = absolute_path(path)
        self._write([newest, *(p for p in self.all() if p != newest)])

    def remove(self, path: str | PathLike[str]) -> None:
        """Forget a file."""
        gone = absolute_path(path)
        self._write([p for p in self.all() if p != gone])

    def clear(self) -> None:
        """Forget all."""
        self._write([])

    def _write(self, paths: list[Path]) -> None:
        content = {"files": [str(p) for p in paths[: self._limit]]}
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            write_text(self._path, json.dumps(content, indent=1))
        except (OSError, GpError):
            return
