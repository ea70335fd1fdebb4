"""``-`` on a command line: standard input where a file is read, standard output where one is written.

What is read is first copied to a temporary file whose ending tells its kind, found from its content, and what
is written is copied out when the command is done. So every reader and writer works as with any other file.
Text for people goes to standard error while standard output carries a file.
"""

from __future__ import annotations

import argparse
import contextlib
import gzip
import os
import re
import shutil
import sys
import tempfile
import zlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from gp_core.errors import FileFormatError, GpError

__all__ = ["STANDARD", "kind_of", "shown_name", "shown_path", "standard_streams"]

STANDARD = "-"

_INPUT, _OUTPUT = "standard input", "standard output"
_PREFIX = "gp-streams-"
_CHUNK_BYTES = 1 << 20
_HEAD_BYTES = 4096
_MOST_BYTES = 200_000_000_000

_MAGIC = (
    (b"NRRD", ".nrrd"),
    (b"II*\0", ".tif"),
    (b"MM\0*", ".tif"),
    (b"II+\0", ".tif"),
    (b"MM\0+", ".tif"),
    (b"\x89PNG", ".png"),
    (b"MATLAB 5.0", ".mat"),
    (b"ply\n", ".ply"),
    (b"ply\r\n", ".ply"),
    (b"solid ", ".stl"),
    (b"ObjectType", ".mha"),
    (b"NDims", ".mha"),
)
_TOML = re.compile(r"(?:#[^\n]*\n|\s)*(?:\[\[?\s*[A-Za-z_]|[A-Za-z_]+\s*=)")
_NUMBERS = re.compile(r"[-+0-9.eE\s]+")


@contextmanager
def standard_streams(
    args: argparse.Namespace, written: Mapping[str, str], read: Iterable[str], *, folders: Iterable[str] = ()
) -> Iterator[None]:
    """Replace ``-`` among the options of a command by files, while the command runs.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options; changed.
    written : mapping of str to str
        Options whose file is written, and the ending of what goes to standard output.
    read : iterable of str
        Options and arguments whose file is read, or whose files are.
    folders : iterable of str
        Options that name a folder, or a file that is read and written.

    Yields
    ------
    None
        While the command runs.

    Raises
    ------
    GpError
        One of `folders`, or two files, would come from or go to one stream; or the kind of the input is not
        known.
    """
    values = vars(args)
    for name in folders:
        if _is_standard(values.get(name)):
            raise GpError(f"{_option(name)} cannot be a stream", remedy="Give a path in place of -.")
    inputs = [name for name in read for word in _words(values.get(name)) if _is_standard(word)]
    outputs = [name for name in written if _is_standard(values.get(name))]
    for names, stream in ((inputs, _INPUT), (outputs, _OUTPUT)):
        if len(names) > 1:
            raise GpError(f"only one file can be {stream}", remedy="Name files for the others.")
    if not inputs and not outputs:
        yield
        return
    with tempfile.TemporaryDirectory(prefix=_PREFIX) as folder, _named(folder):
        for name in inputs:
            values[name] = _replaced(values[name], _received(Path(folder)))
        for name in outputs:
            values[name] = _replaced(values[name], Path(folder, _OUTPUT + written[name]))
        if not outputs:
            yield
            return
        with contextlib.redirect_stdout(sys.stderr):
            yield
        _send(Path(str(values[outputs[0]])))


def shown_name(path: str | os.PathLike[str]) -> str:
    """Return the name of a file for people: ``standard input`` for what came from there.

    Parameters
    ----------
    path : path-like
        As an option names it while its command runs.

    Returns
    -------
    str
        Without folders.
    """
    file = Path(path)
    is_stream = file.parent.name.startswith(_PREFIX) and file.name.startswith(_INPUT)
    return _INPUT if is_stream else file.name


def shown_path(path: str | os.PathLike[str]) -> str:
    """Return a path for people: ``standard output`` or ``standard input`` in place of a temporary file.

    Parameters
    ----------
    path : path-like
        As an option names it while its command runs.

    Returns
    -------
    str
        As it was given, unless it was ``-``.
    """
    file = Path(path)
    return file.stem if file.parent.name.startswith(_PREFIX) else str(path)


def _is_standard(value: object) -> bool:
    return isinstance(value, str | Path) and str(value) == STANDARD


