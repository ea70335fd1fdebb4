"""Figures of specimens, atlases and poses, for notebooks and scripts: pyvista plotters, ready to show.

Examples
--------
>>> import gp_core
>>> from gp_labeler.plotting import plot
>>> plotter = plot(gp_core.Atlas.published(), off_screen=True, window_size=(320, 240))
>>> picture = plotter.screenshot()
>>> plotter.close()
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from gp_core import Atlas, CochleaPose, GpError, LandmarkSet, RigidTransform, Side
from gp_labeler.imaging.datasets import to_pyvista
from gp_labeler.imaging.mesh import Surface
from gp_labeler.imaging.volume import Volume
from gp_labeler.scene.colours import LIGHT

if TYPE_CHECKING:
    import pyvista as pv

__all__ = ["compare", "plot"]

_COLOURS = (*(LIGHT.states[name] for name in ("pose", "pose_2", "truth", "touch")), "#7A5195", "#6B747E")
"""Of the poses that are compared; they can be told apart by the colour-blind."""

_BONE_OPACITY = 0.25
_ZOOM = 1.25
_DOT_PIXELS = 14
_NAME_PIXELS = 16


def plot(
    data: Any,
    *,
    over: Surface | None = None,
    T_scan_data: RigidTransform | None = None,
    names: bool = True,
    **options: Any,
) -> pv.Plotter:
    """Draw a specimen, an atlas or a pose.

    Parameters
    ----------
    data : Specimen, LandmarkSet, Atlas, CochleaPose, Surface or Volume
        Landmarks are drawn as points with their names; an atlas as its means, each with the region that
        contains 95 % of animals; a pose as its axis, its 95 % region and cone, and the mean cochlea; a volume
        as a block of grey values.
    over : Surface, optional
        Bone to draw with it, translucent; scan frame.
    T_scan_data : RigidTransform, optional
        Brings the data into the scan, such as touches in the frame of a tracker.
    names : bool
        Whether points are named.
    **options
        As for `pyvista.Plotter`, such as ``off_screen=True`` or ``window_size=(900, 700)``.

    Returns
    -------
    pyvista.Plotter
        Call ``show()`` or ``screenshot(path)``, or add more to it.

    Raises
    ------
    GpError
        Nothing can be drawn of this, or it is not in the frame of the bone.

    Examples
    --------
    >>> import gp_core
    >>> touches = {code: gp_core.Atlas.published()[code] for code in gp_core.PROBE}
    >>> pose = gp_core.estimate_pose(touches, "L")
    >>> plot(pose, off_screen=True).close()
    """
    blocks = _placed(data, over, T_scan_data)
    plotter = _plotter(over, options)
    if isinstance(data, CochleaPose):
        _add_pose(plotter, blocks, _COLOURS[0])
    elif isinstance(data, Surface):
        plotter.add_mesh(blocks, color=LIGHT.bone, smooth_shading=True)
    elif isinstance(data, Volume):
        plotter.add_mesh(blocks.outline(), color=LIGHT.text)
        plotter.add_mesh(blocks.slice_orthogonal(), cmap="gray", show_scalar_bar=False, lighting=False)
    elif isinstance(data, Atlas):
        _add_atlas(plotter, blocks, names)
    else:
        for block in [blocks] if isinstance(data, LandmarkSet) else blocks:
            _add_landmarks(plotter, block, names)
    bounds = blocks.bounds if isinstance(data, CochleaPose) else plotter.bounds
    return _framed(plotter, bounds, _frame_of(blocks, T_scan_data), getattr(data, "side", None))


def compare(
    poses: Mapping[str, CochleaPose] | Iterable[CochleaPose],
    *,
    over: Surface | None = None,
    T_scan_data: RigidTransform | None = None,
    **options: Any,
) -> pv.Plotter:
    """Draw several poses, each in a colour of its own, with a legend of their differences from the first.

    Parameters
    ----------
    poses : mapping of str to CochleaPose, or poses
        By the name that the legend gives them; by default their method. All in one frame.
    over, T_scan_data, **options
        As for `plot`.

    Returns
    -------
    pyvista.Plotter
        Call ``show()`` or ``screenshot(path)``.

    Raises
    ------
    GpError
        There is no pose, or more than six, or they are not in one frame.
    """
    named = _named(poses)
    frames = {pose.transform_to_touches.dst for pose in named.values()}
    if len(frames) > 1:
        raise GpError(
            f"the poses are in the frames {' and '.join(sorted(frames))}; compare those of one frame"
        )
    plotter = _plotter(over, options)
    first = next(iter(named.values()))
    for n, ((name, pose), colour) in enumerate(zip(named.items(), _COLOURS, strict=False)):
        blocks = _placed(pose, over, T_scan_data)
        _add_pose(plotter, blocks, colour)
        words = name if pose is first else f"{name}: {_difference(pose, first)}"
        at = (0.03, 0.94 - 0.05 * n)
        plotter.add_text(words, position=at, color=colour, font_size=11, viewport=True)
    bounds = plotter.bounds if over is None else blocks.bounds
    return _framed(plotter, bounds, _frame_of(blocks, T_scan_data), first.side)


def _named(poses: Mapping[str, CochleaPose] | Iterable[CochleaPose]) -> dict[str, CochleaPose]:
    if isinstance(poses, Mapping):
        named = dict(poses)
    else:
        listed = list(poses)
        methods = [pose.method for pose in listed]
        alone = len(set(methods)) == len(methods)
        named = {
            pose.method if alone else f"{n} {pose.method}": pose for n, pose in enumerate(listed, start=1)
        }
    if not 1 <= len(named) <= len(_COLOURS):
        raise GpError(f"between 1 and {len(_COLOURS)} poses can be compared, got {len(named)}")
    return named


def _difference(pose: CochleaPose, other: CochleaPose) -> str:
    away = float(np.linalg.norm(pose.origin - other.origin))
    turned = float(np.degrees(np.arccos(np.clip(pose.axis @ other.axis, -1.0, 1.0))))
    return f"{away:.2f} mm, {turned:.1f} deg"


def _placed(data: Any, over: Surface | None, T_scan_data: RigidTransform | None) -> Any:
    """Return the dataset of something, in the scan where there is a way."""
    blocks = to_pyvista(data)
    frame = _frame_of(blocks, None)
    if T_scan_data is not None:
        if T_scan_data.dst != "scan" or T_scan_data.src not in (frame, "tracker"):
            raise GpError(
                f"T_scan_data must lead from {frame} to scan, got {T_scan_data.src} to {T_scan_data.dst}"
            )
        return blocks.transform(T_scan_data.matrix, inplace=False)
    if over is not None and frame != "scan":
        raise GpError(
            f"the bone is in the frame scan, what is drawn over it in {frame}",
            remedy="Give T_scan_data, such as from a registration.",
        )
    return blocks


def _frame_of(blocks: Any, T_scan_data: RigidTransform | None) -> str:
    facts = blocks.field_data
    return str(facts["frame"][0]) if T_scan_data is None and "frame" in facts else "scan"


def _plotter(over: Surface | None, options: Mapping[str, Any]) -> Any:
    import pyvista as pv  # takes 0.6 s: not before something is drawn

    with pv.vtk_verbosity("off"):  # where there is no display, VTK says so before it draws in memory
        plotter: Any = pv.Plotter(**{"border": False, **options})
    plotter.set_background(LIGHT.bottom, top=LIGHT.top)
    plotter.enable_parallel_projection()
    if over is not None:
        plotter.add_mesh(over.mesh, color=LIGHT.bone, opacity=_BONE_OPACITY, smooth_shading=True)
    return plotter


def _framed(plotter: Any, bounds: Any, frame: str, side: Side | None) -> pv.Plotter:
    """Look at what lies within bounds from the front, above and its side of the head, with its axes."""
    beside = -0.6 if side is Side.RIGHT else 0.6
    plotter.view_vector((beside, -0.7, 0.4), viewup=(0.0, 0.0, 1.0))
    plotter.reset_camera(bounds=bounds)
    plotter.camera.zoom(_ZOOM)
    plotter.reset_camera_clipping_range()
    letters = "LPS" if frame == "scan" else "xyz"
    plotter.add_axes(xlabel=letters[0], ylabel=letters[1], zlabel=letters[2], color=LIGHT.text)
    framed: pv.Plotter = plotter
    return framed


def _add_pose(plotter: Any, blocks: Any, colour: str) -> None:
    look = {"color": colour, "smooth_shading": True}
    origin = blocks["origin"].points[0]
    plotter.add_mesh(blocks["duct"], opacity=0.35, **look)
    plotter.add_mesh(blocks["modiolus"], opacity=0.25, **look)
    plotter.add_mesh(blocks["cone_95"], opacity=0.12, **look)
    plotter.add_mesh(blocks["region_95"], opacity=0.45, **look)
    plotter.add_mesh(blocks["axis"].tube(radius=0.06), **look)
    plotter.add_points(origin, color=colour, render_points_as_spheres=True, point_size=_DOT_PIXELS)


def _add_atlas(plotter: Any, blocks: Any, names: bool) -> None:
    for region in blocks["regions"]:
        plotter.add_mesh(region, color=LIGHT.states["ghost"], opacity=0.25, smooth_shading=True)
    _add_points(plotter, blocks["mean"], LIGHT.states["ghost"], names)


def _add_landmarks(plotter: Any, blocks: Any, names: bool) -> None:
    _add_points(plotter, blocks["placed"], LIGHT.states["placed"], names)
    _add_points(plotter, blocks["suggested"], LIGHT.states["suggested"], names)


def _add_points(plotter: Any, points: Any, colour: str, names: bool) -> None:
    if not points.n_points:
        return
    plotter.add_points(points.points, color=colour, render_points_as_spheres=True, point_size=_DOT_PIXELS)
    if names:
        plotter.add_point_labels(
            points.points,
            _texts(points["code"]),
            font_size=_NAME_PIXELS,
            text_color=LIGHT.text,
            shape=None,
            show_points=False,
            always_visible=True,
        )


def _texts(codes: Sequence[Any]) -> list[str]:
    return [f"  {code}" for code in codes]
