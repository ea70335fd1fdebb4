"""Text files of landmarks: their encoding, with a reason where they cannot be read."""

from __future__ import annotations

import codecs
from os import PathLike

from gp_core import disk
from gp_core.errors import FileFormatError

__all__ = ["check_file", "read_text"]

_WHAT = "landmark file"


def read_text(path: str | PathLike[str]) -> str:
    """Return the text of a file in UTF-8 (or UTF-16 with a byte-order mark), without the byte-order mark.

    Parameters
    ----------
    path : path-like
        The file.

    Returns
    -------
    str
        Not blank.

    Raises
    ------
    FileFormatError
        Missing, not a plain file, not readable, too large, empty or binary.
    """
    raw = disk.read_bytes(path, what=_WHAT)
    utf16 = raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    try:
        text = raw.decode("utf-16" if utf16 else "utf-8-sig")
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        raise FileFormatError(
            "is binary, or not UTF-8 text", file=path, remedy="Give a landmark file, or save it as UTF-8."
        )
    if not text.strip():
        raise FileFormatError("is empty", file=path, remedy="Export the landmarks again.")
    return text


def check_file(path: str | PathLike[str]) -> None:
    """Check that there is a file of a size that landmarks may have.

    Parameters
    ----------
    path : path-like
        Any path.

    Raises
    ------
    FileFormatError
        As for `gp_core.disk.check_file`.
    """
    disk.check_file(path, what=_WHAT)
