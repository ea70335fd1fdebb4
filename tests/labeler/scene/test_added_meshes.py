"""What is added is drawn where it lies, hides bone and is hidden by it, and leaves nothing behind."""

from __future__ import annotations

import gc
import weakref

import numpy as np
import pytest
import pyvista as pv

from gp_core.errors import GpError
from gp_labeler.imaging.surface import extract_isosurface
from gp_labeler.imaging.volume import Volume
from gp_labeler.scene.scene3d import Scene3D
from gp_labeler.scene.target import RenderTarget

RED = np.array([255, 0, 0])


@pytest.fixture(scope="module")
def ball():
    index = np.moveaxis(np.indices((40, 40, 40)), 0, -1) - 19.5
    volume = Volume.from_parts(
        (12 - np.linalg.norm(index, axis=-1)).astype(np.float32), [0.5] * 3, [-9.75] * 3
    )
    return extract_isosurface(volume, 0.0)  # radius 6 mm about the origin


@pytest.fixture
def scene(ball):
    scene = Scene3D(RenderTarget.offscreen(240, 200))
    scene.bone.show([ball])
    scene.cube.visible = False
    scene.camera.look((0.0, 1.0, 0.0), (0, 0, 1))
    scene.fit()
    yield scene
    scene.close()


def is_red(scene: Scene3D, point) -> bool:
    x, y = np.rint(scene.display_of(np.array([point]))[0]).astype(int)
    red, green, blue = scene.image()[y, x].astype(int)
    return bool(red > 100 and green < 60 and blue < 60)


def ahead(scene: Scene3D, mm: float) -> np.ndarray:
    return scene.camera.focus - mm * scene.camera.direction


def test_it_is_seen_in_front_of_bone_and_hidden_behind_it(scene: Scene3D) -> None:
    middle = np.zeros(3)
    before = scene.image()
    scene.add_mesh(pv.Sphere(radius=1.0, center=ahead(scene, 8.0)), name="near", color="red", lighting=False)
    assert is_red(scene, middle)
    assert scene.remove_mesh("near")
    np.testing.assert_array_equal(scene.image(), before)
    scene.add_mesh(pv.Sphere(radius=1.0, center=ahead(scene, -8.0)), name="far", color="red", lighting=False)
    assert not is_red(scene, middle)
    scene.bone.opacity = 0.3
    seen = scene.image()[100, 120].astype(int)
    assert seen[0] - seen[2] > 40  # through transparent bone, but not as if it lay before it
    assert not is_red(scene, middle)


def test_a_name_is_drawn_once_and_goes_once(scene: Scene3D) -> None:
    at = ahead(scene, 8.0)
    scene.add_mesh(pv.Sphere(radius=1.0, center=at), color="red", lighting=False)
    scene.add_mesh(pv.Sphere(radius=1.0, center=at), color="lime", lighting=False)
    assert scene.added.names == ("mesh",)
    assert not is_red(scene, np.zeros(3))
    assert scene.remove_mesh()
    assert not scene.remove_mesh()


def test_a_point_more_draws_neither_bone_nor_mesh_again(scene: Scene3D) -> None:
    actor = scene.add_mesh(pv.Sphere(radius=1.0, center=ahead(scene, 8.0)), color="red", lighting=False)
    scene.render()
    n = scene.n_bone_frames
    scene.render()
    assert scene.n_bone_frames == n
    actor.prop.color = "lime"
    assert not is_red(scene, np.zeros(3))
    assert scene.n_bone_frames == n + 1


@pytest.mark.parametrize(
    "options",
    [
        {"style": "wireframe", "color": "red"},
        {"scalars": "height", "cmap": "viridis", "show_scalar_bar": False},
        {"opacity": 0.4, "color": "red"},
        {"show_edges": True},
        {"smooth_shading": True, "pbr": False},
    ],
    ids=lambda options: next(iter(options)),
)
def test_options_are_those_of_pyvista(scene: Scene3D, options) -> None:
    mesh = pv.Sphere(radius=2.0, center=ahead(scene, 8.0))
    mesh["height"] = mesh.points[:, 2]
    before = scene.image().astype(int)
    scene.add_mesh(mesh, **options)
    changed = np.abs(scene.image().astype(int) - before).max(axis=-1) > 8
    assert 20 < changed.sum() < changed.size / 3
    y, x = np.argwhere(changed).mean(axis=0)
    np.testing.assert_allclose([x, y], scene.display_of(np.zeros((1, 3)))[0], atol=6)


@pytest.mark.parametrize("quick", [True, False])
def test_every_kind_of_dataset_is_drawn(scene: Scene3D, quick: bool) -> None:
    at = ahead(scene, 8.0)
    grid = pv.ImageData(dimensions=(4, 4, 4), origin=at - 1)
    both = pv.MultiBlock([pv.Cube(center=at), pv.Sphere(center=at)])
    points, line = pv.PolyData(at[None] + np.eye(3)), pv.Line(at - 2, at + 2)
    for data in (points, line, grid, grid.cast_to_unstructured_grid(), both):
        scene.added.close()
        scene.render()
        before = scene.target.pixels().astype(int)
        scene.add_mesh(data, color="red", lighting=False, point_size=12, line_width=4)
        scene.render(quick=quick)
        assert (scene.target.pixels().astype(int) != before).any(), type(data)


def test_it_counts_for_the_whole_view(scene: Scene3D) -> None:
    scene.add_mesh(pv.Sphere(radius=1.0, center=(0, 0, 40.0)), color="red", lighting=False)
    scene.fit()
    assert is_red(scene, (0, 0, 40.0))
    np.testing.assert_allclose(scene.bounds[1, 2], 41.0, atol=0.1)


def test_what_pyvista_cannot_draw_changes_nothing(scene: Scene3D) -> None:
    scene.add_mesh(pv.Sphere(), color="red")
    for data, options, words in (
        (pv.Sphere(), {"colour": "red"}, "colour"),
        (pv.Sphere(), {"scalars": "none"}, "none"),
        (3.0, {}, "cannot be drawn"),
        (pv.PolyData(), {}, "cannot be drawn"),
    ):
        with pytest.raises(GpError, match=words):
            scene.add_mesh(data, **options)
    assert scene.added.names == ("mesh",)


def test_clicks_go_through_it_to_the_bone(scene: Scene3D) -> None:
    x, y = scene.display_of(np.zeros((1, 3)))[0]
    hit = scene.pick(x, y)
    scene.add_mesh(pv.Sphere(radius=1.0, center=ahead(scene, 8.0)))
    np.testing.assert_array_equal(scene.pick(x, y).point, hit.point)


def test_nothing_is_left_of_it(ball) -> None:
    scene = Scene3D(RenderTarget.offscreen(100, 80))
    mesh = pv.Sphere()
    kept = [weakref.ref(scene.add_mesh(mesh)), weakref.ref(mesh)]
    scene.render()
    scene.close()
    del scene, mesh
    gc.collect()
    assert [ref() for ref in kept] == [None, None]
