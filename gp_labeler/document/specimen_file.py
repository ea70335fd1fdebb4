"""The specimen file, ``<specimen>.gpspecimen.json``: what the application saves.

Layout (version 4): ``format``, ``version``, ``application``, ``specimen``, ``volume`` (name, size, spacing,
checksum, path, and path relative to the file), ``landmarks`` (by ``L``, ``R`` and ``both``, then by feature
code: position in scan mm, LPS, or suggestion; unseen, locked, checked; provenance, certainty, note),
``observer``, ``round`` and ``blind`` of that labelling, ``other_labellings`` (each with the same entries),
``threshold``, ``import_choices``, ``headFrame`` (how the head lies in the scan, and whether that is shown),
``notes``, ``pose_checks`` and ``thumbnail`` (PNG, base64). A file without certainties, notes, observer and
other labellings says version 3, which earlier programs read.
"""

from __future__ import annotations

import base64
import binascii
import hashlib
import json
import os
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from os import PathLike
from pathlib import Path
from typing import Any

from gp_core.disk import read_bytes, read_json, write_text
from gp_core.errors import FileFormatError, GpError
from gp_labeler.document.specimen_json import Document, document_of, state_of
from gp_labeler.document.state import SpecimenState

__all__ = [
    "SUFFIX",
    "application",
    "digest",
    "read_document",
    "read_specimen",
    "state_in",
    "thumbnail_in",
    "write_specimen",
]

SUFFIX = ".gpspecimen.json"
FORMAT = "gp-labeler specimen"
VERSION = 4


def application() -> str:
    """Return the program's name and version, as written into files."""
    try:
        return f"gp-labeler {version('gp-labeler')}"
    except PackageNotFoundError:
        return "gp-labeler (from source)"


def write_specimen(
    path: str | PathLike[str], state: SpecimenState, *, thumbnail: bytes | None = None
) -> None:
    """Write a specimen file, all of it or nothing.

    Parameters
    ----------
    path : path
        The file.
    state : SpecimenState
        What to write.
    thumbnail : bytes, optional
        A small picture for lists of specimens, PNG.

    Raises
    ------
    GpError
        It cannot be written there; what was there before is untouched.
    """
    target = Path(path)
    document = document_of(state)
    document = {"format": FORMAT, "version": _version(document), "application": application(), **document}
    document = _with_relative_path(document, target.absolute().parent)
    if thumbnail:
        document["thumbnail"] = base64.b64encode(thumbnail).decode()
    text = json.dumps(document, indent=1, allow_nan=False) + "\n"
    write_text(target, text)


def read_specimen(path: str | PathLike[str]) -> SpecimenState:
    """Read a specimen file.

    The volume's path is the one relative to the file where a volume is there (the folder may have been moved
    or copied as a whole), else the one it had when it was saved.

    Raises
    ------
    GpError
        It cannot be opened, is no specimen file, is of a newer version, or an entry is not what it should be.
    """
    return state_in(read_document(path), path)


def read_document(path: str | PathLike[str]) -> Mapping[str, Any]:
    """Read the document of a specimen file as it was saved; raises as `read_specimen` does."""
    source = Path(path)
    content = read_json(source, what="specimen file", remedy=f"Choose a *{SUFFIX} file.")
    _check_header(content, source)
    return _with_found_volume(content, source.absolute().parent)


def thumbnail_in(document: Mapping[str, Any]) -> bytes:
    """Return the picture in the document of a specimen file, PNG; empty where there is none."""
    text = document.get("thumbnail")
    try:
        return base64.b64decode(text, validate=True) if isinstance(text, str) else b""
    except (binascii.Error, ValueError):
        return b""


def state_in(document: Mapping[str, Any], path: str | PathLike[str]) -> SpecimenState:
    """Return the state of the document that was read from `path`; raises `FileFormatError`."""
    try:
        return state_of(document)
    except GpError as error:
        raise FileFormatError(
            error.problem, file=path, landmark=error.landmark, remedy=error.remedy
        ) from None


def _version(document: Document) -> int:
    """Return the oldest version whose programs lose nothing of a document."""
    marks = [mark for of_side in document["landmarks"].values() for mark in of_side.values()]
    is_new = any("certainty" in mark or "note" in mark for mark in marks)
    is_new |= any(key in document for key in ("observer", "round", "blind", "other_labellings"))
    return VERSION if is_new else VERSION - 1


def _check_header(content: Any, source: Path) -> None:
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise FileFormatError("is not a specimen file", file=source, remedy=f"Choose a *{SUFFIX} file.")
    found = content.get("version")
    if not isinstance(found, int) or found < 1:
        raise FileFormatError(f"version must be a whole number from 1, got {found!r:.20}", file=source)
    if found > VERSION:
        raise FileFormatError(
            f"was saved by a newer program (version {found}, this one reads up to {VERSION})",
            file=source,
            remedy="Update gp-labeler.",
        )


def _with_relative_path(document: Document, folder: Path) -> Document:
    path = document.get("volume", {}).get("path")
    if not path:
        return document
    try:
        relative = os.path.relpath(path, folder)
    except ValueError:  # another drive
        return document
    return document | {"volume": document["volume"] | {"relative_path": Path(relative).as_posix()}}


def _with_found_volume(document: Mapping[str, Any], folder: Path) -> Mapping[str, Any]:
    volume = document.get("volume")
    relative = volume.get("relative_path") if isinstance(volume, dict) else None
    if not isinstance(relative, str) or not (folder / relative).exists():
        return document
    assert isinstance(volume, dict)
    saved = volume.get("path")
    found = os.path.normpath(folder / relative)
    if isinstance(saved, str) and Path(saved).exists() and Path(saved).samefile(found):
        return document
    return {**document, "volume": volume | {"path": found}}


def digest(path: str | PathLike[str]) -> str | None:
    """Return a checksum of a file's bytes; None where there is no such file."""
    try:
        return hashlib.blake2b(read_bytes(path), digest_size=16).hexdigest()
    except GpError:
        return None
