"""Read meshes that others made, with pyvista; a file that is cut off is refused, never half read."""

from __future__ import annotations

import json
import re
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote

import numpy as np

from gp_core.disk import check_file, read_head
from gp_core.errors import FileFormatError
from gp_labeler.imaging.ply import is_whole_ply

if TYPE_CHECKING:
    import pyvista as pv

__all__ = ["MESH_SUFFIXES", "read_mesh"]

MESH_SUFFIXES = (".ply", ".stl", ".vtp", ".obj", ".gltf", ".glb")
"""Of the files that `read_mesh` takes."""

_REMEDY = "Export it again, as PLY, STL, VTP, OBJ or glTF in mm."
_HEAD = 4096
_MAX_BYTES = 4_000_000_000
_STL_HEADER, _STL_TRIANGLE = 84, 50
_OBJ_COUNTS = re.compile(rb"^# gp-labeler\..* (\d+) points, (\d+) triangles")
_RAS = re.compile(rb"SPACE\s*=\s*RAS")


def read_mesh(path: str | PathLike[str]) -> pv.PolyData:
    """Read a mesh.

    Parameters
    ----------
    path : path
        PLY, STL, VTP, OBJ or glTF (``.gltf``, ``.glb``).

    Returns
    -------
    pyvista.PolyData
        Scan frame: mm, LPS. Coordinates are taken as they are, but for a file that says ``SPACE=RAS``, as
        3D Slicer may write it.

    Raises
    ------
    FileFormatError
        Missing, of another format, cut off, damaged, or without a point.

    Notes
    -----
    Every format but OBJ says how much there should be; so an OBJ file of another program that is cut off
    between two lines cannot be distinguished from a smaller one. Ours say it in their first line.
    """
    file = Path(path)
    suffix = file.suffix.lower()
    if suffix not in MESH_SUFFIXES:
        raise FileFormatError(
            f"meshes are read from {', '.join(MESH_SUFFIXES)}, got {suffix or 'no suffix'!r}",
            file=file,
            remedy=_REMEDY,
        )
    check_file(file, what="mesh", max_bytes=_MAX_BYTES)
    head = read_head(file, _HEAD)
    if not (is_whole_ply(file) if suffix == ".ply" else _may_be_whole(file, suffix, head)):
        raise FileFormatError("the mesh is cut off or damaged", file=file, remedy=_REMEDY)
    if suffix == ".gltf":
        _check_buffers(file)
    mesh = _read(file)
    if not _has_all(mesh, suffix, head):
        raise FileFormatError("the mesh is cut off or damaged", file=file, remedy=_REMEDY)
    if not mesh.n_points or not np.isfinite(mesh.points).all():
        raise FileFormatError("has no mesh in it", file=file, remedy=_REMEDY)
    return _to_lps(mesh, head)


def _read(file: Path) -> pv.PolyData:
    import pyvista as pv  # takes 0.6 s: not before a mesh is read

    try:
        with pv.vtk_verbosity("off"), pv.VtkErrorCatcher(send_to_logging=False) as caught:
            find: Any = pv.get_reader
            reader: Any = find(file).reader
            reader.Update()
    except Exception as error:  # pyvista and VTK raise many kinds
        raise FileFormatError(
            f"cannot be read as a mesh ({error or type(error).__name__})", file=file, remedy=_REMEDY
        ) from error
    if caught.events:
        what = caught.events[0].alert.splitlines()[0]
        raise FileFormatError(f"cannot be read as a mesh ({what})", file=file, remedy=_REMEDY)
    read: Any = reader.GetOutputDataObject(0)
    if not _attributes_fit(read):
        raise FileFormatError("the mesh is cut off or damaged", file=file, remedy=_REMEDY)
    read = pv.wrap(read)
    whole = _joined(read) if isinstance(read, pv.MultiBlock) else read
    mesh: pv.PolyData = (
        whole if isinstance(whole, pv.PolyData) else whole.extract_surface(algorithm="dataset_surface")
    )
    return mesh


def _joined(blocks: pv.MultiBlock) -> pv.DataSet:
    """Return the surfaces of all blocks as one; in pyvista 0.49.0, `combine` fails on blocks in blocks."""
    import pyvista as pv
    from vtkmodules.vtkFiltersGeometry import vtkCompositeDataGeometryFilter

    join = vtkCompositeDataGeometryFilter()
    join.SetInputDataObject(blocks)
    join.Update()
    joined: pv.DataSet = pv.wrap(join.GetOutput())
    return joined


def _attributes_fit(read: Any) -> bool:
    """Whether there are as many normals, colours and so on as points."""
    if not read.IsA("vtkPolyData"):
        return True
    data, n = read.GetPointData(), read.GetNumberOfPoints()
    return all(data.GetAbstractArray(k).GetNumberOfTuples() == n for k in range(data.GetNumberOfArrays()))


def _may_be_whole(file: Path, suffix: str, head: bytes) -> bool:
    """Whether a file is as long as its beginning says, where it says so."""
    size = file.stat().st_size
    if suffix == ".stl":
        count = int.from_bytes(head[_STL_HEADER - 4 : _STL_HEADER], "little")
        if size == _STL_HEADER + _STL_TRIANGLE * count and size > _STL_HEADER:
            return True
        return head.lstrip().startswith(b"solid") and b"endsolid" in _tail(file)
    if suffix == ".glb":
        return int.from_bytes(head[8:12], "little") == size > 0
    if suffix == ".gltf":
        return _is_json(file)
    if suffix == ".vtp":
        return _tail(file).rstrip().endswith(b"</VTKFile>")
    return _tail(file).endswith((b"\n", b"\r"))  # a line of OBJ that is cut off may still read as one


def _has_all(mesh: pv.PolyData, suffix: str, head: bytes) -> bool:
    """Whether as much was read as the file's header promises."""
    counts = _OBJ_COUNTS.match(head) if suffix == ".obj" else None
    return counts is None or (mesh.n_points, mesh.n_cells) == (int(counts[1]), int(counts[2]))


def _to_lps(mesh: pv.PolyData, head: bytes) -> pv.PolyData:
    space: Any = mesh.field_data.get("SPACE", ())
    if _RAS.search(head) or "RAS" in [str(word) for word in space]:
        turned: pv.PolyData = mesh.rotate_z(180.0)
        return turned
    return mesh


def _check_buffers(file: Path) -> None:
    """Refuse a glTF file whose points are to be read from a pipe or a device, where reading would wait."""
    content = json.loads(file.read_bytes())
    buffers = content.get("buffers", ()) if isinstance(content, dict) else ()
    for buffer in buffers if isinstance(buffers, list) else ():
        uri = buffer.get("uri") if isinstance(buffer, dict) else None
        if isinstance(uri, str) and not uri.startswith("data:"):
            check_file(file.parent / unquote(uri), what="mesh", max_bytes=_MAX_BYTES)


def _is_json(file: Path) -> bool:
    try:
        json.loads(file.read_bytes())
    except (ValueError, RecursionError):
        return False
    return True


def _tail(file: Path) -> bytes:
    with file.open("rb") as stream:
        stream.seek(max(0, file.stat().st_size - _HEAD))
        return stream.read()
