"""Files in and out of the program.

Only plain files of bounded size are read, so that neither a pipe nor an endless file holds the program up. A
file is written whole or not at all: a draft beside it goes to the disk, then takes its name; whatever fails,
the old file stays. Files that belong together take their names only when all of their drafts are written.
Devices and pipes are written to, never replaced. While a command runs, what it reads is protected: nothing is
written over it.
"""

from __future__ import annotations

import contextlib
import errno
import json
import logging
import os
import re
import stat
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

from gp_core.errors import AlreadyExistsError, FileFormatError, GpError, blaming
from gp_core.terminal import printable

try:
    import fcntl
except ImportError:  # Windows locks open files
    fcntl = None  # type: ignore[assignment]

__all__ = [
    "FREE_SPACE",
    "MAX_BYTES",
    "all_or_none",
    "atomic_file",
    "check_file",
    "is_protected",
    "is_stream",
    "make_folder",
    "make_room",
    "parse_json",
    "protect",
    "protected_inputs",
    "read_bytes",
    "read_head",
    "read_json",
    "remove_drafts",
    "write_bytes",
    "write_text",
]

_log = logging.getLogger(__name__)

AnyPath = str | PathLike[str]

MAX_BYTES = 50_000_000
"""Size of the largest text or JSON file that is read."""

FREE_SPACE = "Free some space, or choose another folder. The file is as it was."
"""Remedy of a file that was not written whole."""

_DRAFT = re.compile(r"\.(?P<name>.*)\.[0-9a-f]{8}\.tmp(\.\w+){0,2}", re.DOTALL)
_CHUNK_BYTES = 1 << 20
_LONGEST_NAME = 200  # bytes of the name in that of its temporary file; systems allow 255
_MOST_LOCKS = 100  # of one batch; systems allow some hundred open files
_FORGOTTEN_SECONDS = 3600.0  # after which any temporary file counts as abandoned
PIPE_PATIENCE_S = 10.0  # for a reader of a pipe
_DESCRIPTOR = re.compile(r"/(?:dev|proc/self)/fd/(?P<number>\d+)")
_STREAMS = {"/dev/stdout": 1, "/dev/stderr": 2}
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)

_protected: dict[tuple[int, int], str] = {}
"""Device and inode of the files that must not be overwritten."""


# Reading


def check_file(path: AnyPath, *, what: str = "file", max_bytes: int = MAX_BYTES) -> None:
    """Check that a path is a plain file of acceptable size.

    Parameters
    ----------
    path : path-like
        Any path.
    what : str
        What it should be, for the message.
    max_bytes : int
        Largest size, bytes.

    Raises
    ------
    FileFormatError
        Missing, not a plain file, or too large.
    """
    try:
        _check_kind(Path(path).stat(), path, what, max_bytes)
    except (OSError, ValueError) as error:
        raise _unreadable(path, error) from None


def read_bytes(path: AnyPath, *, what: str = "file", max_bytes: int = MAX_BYTES) -> bytes:
    """Return the content of a plain file.

    Parameters
    ----------
    path : path-like
        The file.
    what : str
        What it should be, for the message.
    max_bytes : int
        Size of the largest file that is read.

    Returns
    -------
    bytes
        The content.

    Raises
    ------
    FileFormatError
        Missing, a folder, a device or a pipe, not readable, or too large.
    """
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)  # do not block on a pipe
    try:
        if Path(path).is_dir():  # Windows cannot open a folder
            _check_kind(Path(path).stat(), path, what, max_bytes)
        with os.fdopen(os.open(path, flags), "rb") as file:
            status = os.fstat(file.fileno())
            _check_kind(status, path, what, max_bytes)
            content = file.read(status.st_size + 1)
            while len(content) <= max_bytes and (more := file.read(_CHUNK_BYTES)):  # growing, or in /proc
                content += more
    except (OSError, ValueError) as error:
        raise _unreadable(path, error) from None
    if len(content) > max_bytes:
        raise _too_large(path, what, max_bytes)
    _log.debug("read %s (%d bytes)", printable(os.fspath(path)), len(content))
    return content


def read_head(path: AnyPath, n_bytes: int) -> bytes:
    """Return the first bytes of a plain file, to identify its format.

    Parameters
    ----------
    path : path-like
        Any path.
    n_bytes : int
        How many bytes at most.

    Returns
    -------
    bytes
        Empty where there is no readable plain file.
    """
    with contextlib.suppress(OSError, ValueError):
        status = Path(path).stat()
        if stat.S_ISREG(status.st_mode):
            with Path(path).open("rb") as file:
                return file.read(min(n_bytes, status.st_size))
    return b""


