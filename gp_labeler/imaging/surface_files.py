"""Write meshes whole or not at all, saying where a format can that their coordinates are LPS."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from vtkmodules.vtkCommonDataModel import vtkPolyData

from gp_core.disk import FREE_SPACE, atomic_file
from gp_core.errors import FileFormatError, GpError

__all__ = ["OBJ_COMMENT", "check_mesh_name", "write_mesh"]

_SPACE = "SPACE=LPS"
OBJ_COMMENT = "# gp-labeler. {space}. {points} points, {triangles} triangles\n"
"""The first line of an OBJ file: nothing else in one says how much of it there should be."""

_STL_HEADER, _STL_TRIANGLE = 84, 50  # bytes
_PLY_TRIANGLE = 13
_PLY_END, _PLY_HEADER_MAX = b"end_header\n", 2000
_GLB_LENGTH = slice(8, 12)


def _ply(mesh: vtkPolyData) -> Any:
    import pyvista as pv  # takes 0.6 s: not before a mesh is written

    writer: Any = pv.PLYWriter("", pv.wrap(mesh)).writer
    writer.AddComment(_SPACE)
    writer.SetFileTypeToBinary()
    return writer


def _stl(mesh: vtkPolyData) -> Any:
    import pyvista as pv

    writer: Any = pv.STLWriter("", pv.wrap(mesh)).writer
    writer.SetHeader(f"gp-labeler. {_SPACE}")
    writer.SetFileTypeToBinary()
    return writer


def _vtp(mesh: vtkPolyData) -> Any:
    import pyvista as pv

    noted: Any = pv.wrap(mesh)  # shares points and triangles
    noted.field_data["SPACE"] = ["LPS"]
    writer: Any = pv.XMLPolyDataWriter("", noted).writer
    writer.SetDataModeToAppended()  # as VTK does: in the middle of the text, a full disk crashes it (9.7)
    return writer


def _obj(mesh: vtkPolyData) -> Any:
    import pyvista as pv

    return pv.OBJWriter("", pv.wrap(mesh)).writer


def _gltf(mesh: vtkPolyData) -> Any:
    import pyvista as pv
    from vtkmodules.vtkIOGeometry import vtkGLTFWriter  # pyvista writes glTF of a plotter only

    writer: Any = vtkGLTFWriter()
    writer.SetInputDataObject(pv.MultiBlock([pv.MultiBlock([pv.wrap(mesh)])]))
    writer.SetInlineData(True)
    writer.SetSaveNormal(True)
    return writer


_WRITERS: Mapping[str, Callable[[vtkPolyData], Any]] = MappingProxyType(
    {".ply": _ply, ".stl": _stl, ".vtp": _vtp, ".obj": _obj, ".gltf": _gltf, ".glb": _gltf}
)


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
        Ends in ``.ply``, ``.stl``, ``.vtp``, ``.obj``, ``.gltf`` or ``.glb``.

    Raises
    ------
    GpError
        Another suffix, or the file cannot be written.
    """
    check_mesh_name(path)
    suffix = path.suffix.lower()
    writer = _WRITERS[suffix](mesh)
    complaints: list[str] = []
    for teller in (writer, writer.GetExecutive()):  # what VTK would print
        teller.AddObserver("ErrorEvent", lambda *_: complaints.append("error"))
    with atomic_file(path) as draft:
        writer.SetFileName(os.fsencode(draft))  # as bytes: a name need not be UTF-8
        done = writer.Write() and not complaints and not writer.GetErrorCode() and draft.is_file()
        if done and suffix == ".obj":
            _say_space(draft, mesh)
        if not done or not _IS_WHOLE[suffix](draft, mesh):
            raise GpError("the mesh cannot be written whole", file=path, remedy=FREE_SPACE)


def _say_space(file: Path, mesh: vtkPolyData) -> None:
    """Put the frame, and how much there is, at the head of an OBJ file."""
    text = file.read_bytes()
    counts = {"points": mesh.GetNumberOfPoints(), "triangles": mesh.GetNumberOfPolys()}
    try:
        file.write_bytes(OBJ_COMMENT.format(space=_SPACE, **counts).encode() + text)
    except OSError:  # such as a full disk
        file.write_bytes(b"")


def _stl_is_whole(file: Path, mesh: vtkPolyData) -> bool:
    return file.stat().st_size == _STL_HEADER + _STL_TRIANGLE * mesh.GetNumberOfPolys()


def _ply_is_whole(file: Path, mesh: vtkPolyData) -> bool:
    """VTK does not say of PLY that the disk was full."""
    with file.open("rb") as stream:
        header, mark, _ = stream.read(_PLY_HEADER_MAX).partition(_PLY_END)
    point = 4 * header.count(b"property float ")  # position and normal
    body = point * mesh.GetNumberOfPoints() + _PLY_TRIANGLE * mesh.GetNumberOfPolys()
    return file.stat().st_size == len(header) + len(mark) + body


def _obj_is_whole(file: Path, mesh: vtkPolyData) -> bool:
    text = file.read_bytes()
    whole = text.endswith(b"\n") and text.count(b"\nv ") == mesh.GetNumberOfPoints()
    return whole and text.count(b"\nf ") == mesh.GetNumberOfPolys()


def _gltf_is_whole(file: Path, _: vtkPolyData) -> bool:
    return file.read_bytes().rstrip().endswith(b"}")


def _glb_is_whole(file: Path, _: vtkPolyData) -> bool:
    with file.open("rb") as stream:
        head = stream.read(_GLB_LENGTH.stop)
    return int.from_bytes(head[_GLB_LENGTH], "little") == file.stat().st_size > 0


def _vtp_is_whole(file: Path, _: vtkPolyData) -> bool:
    return file.stat().st_size > 0  # VTK notices it itself


_IS_WHOLE: Mapping[str, Callable[[Path, vtkPolyData], bool]] = MappingProxyType(
    {
        ".ply": _ply_is_whole,
        ".stl": _stl_is_whole,
        ".vtp": _vtp_is_whole,
        ".obj": _obj_is_whole,
        ".gltf": _gltf_is_whole,
        ".glb": _glb_is_whole,
    }
)
