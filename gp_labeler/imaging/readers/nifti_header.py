"""NIfTI-1 and NIfTI-2, single files and pairs, and Analyze 7.5: headers as nibabel reads them."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from nibabel.imageglobals import LoggingOutputSuppressor, logger
from nibabel.nifti1 import Nifti1Header, Nifti1PairHeader
from nibabel.nifti2 import Nifti2Header, Nifti2PairHeader
from nibabel.spatialimages import HeaderDataError
from nibabel.spm99analyze import Spm99AnalyzeHeader

from gp_core.validation import FloatArray
from gp_labeler.imaging.readers.grey import to_grey
from gp_labeler.imaging.readers.headers import Header, Layout, not_a
from gp_labeler.imaging.readers.options import Spacing
from gp_labeler.imaging.readers.plan import Geometry
from gp_labeler.imaging.readers.problems import Problem, VolumeError, warning
from gp_labeler.imaging.readers.raw_voxels import StoredVoxels, length_problems, voxels_in
from gp_labeler.imaging.readers.source import Compression, Plane, open_stream
from gp_labeler.imaging.readers.spm_matrix import SpmMatrix, read_spm_matrix

__all__ = ["read_nifti_header"]

_LPS_FROM_RAS = np.diag([-1.0, -1.0, 1.0, 1.0])
_UNITS_MM = {1: 1000.0, 2: 1.0, 3: 1e-3}
_UNIT_NAMES = {1: "m", 3: "µm"}
_APART = 0.1
"""Part of a voxel by which two placements may differ without a word."""


@dataclass(frozen=True)
class _Values:
    """How stored numbers become grey values."""

    slope: float = 1.0
    intercept: float = 0.0

    @property
    def scaled(self) -> bool:
        return (self.slope, self.intercept) != (1.0, 0.0)

    def finish(self, plain: Callable[[Plane], Plane]) -> Callable[[Plane], Plane]:
        if not self.scaled:
            return plain
        return lambda plane: (plain(plane) * np.float64(self.slope) + self.intercept).astype(np.float32)


def read_nifti_header(path: Path, channel: int | None = None) -> Header:
    """Read the binary header of a NIfTI or Analyze file, packed or not.

    Raises
    ------
    VolumeError
        It is neither, or its header is invalid.
    """
    header_file, voxel_file = _pair(path)
    head = _unpacked(header_file, 544)
    kind = _kind(head)
    if kind is None:
        raise not_a("NIfTI" if "nii" in path.name.lower() else "Analyze or NIfTI", path)
    head, said = _with_offset(head, kind)
    header, complaints = _checked(kind, head)
    found = _offset_problems(header, said, voxel_file)
    shape = (*(int(n) for n in header.get_data_shape()), 1, 1)[: max(3, len(header.get_data_shape()))]
    dtype = header.get_data_dtype()
    colours = len(dtype.names or ()) or 1
    layout = Layout(shape, (0, 1, 2)) if colours == 1 else Layout((colours, *shape), (1, 2, 3))
    base = dtype[0] if dtype.names else dtype
    values, warnings = _scaling(header) if dtype.names is None else (_Values(), ())
    stored = StoredVoxels(base, _packing(voxel_file), skip=int(header.get_data_offset()))
    plain = layout.finish(channel) if colours > 1 else to_grey
    source = voxels_in([voxel_file], stored, layout, values.finish(plain))
    geometry, more, units = _geometry(header, read_spm_matrix(voxel_file))
    scaled = (f"values were scaled by {values.slope:g} and shifted by {values.intercept:g}",)
    return Header(
        size=layout.size,
        dtype=np.dtype(np.float32) if values.scaled else base,
        source=source,
        files=tuple(dict.fromkeys((header_file, voxel_file))),
        geometry=geometry,
        found=(*length_problems(source, stored), *found, *complaints, *warnings, *more),
        notes=(*units, *(scaled if values.scaled else ())),
        channels=layout.channels,
        n_volumes=layout.n_volumes,
        format="NIfTI" if isinstance(header, Nifti1Header) else "Analyze",
    )


def _pair(path: Path) -> tuple[Path, Path]:
    """Return the files with header and voxels: of a pair, whichever was given, both."""
    name = path.name.lower().removesuffix(".gz")
    if not name.endswith((".hdr", ".img")):
        return path, path
    stem = path.name[: len(name) - 4]
    beside = (file for file in path.parent.iterdir() if file.name.startswith(stem) and file.is_file())
    there = {file.name.lower(): file for file in beside}
    header, voxels = (
        next((there[n] for end in ("", ".gz") if (n := f"{stem.lower()}{suffix}{end}") in there), None)
        for suffix in (".hdr", ".img")
    )
    if header is None or voxels is None:
        missing = "hdr" if header is None else "img"
        raise VolumeError(
            f"it is one of a pair, and {stem}.{missing} is not there", file=path, remedy="Put it beside."
        )
    return header, voxels


def _kind(head: bytes) -> Any:
    """Return nibabel's class for a header, by its length and magic."""
    sizes = {int.from_bytes(head[:4], "little"), int.from_bytes(head[:4], "big")}
    if 540 in sizes and len(head) >= 540:
        return {b"n+2\0": Nifti2Header, b"ni2\0": Nifti2PairHeader}.get(head[4:8])
    if 348 in sizes and len(head) >= 348:
        return {b"n+1\0": Nifti1Header, b"ni1\0": Nifti1PairHeader}.get(head[344:348], Spm99AnalyzeHeader)
    return None


