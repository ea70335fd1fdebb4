"""SimpleITK, quiet: GIPL and VTK images, and DICOM pixels that are packed."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import SimpleITK

from gp_core.validation import FloatArray
from gp_labeler.imaging.readers.grey import to_grey
from gp_labeler.imaging.readers.headers import Header
from gp_labeler.imaging.readers.options import Spacing
from gp_labeler.imaging.readers.plan import Geometry
from gp_labeler.imaging.readers.problems import VolumeError
from gp_labeler.imaging.readers.raw_voxels import Whole
from gp_labeler.imaging.readers.source import Plane

_sitk: Any = SimpleITK  # its functions carry no types

__all__ = ["read_itk_header", "read_itk_planes"]


def read_itk_header(path: Path, channel: int | None = None, *, kind: str = "") -> Header:
    """Read the header of a file of a format that states no frame: GIPL, VTK image.

    Raises
    ------
    VolumeError
        SimpleITK cannot read it.
    """
    _check_image(path)
    reader = _sitk.ImageFileReader()
    with _quiet(), _plain_name(path) as name:
        reader.SetFileName(name)
        try:
            reader.ReadImageInformation()
        except RuntimeError as problem:
            raise _explained(problem, path) from None
    n = reader.GetDimension()
    size = (*reader.GetSize(), 1, 1)
    return Header(
        size=(int(size[0]), int(size[1]), int(size[2])),
        dtype=_dtype(reader.GetPixelIDValue()),
        source=Whole(partial(read_itk_planes, path), lambda plane: to_grey(plane, channel)),
        files=(path,),
        geometry=Geometry(
            _three(reader.GetSpacing(), 1.0),
            _three(reader.GetOrigin(), 0.0),
            _direction(reader.GetDirection(), n),
            sides_known=False,
        ),
        channels=reader.GetNumberOfComponents(),
        n_volumes=int(size[3]) if n > 3 else 1,
        format=kind or None,
    )


def _check_image(path: Path) -> None:
    """Refuse a VTK file that holds a mesh."""
    with path.open("rb") as file:
        head = file.read(1000)
    kind = re.search(rb"^DATASET +(\w+)", head, re.MULTILINE)
    if head.startswith(b"# vtk") and kind and kind[1].upper() != b"STRUCTURED_POINTS":
        name = kind[1].decode("ascii", "replace")
        raise VolumeError(
            f"it holds {name}, which is no image", file=path, remedy="Give the scan it was made from."
        )


def read_itk_planes(path: Path) -> Plane:
    """Read the (z, y, x) or (z, y, x, channels) voxels of a file; of several volumes the first.

    Raises
    ------
    VolumeError
        SimpleITK cannot read it.
    """
    with _quiet(), _plain_name(path) as name:
        try:
            image = _sitk.ReadImage(name)
        except RuntimeError as problem:
            raise _explained(problem, path) from None
    array: Plane = _sitk.GetArrayFromImage(image)
    while array.ndim > 3 + (image.GetNumberOfComponentsPerPixel() > 1):
        array = array[0]
    return array if image.GetDimension() > 2 else array[None]


@contextmanager
def _plain_name(path: Path) -> Iterator[str]:
    """Yield a name that ITK can take: it ends the process on names that are not UTF-8."""
    try:
        str(path).encode("utf-8")
    except UnicodeEncodeError:
        with TemporaryDirectory(prefix="gp-labeler-") as folder:
            link = Path(folder, "scan").with_suffix(path.suffix.encode("ascii", "ignore").decode())
            link.symlink_to(path.resolve())
            yield str(link)
    else:
        yield str(path)


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
