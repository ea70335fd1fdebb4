"""The names that a lab has for the features, remembered from one import to the next."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Mapping
from pathlib import Path

from gp_core.disk import read_json, write_text
from gp_core.errors import GpError
from gp_core.landmarks.labels import LabelNames

__all__ = ["LabNamesMemory"]

_MOST = 1000


class LabNamesMemory:
    """Our code by the lab's own name, in a small file of the state directory.

    A damaged file counts as empty. Where it cannot be written nothing is lost but the convenience.

    Parameters
    ----------
    directory : Path or None
        The state directory; None remembers nothing.
    """

    def __init__(self, directory: Path | None) -> None:
        self._path = None if directory is None else directory / "lab-names.json"

    def recall(self) -> LabelNames:
        """Return the names that are remembered."""
        if self._path is None:
            return LabelNames({})
        try:
            content = read_json(self._path)
            valid = isinstance(content, dict) and all(isinstance(code, str) for code in content.values())
            return LabelNames(content if valid else {})
        except GpError:
            return LabelNames({})

    def remember(self, codes: Mapping[str, str]) -> None:
        """Add names to those that are remembered; the newest are kept where there are too many."""
        if self._path is None or not codes:
            return
        known = dict(self.recall().codes) | dict(LabelNames(codes).codes)
        newest = dict(list(known.items())[-_MOST:])
        with contextlib.suppress(GpError):
            write_text(self._path, json.dumps(newest, ensure_ascii=False, indent=1) + "\n")
