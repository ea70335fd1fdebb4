"""The edge of bone on a slice, against VTK's, and against circles."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkFiltersCore import vtkFlyingEdges2D

from gp_labeler.imaging.surface import extract_isosurface
from gp_labeler.imaging.volume import Volume
from gp_labeler.imaging.vtk_arrays import to_numpy, to_vtk
from gp_labeler.scene.bone_edge import BoneEdge, nearest_on_segments
from gp_labeler.scene.level_lines import level_segments
from gp_labeler.scene.planes import Plane
from gp_labeler.scene.slices import VolumeSlicer


def of_vtk(values: np.ndarray, level: float) -> np.ndarray:
    image = vtkImageData()
    image.SetDimensions(values.shape[1], values.shape[0], 1)
    image.GetPointData().SetScalars(to_vtk(values.ravel()))
    edges = vtkFlyingEdges2D()
    edges.SetInputData(image)
    edges.SetValue(0, level)
    edges.Update()
    lines = edges.GetOutput()
    points = to_numpy(lines.GetPoints().GetData())[:, :2].astype(float)
    return points[to_numpy(lines.GetLines().GetConnectivityArray()).reshape(-1, 2)]


@pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.float32])
def test_the_edge_is_vtks(dtype: type) -> None:
    values = np.random.default_rng(3).uniform(0, 100, (30, 40)).astype(dtype)
    ours, vtks = level_segments(values, 49.5), of_vtk(values, 49.5)
    for some, others in ((ours, vtks), (vtks, ours)):
        away, _ = cKDTree(others.reshape(-1, 2)).query(some.reshape(-1, 2))
        assert away.max() < 1e-4
    assert len(ours) == len(vtks)


def test_lines_lie_on_the_mesh_of_the_same_level_in_noise_too() -> None:
    """Where two corners of a cell that face each other lie above, the lines could join either way."""
    values = np.random.default_rng(0).integers(0, 100, (4, 16, 18)).astype(np.uint16)
    mesh = extract_isosurface(Volume.from_parts(values, [1.0] * 3), 50, smallest_mm=0)
    for k, layer in enumerate(values):
        middles = level_segments(layer, 49.5).mean(axis=1)
        assert len(middles) > 200
        away = [np.linalg.norm(mesh.project([x, y, k]).point - [x, y, k]) for x, y in middles]
        assert max(away) < 1e-5


def test_any_strides_and_missing_values() -> None:
    values = np.random.default_rng(5).normal(size=(20, 31))
    turned, ours = level_segments(values.T[::-1], 0.2), level_segments(values, 0.2)
    placed = np.sort(np.stack([30 - turned[..., 1], turned[..., 0]], axis=-1).reshape(-1, 2), axis=0)
    assert placed == pytest.approx(np.sort(ours.reshape(-1, 2), axis=0), abs=1e-12)
    values[7, 11] = np.nan
    lines = level_segments(values, 0.2)
    assert np.isfinite(lines).all()
    assert 0 < len(ours) - len(lines) <= 8


def test_a_circle_is_a_closed_line_of_its_length() -> None:
    y, x = np.mgrid[:61, :81].astype(float)
    segments = level_segments(20 - np.hypot(x - 41.3, y - 29.8), 0)
    assert np.hypot(*(segments.reshape(-1, 2) - [41.3, 29.8]).T) == pytest.approx(20, abs=0.01)
    assert np.linalg.norm(segments[:, 0] - segments[:, 1], axis=1).sum() == pytest.approx(
        40 * np.pi, rel=1e-3
    )
    _, times = np.unique(np.round(segments.reshape(-1, 2), 9), axis=0, return_counts=True)
    assert (times == 2).all()
    assert level_segments(np.zeros((5, 5), bool), 0.5).shape == (0, 2, 2)


def test_the_nearest_point_of_the_edge_lies_on_bone(ball) -> None:
    edge = BoneEdge(VolumeSlicer(ball), Plane.CORONAL.in_scan, 1000.0)
    middle = np.array(ball.extent.mean(axis=0))
    for angle in np.linspace(0, 2 * np.pi, 12):
        towards = np.array([np.cos(angle), 0, np.sin(angle)])
        near = edge.nearest(middle + 6.8 * towards + [0, 1.0, 0], 2.0)
        assert near is not None
        assert np.linalg.norm(near - middle) == pytest.approx(6.0, abs=0.04)
        assert abs(near[1] - middle[1] - 1.0) <= 0.125 + 1e-9
    assert edge.nearest(middle, 2.0) is None
    assert nearest_on_segments(np.zeros(2), np.empty((0, 2, 2))) is None
    ends = np.array([[[1.0, -1], [1, 3]], [[-4, 0], [-2, 0]]])
    assert nearest_on_segments(np.zeros(2), ends).tolist() == [1, 0]
