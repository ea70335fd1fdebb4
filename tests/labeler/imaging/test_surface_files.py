"""Meshes are written whole or not at all, under any name."""

from __future__ import annotations

import os
import resource
import signal
from pathlib import Path

import pytest
from vtkmodules.vtkFiltersSources import vtkSphereSource

from gp_core.errors import GpError
from gp_labeler.imaging.surface_files import write_mesh

SUFFIXES = (".ply", ".stl", ".vtp", ".obj", ".gltf", ".glb")
OLD = b"the mesh of yesterday"


def sphere():
    source = vtkSphereSource()
    source.SetThetaResolution(100)
    source.SetPhiResolution(100)
    source.Update()
    return source.GetOutput()


@pytest.mark.parametrize("missing", [1, 100_000])
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_full_disk_keeps_the_old_mesh(suffix: str, missing: int, tmp_path: Path, capfd) -> None:
    mesh, path = sphere(), tmp_path / f"bone{suffix}"
    write_mesh(mesh, path)
    n_bytes = path.stat().st_size
    path.write_bytes(OLD)
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (max(n_bytes - missing, 1), limit[1]))
        with pytest.raises(GpError, match=r"bone\.\w+: .*cannot be written"):
            write_mesh(mesh, path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)
        signal.signal(signal.SIGXFSZ, handler)
    assert path.read_bytes() == OLD
    assert list(tmp_path.iterdir()) == [path]
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_name_that_is_not_utf8_is_written(suffix: str, tmp_path: Path) -> None:
    folder = tmp_path / os.fsdecode(b"sch\xe4del")
    try:
        folder.mkdir()
    except OSError:
        pytest.skip("this file system takes UTF-8 only")
    path = folder / os.fsdecode(b"bone\xff" + suffix.encode())
    write_mesh(sphere(), path)
    assert path.stat().st_size > 10_000
