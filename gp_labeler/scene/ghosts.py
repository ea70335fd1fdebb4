"""Where a feature is expected: a translucent ellipsoid; its outline is painted over the frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkFiltersSources import vtkSphereSource
from vtkmodules.vtkRenderingCore import vtkActor

from gp_core.constants import CHI2_3_95
from gp_core.validation import FloatArray
from gp_labeler.imaging.vtk_arrays import matrix_of
from gp_labeler.scene.camera import Viewpoint
from gp_labeler.scene.render_layers import RenderLayers, release, solid_actor

__all__ = ["RADIUS_95", "GhostActor", "GhostEllipsoid", "ellipse", "outline_in"]

RADIUS_95 = CHI2_3_95**0.5
"""95 % radius of a three-dimensional Gaussian, in standard deviations."""

_FILL = 0.16
_TURN = np.linspace(0.0, 2 * np.pi, 65)
_CIRCLE = np.stack([np.cos(_TURN), np.sin(_TURN)], axis=1)


@dataclass(frozen=True, eq=False)
class GhostEllipsoid:
    """The expected place of a feature.

    Parameters
    ----------
    key : str
        Its name among all ghosts.
    mean : (3,) float array
        Most likely position, scan frame, mm.
    covariance : (3, 3) float array
        In mm squared.
    label : str
        What stands beside it, such as ``"IN?"``.
    active : bool
        Whether it is the feature to place next: filled, and outlined more boldly.
    """

    key: str
    mean: FloatArray
    covariance: FloatArray
    label: str = ""
    active: bool = False


def ellipse(centre: ArrayLike, covariance: ArrayLike, radius: float = RADIUS_95) -> FloatArray:
    """Return the (65, 2) closed outline of an ellipse.

    Parameters
    ----------
    centre : (2,) array_like
        Its middle.
    covariance : (2, 2) array_like
        Of a normal distribution in the same plane and units.
    radius : float
        In standard deviations.
    """
    values, axes = np.linalg.eigh(np.asarray(covariance, dtype=np.float64))
    outline: FloatArray = np.asarray(centre) + radius * (_CIRCLE * np.sqrt(values.clip(0))) @ axes.T
    return outline


class GhostActor:
    """Draws the ellipsoids of ghosts.

    Parameters
    ----------
    layers : RenderLayers
        Where to draw.
    state : str
        Whose colour of the theme they have.
    """

    def __init__(self, layers: RenderLayers, state: str = "ghost") -> None:
        self._layers, self._state = layers, state
        self._ghosts: tuple[GhostEllipsoid, ...] = ()
        self._fills: list[vtkActor] = []

    @property
    def ghosts(self) -> tuple[GhostEllipsoid, ...]:
        """What is drawn."""
        return self._ghosts

    def show(self, ghosts: Sequence[GhostEllipsoid]) -> None:
        """Draw these ghosts in place of those before."""
        self._drop()
        self._ghosts = tuple(ghosts)
        for ghost in self._ghosts:
            if ghost.active:
                fill = solid_actor(_ball(), self._layers.colours.states[self._state], _FILL)
                fill.SetUserMatrix(_ellipsoid(ghost))
                self._layers.base.AddActor(fill)
                self._fills.append(fill)

    def close(self) -> None:
        """Let go of the ellipsoids."""
        self._drop()
        self._ghosts = ()

    def _drop(self) -> None:
        for fill in self._fills:
            release(self._layers.base, fill)
        self._fills = []


def _ball() -> object:
    source = vtkSphereSource()
    source.SetRadius(1.0)
    source.SetThetaResolution(40)
    source.SetPhiResolution(24)
    source.Update()
    return source.GetOutput()


def _ellipsoid(ghost: GhostEllipsoid) -> vtkMatrix4x4:
    """Place the unit ball as the 95 % ellipsoid."""
    values, axes = np.linalg.eigh(ghost.covariance)
    axes[:, 0] *= np.sign(np.linalg.det(axes))  # a mirrored ball would turn its faces inward, and be black
    matrix = np.eye(4)
    matrix[:3, :3] = RADIUS_95 * axes * np.sqrt(values.clip(1e-12))
    matrix[:3, 3] = ghost.mean
    return matrix_of(matrix)


def outline_in(view: Viewpoint, mean: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return the silhouette, (65, 2) pixels, of the 95 % ellipsoid of a (3,) mean and (3, 3) covariance."""
    step = max(float(np.sqrt(np.trace(covariance))), 1e-3)
    around = mean + step * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
    pixels = view.display(around)[:, :2]
    slope = (pixels[1:4] - pixels[4:7]).T / (2 * step)
    return ellipse(pixels[0], slope @ covariance @ slope.T)
