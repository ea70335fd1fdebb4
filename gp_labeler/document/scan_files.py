"""Scans in a folder, told by the names of files alone: none is opened."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from gp_labeler.imaging.readers.formats import (
    DICOM_SUFFIXES,
    SCANCO_SUFFIXES,
    SLICE_SUFFIXES,
    TIFF_SUFFIXES,
    scanco_suffix,
    volume_kind,
)

__all__ = ["is_slice_folder", "scan_files"]

_FEWEST_SLICES = 20
"""So many slices, whose names differ in their numbers alone, are a scan; fewer may be other pictures."""

_SMALLEST_TIFF_BYTES = 1 << 22
"""A TIFF file of at least 4 MB may be a whole scan; a smaller one is a picture."""

_NO_SCANS = (".seg.nrrd", ".seg.nhdr", "-label.nrrd", "-label.nii.gz", ".vtk")
"""Segmentations and meshes, which have the suffixes of scans."""


def is_slice_folder(entries: Iterable[Path]) -> bool:
    """Return whether the entries of a folder are the slices of a scan, so that the folder is one.

    Parameters
    ----------
    entries : iterable of Path
        All that is in the folder.
    """
    suffixes = (*SLICE_SUFFIXES, *DICOM_SUFFIXES)
    slices = (entry.name for entry in entries if entry.suffix.lower() in suffixes)
    counts = Counter(re.sub(r"\d+", "#", name) for name in slices)
    return max(counts.values(), default=0) >= _FEWEST_SLICES


def scan_files(entries: Sequence[Path]) -> Iterator[Path]:
    """Return those entries of a folder that are a scan each.

    Parameters
    ----------
    entries : sequence of Path
        All that is in the folder, which is no scan as a whole.
    """
    names = {entry.name.lower() for entry in entries}
    for entry in entries:
        name = entry.name.lower()
        if entry.name.startswith(".") or name.endswith(_NO_SCANS) or not _may_be_scan(entry):
            continue
        if not _is_data_of(name, names) and entry.is_file():
            yield entry


def _may_be_scan(entry: Path) -> bool:
    if entry.suffix.lower() in TIFF_SUFFIXES:
        try:
            return entry.stat().st_size >= _SMALLEST_TIFF_BYTES
        except OSError:
            return False
    return volume_kind(entry) is not None or scanco_suffix(entry) in SCANCO_SUFFIXES


def _is_data_of(name: str, names: set[str]) -> bool:
    """Whether a file holds the voxels of a header that lies beside it: ``head.img`` of ``head.hdr``."""
    stem, dot, rest = name.partition(".img")
    return bool(dot) and f"{stem}.hdr{rest}" in names
