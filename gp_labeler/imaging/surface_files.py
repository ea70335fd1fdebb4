"""Write meshes so that 3D Slicer and others know their coordinates are LPS."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from vtkmodules.vtkCommonCore import vtkStringArray
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkIOGeometry import vtkSTLWriter
from vtkmodules.vtkIOPLY import vtkPLYWriter
from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

from gp_core.disk import atomic_file
from gp_core.errors import FileFormatError, GpError

__all__ = ["check_mesh_name", "write_mesh"]

_SPACE = "SPACE=LPS"
_STL_HEADER, _STL_TRIANGLE = 84, 50  # bytes
_PLY_TRIANGLE = 13
_PLY_END, _PLY_HEADER_MAX = b"end_header\n", 2000


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
    writer = _WRITERS[path.suffix.lower()](mesh)
    complaints: list[str] = []
    for teller in (writer, writer.GetExecutive()):  # what VTK would print
        teller.AddObserver("ErrorEvent", lambda *_: complaints.append("error"))
    with atomic_file(path) as draft:
        writer.SetFileName(os.fsencode(draft))  # as bytes: a name need not be UTF-8
        done = writer.Write() and not complaints and not writer.GetErrorCode()
        if not done or not _is_whole(draft, mesh):
            remedy = "Free some space, or choose another folder. The file is as it was."
            raise GpError("the mesh cannot be written whole", file=path, remedy=remedy)


def _is_whole(file: Path, mesh: vtkPolyData) -> bool:
    """Whether all of a mesh is in the file; VTK does not say of PLY that the disk was full."""
    if not file.is_file():
        return False
    n_bytes = file.stat().st_size
    if file.suffix.lower() == ".stl":
        return n_bytes == _STL_HEADER + _STL_TRIANGLE * mesh.GetNumberOfPolys()
    if file.suffix.lower() == ".ply":
        with file.open("rb") as stream:
            header, mark, _ = stream.read(_PLY_HEADER_MAX).partition(_PLY_END)
        point = 4 * header.count(b"property float ")  # position and normal
        body = point * mesh.GetNumberOfPoints() + _PLY_TRIANGLE * mesh.GetNumberOfPolys()
        return n_bytes == len(header) + len(mark) + body
    return n_bytes > 0  # VTK notices it itself