def _words(value: Any) -> list[Any]:
    return list(value) if isinstance(value, list | tuple) else [value]


def _replaced(value: Any, file: Path) -> Any:
    """Return the value of an option with the file in place of ``-``, as text or path like that."""
    if isinstance(value, list | tuple):
        return [_replaced(word, file) for word in value]
    if not _is_standard(value):
        return value
    return file if isinstance(value, Path) else str(file)


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"


@contextmanager
def _named(folder: str) -> Iterator[None]:
    """Let messages say ``standard input`` in place of the temporary file's path."""
    try:
        yield
    except GpError as error:
        if error.file is None or folder not in error.file:
            raise
        name = error.file.replace(folder + os.sep, "")
        for stream in (_INPUT, _OUTPUT):
            name = re.sub(re.escape(stream) + r"\.[a-z.]+", stream, name)
        raise type(error)(
            error.problem,
            file=name,
            specimen=error.specimen,
            landmark=error.landmark,
            remedy=error.remedy,
        ) from None


def _received(folder: Path) -> Path:
    """Copy standard input to a file whose ending tells its kind."""
    draft = folder / "received"
    source: Any = getattr(sys.stdin, "buffer", None)
    if source is None:
        raise FileFormatError("is closed", file=_INPUT, remedy="Give a file.")
    size = 0
    with draft.open("wb") as file:
        while chunk := source.read(_CHUNK_BYTES):
            size += len(chunk)
            if size > _MOST_BYTES:
                raise FileFormatError("is endless", file=_INPUT, remedy="Give a file.")
            file.write(chunk)
    with draft.open("rb") as file:
        head = file.read(_HEAD_BYTES)
    if not head.strip():
        raise FileFormatError("is empty", file=_INPUT, remedy="Pipe a file into the command.")
    return draft.rename(folder / (_INPUT + kind_of(head)))


def kind_of(head: bytes) -> str:
    """Return the ending of a file from its beginning.

    Parameters
    ----------
    head : bytes
        The first few thousand bytes.

    Returns
    -------
    str
        Such as ``.mrk.json``, ``.csv`` or ``.nrrd``.

    Raises
    ------
    FileFormatError
        The content is of no known kind.

    Examples
    --------
    >>> kind_of(b"name,x,y,z"), kind_of(b'{"gpPose": 1'), kind_of(b"1 2 3")
    ('.csv', '.json', '.dat')
    """
    if head.startswith(b"\x1f\x8b"):
        return _compressed_kind(head)
    for magic, ending in _MAGIC:
        if head.startswith(magic):
            return ending
    if head[344:347] == b"n+1" or head[4:8] == b"n+2\0":
        return ".nii"
    if head[128:132] == b"DICM":
        return ".dcm"
    return _text_kind(head)


def _compressed_kind(head: bytes) -> str:
    with contextlib.suppress(zlib.error, OSError, EOFError, gzip.BadGzipFile):
        if kind_of(zlib.decompressobj(31).decompress(head)) == ".nii":
            return ".nii.gz"
    raise _unknown()


def _text_kind(head: bytes) -> str:
    utf16 = head.startswith((b"\xff\xfe", b"\xfe\xff"))
    text = head.decode("utf-16" if utf16 else "utf-8-sig", errors="ignore").lstrip()
    if "\0" in text or not text:
        raise _unknown()
    if _TOML.match(text):
        return ".toml"
    if text[0] in "{[":
        return ".mrk.json" if '"markups"' in text or "markups-schema" in text else ".json"
    if text.startswith("#") and ("Markups fiducial" in text or "CoordinateSystem" in text):
        return ".fcsv"
    if _NUMBERS.fullmatch(text):
        return ".dat"
    return ".tsv" if "\t" in text.splitlines()[0] else ".csv"


def _unknown() -> GpError:
    return FileFormatError("is of an unknown kind", file=_INPUT, remedy="Give a file.")


def _send(file: Path) -> None:
    """Copy what the command wrote to standard output; nothing where it wrote nothing."""
    if not file.is_file():
        return
    sys.stdout.flush()
    target = getattr(sys.stdout, "buffer", None)
    if target is None:
        sys.stdout.write(file.read_text(encoding="utf-8"))
    else:
        with file.open("rb") as source:
            shutil.copyfileobj(source, target)
    sys.stdout.flush()
