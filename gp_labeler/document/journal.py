"""The journal: what makes every confirmed edit outlive the program.

A journal is a file of JSON lines, each ``{"record": ..., "crc32": ...}``. The first record holds the whole
document as it was last saved; each further one what an edit changed in it (recovery needs nothing else, so
it depends on nothing but the format), and the edit itself, as a script has it (`edit_tables`). A record is on
the disk before the edit shows. An edit whose line was not finished was never confirmed. Damaged lines are
left out, with what no longer fits without them, and counted.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import re
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from gp_core.disk import make_folder, read_bytes, write_bytes
from gp_core.errors import FileFormatError, GpError
from gp_labeler.document.json_changes import difference, dumped, patched
from gp_labeler.document.specimen_file import application
from gp_labeler.document.specimen_json import Document, document_of, state_of
from gp_labeler.document.state import SpecimenState

__all__ = ["Entry", "Journal", "JournalContent", "base_line", "read_journal", "record_line"]

VERSION = 1
_MAX_BYTES = 1_000_000_000
_LINE = re.compile(rb'\{"record":(.*),"crc32":([0-9]{1,10})\}\n', re.DOTALL)


@dataclass(frozen=True)
class Entry:
    """One confirmed edit: what kind, its text, when, and the document after it.

    Kinds are ``edit``, ``merge`` (it continues the one before), ``undo``, ``redo`` and ``change``, which
    cannot be undone (another volume).
    """

    kind: str
    text: str
    time: str
    document: Document
    edit: Mapping[str, Any] | None = None


@dataclass(frozen=True)
class JournalContent:
    """What a journal says.

    Parameters
    ----------
    base : Document
        The document as last saved (or begun with).
    entries : tuple of Entry
        The edits since, oldest first.
    specimen_file : Path, optional
        The file the specimen is saved in; None where it never was.
    saved : str, optional
        Checksum of that file.
    n_bytes : int
        Length of the part that is whole.
    damage : str
        What of it cannot be read, in words; empty where nothing was damaged.
    """

    base: Document
    entries: tuple[Entry, ...]
    specimen_file: Path | None
    saved: str | None
    n_bytes: int
    damage: str = ""

    @property
    def document(self) -> Document:
        """The document after the last confirmed edit."""
        return self.entries[-1].document if self.entries else self.base

    @property
    def time(self) -> str:
        """When the last edit was made; empty where there is none."""
        return self.entries[-1].time if self.entries else ""


class Journal:
    """An open journal; see `Journal.create` and `Journal.resume`.

    Parameters
    ----------
    path : Path
        The file, whose first `n_bytes` are whole.
    n_records : int
        How many records these are.
    document : Document
        The document after them.
    """

    def __init__(self, path: Path, *, n_bytes: int, n_records: int, document: Document) -> None:
        self.path = path
        self._end = n_bytes
        self._n_records = n_records
        self._document = document
        self._file: BinaryIO | None = _opened(path)

    @classmethod
    def create(
        cls, path: Path, base: Document, *, specimen_file: Path | None, saved: str | None = None
    ) -> Journal:
        """Begin a journal at `base`, in place of what is at `path`.

        Parameters
        ----------
        path : Path
            Where; its folder is made if need be.
        base : Document
            What to begin with.
        specimen_file : Path, optional
            The file the specimen is saved in.
        saved : str, optional
            Checksum of that file.

        Raises
        ------
        GpError
            It cannot be written.
        """
        make_folder(path.parent)
        line = base_line(base, specimen_file, saved)
        write_bytes(path, line)
        return cls(path, n_bytes=len(line), n_records=1, document=base)

    @classmethod
    def resume(cls, path: Path, content: JournalContent) -> Journal:
        """Go on with a journal that was read, behind its last whole record."""
        return cls(
            path,
            n_bytes=content.n_bytes,
            n_records=1 + len(content.entries),
            document=content.document,
        )

    def append(
        self,
        kind: str,
        text: str,
        document: Document,
        *,
        time: str = "",
        edit: Mapping[str, Any] | None = None,
    ) -> None:
        """Write what leads from the last document to this one, and wait until the disk has it.

        Parameters
        ----------
        kind, text, time : str
            See `Entry`.
        document : Document
            The document after the edit.
        edit : mapping, optional
            The edit as a table; none for undo, redo and another scan.

        Raises
        ------
        GpError
            The disk is full or gone; the journal is as it was.
        """
        changes = difference(self._document, document)
        record = {"kind": kind, "n": self._n_records, "text": text, "time": time, "changes": changes}
        line = record_line(record if edit is None else record | {"edit": edit})
        try:
            self._write(line)
        except OSError as error:
            with contextlib.suppress(OSError):
                self._handle().truncate(self._end)
            raise GpError(
                f"the edit cannot be stored safely: {error.strerror}",
                file=self.path,
                remedy="It was not made. Free some disk space, then repeat it.",
            ) from None
        self._end += len(line)
        self._n_records += 1
        self._document = document

    def _write(self, line: bytes) -> None:
        file = self._handle()
        file.seek(self._end)
        if file.write(line) != len(line):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        file.truncate()  # what a torn line may have left behind
        os.fsync(file.fileno())

    def _handle(self) -> BinaryIO:
        if self._file is None:
            raise OSError(errno.EBADF, "the journal is closed")
        return self._file

    def restart(self, base: Document, *, specimen_file: Path | None, saved: str | None) -> None:
        """Begin again at `base`, which is saved; the arguments are those of `create`.

        Raises
        ------
        GpError
            It cannot be written; the journal goes on as it was.
        """
        line = base_line(base, specimen_file, saved)
        self.close()
        try:
            write_bytes(self.path, line)
        finally:
            self._file = _opened(self.path)
        self._end, self._n_records, self._document = len(line), 1, base

    def close(self) -> None:
        """Close the file and leave it where it is."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def remove(self) -> None:
        """Close and delete the file: all it holds is saved, or not wanted."""
        self.close()
        with contextlib.suppress(OSError):
            self.path.unlink()


