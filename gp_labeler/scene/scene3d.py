"""The 3D view: bone, ghosts, estimates, slices, where landmarks lie, and what is under a pixel.

Adapters only draw what they are shown; who shows what when is for the view that owns the scene. Landmarks,
names, outlines and the scale bar are painted over the frame (`views.painting.scene_overlay`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from vtkmodules.vtkRenderingCore import vtkLight, vtkRenderer

from gp_core.validation import FloatArray
from gp_labeler.imaging.surface import SurfaceHit
from gp_labeler.scene.added_meshes import AddedMeshActors
from gp_labeler.scene.bone import BoneActor
from gp_labeler.scene.bone_frame_cache import BoneFrameCache, RenderKey
from gp_labeler.scene.camera import SceneCamera
from gp_labeler.scene.colours import SceneColours, rgb
from gp_labeler.scene.gestures import CameraControl
from gp_labeler.scene.ghosts import GhostActor
from gp_labeler.scene.marks import LOOKED_AT, MarkSet
from gp_labeler.scene.orientation_cube import OrientationCube
from gp_labeler.scene.pose import PoseActor
from gp_labeler.scene.render_layers import RenderLayers
from gp_labeler.scene.segments import SegmentActor
from gp_labeler.scene.slice_planes import SlicePlaneActor
from gp_labeler.scene.target import RenderTarget

if TYPE_CHECKING:
    import pyvista as pv

__all__ = ["Scene3D"]

_EMPTY_BOUNDS = np.array([[-10.0, -10.0, -10.0], [10.0, 10.0, 10.0]])
_LIGHTS = (((0.35, 0.75, 1.0), 0.84), ((-0.9, 0.1, 0.6), 0.24), ((0.3, -0.9, 0.4), 0.14))
"""Directions in camera coordinates (right, up, towards the eye) and strengths: from above, with two fills."""

_HIDDEN_SLACK_VOXELS = 2.0
_FIT_SAMPLES = 20_000


class Scene3D:
    """A 3D scene in a render target.

    Parameters
    ----------
    target : RenderTarget
        Where it is drawn; closed with the scene.

    Attributes
    ----------
    bone, ghosts, pose, lines, slices : adapters
        What is drawn; each has ``show(...)``.
    marks : MarkSet
        The landmarks: where they are, and which are hidden.
    camera : SceneCamera
        Where it is seen from.
    control : CameraControl
        Takes mouse gestures.
    """

    def __init__(self, target: RenderTarget) -> None:
        self.target = target
        bone, base, overlay = vtkRenderer(), vtkRenderer(), vtkRenderer()
        self.layers = RenderLayers(bone, base, overlay)
        base.EraseOff()  # it is drawn against the depths of the bone
        overlay.SetLayer(1)
        overlay.InteractiveOff()
        for renderer in (bone, base, overlay):
            renderer.SetActiveCamera(bone.GetActiveCamera())
            renderer.SetUseOIT(renderer is bone)  # right in any order, but it takes a pass over every pixel
            target.add(renderer)
            _light(renderer)
        self._room = _Room(bone)
        self.camera = SceneCamera(bone.GetActiveCamera(), lambda: target.size)
        self.control = CameraControl(self.camera)
        self.bone = BoneActor(self.layers)
        self.added = AddedMeshActors(self.layers)
        self.slices = SlicePlaneActor(self.layers)
        self.lines = SegmentActor(self.layers)
        self.ghosts = GhostActor(self.layers)
        self.pose = PoseActor(self.layers)
        self.marks = MarkSet()
        self.cube = OrientationCube(self.layers)
        target.add(self.cube.renderer)
        self._bone_frames = BoneFrameCache(self.layers, target, self.bone, self.added, self.cube)
        self._behind: tuple[object, dict[bytes, bool]] = (None, {})
        self.set_colours(self.layers.colours)
        self.camera.view_from("A")
        self.camera.fit(_EMPTY_BOUNDS)

    @property
    def scale(self) -> float:
        """Device pixels per logical pixel."""
        return self.layers.scale

    @scale.setter
    def scale(self, value: float) -> None:
        self.layers.scale = float(value)

    def set_colours(self, colours: SceneColours) -> None:
        """Take a theme; lines and ghosts take it when they are shown next."""
        self.layers.colours = colours
        behind = self.layers.bone
        behind.GradientBackgroundOn()
        behind.SetBackground(rgb(colours.bottom))
        behind.SetBackground2(rgb(colours.top))
        self.bone.recolour()
        self.cube.recolour()

    @property
    def bounds(self) -> FloatArray:
        """(2, 3) lowest and highest coordinates of the bone and the marks, mm."""
        boxes = [box for box in (self.bone.bounds, self.added.bounds) if box is not None]
        if len(self.marks.positions):
            boxes.append(np.stack([self.marks.positions.min(axis=0), self.marks.positions.max(axis=0)]))
        if not boxes:
            return _EMPTY_BOUNDS
        return np.stack([np.min(boxes, axis=(0, 1)), np.max(boxes, axis=(0, 1))])

    def add_mesh(self, dataset: Any, *, name: str = "mesh", **options: Any) -> pv.Actor:
        """Draw a dataset with the bone, until `remove_mesh`.

        Each hides the other, as they lie in the scan; clicks go through it to the bone, and cuts spare it.

        Parameters
        ----------
        dataset : pyvista dataset
            Scan frame (LPS), mm: a mesh, points, a grid, an image or a ``MultiBlock`` of them.
        name : str
            A dataset of the same name is replaced.
        **options
            As for `pyvista.Plotter.add_mesh`, such as ``color="red"``, ``opacity=0.5``, ``scalars="height"``
            or ``style="wireframe"``.

        Returns
        -------
        pyvista.Actor
            Its ``prop`` may be changed; call `render` then.

        Raises
        ------
        GpError
            pyvista cannot draw it, or not with these options.

        Examples
        --------
        >>> import pyvista as pv
        >>> scene = Scene3D(RenderTarget.offscreen(64, 64))
        >>> _ = scene.add_mesh(pv.Sphere(radius=2.0), name="marker", color="red")
        >>> scene.remove_mesh("marker")
        True
        >>> scene.close()
        """
        return self.added.add(dataset, name, options)

    def remove_mesh(self, name: str = "mesh") -> bool:
        """Take away what `add_mesh` drew under a name; return whether it was there."""
        return self.added.remove(name)

    def fit(self) -> None:
        """Show everything from where the eye looks now."""
        shown: list[NDArray[Any]] = [
            surface.points[:: max(1, len(surface.points) // _FIT_SAMPLES)] for surface in self.bone.surfaces
        ]
        if self.added.bounds is not None:
            shown.append(_corners_of(self.added.bounds))
        points = np.concatenate([*shown, self.marks.positions]) if shown else self.marks.positions
        self.camera.fit(points if len(points) > 1 else _EMPTY_BOUNDS)

    @property
    def is_fine(self) -> bool:
        """Whether the bone as it was to be seen in the last frame is drawn finely, and kept."""
        return self._bone_frames.is_fine(self._render_key())

    @property
    def n_bone_frames(self) -> int:
        """How often bone has been drawn."""
        return self._bone_frames.n_drawn

    def render(self, *, quick: bool = False) -> None:
        """Draw one frame; the bone again only where it or the camera has changed.

        Parameters
        ----------
        quick : bool
            Where the bone must be drawn again, draw its coarser preview mesh, if there is one; `advance` then
            draws it finely.
        """
        self._set_clipping()
        key = self._render_key()
        if not quick:
            self._advance(key)
        elif not (self._bone_frames.is_fine(key) or self._bone_frames.may_stay(key)):
            self._refresh_cube()
            self._bone_frames.draw_quickly(key, self.camera.direction)
        self._draw_over_bone()

    def advance(self, seconds: float) -> bool:
        """Draw more of the fine bone, in about so many seconds, unseen yet; return whether it is done."""
        self._set_clipping()
        return self._advance(self._render_key(), seconds)

    def _advance(self, key: RenderKey, seconds: float = np.inf) -> bool:
        self._refresh_cube()
        return self._bone_frames.advance(key, self.camera.direction, seconds)

    def _refresh_cube(self) -> None:
        self.cube.refresh(self.camera.viewpoint(), self.camera)

    def _draw_over_bone(self) -> None:
        self.pose.refresh(self.camera.viewpoint())
        self._bone_frames.restore()
        covered = self.cube.visible and bool(self.slices.images)  # a slice may stand before it
        over = (self.cube.renderer,) if covered else ()
        self.target.draw(self.layers.base, *over, self.layers.overlay)

    def _render_key(self) -> RenderKey:
        look = (
            *self.bone.look,
            self.added.look,
            self.cube.visible,
            self.cube.axes.tobytes(),
            self.layers.scale,
        )
        matrix = self.camera.viewpoint().matrix
        return RenderKey(matrix.tobytes(), self.target.size, look, self.bone.version)

    def forget(self) -> None:
        """Draw everything again: the context of OpenGL in which pictures were kept is gone."""
        self.target.forget()
        self._bone_frames.forget()

    def image(self, width: int | None = None, height: int | None = None) -> NDArray[np.uint8]:
        """Draw a frame, of another size where given, and return it, (h, w, 3)."""
        before = self.target.size
        self.target.resize(width or before[0], height or before[1])
        self.render()
        pixels = self.target.pixels()
        self.target.resize(*before)
        return pixels

    def pick(self, x: float, y: float) -> SurfaceHit | None:
        """Return the point of the bone seen at a pixel, or None where there is none."""
        self._set_clipping()
        ray = self._viewpoint_ray(x, y)
        hit = self.bone.pick(*ray)
        return None if hit is not None and self.slices.blocks(ray[0], hit.point) else hit

    def ray(self, x: float, y: float) -> tuple[FloatArray, FloatArray]:
        """Return where the ray through a pixel begins, (3,) mm, and its (3,) direction."""
        return self._viewpoint_ray(x, y)

    def pick_slice(self, x: float, y: float) -> FloatArray | None:
        """Return the (3,) point of a slice's picture seen at a pixel, or None where there is none."""
        self._set_clipping()
        origin, direction = self._viewpoint_ray(x, y)
        point, hit = self.slices.pick(origin, direction), self.bone.pick(origin, direction)
        nearer = hit is None or point is None or (point - hit.point) @ direction < 0
        return point if nearer else None

    def display_of(self, points: ArrayLike) -> FloatArray:
        """Return the (N, 2) pixels of (N, 3) scan positions, seen or not; `pick` there finds them again."""
        return self.camera.viewpoint().display(points)[:, :2]

    def hidden(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Return which of (N, 3) scan positions lie behind bone or slices; those on a near surface do not."""
        scan = np.asarray(points, dtype=np.float64).reshape(-1, 3)
        slack = _HIDDEN_SLACK_VOXELS * max((s.voxel_mm for s in self.bone.surfaces), default=0.0)
        if not slack or not len(scan):
            return np.zeros(len(scan), dtype=bool)
        seen = (self._render_key(), self.slices.images)
        if self._behind[0] != seen:
            self._behind = (seen, {})
        known = self._behind[1]
        new = [n for n, point in enumerate(scan) if point.tobytes() not in known]
        known.update(zip((scan[n].tobytes() for n in new), self._behind_bone(scan[new], slack), strict=True))
        return np.array([known[point.tobytes()] for point in scan], dtype=bool)

    def _behind_bone(self, scan: FloatArray, slack: float) -> list[bool]:
        view = self.camera.viewpoint()
        display = view.display(scan)
        near = view.scan(np.column_stack([display[:, :2], np.full(len(scan), -1.0)]))
        towards = near - scan
        distance = np.maximum(np.linalg.norm(towards, axis=1, keepdims=True), 1e-9)
        ends = scan + towards / distance * np.minimum(slack, distance)
        return [
            self.bone.blocks(eye, end) or self.slices.blocks(eye, end)
            for eye, end in zip(near, ends, strict=True)
        ]

    def mark_at(self, x: float, y: float, within: float = 10.0) -> str | None:
        """Return the key of the landmark nearest to a pixel, seen before hidden, within logical pixels."""
        marks = self.marks.marks
        if not marks:
            return None
        away = np.linalg.norm(self.display_of(self.marks.positions) - [x, y], axis=1)
        pickable = np.array([mark.state not in LOOKED_AT for mark in marks])
        near = pickable & (away <= within * self.scale)
        if not near.any():
            return None
        rank = away + np.where(self.hidden(self.marks.positions), within * self.scale, 0.0)
        return marks[int(np.where(near, rank, np.inf).argmin())].key

    def close(self) -> None:
        """Let go of everything drawn, and of the target."""
        self._bone_frames.close()
        for adapter in (self.cube, self.ghosts, self.pose, self.lines, self.slices, self.added, self.bone):
            adapter.close()
        for renderer in (self.layers.overlay, self.layers.base, self.layers.bone):
            renderer.RemoveAllLights()
            renderer.RemoveAllViewProps()
        self.target.close()

    def _viewpoint_ray(self, x: float, y: float) -> tuple[FloatArray, FloatArray]:
        return self.camera.viewpoint().ray(x, y)

    def _set_clipping(self) -> None:
        """Keep everything between the near and the far plane; all layers share them."""
        self._room.hold(self._drawn_bounds())

    def _drawn_bounds(self) -> FloatArray:
        boxes = [self.bounds, np.stack([self.camera.focus - 5.0, self.camera.focus + 5.0])]
        for renderer in (self.layers.base, self.layers.overlay):
            drawn = np.array(renderer.ComputeVisiblePropBounds()).reshape(3, 2).T
            if (drawn[0] <= drawn[1]).all():
                boxes.append(drawn)
        return np.stack([np.min(boxes, axis=(0, 1)), np.max(boxes, axis=(0, 1))])


class _Room:
    """Near and far plane of the camera: moved with it, else only for what lies outside them.

    A point more must not change the projection, or the bone would be drawn again for it.
    """

    def __init__(self, renderer: vtkRenderer) -> None:
        self._renderer = renderer
        self._box = np.zeros((2, 3))
        self._time = -1

    def hold(self, box: FloatArray) -> None:
        """See to it that a (2, 3) box, mm, lies between the planes."""
        camera = self._renderer.GetActiveCamera()
        held = (box[0] >= self._box[0]).all() and (box[1] <= self._box[1]).all()
        if held and camera.GetMTime() == self._time:
            return
        margin = 0.15 * float(np.linalg.norm(box[1] - box[0])) + 2.0
        self._box = box + margin * np.array([[-1.0], [1.0]])
        self._renderer.ResetCameraClippingRange(self._box.T.ravel().tolist())
        self._time = camera.GetMTime()


def _corners_of(box: FloatArray) -> FloatArray:
    """Return the (8, 3) corners of a (2, 3) box."""
    return np.array([[box[a][0], box[b][1], box[c][2]] for a, b, c in np.ndindex(2, 2, 2)])


def _light(renderer: vtkRenderer) -> None:
    """Light from above and beside the eye, moving with it, so that form shows from everywhere."""
    renderer.AutomaticLightCreationOff()
    for direction, strength in _LIGHTS:
        light = vtkLight()
        light.SetLightTypeToCameraLight()
        light.SetPosition(direction)
        light.SetFocalPoint(0, 0, 0)
        light.SetIntensity(strength)
        renderer.AddLight(light)
