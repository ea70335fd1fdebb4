"""Meshes of every format come back as they were written; one that is cut off does not come back at all."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv

from gp_core.errors import GpError
from gp_labeler.imaging.mesh_files import MESH_SUFFIXES, read_mesh
from gp_labeler.imaging.surface_files import write_mesh

CENTRE = np.array([3.0, -20.0, 12.0])


def ball() -> pv.PolyData:
    return pv.Sphere(radius=4.0, center=CENTRE, theta_resolution=24, phi_resolution=20)


@pytest.mark.parametrize("suffix", MESH_SUFFIXES)
def test_what_was_written_is_read(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"bone{suffix}"
    write_mesh(ball(), path)
    mesh = read_mesh(path)
    assert (mesh.n_points, mesh.n_cells) == (434, 864)
    assert mesh.volume == pytest.approx(ball().volume, rel=1e-4)
    np.testing.assert_allclose(np.sort(mesh.points, axis=0), np.sort(ball().points, axis=0), atol=1e-4)


@pytest.mark.parametrize("suffix", [".ply", ".stl", ".vtp", ".obj"])
def test_what_pyvista_wrote_is_read_binary_or_text(suffix: str, tmp_path: Path) -> None:
    for n, binary in enumerate((True, False)):
        path = tmp_path / f"bone{n}{suffix}"
        ball().save(path, binary=binary)
        assert read_mesh(path).n_cells == 864


@pytest.mark.parametrize("binary", [True, False])
@pytest.mark.parametrize("suffix", MESH_SUFFIXES)
def test_a_file_that_is_cut_off_is_refused(suffix: str, binary: bool, tmp_path: Path, capfd) -> None:
    path, cut = tmp_path / f"whole{suffix}", tmp_path / f"cut{suffix}"
    if binary:
        write_mesh(ball(), path)
    elif suffix in (".ply", ".stl", ".vtp"):
        ball().save(path, binary=False)
    else:
        pytest.skip("this format has one form only")
    raw = path.read_bytes()
    size = len(raw.rstrip(b"\n")) if suffix in (".stl", ".vtp", ".gltf") else len(raw)
    lines = [size - 300 + n for n, byte in enumerate(raw[size - 300 : size - 1]) if byte == 10]
    for n in {
        0,
        1,
        80,
        84,
        size - 1,
        size - 2,
        *lines,
        *np.random.default_rng(0).integers(0, size, 25).tolist(),
    }:
        cut.write_bytes(raw[:n])
        with pytest.raises(GpError, match=rf"cut\{suffix}: .*\. Export it again"):
            read_mesh(cut)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("suffix", [".ply", ".vtp", ".obj", ".stl"])
def test_rubbish_is_refused_in_one_line(suffix: str, tmp_path: Path, capfd) -> None:
    path = tmp_path / f"noise{suffix}"
    path.write_bytes(np.random.default_rng(1).integers(0, 256, 5000, dtype=np.uint8).tobytes() + b"\n")
    with pytest.raises(GpError, match="Export it again") as error:
        read_mesh(path)
    assert "\n" not in str(error.value)
    assert capfd.readouterr().err == ""


def test_other_suffixes_and_missing_files_are_named(tmp_path: Path) -> None:
    with pytest.raises(GpError, match=r"meshes are read from \.ply"):
        read_mesh(tmp_path / "head.nrrd")
    with pytest.raises(GpError, match=r"none\.ply"):
        read_mesh(tmp_path / "none.ply")


def test_a_file_in_slicers_older_frame_is_turned(tmp_path: Path) -> None:
    path = tmp_path / "ras.stl"
    write_mesh(ball(), path)
    raw = path.read_bytes()
    path.write_bytes(raw.replace(b"SPACE=LPS", b"SPACE=RAS", 1))
    np.testing.assert_allclose(read_mesh(path).center, CENTRE * [-1, -1, 1], atol=1e-4)


@pytest.mark.parametrize("suffix", [".ply", ".stl", ".vtp", ".obj"])
def test_files_say_that_they_are_lps(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"bone{suffix}"
    write_mesh(ball(), path)
    said = b"LPS" if suffix == ".vtp" else b"SPACE=LPS"
    assert said in path.read_bytes()[:300] or read_mesh(path).field_data["SPACE"].tolist() == ["LPS"]


def test_faces_of_many_corners_are_read_and_measured(tmp_path: Path) -> None:
    path = tmp_path / "dodecahedron.ply"
    pv.Dodecahedron().save(path)
    assert read_mesh(path).n_cells == 12
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(GpError, match="cut off"):
        read_mesh(path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
def test_points_are_not_awaited_from_a_pipe(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "points.bin")
    content = {"asset": {"version": "2.0"}, "buffers": [{"uri": "points.bin", "byteLength": 36}]}
    (tmp_path / "bone.gltf").write_text(json.dumps(content))
    with pytest.raises(GpError, match=r"points\.bin: is a device or a pipe"):
        read_mesh(tmp_path / "bone.gltf")
