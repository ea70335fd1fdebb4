"""One window for each specimen: a lock that the operating system lets go of when its process dies.

The file says who holds it (for the message); whether it is held, the system knows. So a lock left behind by a
killed program is free again at once, and no reused process number can fool us.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import socket
import sys
from pathlib import Path
from typing import IO

from gp_core.disk import read_json
from gp_core.errors import GpError

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

__all__ = ["FileLock", "InUseError"]

_FAR_BYTE = 1 << 30
"""Windows locks bytes against reading too: lock one that nobody reads."""
_HELD = (errno.EACCES, errno.EAGAIN, errno.EDEADLK)


class InUseError(GpError):
    """Another window has it open."""


class FileLock:
    """A lock held from construction to `release`, or to the end of the process.

    Parameters
    ----------
    path : Path
        The lock file; made if need be, and left empty afterwards.
    what : str
        What is locked; stands in the message.

    Raises
    ------
    InUseError
        Somebody else holds it.
    GpError
        The file cannot be made.
    """

    def __init__(self, path: Path, what: str) -> None:
        self.path = path
        self._file: IO[str] | None = None
        try:
            file = _opened(path)
        except OSError as error:
            raise GpError(f"cannot be made: {error.strerror}", file=path) from None
        if not _lock(file):
            holder = _holder(path)
            file.close()
            raise InUseError(
                f"{what} is open in another window{holder}",
                remedy="Go on there, or close it there first; or open it here as a copy.",
            )
        self._file = file
        with contextlib.suppress(OSError):  # a full disk: it is locked all the same
            file.truncate(0)
            os.write(file.fileno(), json.dumps({"pid": os.getpid(), "host": socket.gethostname()}).encode())

    def release(self, *, remove: bool = False) -> None:
        """Let go; more than once does no harm.

        The file stays, since another window may be waiting at its door; `remove` it where none can.
        """
        if self._file is None:
            return
        with contextlib.suppress(OSError):
            self._file.truncate(0)
        self._file.close()
        self._file = None
        if remove:
            with contextlib.suppress(OSError):
                self.path.unlink(missing_ok=True)


def _opened(path: Path) -> IO[str]:
    """Open a lock file; where it cannot be written, to be read, which the system locks all the same."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        return path.open("a+", encoding="utf-8")
    except OSError:
        if not path.is_file():
            raise
        return path.open(encoding="utf-8")


def _lock(file: IO[str]) -> bool:
    """Take the system's lock; False where it is held. A file system without locks counts as free."""
    try:
        if sys.platform == "win32":
            file.seek(_FAR_BYTE)
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        else:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        return error.errno not in _HELD
    finally:
        file.seek(0)
    return True


def _holder(path: Path) -> str:
    try:
        holder = read_json(path)
        return f" (process {int(holder['pid'])} on {holder['host']})"
    except (GpError, ValueError, TypeError, KeyError):
        return ""
