"""The directory of a DICOM disc: the files that it names."""

from __future__ import annotations

from pathlib import Path, PurePosixPath

import pydicom

from gp_labeler.imaging.readers.problems import Problem, names, warning

__all__ = ["lost_files"]


def lost_files(directory: Path) -> tuple[Problem, ...]:
    """Return a warning of the images that the directory of a disc names, and that are not there.

    Parameters
    ----------
    directory : Path
        The file ``DICOMDIR``.
    """
    try:
        records = pydicom.dcmread(directory).get("DirectoryRecordSequence") or []
        named = [_file_of(one) for one in records if str(one.get("DirectoryRecordType", "")) == "IMAGE"]
    except Exception:  # a damaged directory: the files count, which say more of themselves
        return ()
    folder = directory.parent
    there = {_plain(file.relative_to(folder).as_posix()) for file in folder.rglob("*") if file.is_file()}
    lost = [name for name in named if name and _plain(name) not in there]
    if not lost:
        return ()
    return (warning("lost", f"{directory.name} names images that are not there: {names(lost)}"),)


def _file_of(record: pydicom.Dataset) -> str:
    parts = record.get("ReferencedFileID") or ""
    return str(PurePosixPath(*([parts] if isinstance(parts, str) else map(str, parts)))) if parts else ""


def _plain(name: str) -> str:
    """Return a name as it is compared: systems show those of a disc in small letters, or with a version."""
    return name.lower().removesuffix(";1").removesuffix(".")
