"""What the window remembers from one day to the next: its place, its look, where files were opened last."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gp_core.disk import read_json, write_text
from gp_core.errors import GpError

__all__ = ["WindowState"]


class WindowState:
    """A few values in a small file; a damaged one counts as empty, and one that cannot be written is ignored.

    Parameters
    ----------
    path : Path, optional
        The file; None remembers nothing beyond this window.
    """

    def __init__(self, path: Path | None = None) -> None:
        self._path = path
        self._values: dict[str, Any] = _read(path)

    def get(self, name: str, kind: type, default: Any) -> Any:
        """Return a value, or the default where there is none of that kind."""
        value = self._values.get(name)
        return value if isinstance(value, kind) else default

    def set(self, **values: Any) -> None:
        """Remember values, which must be JSON's."""
        self._values.update(values)

    def fields(self, name: str) -> Mapping[str, Any]:
        """Return a remembered mapping; empty where there is none."""
        found: dict[str, Any] = self.get(name, dict, {})
        return found

    def save(self) -> None:
        """Write the file."""
        if self._path is None:
            return
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            write_text(self._path, json.dumps(self._values, indent=1))
        except (OSError, GpError):
            return


def _read(path: Path | None) -> dict[str, Any]:
    if path is None:
        return {}
    try:
        content = read_json(path)
    except GpError:
        return {}
    return content if isinstance(content, dict) else {}
