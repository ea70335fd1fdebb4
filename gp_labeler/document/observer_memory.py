"""Who labels, asked once and remembered from one start to the next."""

from __future__ import annotations

import json
from pathlib import Path

from gp_core.disk import read_json, write_text
from gp_core.errors import GpError

__all__ = ["ObserverMemory"]


class ObserverMemory:
    """The observer, in a small file of the state directory.

    It is what a person has answered, never the name of the account: several people share a computer of the
    lab, and files should not tell account names. Damaged it counts as empty, and where it cannot be written,
    that is ignored.

    Parameters
    ----------
    directory : Path
        The state directory.
    """

    def __init__(self, directory: Path) -> None:
        self._path = directory / "observer.json"

    def recall(self) -> str:
        """Return the observer; empty where nobody has answered yet."""
        try:
            content = read_json(self._path)
        except GpError:
            return ""
        name = content.get("observer") if isinstance(content, dict) else None
        return " ".join(name.split()) if isinstance(name, str) else ""

    def remember(self, observer: str) -> None:
        """Remember who labels from now on."""
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            write_text(self._path, json.dumps({"observer": observer}, indent=1))
        except (OSError, GpError):
            return
