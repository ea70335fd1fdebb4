"""File names of scans; kept apart, so that a file dialog need not load the readers."""

from __future__ import annotations

from pathlib import Path

__all__ = [
    "DICOM_SUFFIXES",
    "READABLE",
    "SCANCO_SUFFIXES",
    "SLICE_SUFFIXES",
    "TIFF_SUFFIXES",
    "VOLUME_SUFFIXES",
    "is_readable_name",
    "scanco_suffix",
    "volume_kind",
    "volume_stem",
]

READABLE = (
    "NRRD, NHDR, MHA, MHD, NIfTI, DICOM, TIFF (one file or a stack), BMP, PNG or JPEG stacks, "
    "SkyScan folders, Scanco ISQ"
)
VOLUME_SUFFIXES = {
    ".nrrd": "NRRD",
    ".nhdr": "NRRD",
    ".mha": "MetaImage",
    ".mhd": "MetaImage",
    ".nii": "NIfTI",
    ".nii.gz": "NIfTI",
    ".hdr": "Analyze",
    ".img": "Analyze",
    ".hdr.gz": "Analyze",
    ".img.gz": "Analyze",
    ".gipl": "GIPL",
    ".vtk": "VTK image",
}
TIFF_SUFFIXES = (".tif", ".tiff", ".btf", ".tf8")
SLICE_SUFFIXES = (".tif", ".tiff", ".bmp", ".png", ".jpg", ".jpeg", ".jp2")
DICOM_SUFFIXES = (".dcm", ".dicom", ".ima")
SCANCO_SUFFIXES = (".isq", ".rsq", ".aim")


def volume_kind(path: Path) -> str | None:
    """Return the format in `VOLUME_SUFFIXES` that a name speaks of, or None."""
    name = path.name.lower()
    fitting = [suffix for suffix in VOLUME_SUFFIXES if name.endswith(suffix)]
    return VOLUME_SUFFIXES[max(fitting, key=len)] if fitting else None


def volume_stem(path: Path) -> str:
    """Return the file name without what says its format (``head.nii.gz`` -> ``head``)."""
    name = path.name
    for suffix in (*sorted(VOLUME_SUFFIXES, key=len, reverse=True), ".ome.tif", ".ome.tiff"):
        if name.lower().endswith(suffix):
            return name[: -len(suffix)]
    return path.stem


def scanco_suffix(path: Path) -> str:
    """Return the suffix in lower case, without the version number that VMS appends (``C001.ISQ;1``)."""
    return path.suffix.lower().partition(";")[0]


def is_readable_name(path: Path) -> bool:
    """Return whether a file's name alone says that it may be a scan."""
    suffixes = (*SLICE_SUFFIXES, *TIFF_SUFFIXES, *DICOM_SUFFIXES)
    return (
        volume_kind(path) is not None
        or path.suffix.lower() in suffixes
        or scanco_suffix(path) in SCANCO_SUFFIXES
    )
