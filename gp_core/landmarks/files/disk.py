"""Between landmark files and the disk: whole texts in, whole texts out, and a reason where it fails."""

from __future__ import annotations

import codecs
import os
import stat
from os import PathLike
from pathlib import Path

from gp_core.errors import FileFormatError, GpError

__all__ = ["check_file", "read_text", "write_text"]

_MAX_BYTES = 50_000_000


def read_text(path: str | PathLike[str]) -> str:
    """Return the text of a file, of UTF-8 (or UTF-16 with its mark), without the byte-order mark.

    Raises
    ------
    FileFormatError
        Missing, a folder, not readable, too large, empty or binary.
    """
    check_file(path)
    try:
        raw = Path(path).read_bytes()
    except OSError as error:
        raise _unreadable(path, error) from None
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
    """Raise `FileFormatError` unless there is a file, of a size that landmarks may have."""
    file = Path(path)
    try:
        if file.is_dir():
            raise FileFormatError("is a folder, not a landmark file", file=path, remedy="Name a file in it.")
        if not file.exists():
            raise FileFormatError("does not exist", file=path, remedy="Check the name and the folder.")
        if not file.is_file() or file.stat().st_size > _MAX_BYTES:
            raise FileFormatError("is too large, or no plain file", file=path, remedy="Give a landmark file.")
    except (OSError, ValueError) as error:
        raise _unreadable(path, error) from None


def _unreadable(path: str | PathLike[str], error: Exception) -> FileFormatError:
    reason = getattr(error, "strerror", None) or error  # ValueError: a name that no system can hold
    return FileFormatError(f"cannot be read ({reason})", file=path, remedy="Check its name and permissions.")


def write_text(path: str | PathLike[str], text: str) -> None:
    """Write a file wholly or not at all: a draft beside it goes to the disk, then takes its name.

    Raises
    ------
    GpError
        The folder is missing, or the disk or its permissions refuse.
    """
    try:
        target = Path(os.path.realpath(path))  # a link stays a link
        if target.is_dir():
            raise GpError("is a folder, not a file", file=path, remedy="Name a file in it.")
        draft = target.with_name(f".{target.name}.{os.urandom(4).hex()}.tmp")
        try:
            with draft.open("x", encoding="utf-8", newline="\n") as stream:
                stream.write(text)
                stream.flush()
                os.fsync(stream.fileno())
            if target.exists():
                draft.chmod(stat.S_IMODE(target.stat().st_mode))
            draft.replace(target)
        finally:
            draft.unlink(missing_ok=True)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise GpError(
            f"cannot be written ({reason})",
            file=path,
            remedy="Check the folder and its permissions.",
        ) from None
