"""Checksums of scans, kept so that a scan is read for its checksum once, not at every run.

What is prepared of a scan is known by the scan's checksum, so that a copied, moved or touched file is not
prepared again. A note says which checksum a file had, by its path, size and time.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gp_core.disk import write_text
from gp_core.errors import GpError

__all__ = ["ScanChecksums"]

_CHECKSUM = re.compile(r"[0-9a-f]{32}\s*")


@dataclass(frozen=True)
class ScanChecksums:
    """Notes of the checksums of scans.

    Parameters
    ----------
    folder : Path, optional
        Where they are kept. None: nothing is kept.
    """

    folder: Path | None

    def known(self, path: Path, options: Mapping[str, Any]) -> str | None:
        """Return the checksum of a scan that was noted, None where it was not, or the file has changed.

        Parameters
        ----------
        path : Path
            File or folder of the scan.
        options : mapping
            How it is read.

        Raises
        ------
        GpError
            The file is not there.
        """
        note = self._note(path, options)
        try:
            text = "" if note is None else note.read_text(encoding="ascii")
        except (OSError, ValueError):
            return None
        return text.strip() if _CHECKSUM.fullmatch(text) else None

    def keep(self, path: Path, options: Mapping[str, Any], checksum: str) -> None:
        """Note the checksum of a scan; a folder that cannot be written to is no reason to stop."""
        note = self._note(path, options)
        if note is None:
            return
        try:
            note.parent.mkdir(parents=True, exist_ok=True)
            write_text(note, f"{checksum}\n")
        except (OSError, GpError):
            return

    def _note(self, path: Path, options: Mapping[str, Any]) -> Path | None:
        if self.folder is None:
            return None
        told = repr((_stamps(path), sorted(options.items(), key=lambda item: item[0])))
        return self.folder / "checksums" / f"{hashlib.blake2b(told.encode(), digest_size=16).hexdigest()}.txt"


def _stamps(path: Path) -> list[tuple[str, int, int]]:
    """Return names, sizes and times of a file, or of the files of a folder."""
    try:
        files = sorted(path.iterdir()) if path.is_dir() else [path]
        return [(str(f.absolute()), f.stat().st_size, f.stat().st_mtime_ns) for f in files if f.is_file()]
    except OSError as error:
        raise GpError(f"cannot be read ({error})", file=path) from None
