"""Write meshes so that 3D Slicer and others know their coordinates are LPS."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from vtkmodules.vtkCommonCore import vtkStringArray
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkIOGeometry import vtkSTLWriter
from vtkmodules.vtkIOPLY import vtkPLYWriter
from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

from gp_core.errors import FileFormatError, GpError

__all__ = ["check_mesh_name", "write_mesh"]

_SPACE = "SPACE=LPS"


def _ply(mesh: vtkPolyData) -> Any:
    writer = vtkPLYWriter()
    writer.AddComment(_SPACE)
    writer.SetFileTypeToBinary()
    writer.SetInputData(mesh)
    return writer


def _stl(mesh: vtkPolyData) -> Any:
    writer = vtkSTLWriter()
    writer.SetHeader(f"gp-labeler. {_SPACE}")
    writer.SetFileTypeToBinary()
    writer.SetInputData(mesh)
    return writer


def _vtp(mesh: vtkPolyData) -> Any:
    space = vtkStringArray()
    space.SetName("SPACE")
    space.InsertNextValue("LPS")
    noted = vtkPolyData()
    noted.ShallowCopy(mesh)
    noted.GetFieldData().AddArray(space)
    writer = vtkXMLPolyDataWriter()
    writer.SetInputData(noted)
    return writer


_WRITERS = {".ply": _ply, ".stl": _stl, ".vtp": _vtp}


def check_mesh_name(path: Path) -> None:
    """Raise `FileFormatError` unless a file's name ends as a mesh that can be written."""
    if path.suffix.lower() not in _WRITERS:
        raise FileFormatError(
            f"meshes are written as {', '.join(_WRITERS)}, got {path.suffix or 'no suffix'!r}", file=path
        )


def write_mesh(mesh: vtkPolyData, path: Path) -> None:
    """Write a mesh whole or not at all.

    Parameters
    ----------
    mesh : vtkPolyData
        Triangles, mm, LPS.
    path : Path
        Ends in ``.ply``, ``.stl`` or ``.vtp``.

    Raises
    ------
    GpError
        Another suffix, or the file cannot be written.
    """
    check_mesh_name(path)
    try:
        with tempfile.TemporaryDirectory(dir=path.parent, prefix=".mesh-") as folder:
            part = Path(folder, f"mesh{path.suffix.lower()}")
            writer = _WRITERS[path.suffix.lower()](mesh)
            writer.SetFileName(str(part))
            if not writer.Write() or not part.is_file():
                raise OSError("VTK could not write it")
            part.replace(path)
    except OSError as error:
        reason = error.strerror or error
        raise GpError(
            f"the mesh cannot be written ({reason})", file=path, remedy="Choose another folder."
        ) from None
