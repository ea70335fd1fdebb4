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

_GIPL_HEADER = 256
_VTK_HEAD = 4096


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
    dtype, channels = _dtype(reader.GetPixelIDValue()), reader.GetNumberOfComponents()
    _check_length(path, int(np.prod(reader.GetSize(), dtype=np.float64)) * channels, dtype)
    return Header(
        size=(int(size[0]), int(size[1]), int(size[2])),
        dtype=dtype,
        source=Whole(partial(read_itk_planes, path), lambda plane: to_grey(plane, channel)),
        files=(path,),
        geometry=Geometry(
            _three(reader.GetSpacing(), 1.0),
            _three(reader.GetOrigin(), 0.0),
            _direction(reader.GetDirection(), n),
            sides_known=False,
        ),
        channels=channels,
        n_volumes=int(size[3]) if n > 3 else 1,
        format=kind or None,
    )


def _check_image(path: Path) -> None:
    """Refuse a VTK file that holds a mesh, or what ITK misreads without a word."""
    with path.open("rb") as file:
        head = file.read(_VTK_HEAD)
    if not head.startswith(b"# vtk"):
        return
    kind = re.search(rb"^DATASET +(\w+)", head, re.MULTILINE)
    if kind and kind[1].upper() != b"STRUCTURED_POINTS":
        name = kind[1].decode("ascii", "replace")
        raise VolumeError(
            f"it holds {name}, which is not an image", file=path, remedy="Give the scan it was made from."
        )
    text = head[: _vtk_data(head)]
    if re.search(rb"^CELL_DATA", text, re.MULTILINE | re.IGNORECASE):
        raise VolumeError(
            "its values belong to cells (CELL_DATA) rather than points",
            file=path,
            remedy="Save it as NRRD or MHA.",
        )
    if b"\r" in text and _is_binary(text):
        raise VolumeError(
            "its header has the line ends of Windows before binary voxels", file=path, remedy="Save it again."
        )


def _vtk_data(head: bytes) -> int:
    """Return where the voxels of a VTK file begin: after the lines about them; 0 where none are found."""
    found = re.search(rb"^(SCALARS[^\n]*\n(LOOKUP_TABLE[^\n]*\n)?|VECTORS[^\n]*\n)", head, re.M | re.I)
    return found.end() if found else 0


def _is_binary(head: bytes) -> bool:
    return re.search(rb"^BINARY", head, re.MULTILINE | re.IGNORECASE) is not None


def _check_length(path: Path, n_values: int, dtype: np.dtype[Any]) -> None:
    """Refuse a file that is too short for its voxels: ITK leaves what is missing as it comes.

    Raises
    ------
    VolumeError
        It is.
    """
    with path.open("rb") as file:
        head = file.read(_VTK_HEAD)
    is_vtk = head.startswith(b"# vtk")
    start = _vtk_data(head) if is_vtk else _GIPL_HEADER
    have, need, what = path.stat().st_size, start + dtype.itemsize * n_values, "bytes"
    if is_vtk and not _is_binary(head[:start]):
        have, need, what = _words_from(path, start), n_values, "values"
    if have < need:
        raise VolumeError(
            f"{path.name} holds {have:,} {what}, but {need:,} are needed: it is incomplete",
            file=path,
            remedy="Copy it again.",
        )


def _words_from(path: Path, start: int) -> int:
    with path.open("rb") as file:
        file.seek(start)
        return sum(len(line.split()) for line in file)


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