def read_json(path: AnyPath, *, what: str = "file", remedy: str | None = None) -> Any:
    """Return the content of a JSON file.

    Parameters
    ----------
    path : path-like
        The file.
    what : str
        What it should be, for the message.
    remedy : str, optional
        What to do about a file that is not JSON.

    Returns
    -------
    object
        The parsed content.

    Raises
    ------
    FileFormatError
        As for `read_bytes`, the file is not JSON, or gives a name twice.
    """
    content = read_bytes(path, what=what)
    try:
        with blaming(path):
            return parse_json(content)
    except (ValueError, RecursionError):
        raise FileFormatError("is not JSON: damaged or cut off", file=path, remedy=remedy) from None


def parse_json(
    text: str | bytes,
    *,
    parse_constant: Callable[[str], Any] | None = None,
    remedy: str = "Keep one of them.",
) -> Any:
    """Parse JSON in which no object gives a name twice: of two values, Python would silently take the last.

    Parameters
    ----------
    text : str or bytes
        The content of a file, or of a request.
    parse_constant : callable, optional
        Called with ``NaN`` and the like; by default they are taken.
    remedy : str
        What to do about a name that is given twice.

    Returns
    -------
    object
        The parsed content.

    Raises
    ------
    FileFormatError
        A name is given twice. A `ValueError` or a `RecursionError` means that it is not JSON.
    """

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        found = dict(pairs)
        if len(found) < len(pairs):
            names = [name for name, _ in pairs]
            twice = next(name for name in names if names.count(name) > 1)
            raise FileFormatError(f"{twice[:40]!r} is given twice", remedy=remedy)
        return found

    return json.loads(text, parse_constant=parse_constant, object_pairs_hook=once)


def _check_kind(status: os.stat_result, path: AnyPath, what: str, max_bytes: int) -> None:
    remedy = f"Give {_a(what)}."
    if stat.S_ISDIR(status.st_mode):
        raise FileFormatError(f"is a folder, not {_a(what)}", file=path, remedy="Name a file in it.")
    if not stat.S_ISREG(status.st_mode):
        raise FileFormatError("is a device or a pipe, not a regular file", file=path, remedy=remedy)
    if status.st_size > max_bytes:
        raise _too_large(path, what, max_bytes)


def _too_large(path: AnyPath, what: str, max_bytes: int) -> FileFormatError:
    limit = f"{max_bytes / 1e6:g} MB"
    return FileFormatError(f"is too large for {_a(what)}, above {limit}", file=path, remedy="Check the name.")


def _a(what: str) -> str:
    return f"{'an' if what[0] in 'aeiou' else 'a'} {what}"


def _unreadable(path: AnyPath, error: Exception) -> FileFormatError:
    if isinstance(error, FileNotFoundError):
        return FileFormatError("does not exist", file=path, remedy="Check the name and the folder.")
    problem = f"cannot be read ({_reason(error)})"
    return FileFormatError(problem, file=path, remedy="Check its name and permissions.")


# Writing


def write_text(path: AnyPath, text: str) -> None:
    """Write a text as UTF-8, atomically.

    Parameters
    ----------
    path : path-like
        Where to write.
    text : str
        The content.

    Raises
    ------
    GpError
        As for `atomic_file`.
    """
    content = text.encode("utf-8", errors="backslashreplace")  # names may hold bytes that are not UTF-8
    write_bytes(path, content)


def write_bytes(path: AnyPath, content: bytes) -> None:
    """Write a file atomically.

    Parameters
    ----------
    path : path-like
        Where to write.
    content : bytes
        The content.

    Raises
    ------
    GpError
        As for `atomic_file`.
    """
    with atomic_file(path) as draft:
        draft.write_bytes(content)


def make_folder(folder: AnyPath) -> None:
    """Make a folder, and those that it lies in, where they are not there yet.

    Parameters
    ----------
    folder : path-like
        The folder.

    Raises
    ------
    GpError
        It cannot be made.
    """
    try:
        Path(folder).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise GpError(f"cannot be made: {error.strerror}", file=folder) from None


def make_room(folder: AnyPath, files: Iterable[AnyPath], *, overwrite: bool) -> None:
    """Make a folder for files, and check that none of them is there already.

    Parameters
    ----------
    folder : path-like
        Made where it is not there.
    files : iterable of path-like
        Files to be written into it.
    overwrite : bool
        Whether files may be replaced.

    Raises
    ------
    AlreadyExistsError
        A file would be replaced.
    GpError
        The folder cannot be made.
    """
    make_folder(folder)
    there = [path for path in files if Path(path).exists()]
    if there and not overwrite:
        remedy = "Choose another folder, or overwrite it."
        raise AlreadyExistsError("already exists", file=there[0], remedy=remedy)


