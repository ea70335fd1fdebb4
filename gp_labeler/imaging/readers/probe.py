"""Look at a path: which reader it is for, and what that reader finds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from os import PathLike
from pathlib import Path

from gp_core.extensions import Extensions
from gp_labeler.imaging.progress import Report
from gp_labeler.imaging.readers.added import Read, added_reader
from gp_labeler.imaging.readers.choosing import FEW
from gp_labeler.imaging.readers.dicom import inspect_dicom
from gp_labeler.imaging.readers.dicom_disc import lost_files
from gp_labeler.imaging.readers.dicom_tags import has_preamble, is_dicom, is_dicomdir
from gp_labeler.imaging.readers.formats import (
    DICOM_SUFFIXES,
    READABLE,
    SCANCO_SUFFIXES,
    SLICE_SUFFIXES,
    TIFF_SUFFIXES,
    VOLUME_SUFFIXES,
    is_readable_name,
    scanco_suffix,
    volume_kind,
)
from gp_labeler.imaging.readers.itk_image import inspect_itk_image
from gp_labeler.imaging.readers.naming import group_slices
from gp_labeler.imaging.readers.options import ImportOptions
from gp_labeler.imaging.readers.plan import ImportPlan, ScanReader
from gp_labeler.imaging.readers.problems import VolumeError, failing_as_volume_error, names, quiet, warning
from gp_labeler.imaging.readers.scanco import inspect_scanco
from gp_labeler.imaging.readers.stack import inspect_stack
from gp_labeler.imaging.readers.tiff import inspect_tiff, is_multi_page

__all__ = ["READERS", "inspect_path"]

_FEW_IMAGES = 20  # more than that are slices, and need not be opened to see it
_REMEDIES = {
    "A raw file needs its header: give the MHD or NHDR file that belongs to it.": ".raw",
    "Save it as TIFF stack, DICOM or MHD in the scanner's software.": ".vol .vgi .txm .txrm .xrm .tom .pcr",
    "Save it as NRRD in 3D Slicer (extension SlicerRT) first.": ".vff",
    "Save the scan in it as NRRD in 3D Slicer.": ".mrb .mrml",
    "It is the description of an OME-TIFF: give a TIFF file that belongs to it.": ".ome",
    "Save it as NIfTI or NRRD first.": ".mnc .mgz .mgh",
    "Save it as NRRD or MHA first.": ".vti",
    "Save it as NRRD or OME-TIFF in the program that it comes from, or in Fiji.": (
        ".zarr .n5 .h5 .hdf5 .he5 .ims .am .czi .lif .lsm .nd2 .oib .oir .stk .dv .mrc .rec .ics .ids .inr"
    ),
    "Unpack it first.": ".gz .bz2 .xz .zst .zip .7z .rar .tar .tgz",
    "This format has neither voxel size nor directions: save it as NRRD or MHA first.": ".npy .npz",
    "This is a mesh; give the scan it was made from.": ".stl .ply .obj .vtp .glb .gltf",
}
_HINTS = {suffix: remedy for remedy, suffixes in _REMEDIES.items() for suffix in suffixes.split()}
_ZARR = (".zgroup", ".zattrs", ".zarray", "zarr.json")
"""Files that make a folder a Zarr store; its voxels lie in thousands of others."""


def inspect_path(path: str | PathLike[str], options: ImportOptions, report: Report) -> ImportPlan:
    """Look into a file or folder under given options; see `inspect_volume`."""
    where = Path(path)
    if not where.exists():
        raise VolumeError("there is no such file or folder", file=where, remedy="Check the path.")
    with quiet(), failing_as_volume_error(where):
        if (store := _zarr_of(where)) is not None:
            problem = "it is a Zarr store, which is not read"
            raise VolumeError(problem, file=store, remedy=_HINTS[".zarr"])
        if where.is_dir():
            return _inspect_folder(where, options, report)
        if not where.is_file():
            raise VolumeError("it is not a regular file", file=where, remedy="Give a scan or its folder.")
        if where.stat().st_size == 0:
            raise VolumeError("it is empty", file=where, remedy="Copy it again.")
        return _inspect_file(where, options, report)


def _inspect_file(path: Path, options: ImportOptions, report: Report) -> ImportPlan:
    """Look into a file by the first reader that knows it."""
    reader = next((reader for reader in _readers() if reader.knows(path)), None)
    if reader is None:
        raise VolumeError("its format is not known", file=path, remedy=_remedy([path]))
    return reader.inspect(path, options, report)


def _readers() -> Iterator[ScanReader]:
    """Yield all readers; no package is imported for a file that one of those built in knows."""
    yield from _BUILT_IN
    yield from _added_readers()


def _added_readers() -> Iterator[ScanReader]:
    for ending, read in READERS.added.items():
        yield added_reader(ending, read, READERS.described(ending), partial(READERS.failure, ending))


def _inspect_folder(folder: Path, options: ImportOptions, report: Report) -> ImportPlan:
    """Look into the only scan of a folder; few images beside it, such as screenshots, are named, not read."""
    files = _files(folder)
    images = _images(files)
    others = sorted(set(files) - set(images))
    dicom = [file for file in others if is_dicom(file) and not is_dicomdir(file)]
    directory = None if dicom else next(filter(is_dicomdir, files), None)
    if directory is not None and (disc := _dicom_below(folder)):
        plan = inspect_dicom(folder, disc, options, report)
        return replace(plan, found=(*plan.found, *lost_files(directory)))
    few = images if len(images) <= _FEW_IMAGES else []
    known = set(dicom)
    volumes = [file for file in (*others, *few) if file not in known and _is_volume(file)]
    slices = sorted(set(images) - set(volumes))
    stack = max((len(group.files) for group in group_slices(slices)), default=0)
    if len(volumes) + bool(dicom) > 1:
        raise _several(folder, volumes, dicom, slices if stack > 1 else [])
    if volumes or dicom:
        plan = (
            inspect_dicom(folder, others, options, report)
            if dicom
            else _inspect_file(volumes[0], options, report)
        )
        if stack > 1 and stack >= FEW * plan.size[2]:
            raise _several(folder, volumes, dicom, slices)
        text = f"images beside it are left out: {names(slices)}"
        return replace(plan, found=(*plan.found, warning("stray", text))) if slices else plan
    if images:
        return inspect_stack(folder, images, options, report)
    return _inspect_below(folder, files, options, report)


def _remedy(files: Sequence[Path]) -> str:
    """Return what to do about files that nobody reads: by the name of the first that is known."""
    known = (_HINTS[file.suffix.lower()] for file in files if file.suffix.lower() in _HINTS)
    return next(known, f"Readable are {READABLE}.")


def _zarr_of(path: Path) -> Path | None:
    """Return the Zarr store that a path names, or of which it names the description."""
    folder = path if path.is_dir() else path.parent
    is_meant = path.is_dir() or path.name in _ZARR
    return folder if is_meant and any((folder / name).is_file() for name in _ZARR) else None


def _several(
    folder: Path, volumes: Sequence[Path], dicom: Sequence[Path], slices: Sequence[Path]
) -> VolumeError:
    """Return the question which scan of a folder is meant."""
    kinds = [names(volumes, 12)] if volumes else []
    kinds += [f"{len(dicom)} DICOM files ({names(dicom, 1)})"] if dicom else []
    kinds += [f"{len(slices)} images ({names(slices, 1)})"] if slices else []
    what = "several volumes" if len(kinds) == 1 else "several scans"
    return VolumeError(
        f"it holds {what}: {'; '.join(kinds)}",
        file=folder,
        remedy="Give one of them: a file, or any file of a series or stack.",
    )


def _inspect_below(folder: Path, files: Sequence[Path], options: ImportOptions, report: Report) -> ImportPlan:
    """Go into the only subfolder that holds anything, as DICOM exports nest them."""
    if (store := next(filter(None, map(_zarr_of, _children(folder))), None)) is not None:
        problem = f"it holds no scan, only {store.name}"
        raise VolumeError(problem, file=folder, remedy=_HINTS[".zarr"])
    below = [
        sub
        for sub in _subfolders(folder)
        if any(is_readable_name(file) or is_dicom(file) for file in _files(sub))
    ]
    if len(below) > 1 and all(any(map(is_dicom, _files(sub))) for sub in below):
        return inspect_dicom(folder, _dicom_below(folder), options, report)
    if len(below) == 1:
        return _inspect_folder(below[0], options, report)
    if below:
        text = f"the scans are in its folders {names(below, 12)}"
        raise VolumeError(text, file=folder, remedy="Give one of these folders.")
    holds = f"only {names(files)}" if files else "nothing"
    raise VolumeError(f"it holds no scan, {holds}", file=folder, remedy=_remedy(files))


def _dicom_below(folder: Path) -> list[Path]:
    """Return the DICOM files of all subfolders, where discs and exports keep a folder for each series."""
    return [file for sub in _subfolders(folder) for file in _files(sub) if is_dicom(file)]


def _is_volume(path: Path) -> bool:
    """Return whether a file of a folder is a whole volume by itself."""
    if path.suffix.lower() in TIFF_SUFFIXES:
        try:
            return path.stat().st_size > 0 and is_multi_page(path)
        except Exception:  # a broken slice: the stack reader names it
            return False
    if volume_kind(path) is not None or scanco_suffix(path) in SCANCO_SUFFIXES:
        return path.suffix.lower() != ".img"
    return any(path.name.lower().endswith(f".{ending.lower()}") for ending in READERS.added)


def _begins(path: Path, magic: bytes) -> bool:
    with path.open("rb") as file:
        return file.read(len(magic)) == magic


def _siblings(path: Path) -> list[Path]:
    return _files(path.parent)


def _files(folder: Path) -> list[Path]:
    return sorted(file for file in folder.iterdir() if file.is_file() and not file.name.startswith("."))


def _children(folder: Path) -> list[Path]:
    return sorted(sub for sub in folder.iterdir() if sub.is_dir())


def _subfolders(folder: Path) -> list[Path]:
    return sorted(sub for sub in folder.rglob("*") if sub.is_dir() and not sub.name.startswith("."))


def _images(files: Sequence[Path]) -> list[Path]:
    """Return the files that are named as images; some programs name DICOM slices so."""
    named = (file for file in files if file.suffix.lower() in SLICE_SUFFIXES)
    return [file for file in named if not has_preamble(file)]


# What is built in


def _itk_kind(path: Path) -> str | None:
    """Return the format of `VOLUME_SUFFIXES` that a file is of, by its name or its content."""
    if (kind := volume_kind(path)) is not None:
        return kind
    if path.suffix.lower() in (*SLICE_SUFFIXES, *TIFF_SUFFIXES, *DICOM_SUFFIXES):
        return None
    with path.open("rb") as file:
        head = file.read(352)
    if head.startswith(b"NRRD000"):
        return "NRRD"
    if head[344:348] == b"n+1\0" or head[4:8] == b"n+2\0":
        return "NIfTI"
    return "MetaImage" if head.startswith((b"ObjectType", b"NDims")) else None


def _inspect_itk(path: Path, options: ImportOptions, report: Report) -> ImportPlan:
    return inspect_itk_image(path, options, _itk_kind(path) or "")


def _is_dicom_file(path: Path) -> bool:
    return is_dicom(path) or path.suffix.lower() in DICOM_SUFFIXES


def _is_tiff(path: Path) -> bool:
    return path.suffix.lower() in TIFF_SUFFIXES and is_multi_page(path)


def _is_slice(path: Path) -> bool:
    return path.suffix.lower() in SLICE_SUFFIXES


def _is_skyscan_log(path: Path) -> bool:
    return path.suffix.lower() == ".log" and bool(_images(_siblings(path)))


def _is_scanco(path: Path) -> bool:
    return scanco_suffix(path) in SCANCO_SUFFIXES or _begins(path, b"CTDATA-HEADER_V1")


def _inspect_disc(path: Path, options: ImportOptions, report: Report) -> ImportPlan:
    return _inspect_folder(path.parent, options, report)


def _inspect_series(path: Path, options: ImportOptions, report: Report) -> ImportPlan:
    return inspect_dicom(path.parent, _siblings(path), options, report, chosen=path)


def _inspect_slices(path: Path, options: ImportOptions, report: Report) -> ImportPlan:
    chosen = path if _is_slice(path) else None
    return inspect_stack(path.parent, _images(_siblings(path)), options, report, chosen=chosen)


_BUILT_IN = tuple(
    ScanReader(tuple(suffix.lstrip(".") for suffix in suffixes), knows, inspect)
    for suffixes, knows, inspect in (
        ((), lambda path: has_preamble(path) and not is_dicomdir(path), _inspect_series),
        (tuple(VOLUME_SUFFIXES), lambda path: _itk_kind(path) is not None, _inspect_itk),
        (("dicomdir",), is_dicomdir, _inspect_disc),
        (DICOM_SUFFIXES, _is_dicom_file, _inspect_series),
        (TIFF_SUFFIXES, _is_tiff, lambda path, options, _: inspect_tiff(path, options)),
        (SLICE_SUFFIXES, _is_slice, _inspect_slices),
        ((".log",), _is_skyscan_log, _inspect_slices),
        (SCANCO_SUFFIXES, _is_scanco, lambda path, options, _: inspect_scanco(path, options)),
    )
)
"""In the order in which they are asked; what a file holds counts more than how it is named."""

READERS: Extensions[ScanReader | Read] = Extensions(
    "gp_labeler.readers", {ending: reader for reader in _BUILT_IN for ending in reader.endings}
)
"""Readers by the endings of their files' names, those of installed packages among them."""
