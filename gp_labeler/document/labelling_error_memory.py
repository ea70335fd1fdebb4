"""The measured error of labels that checks and regions use, remembered from one start to the next."""

from __future__ import annotations

import json
from pathlib import Path

from gp_core.atlas.labelling_error import LabellingError
from gp_core.disk import read_json, write_text
from gp_core.errors import GpError

__all__ = ["LabellingErrorMemory"]


class LabellingErrorMemory:
    """A small file of the state directory; damaged it counts as absent, and errors of writing are ignored.

    Parameters
    ----------
    directory : Path
        The state directory.
    """

    def __init__(self, directory: Path) -> None:
        self._path = directory / "labelling_error.json"

    def recall(self) -> LabellingError | None:
        """Return the error; None where the assumed one is used."""
        try:
            content = read_json(self._path)
            return LabellingError.from_dict(content) if content else None
        except GpError:
            return None

    def remember(self, error: LabellingError | None) -> None:
        """Remember an error, or that the assumed one is wanted."""
        content = {} if error is None else error.as_dict()
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            write_text(self._path, json.dumps(content, indent=1))
        except (OSError, GpError):
            return