def _with_offset(head: bytes, kind: Any) -> tuple[bytes, float | None]:
    """Set a `vox_offset` within the header, mostly 0, to where the header ends; return what it was."""
    header = kind(head[: kind.sizeof_hdr], check=False)
    if not getattr(kind, "is_single", False) or header["vox_offset"] >= kind.single_vox_offset:
        return head, None
    said = float(header["vox_offset"])
    header["vox_offset"] = kind.single_vox_offset
    return header.binaryblock, said


def _offset_problems(header: Any, said: float | None, path: Path) -> tuple[Problem, ...]:
    """Return a warning where the file is as long as the mended offset makes it, else a question."""
    if said is None:
        return ()
    first = header.single_vox_offset
    n_bytes = int(np.prod(header.get_data_shape(), dtype=np.float64)) * header.get_data_dtype().itemsize
    text = f"its vox_offset is {said:g}, which lies within its header"
    if _packing(path) == "none" and path.stat().st_size == first + n_bytes:
        return (warning("vox-offset", f"{text}; the voxels begin at {first}"),)
    remedy = f"If its voxels begin right after the header, at byte {first}, go on (--accept vox-offset)."
    return (Problem("vox-offset", text, remedy=remedy, resolved_by=("accept",)),)


def _checked(kind: Any, head: bytes) -> tuple[Any, tuple[Problem, ...]]:
    """Make a header, and warnings of what nibabel mended in it."""
    with _listening() as said:
        try:
            header = kind(head[: kind.sizeof_hdr], check=True)
        except HeaderDataError as problem:
            raise VolumeError(f"its header is invalid: {problem}", remedy="Save it again.") from None
    mended = [line for line in said if "SPM" not in line]
    return header, (warning("header", f"its header was mended: {'; '.join(mended)}"),) if mended else ()