def base_line(base: Document, specimen_file: Path | None, saved: str | None) -> bytes:
    """Return the first line of a journal; the arguments are those of `Journal.create`."""
    header = {"kind": "base", "n": 0, "version": VERSION, "application": application(), "document": base}
    return record_line(header | {"specimen_file": specimen_file and str(specimen_file), "saved": saved})


def _opened(path: Path) -> BinaryIO:
    try:
        return path.open("r+b", buffering=0)
    except OSError as error:
        raise GpError(f"cannot be opened: {error.strerror}", file=path) from None


def read_journal(path: Path) -> JournalContent:
    """Read what a journal confirms.

    Raises
    ------
    GpError
        It cannot be opened, its first record is damaged, or it is of a newer version.
    """
    content = read_bytes(path, what="journal", max_bytes=_MAX_BYTES)
    records, n_damaged = _records(content)
    header = records.pop(0) if records and records[0].get("kind") == "base" else None
    if header is None and not records:
        raise FileFormatError("is not a journal, or all of it is damaged", file=path)
    header = header or {"document": document_of(SpecimenState("recovered")), "version": VERSION}
    if not isinstance(header.get("document"), dict):
        raise FileFormatError("is not a journal", file=path)
    if header.get("version") != VERSION:
        raise FileFormatError(f"is a journal of version {header.get('version')}, not {VERSION}", file=path)
    entries, n_lost = _entries(header["document"], records)
    file = header.get("specimen_file")
    return JournalContent(
        header["document"],
        tuple(entries),
        Path(file) if file else None,
        header.get("saved"),
        content.rfind(b"\n") + 1,
        _damage(max(n_lost, n_damaged), "saved" in header, path) if n_lost or n_damaged else "",
    )


def _records(content: bytes) -> tuple[list[dict[str, Any]], int]:
    """Return the records that are whole, and the number of the lines that are not.

    What stands behind the last line is an edit that was being written when the program was killed.
    """
    *lines, tail = content.split(b"\n")
    found = [_record(line + b"\n") for line in lines]
    if _record(tail[:-1] + b"\n") is not None:  # all of it was written; its end is damaged
        found.append(None)
    whole = [record for record in found if record is not None]
    return whole, len(found) - len(whole)


def _entries(document: Document, records: list[dict[str, Any]]) -> tuple[list[Entry], int]:
    """Apply the records in turn; those that do not fit, for what they build on is lost, are counted."""
    entries: list[Entry] = []
    n_lost, expected = 0, 1
    for record in records:
        try:
            n = int(record["n"])
            changed = patched(document, record["changes"])
            kind = record["kind"]
            if n != expected or n_lost:
                state_of(changed)  # what it builds on is lost: it may not fit
                kind = "edit" if n != expected and kind != "change" else kind  # nor what it undoes be there
            entries.append(Entry(kind, record["text"], record["time"], changed, record.get("edit")))
        except (GpError, KeyError, TypeError, ValueError, OverflowError, IndexError, AttributeError):
            n_lost += 1
            continue
        n_lost += max(n - expected, 0)
        document, expected = changed, n + 1
    return entries, n_lost


def _damage(n_lost: int, has_header: bool, path: Path) -> str:
    edits = f"{n_lost} edit{'' if n_lost == 1 else 's'} in {path.name} cannot be read: the file is damaged"
    if has_header:
        return f"{edits}. All others are here, and a copy of the file is kept"
    return f"{edits}, also in what had been saved before; what was edited since is here. A copy is kept"


def record_line(record: Mapping[str, Any]) -> bytes:
    """Return a record as a line, with its checksum."""
    text = dumped(record)
    return f'{{"record":{text},"crc32":{zlib.crc32(text.encode())}}}\n'.encode()


def _record(line: bytes) -> dict[str, Any] | None:
    match = _LINE.fullmatch(line)
    if match is None or zlib.crc32(match[1]) != int(match[2]):
        return None
    record = json.loads(match[1])
    return record if isinstance(record, dict) else None
