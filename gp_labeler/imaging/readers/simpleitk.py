"""SimpleITK, quiet and within bounds: headers, and voxels where no reader of ours streams them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import SimpleITK

from gp_core.checks import FloatArray
from gp_labeler.imaging.readers.grey import to_grey
from gp_labeler.imaging.readers.options import Spacing
from gp_labeler.imaging.readers.problems import VolumeError
from gp_labeler.imaging.readers.source import Plane

_sitk: Any = SimpleITK  # its functions carry no types

__all__ = ["ItkHeader", "ItkSource", "read_itk_header", "read_itk_planes"]


_READERS = {"NRRD": "NrrdImageIO", "MetaImage": "MetaImageIO", "NIfTI": "NiftiImageIO"}


@dataclass(frozen=True, eq=False)
class ItkHeader:
    """What SimpleITK says of a file: size (x, y, z), spacing, origin (LPS mm), direction, type, channels."""

    size: tuple[int, int, int]
    spacing: Spacing
    origin: Spacing
    direction: FloatArray
    dtype: np.dtype[np.generic]
    channels: int
    n_volumes: int


def read_itk_header(path: Path, kind: str = "", shown_path: Path | None = None) -> ItkHeader:
    """Read the header of a file of a known kind, or of one that SimpleITK recognises.

    Parameters
    ----------
    path : Path
        File to read.
    kind : str
        ``"NRRD"``, ``"MetaImage"``, ``"NIfTI"``; anything else is recognised by name and content.
    shown_path : Path, optional
        The file to name in errors where `path` is a stand-in.

    Raises
    ------
    VolumeError
        SimpleITK cannot read it, or its grid is sheared.
    """
    reader = _sitk.ImageFileReader()
    reader.SetFileName(str(path))
    reader.SetImageIO(_READERS.get(kind, ""))
    try:
        with _quiet():
            reader.ReadImageInformation()
    except RuntimeError as problem:
        raise _explained(problem, shown_path or path) from None
    n = reader.GetDimension()
    size = (*reader.GetSize(), 1, 1)
    return ItkHeader(
        size=(int(size[0]), int(size[1]), int(size[2])),
        spacing=_three(reader.GetSpacing(), 1.0),
        origin=_three(reader.GetOrigin(), 0.0),
        direction=_direction(reader.GetDirection(), n),
        dtype=_dtype(reader.GetPixelIDValue()),
        channels=reader.GetNumberOfComponents(),
        n_volumes=int(size[3]) if n > 3 else 1,
    )


def _three(values: Sequence[float], rest: float) -> Spacing:
    x, y, z = (*(float(v) for v in values), rest, rest)[:3]
    return x, y, z


def _direction(flat: Sequence[float], n: int) -> FloatArray:
    direction = np.eye(3)
    m = min(n, 3)
    direction[:m, :m] = np.reshape(flat, (n, n))[:m, :m]
    return direction


def _dtype(pixel_id: int) -> np.dtype[np.generic]:
    name = _sitk.GetPixelIDValueAsString(pixel_id)
    for bits in (8, 16, 32, 64):
        if f"{bits}-bit" in name:
            kind = "float" if "float" in name else "uint" if "unsigned" in name else "int"
            return np.dtype(f"{'complex' if 'complex' in name else kind}{bits}")
    return np.dtype(object)


def _explained(problem: RuntimeError, path: Path) -> VolumeError:
    text = str(problem)
    if "rthonormal" in text or "rthogonal" in text:
        return VolumeError(
            "its voxel axes are sheared (not at right angles to each other)",
            file=path,
            remedy="Resample it to a rectangular grid, e.g. with Slicer's Resample Scalar/Vector/DWI Volume.",
        )
    if "singular" in text or "determinant is 0" in text:
        return VolumeError(
            "its direction matrix is singular", file=path, remedy="Save it again from its program."
        )
    last = text.strip().splitlines()[-1].removeprefix("sitk::ERROR: ") if text.strip() else "unknown error"
    return VolumeError(
        f"it cannot be read: {last}", file=path, remedy="The file may be damaged: copy it again."
    )


@contextmanager
def _quiet() -> Iterator[None]:
    before = _sitk.ProcessObject.GetGlobalWarningDisplay()
    _sitk.ProcessObject.SetGlobalWarningDisplay(False)
    try:
        yield
    finally:
        _sitk.ProcessObject.SetGlobalWarningDisplay(before)


@dataclass(frozen=True)
class ItkSource:
    """The planes of a volume that SimpleITK reads as a whole: no progress, and twice the memory.

    Parameters
    ----------
    path : Path
        File to read.
    channel : int, optional
        Which colour channel; without it colours become luminance.
    """

    path: Path
    channel: int | None = None

    def planes(self, wanted: Sequence[int]) -> Iterator[Plane]:
        """Yield the (y, x) grey planes with the numbers `wanted`."""
        volume = read_itk_planes(self.path)
        for number in wanted:
            yield to_grey(volume[number], self.channel)


def read_itk_planes(path: Path) -> Plane:
    """Read the (z, y, x) or (z, y, x, channels) voxels of a file; of several volumes the first.

    Raises
    ------
    VolumeError
        SimpleITK cannot read it.
    """
    try:
        with _quiet():
            image = _sitk.ReadImage(str(path))
    except RuntimeError as problem:
        raise _explained(problem, path) from None
    array: Plane = _sitk.GetArrayFromImage(image)
    while array.ndim > 3 + (image.GetNumberOfComponentsPerPixel() > 1):
        array = array[0]
    return array if image.GetDimension() > 2 else array[None]
