"""The file `.mat` that SPM keeps beside a scan: the matrix that places its voxels."""

from __future__ import annotations

import struct
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gp_core.disk import read_bytes
from gp_core.errors import GpError
from gp_core.io.mat5 import read_mat5
from gp_core.validation import FloatArray

__all__ = ["SpmMatrix", "read_spm_matrix"]

_MOST_BYTES = 1_000_000
_FROM_ZERO = np.array([[1.0, 0, 0, 1], [0, 1, 0, 1], [0, 0, 1, 1], [0, 0, 0, 1]])
"""SPM counts voxels from 1."""

_MIRROR_X = np.diag([-1.0, 1.0, 1.0, 1.0])
_TYPES = "f8", "f4", "i4", "i2", "u2", "u1"  # by their numbers in a file of version 4


@dataclass(frozen=True, eq=False)
class SpmMatrix:
    """Where SPM says that voxels lie.

    Parameters
    ----------
    path : Path
        The file.
    affine : (4, 4) array
        From voxels (i, j, k), counted from 0, to RAS mm.
    sides_known : bool
        False for the oldest variable, `M`, which leaves it to the program whether x is mirrored; here it is,
        as in SPM and nibabel.
    """

    path: Path
    affine: FloatArray
    sides_known: bool


def read_spm_matrix(scan: Path) -> SpmMatrix | None:
    """Return the matrix that lies beside a scan, or None where no such file holds one.

    Parameters
    ----------
    scan : Path
        The file with the voxels: ``head.img`` or ``head.nii``, to which ``head.mat`` belongs.
    """
    path = scan.with_suffix("").with_suffix(".mat") if scan.suffix == ".gz" else scan.with_suffix(".mat")
    if not path.is_file() or path.stat().st_size > _MOST_BYTES:
        return None
    variables: dict[str, FloatArray | None] = {}
    with suppress(GpError):
        variables = _read_mat4(path) or read_mat5(path)
    for name in ("mat", "M"):
        matrix = variables.get(name)
        if matrix is not None and matrix.ndim == 3:
            matrix = matrix[:, :, 0]  # one for each volume of a file
        if matrix is not None and _is_placement(matrix):
            known = name == "mat"
            return SpmMatrix(path, (np.eye(4) if known else _MIRROR_X) @ matrix @ _FROM_ZERO, known)
    return None


def _is_placement(matrix: FloatArray) -> bool:
    return (
        matrix.shape == (4, 4)
        and bool(np.isfinite(matrix).all())
        and bool(np.allclose(matrix[3], [0, 0, 0, 1]))
        and abs(np.linalg.det(matrix[:3, :3])) > 0
    )


def _read_mat4(path: Path) -> dict[str, FloatArray | None]:
    """Read the real matrices of a MATLAB file of version 4, as SPM99 wrote; none where it is no such file."""
    content = read_bytes(path, what="MATLAB file")
    found: dict[str, FloatArray | None] = {}
    at = 0
    while at + 20 <= len(content):
        order = "<" if content[at + 2 : at + 4] == b"\0\0" else ">"
        kind, rows, columns, imaginary, n_name = struct.unpack_from(order + "5i", content, at)
        code, is_text = divmod(kind % 1000, 10)
        n_bytes = rows * columns
        if kind // 1000 not in (0, 1) or code >= len(_TYPES) or not 0 < n_name < 64 or n_bytes <= 0:
            return {}
        dtype = np.dtype((">" if kind // 1000 else "<") + _TYPES[code])
        start = at + 20 + n_name
        at = start + n_bytes * dtype.itemsize * (1 + bool(imaginary))
        if at > len(content):
            return {}
        name = content[start - n_name : start].rstrip(b"\0").decode("latin-1")
        values = np.frombuffer(content, dtype, n_bytes, start).astype(np.float64)
        found[name] = None if is_text else values.reshape((rows, columns), order="F")
    return found