@contextmanager
def all_or_none() -> Iterator[None]:
    """Write all files of a block, or none: old files are replaced when all new ones are complete.

    A block within another one leaves that to the outer one. What a block writes cannot be read from its place
    before the block ends.

    Yields
    ------
    None
        While the files are written.

    Raises
    ------
    GpError
        As for `atomic_file`. All old files are then unchanged.
    """
    with _joined_batch():
        yield


@contextmanager
def atomic_file(path: AnyPath) -> Iterator[Path]:
    """Write a file atomically: completely, or not at all.

    Parameters
    ----------
    path : path-like
        The file to write.

    Yields
    ------
    Path
        A temporary file beside it, with the same suffix, to be written completely. It replaces the file
        afterwards (in `all_or_none`, after all others), unless an exception is raised. For a device or a pipe
        its content is copied there.

    Raises
    ------
    GpError
        The folder is missing, the disk or its permissions refuse, or the file is protected. The previous
        content is then unchanged.
    """
    with _joined_batch() as batch, _disk_errors(path), ExitStack() as resources:
        _refuse_protected(path)
        written = (_begin_stream if is_stream(path) else _begin_file)(path, resources)
        yield written.draft
        written.finish()
        batch.take(written, resources.pop_all())


class _Batch:
    """Files that belong together: their drafts wait until all are written.

    Parameters
    ----------
    resources : ExitStack
        Deletes the drafts that were not put in place.
    """

    def __init__(self, resources: ExitStack) -> None:
        self._resources = resources
        self._written: list[_Written] = []

    def take(self, written: _Written, resources: ExitStack) -> None:
        """Add a complete draft. Locks of the earliest are given up before there are too many open files."""
        self._resources.push(resources)
        self._written.append(written)
        for earliest in self._written[:-_MOST_LOCKS][-1:]:
            earliest.lock.close()

    def put_in_place(self) -> None:
        """Send the streams, which may still fail, then replace the files."""
        for written in sorted(self._written, key=lambda each: not is_stream(each.path)):
            written.put_in_place()


@dataclass(frozen=True)
class _Written:
    """A draft, and the file that it becomes."""

    draft: Path
    path: AnyPath
    lock: ExitStack = field(default_factory=ExitStack)

    def finish(self) -> None:
        if is_stream(self.path):
            return
        _to_disk(self.draft)
        target = _target(self.path)
        if target.exists():
            self.draft.chmod(stat.S_IMODE(target.stat().st_mode))

    def put_in_place(self) -> None:
        with _disk_errors(self.path):
            if is_stream(self.path):
                _send(self.path, self.draft.read_bytes())
                return
            target = _target(self.path)
            self.draft.replace(target)
            _log.debug("wrote %s", printable(str(target)))
            with contextlib.suppress(OSError):  # flush the directory entry too, where the system can
                _to_disk(target.parent)


_batch: ContextVar[_Batch | None] = ContextVar("_batch", default=None)


@contextmanager
def _joined_batch() -> Iterator[_Batch]:
    """Join the batch of an outer block, or open one and put its files in place at the end."""
    outer = _batch.get()
    if outer is not None:
        yield outer
        return
    with ExitStack() as resources:
        batch = _Batch(resources)
        outside = _batch.set(batch)
        try:
            yield batch
        finally:
            _batch.reset(outside)
        batch.put_in_place()


@contextmanager
def _disk_errors(path: AnyPath) -> Iterator[None]:
    """Report what the disk refuses, in words that name the file."""
    try:
        yield
    except (OSError, ValueError) as error:
        raise GpError(f"cannot be written ({_reason(error)})", file=path, remedy=_remedy(error)) from None


def _target(path: AnyPath) -> Path:
    return Path(os.path.realpath(path))  # keep a symbolic link


def _begin_file(path: AnyPath, resources: ExitStack) -> _Written:
    """Create a temporary file beside a file, which `remove_drafts` ignores while this program runs."""
    target = _target(path)
    _check_target(target, path)
    remove_drafts(target.parent, target.name)
    name = os.fsdecode(os.fsencode(target.name)[:_LONGEST_NAME])
    draft = target.with_name(f".{name}.{os.urandom(4).hex()}.tmp{_ending(target)[:20]}")
    descriptor = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
    lock = resources.enter_context(ExitStack())
    lock.callback(os.close, descriptor)
    resources.callback(draft.unlink, missing_ok=True)
    if fcntl is None:
        lock.close()  # Windows cannot rename an open file
    else:
        with contextlib.suppress(OSError):  # a file system without locks
            fcntl.flock(descriptor, fcntl.LOCK_EX)
    return _Written(draft, path, lock)


def _begin_stream(path: AnyPath, resources: ExitStack) -> _Written:
    """Return a temporary file for what goes to a stream."""
    import tempfile

    folder = resources.enter_context(tempfile.TemporaryDirectory())
    return _Written(Path(folder, f"draft{_ending(Path(path))}"), path)


