"""Where the atlas in use comes from, remembered from one start to the next."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gp_core.disk import read_json, write_text
from gp_core.errors import GpError
from gp_labeler.document.paths import absolute_path

__all__ = ["AtlasMemory", "AtlasSource"]


@dataclass(frozen=True)
class AtlasSource:
    """What to read an atlas from, one of the two.

    Parameters
    ----------
    file : Path, optional
        A saved atlas.
    animals : tuple of Path
        Labelled animals, files or folders of them, to fit it to.
    keep_doubtful : bool
        Whether labels that the check finds doubtful are used.
    """

    file: Path | None = None
    animals: tuple[Path, ...] = ()
    keep_doubtful: bool = False
    weigh_certainty: bool = False

    @property
    def text(self) -> str:
        """Such as ``own.json``, or ``GP01_L.mrk.json and 3 more``."""
        first, *others = (self.file,) if self.file is not None else self.animals
        return first.name + (f" and {len(others)} more" if others else "")


class AtlasMemory:
    """The source of the atlas chosen last, in a small file of the state directory.

    Damaged it counts as empty, and where it cannot be written, that is ignored: it is a convenience.

    Parameters
    ----------
    directory : Path
        The state directory.
    """

    def __init__(self, directory: Path) -> None:
        self._path = directory / "atlas.json"

    def recall(self) -> AtlasSource | None:
        """Return the source; None for the published atlas."""
        try:
            content = read_json(self._path)
        except GpError:
            return None
        if not isinstance(content, dict):
            return None
        file, animals = content.get("file"), content.get("animals")
        if isinstance(file, str) and file:
            return AtlasSource(Path(file))
        if isinstance(animals, list) and animals and all(isinstance(path, str) and path for path in animals):
            keep, weigh = (content.get(key) is True for key in ("keep_doubtful", "weigh_certainty"))
            return AtlasSource(None, tuple(map(Path, animals)), keep, weigh)
        return None

    def remember(self, source: AtlasSource | None) -> None:
        """Remember a source, or that the published atlas is wanted."""
        content: dict[str, Any] = {}
        try:
            if source is not None and source.file is not None:
                content = {"file": str(absolute_path(source.file))}
            elif source is not None:
                content = {"animals": [str(absolute_path(path)) for path in source.animals]}
                how = {key: getattr(source, key) for key in ("keep_doubtful", "weigh_certainty")}
                content |= {key: True for key, is_so in how.items() if is_so}
            self._path.parent.mkdir(parents=True, exist_ok=True)
            write_text(self._path, json.dumps(content, indent=1))
        except (OSError, GpError):
            return
