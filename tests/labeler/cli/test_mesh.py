"""`gp-labeler mesh`: every option that an error names resolves that error, and the surface is right."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import SimpleITK
import tifffile
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOPLY import vtkPLYReader
from window_cases import BALL_MM, VOXEL_MM, ball_volume

from gp_labeler.cli.entry import main

MOUSE = Path(__file__).resolve().parents[4] / "shared" / "data" / "mouse_ct" / "BALB_CJ_.nii.gz"


def corners(path: Path) -> np.ndarray:
    reader = vtkPLYReader()
    reader.SetFileName(str(path))
    reader.Update()
    return vtk_to_numpy(reader.GetOutput().GetPoints().GetData())


def ball_values() -> np.ndarray:
    """A ball with a horn towards the first slice, so that a mirror shows."""
    array = ball_volume().array.astype(np.uint16)
    array[4:20, 30:34, 30:34] = 1400
    return array


def write_stack(folder: Path, array: np.ndarray, name: str = "slice") -> Path:
    folder.mkdir(exist_ok=True)
    for k, plane in enumerate(array):
        tifffile.imwrite(folder / f"{name}{k:03}.tif", plane)
    return folder


def mesh(capsys, *arguments: object) -> tuple[int, str]:
    status = main(["mesh", *map(str, arguments)])
    captured = capsys.readouterr()
    return status, captured.err if status else captured.out


@pytest.fixture
def out(tmp_path) -> Path:
    return tmp_path / "mesh.ply"


def test_spacing_is_asked_for_and_given(tmp_path, out, capsys) -> None:
    stack = write_stack(tmp_path / "stack", ball_values())
    status, said = mesh(capsys, stack, "-o", out, "--threshold", 1000)
    assert status == 2
    assert "--spacing" in said
    assert not out.exists()
    status, said = mesh(capsys, stack, "-o", out, "--threshold", 1000, "--spacing", VOXEL_MM)
    assert (status, said.count("\n")) == (0, 1)
    size = np.ptp(corners(out), axis=0)
    np.testing.assert_allclose(size[:2], 2 * BALL_MM, atol=0.1)
    mesh(capsys, stack, "-o", out, "--threshold", 1000, "--spacing", 0.2, 0.25, 0.5)
    np.testing.assert_allclose(np.ptp(corners(out), axis=0), size / VOXEL_MM * [0.2, 0.25, 0.5], atol=0.01)


def test_reverse_mirrors_the_stack(tmp_path, out, capsys) -> None:
    stack = write_stack(tmp_path / "stack", ball_values())
    how = (stack, "-o", out, "--threshold", 1000, "--spacing", VOXEL_MM)
    mesh(capsys, *how)
    forward = corners(out)
    status, _ = mesh(capsys, *how, "--reverse")
    last = (len(ball_values()) - 1) * VOXEL_MM
    assert status == 0
    np.testing.assert_allclose(corners(out)[:, 2].min(), last - forward[:, 2].max(), atol=1e-4)
    np.testing.assert_allclose(corners(out)[:, 2].max(), last - forward[:, 2].min(), atol=1e-4)


def test_a_gap_is_named_and_accepted(tmp_path, out, capsys) -> None:
    stack = write_stack(tmp_path / "stack", ball_values())
    (stack / "slice040.tif").unlink()
    how = (stack, "-o", out, "--threshold", 1000, "--spacing", VOXEL_MM)
    status, said = mesh(capsys, *how)
    assert status == 2
    assert "--accept gap" in said
    status, _ = mesh(capsys, *how, "--accept", "gap", "--accept", "doubled")
    assert status == 0
    np.testing.assert_allclose(np.ptp(corners(out), axis=0)[:2], 2 * BALL_MM, atol=0.1)


def test_one_of_several_stacks_is_chosen(tmp_path, out, capsys) -> None:
    stack = write_stack(tmp_path / "stack", ball_values(), "left_")
    write_stack(stack, ball_values()[:, ::2, ::2], "right_")
    how = (stack, "-o", out, "--threshold", 1000, "--spacing", VOXEL_MM)
    status, said = mesh(capsys, *how)
    assert status == 2
    assert "--series" in said
    status, _ = mesh(capsys, *how, "--series", "left")
    assert status == 0
    np.testing.assert_allclose(np.ptp(corners(out), axis=0)[:2], 2 * BALL_MM, atol=0.1)


def test_a_head_of_impossible_size_is_accepted_only_knowingly(tmp_path, out, capsys) -> None:
    image = SimpleITK.GetImageFromArray(ball_values())
    image.SetSpacing([25.0] * 3)
    SimpleITK.WriteImage(image, str(tmp_path / "huge.nrrd"))
    how = (tmp_path / "huge.nrrd", "-o", out, "--threshold", 1000)
    status, said = mesh(capsys, *how)
    assert status == 2
    assert "--accept extent" in said
    assert mesh(capsys, *how, "--accept", "extent")[0] == 0
    np.testing.assert_allclose(np.ptp(corners(out), axis=0)[0], 100 * 2 * BALL_MM, rtol=0.02)


def test_a_colour_channel_is_chosen(tmp_path, out, capsys) -> None:
    grey = (ball_values() // 6).astype(np.uint8)
    stack = write_stack(tmp_path / "stack", np.stack([0 * grey, grey, 0 * grey], axis=-1))
    how = (stack, "-o", out, "--threshold", 1000 // 6, "--spacing", VOXEL_MM)
    assert mesh(capsys, *how)[0] == 2  # luminance of pure green never comes so far
    assert mesh(capsys, *how, "--channel", 1)[0] == 0
    np.testing.assert_allclose(np.ptp(corners(out), axis=0)[:2], 2 * BALL_MM, atol=0.15)


def test_stride_and_region_of_a_real_scan(out, capsys) -> None:
    if not MOUSE.exists():
        pytest.skip("needs ../shared/data/mouse_ct")
    image = SimpleITK.ReadImage(str(MOUSE))
    low, size = [60, 60, 60], [80, 80, 80]
    region = [n for a in range(3) for n in (low[a], low[a] + size[a])]
    status, said = mesh(capsys, MOUSE, "-o", out, "--threshold", 25, "--region", *region, "--stride", 2)
    assert status == 0
    assert f"{2 * image.GetSpacing()[0]:g} x" in said
    ends = [image.TransformIndexToPhysicalPoint(index) for index in (low, np.add(low, size).tolist())]
    assert (corners(out) >= np.min(ends, axis=0) - 1e-4).all()
    assert (corners(out) <= np.max(ends, axis=0) + 1e-4).all()
    assert (np.ptp(corners(out), axis=0) > 0.5 * np.array(size) * image.GetSpacing()).all()


def test_islands_are_left_out_as_asked(tmp_path, out, capsys) -> None:
    array = ball_values()
    array[60:62, 60:62, 60:62] = 1400
    image = SimpleITK.GetImageFromArray(array)
    image.SetSpacing([VOXEL_MM] * 3)
    SimpleITK.WriteImage(image, str(tmp_path / "ball.nrrd"))
    reach = {}
    for name, extra in {
        "default": (),
        "all": ("--smallest", 0),
        "one": ("--smallest", 0, "--largest", 1),
    }.items():
        assert mesh(capsys, tmp_path / "ball.nrrd", "-o", out, "--threshold", 1000, *extra)[0] == 0
        reach[name] = corners(out).max()
    assert reach["all"] > 60 * VOXEL_MM - 0.2
    assert reach["default"] == reach["one"] < 58 * VOXEL_MM


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--region", "0", "5", "0", "5", "7", "7"], "region must be ranges of voxels"),
        (["--stride", "0"], "stride must be a whole number from 1"),
        (["--smallest", "-1"], "--smallest must be a length in mm from 0"),
        (["--largest", "0"], "--largest must be a whole number from 1"),
    ],
)
def test_impossible_values_are_one_line(tmp_path, out, arguments, words, capsys) -> None:
    stack = write_stack(tmp_path / "stack", ball_values()[:8])
    status, said = mesh(capsys, stack, "-o", out, "--spacing", VOXEL_MM, *arguments)
    assert status == 2
    assert words in said
    assert said.count("\n") == 1


def test_help_has_an_example_and_names_every_option(capsys) -> None:
    with pytest.raises(SystemExit):
        main(["mesh", "--help"])
    said = capsys.readouterr().out
    assert "gp-labeler mesh head.nrrd -o head.ply" in said
    for option in ("spacing", "series", "channel", "reverse", "accept", "stride", "region", "threshold"):
        assert f"--{option}" in said