def remove_drafts(folder: Path, name: str | None = None) -> None:
    """Delete temporary files that killed programs left in a folder.

    Parameters
    ----------
    folder : Path
        Where.
    name : str, optional
        Only those of this file, and old ones of others; by default all.
    """
    with contextlib.suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            match = _DRAFT.fullmatch(entry.name)
            if match is None:
                continue
            if name in (None, match["name"]) or time.time() - entry.stat().st_mtime > _FORGOTTEN_SECONDS:
                _remove_unless_locked(Path(entry.path))


def _check_target(target: Path, path: AnyPath) -> None:
    if target.is_dir():
        raise GpError("is a folder, not a file", file=path, remedy="Name a file in it.")
    if target.exists() and not target.is_file():
        raise GpError("is neither a file nor a pipe", file=path, remedy="Name another file.")
    as_we_are = os.access in os.supports_effective_ids
    if target.exists() and not os.access(target, os.W_OK, effective_ids=as_we_are):  # the folder is enough
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))


def _ending(path: Path) -> str:
    """Return the suffix, of a compressed file with the one before: writers choose the format by it."""
    return "".join(path.suffixes[-2:]) if path.suffix.lower() == ".gz" else path.suffix


def _remove_unless_locked(draft: Path) -> None:
    with contextlib.suppress(OSError):
        descriptor = os.open(draft, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0))
        try:
            if fcntl is not None:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        finally:
            os.close(descriptor)
        draft.unlink()


def _to_disk(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _reason(error: Exception) -> object:
    return getattr(error, "strerror", None) or error  # ValueError: a name that no system can hold


def _remedy(error: Exception) -> str:
    if getattr(error, "errno", None) in _FULL:
        return FREE_SPACE
    return "Check the folder and its permissions."


# Devices, pipes and the program's own streams


def is_stream(path: AnyPath) -> bool:
    """Whether a path is a device or pipe: written to, never replaced.

    Parameters
    ----------
    path : path-like
        Any path.

    Returns
    -------
    bool
        True for devices, pipes and descriptors such as ``/dev/stdout``.
    """
    if _own_descriptor(path) is not None:
        return True
    with contextlib.suppress(OSError):
        mode = Path(path).stat().st_mode
        return stat.S_ISCHR(mode) or stat.S_ISFIFO(mode)
    return False


def _own_descriptor(path: AnyPath) -> int | None:
    name = str(Path(path).absolute())
    match = _DESCRIPTOR.fullmatch(name)
    return int(match["number"]) if match else _STREAMS.get(name)


def _send(path: AnyPath, content: bytes) -> None:
    own = _own_descriptor(path)
    descriptor = _opened_stream(path) if own is None else os.dup(own)
    with os.fdopen(descriptor, "wb") as stream:
        stream.write(content)


def _opened_stream(path: AnyPath) -> int:
    """Open a device, or a pipe that has a reader, or will soon have one."""
    end = time.monotonic() + PIPE_PATIENCE_S
    while True:
        try:
            descriptor = os.open(path, os.O_WRONLY | getattr(os, "O_NONBLOCK", 0))
            break
        except OSError as error:
            if error.errno != errno.ENXIO:
                raise
            if time.monotonic() > end:
                raise OSError(errno.ENXIO, "nobody reads this pipe") from None
        time.sleep(0.05)
    os.set_blocking(descriptor, True)
    return descriptor


# What a command reads


@contextmanager
def protected_inputs(paths: Iterable[AnyPath] = ()) -> Iterator[None]:
    """Protect files from being overwritten, also through links, together with those that `protect` adds.

    Parameters
    ----------
    paths : iterable of path-like
        The files that a command reads.

    Yields
    ------
    None
        While they are protected.
    """
    before = dict(_protected)
    try:
        for path in paths:
            protect(path)
        yield
    finally:
        _protected.clear()
        _protected.update(before)


def protect(path: AnyPath) -> None:
    """Protect a file from being overwritten until the command ends.

    Parameters
    ----------
    path : path-like
        The file.
    """
    found = _identity(path)
    if found is not None:
        _protected.setdefault(found, os.fspath(path))


def is_protected(path: AnyPath) -> bool:
    """Whether a file is an input of the command.

    Parameters
    ----------
    path : path-like
        Any path.

    Returns
    -------
    bool
        True also for links to such a file.
    """
    return _identity(path) in _protected


def _refuse_protected(path: AnyPath) -> None:
    if is_protected(path):
        raise GpError("is an input, and would be overwritten", file=path, remedy="Name another file.")


def _identity(path: AnyPath) -> tuple[int, int] | None:
    """Return device and inode of a plain file; None where there is none."""
    with contextlib.suppress(OSError, ValueError):
        status = Path(path).stat()
        if stat.S_ISREG(status.st_mode):
            return status.st_dev, status.st_ino
    return None