@contextmanager
def _listening() -> Iterator[list[str]]:
    """Collect what nibabel would write to the terminal."""
    said: list[str] = []

    class Listener(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            said.append(record.getMessage())

    listener = Listener()
    with LoggingOutputSuppressor():
        logger.addHandler(listener)
        try:
            yield said
        finally:
            logger.removeHandler(listener)


def _scaling(header: Any) -> tuple[_Values, tuple[Problem, ...]]:
    """Return the scaling; a slope of 0 is none, and so, with a word, is one that is no number."""
    if "scl_slope" not in header.keys():  # noqa: SIM118 - iterating gives values as well
        return _Values(), ()
    slope = float(header["scl_slope"])
    intercept = float(header["scl_inter"]) if "scl_inter" in header.keys() else 0.0  # noqa: SIM118
    if slope == 0 or (slope, intercept) == (1.0, 0.0):
        return _Values(), ()
    if np.isfinite([slope, intercept]).all():
        return _Values(slope, intercept), ()
    text = f"its scl_slope is {slope:g} and its scl_inter {intercept:g}"
    if np.isinf([slope, intercept]).any():
        remedy = "Save it again, or accept the values as they are stored (--accept scaling)."
        return _Values(), (Problem("scaling", text, remedy=remedy, resolved_by=("accept",)),)
    kept = _Values(slope, 0.0) if np.isfinite(slope) else _Values()
    return kept, (warning("scaling", f"{text}; values that are not numbers were ignored, as in nibabel"),)


def _geometry(header: Any, spm: SpmMatrix | None) -> tuple[Geometry, tuple[Problem, ...], tuple[str, ...]]:
    """Place the voxels by the sform, else by the qform, as nibabel does, and say where the two disagree.

    Analyze has neither: SPM's matrix beside it counts, as for nibabel. Beside NIfTI it does not.
    """
    unit = int(header["xyzt_units"]) & 7 if isinstance(header, Nifti1Header) else 2
    mm = _UNITS_MM.get(unit, 1.0)
    note = (f"lengths were converted from {_UNIT_NAMES[unit]} to mm",) if unit in _UNIT_NAMES else ()
    zooms = np.array(header.get_zooms()[:3], dtype=np.float64)
    forms, found = _forms(header)
    if spm is not None and not isinstance(header, Nifti1Header):
        return _placed(_LPS_FROM_RAS @ spm.affine, spm.sides_known), found, (f"placed by {spm.path.name}",)
    if not forms:
        spacing = _three(np.append(zooms, [1.0, 1.0])[:3] * mm)
        return Geometry(spacing, sides_known=False), found, note
    apart, mirrored = _disagreement(header, forms, zooms, mm)
    if spm is not None:
        more, turned = _against_spm(header, forms[0], spm, mm)
        apart, mirrored = (*apart, *more), mirrored or turned
    return _placed(_LPS_FROM_RAS @ forms[0][1], not mirrored, mm), (*found, *apart), note


def _placed(affine: FloatArray, sides_known: bool, mm: float = 1.0) -> Geometry:
    lengths = np.linalg.norm(affine[:3, :3], axis=0)
    return Geometry(
        _three(lengths * mm), _three(affine[:3, 3] * mm), affine[:3, :3] / lengths, sides_known=sides_known
    )


def _against_spm(
    header: Any, form: tuple[str, FloatArray], spm: SpmMatrix, mm: float
) -> tuple[tuple[Problem, ...], bool]:
    """Say how far SPM's matrix, which other programs leave out, is from the placement in the header."""
    name, matrix = form
    apart, mirrored = _between(header, matrix, spm.affine / np.array([[mm], [mm], [mm], [1.0]]))
    if apart <= _APART * np.linalg.norm(matrix[:3, :3], axis=0).min():
        return (), False
    how = "mirrors the voxels" if mirrored else f"places the voxels up to {apart * mm:.3g} mm elsewhere"
    text = f"{spm.path.name} beside it, which only SPM obeys, {how}; the {name} is used, as in nibabel"
    return (warning("placement", text),), mirrored


def _forms(header: Any) -> tuple[list[tuple[str, FloatArray]], tuple[Problem, ...]]:
    """Return the placements that the header vouches for by a code, the sform first, and what is unusable."""
    if not isinstance(header, Nifti1Header):
        return [], ()
    forms, found = [], []
    for name in ("sform", "qform"):
        code = int(header[f"{name}_code"])
        if code <= 0:
            continue
        try:
            matrix = np.asarray(getattr(header, f"get_{name}")(), dtype=np.float64)
        except (HeaderDataError, ValueError):  # a quaternion longer than 1
            matrix = np.zeros((4, 4))
        if np.isfinite(matrix).all() and abs(np.linalg.det(matrix[:3, :3])) > 0:
            forms.append((f"{name} (code {code})", matrix))
        else:
            found.append(
                warning("placement", f"its {name} (code {code}) is not a valid transform, and was ignored")
            )
    return forms, tuple(found)


def _disagreement(
    header: Any, forms: list[tuple[str, FloatArray]], zooms: FloatArray, mm: float
) -> tuple[tuple[Problem, ...], bool]:
    """Say how far sform and qform, or sform and pixdim, are apart, and whether they are mirror images."""
    name, matrix = forms[0]
    voxel = np.linalg.norm(matrix[:3, :3], axis=0)
    taken = "the sform is used, as in nibabel"
    if len(forms) == 1:
        if name.startswith("qform") or len(zooms) < 3 or np.allclose(voxel, np.abs(zooms), rtol=1e-3):
            return (), False
        sizes = [" x ".join(f"{v:.4g}" for v in lengths) for lengths in (zooms, voxel)]
        text = f"its pixdim says voxels of {sizes[0]}, its {name} {sizes[1]}; {taken}"
        return (warning("placement", text),), False
    other, second = forms[1]
    apart, mirrored = _between(header, matrix, second)
    if apart <= _APART * voxel.min():
        return (), False
    how = (
        "are mirror images of each other" if mirrored else f"place the voxels up to {apart * mm:.3g} mm apart"
    )
    return (warning("placement", f"its {name} and its {other} {how}; {taken}"),), mirrored


def _between(header: Any, one: FloatArray, other: FloatArray) -> tuple[float, bool]:
    """Return how far two placements are apart at a corner, at worst, and whether they are mirror images."""
    last = np.array((*header.get_data_shape(), 1, 1)[:3]) - 1.0
    corners = np.array([(*(last * corner), 1.0) for corner in np.ndindex(2, 2, 2)])
    apart = float(np.linalg.norm(corners @ (one - other).T, axis=1).max())
    return apart, bool(np.linalg.det(one[:3, :3]) * np.linalg.det(other[:3, :3]) < 0)


def _three(values: FloatArray) -> Spacing:
    x, y, z = (float(value) for value in values)
    return x, y, z


def _packing(path: Path) -> Compression:
    with path.open("rb") as file:
        return "gzip" if file.read(2) == b"\x1f\x8b" else "none"


def _unpacked(path: Path, n: int) -> bytes:
    """Return the first bytes of a file, unpacked."""
    parts = b""
    with open_stream(path, _packing(path)) as stream:
        while len(parts) < n and (part := stream.read(n - len(parts))):
            parts += part
    return parts
