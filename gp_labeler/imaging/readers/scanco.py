"""Scanco: ISQ and RSQ are read here, AIM through the optional package itk-ioscanco."""

from __future__ import annotations

import importlib
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from gp_labeler.imaging.readers.formats import scanco_suffix
from gp_labeler.imaging.readers.options import ImportOptions, Spacing
from gp_labeler.imaging.readers.plan import Geometry, ImportPlan
from gp_labeler.imaging.readers.problems import VolumeError
from gp_labeler.imaging.readers.source import Plane, RawSource

__all__ = ["inspect_scanco"]

_MAGIC = b"CTDATA-HEADER_V1"
_AIM_V3 = b"AIMDATA_V030   "
_AIM_V2 = struct.pack("<2i", 20, 140)  # the lengths of its first two headers
_BLOCK = 512
_SAME_STEP = 0.02


def inspect_scanco(path: Path, options: ImportOptions) -> ImportPlan:
    """Look into a Scanco file.

    Raises
    ------
    VolumeError
        It is none, or it is AIM and itk-ioscanco is not installed.
    """
    with path.open("rb") as file:
        head = file.read(_BLOCK)
    if head.startswith(_MAGIC):
        return _inspect_isq(path, head, options)
    if head.startswith(_AIM_V3) or head[:8] == _AIM_V2:
        return _inspect_aim(path, options)
    raise VolumeError(
        "it is not a Scanco file, though its name says so", file=path, remedy="Check what it is."
    )


def _inspect_isq(path: Path, head: bytes, options: ImportOptions) -> ImportPlan:
    """Read the header: little-endian words, pixels from byte 44, their extent in µm from byte 56."""
    if len(head) < _BLOCK:
        raise VolumeError("its header is incomplete", file=path, remedy="Copy it again.")
    nx, ny, nz, x_um, y_um, z_um = struct.unpack("<6i", head[44:68])
    (blocks,) = struct.unpack("<i", head[508:512])
    if min(nx, ny, nz) < 1 or blocks < 0:
        raise VolumeError(f"its header states {nx} x {ny} x {nz} voxels", file=path, remedy="Copy it again.")
    source = RawSource(path, (blocks + 1) * _BLOCK, np.dtype("<i2"), (ny, nx), nz)
    known = min(x_um, y_um, z_um) > 0
    spacing: Spacing | None = (x_um / nx / 1000, y_um / ny / 1000, z_um / nz / 1000) if known else None
    geometry = Geometry(spacing, sides_known=False)
    (step_um,) = struct.unpack("<i", head[72:76])
    if spacing is not None and step_um > 0 and abs(step_um - z_um / nz) > max(1, _SAME_STEP * step_um):
        reason = (
            f"its header gives slices {step_um / 1000:g} mm apart, but {nz} of them in {z_um / 1000:g} mm"
        )
        geometry = Geometry(
            sides_known=False, suggested=(spacing[0], spacing[1], step_um / 1000), reason=reason
        )
    return ImportPlan(
        path=path,
        format="Scanco ISQ",
        files=(path,),
        size=(nx, ny, nz),
        stored_dtype=np.dtype(np.int16),
        source=source,
        geometry=geometry,
        found=source.shortage(),
        notes=("values are the scanner's own, not calibrated",),
        options=options,
        name=path.name.partition(".")[0],
    )


def _inspect_aim(path: Path, options: ImportOptions) -> ImportPlan:
    image = _itk_read(path)
    array = np.asarray(image)
    x, y, z = (float(length) for length in image.GetSpacing())
    return ImportPlan(
        path=path,
        format="Scanco AIM",
        files=(path,),
        size=(array.shape[2], array.shape[1], array.shape[0]),
        stored_dtype=array.dtype,
        source=_ArraySource(array),
        geometry=Geometry((x, y, z), tuple(float(v) for v in image.GetOrigin()), sides_known=False),  # type: ignore[arg-type]
        notes=("values are as itk-ioscanco scales them",),
        options=options,
        name=path.name.partition(".")[0],
    )


@dataclass(frozen=True, eq=False)
class _ArraySource:
    array: Plane

    def planes(self, wanted: Sequence[int]) -> Iterator[Plane]:
        """Yield the (y, x) planes with the numbers `wanted`."""
        return (self.array[number] for number in wanted)


def _itk_read(path: Path) -> Any:
    try:
        itk = importlib.import_module("itk")
        reader = itk.ScancoImageIO.New()
    except (ImportError, AttributeError):
        raise VolumeError(
            "reading Scanco AIM needs the package itk-ioscanco",
            file=path,
            remedy="Install it (pip install gp-labeler[scanco]), or export the scan as ISQ or DICOM.",
        ) from None
    with TemporaryDirectory(prefix="gp-labeler-") as folder:
        plain = Path(folder) / f"scan{scanco_suffix(path)}"  # ITK refuses the names that VMS gives
        try:
            plain.symlink_to(path.resolve())
        except OSError:  # Windows lets only some people link
            plain.write_bytes(path.read_bytes())
        try:
            return itk.imread(str(plain), imageio=reader)
        except (RuntimeError, TypeError) as problem:
            last = str(problem).strip().splitlines()[-1]
            raise VolumeError(
                f"it is not a Scanco file: {last}", file=path, remedy="Check what it is."
            ) from None
