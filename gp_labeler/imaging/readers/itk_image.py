"""NRRD, MetaImage, NIfTI and their kin: the volume formats of ITK, one file or a header with its voxels."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from gp_labeler.imaging.readers.formats import volume_stem
from gp_labeler.imaging.readers.grey import check_channel
from gp_labeler.imaging.readers.headers import Header
from gp_labeler.imaging.readers.metaimage_header import read_meta_header
from gp_labeler.imaging.readers.nifti_header import read_nifti_header
from gp_labeler.imaging.readers.nrrd_header import read_nrrd_header
from gp_labeler.imaging.readers.options import ImportOptions
from gp_labeler.imaging.readers.plan import ImportPlan
from gp_labeler.imaging.readers.problems import Problem, VolumeError, warning
from gp_labeler.imaging.readers.simpleitk import read_itk_header

__all__ = ["inspect_itk_image"]

_HEADERS: dict[str, Callable[[Path, int | None], Header]] = {
    "NRRD": read_nrrd_header,
    "MetaImage": read_meta_header,
    "NIfTI": read_nifti_header,
    "Analyze": read_nifti_header,
}


def inspect_itk_image(path: Path, options: ImportOptions, kind: str) -> ImportPlan:
    """Look into a file of a format in `VOLUME_SUFFIXES`.

    Raises
    ------
    VolumeError
        It is not what its name says, or cannot be read.
    """
    header = _HEADERS.get(kind, partial(read_itk_header, kind=kind))(path, options.channel)
    if header.dtype.kind not in "iuf":
        raise VolumeError("its voxels are not plain numbers", file=path, remedy="Save the grey values only.")
    found, notes = _findings(path, header, options)
    return ImportPlan(
        path=path,
        format=header.format or kind,
        files=header.files,
        size=header.size,
        stored_dtype=header.dtype,
        source=header.source,
        geometry=header.geometry,
        found=(*header.found, *found),
        notes=(*header.notes, *notes),
        options=options,
        name=volume_stem(path),
    )


def _findings(
    path: Path, header: Header, options: ImportOptions
) -> tuple[tuple[Problem, ...], tuple[str, ...]]:
    problems: list[Problem] = []
    notes: list[str] = []
    if header.n_volumes > 1:
        problems.append(warning("many-volumes", f"it holds {header.n_volumes} volumes; the first is taken"))
    if header.channels > 1:
        taken = (
            "luminance"
            if options.channel is None and header.channels > 2
            else f"channel {options.channel or 0}"
        )
        problems.append(warning("colour", f"its voxels have {header.channels} channels; {taken} is taken"))
        check_channel(options.channel, header.channels)
    if np.linalg.det(header.geometry.direction) < 0:
        notes.append("the voxel axes are left-handed; positions are used as stored")
    twin = path.with_suffix("") if path.name.lower().endswith(".nii.gz") else None
    if twin is not None and twin.exists():
        notes.append(f"{twin.name} is beside it and was not changed")
    return tuple(problems), tuple(notes)
