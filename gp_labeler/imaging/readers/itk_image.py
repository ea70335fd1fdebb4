"""NRRD, MetaImage, NIfTI and their kin: geometry as SimpleITK reads it, voxels streamed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from gp_core.errors import GpError
from gp_labeler.imaging.readers.formats import volume_stem
from gp_labeler.imaging.readers.headers import (
    Header,
    nifti_head,
    read_meta_header,
    read_nifti_header,
    read_nrrd_header,
)
from gp_labeler.imaging.readers.options import ImportOptions, Spacing
from gp_labeler.imaging.readers.plan import Geometry, ImportPlan
from gp_labeler.imaging.readers.problems import Problem, VolumeError, warning
from gp_labeler.imaging.readers.simpleitk import ItkHeader, ItkSource, read_itk_header

__all__ = ["inspect_itk_image"]

_HEADERS: dict[str, Callable[[Path, int | None], Header]] = {
    "NRRD": read_nrrd_header,
    "MetaImage": read_meta_header,
    "NIfTI": read_nifti_header,
}


def inspect_itk_image(path: Path, options: ImportOptions, kind: str) -> ImportPlan:
    """Look into a file of a format in `VOLUME_SUFFIXES`.

    Raises
    ------
    VolumeError
        It is not what its name says, or cannot be read.
    """
    header = (
        _HEADERS[kind](path, options.channel)
        if kind in _HEADERS
        else Header(None, (path,), sides_known=False)
    )
    itk = _nifti_geometry(path) if kind == "NIfTI" else read_itk_header(path, kind)
    if itk.dtype.kind not in "iuf":
        raise VolumeError("its voxels are not plain numbers", file=path, remedy="Save the grey values only.")
    source = header.source
    if source is not None and (source.plane_shape[1::-1], source.n_planes) != (itk.size[:2], itk.size[2]):
        source = None  # an arrangement that only SimpleITK understands
    found, notes = _findings(path, header, itk, options)
    unit = header.unit_mm
    return ImportPlan(
        path=path,
        format=kind,
        files=header.files,
        size=itk.size,
        stored_dtype=_stored_dtype(header, itk),
        source=source or ItkSource(path, options.channel),
        geometry=Geometry(
            spacing=_scaled(itk.spacing, unit),
            origin=_scaled(itk.origin, unit),
            direction=itk.direction,
            sides_known=header.sides_known,
        ),
        found=found,
        notes=(*header.notes, *notes),
        options=options,
        name=volume_stem(path),
    )


def _nifti_geometry(path: Path) -> ItkHeader:
    """Read the geometry from a copy of the header, alone in a folder.

    Asked for ``a.nii.gz``, the NIfTI library silently takes ``a.nii`` if that lies beside it.
    """
    with TemporaryDirectory(prefix="gp-labeler-") as folder:
        copy = Path(folder) / "header.nii"
        copy.write_bytes(nifti_head(path))
        return read_itk_header(copy, "NIfTI", shown_path=path)


def _stored_dtype(header: Header, itk: ItkHeader) -> np.dtype[np.generic]:
    """Return the type of the grey values; scaled ones are floats."""
    if header.source is None:
        return itk.dtype
    return np.dtype(np.float32) if header.scaled else header.source.dtype


def _findings(
    path: Path, header: Header, itk: ItkHeader, options: ImportOptions
) -> tuple[tuple[Problem, ...], tuple[str, ...]]:
    problems = [] if header.source is None else list(header.source.shortage())
    notes: list[str] = []
    if itk.n_volumes > 1:
        problems.append(warning("many-volumes", f"it holds {itk.n_volumes} volumes; the first is taken"))
    if itk.channels > 1:
        taken = (
            "luminance" if options.channel is None and itk.channels > 2 else f"channel {options.channel or 0}"
        )
        problems.append(warning("colour", f"its voxels have {itk.channels} channels; {taken} is taken"))
        _check_channel(options.channel, itk.channels)
    if np.linalg.det(itk.direction) < 0:
        notes.append("the voxel axes are left-handed; positions are kept as the file gives them")
    twin = path.with_suffix("") if path.name.lower().endswith(".nii.gz") else None
    if twin is not None and twin.exists():
        notes.append(f"{twin.name} lies beside it and was not touched")
    return tuple(problems), tuple(notes)


def _check_channel(channel: int | None, channels: int) -> None:
    if channel is not None and not 0 <= channel < channels:
        raise GpError(f"channel must be 0 to {channels - 1}, got {channel}")


def _scaled(values: Spacing, unit: float) -> Spacing:
    x, y, z = values
    return x * unit, y * unit, z * unit
