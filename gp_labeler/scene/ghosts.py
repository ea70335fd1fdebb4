"""Where a feature is expected: a translucent ellipsoid with a clear outline."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkFiltersSources import vtkSphereSource
from vtkmodules.vtkRenderingCore import vtkActor

from gp_core.validation import FloatArray
from gp_labeler.imaging.vtk_arrays import matrix_of
from gp_labeler.scene.camera import Viewpoint
from gp_labeler.scene.labels import Label
from gp_labeler.scene.lines2d import PixelLines
from gp_labeler.scene.sprites import Text
from gp_labeler.scene.stage import Stage, release, solid_actor

__all__ = ["RADIUS_95", "Ghost", "GhostActor", "ellipse"]

RADIUS_95 = 2.7955
"""Square root of the 95 % point of chi squared with three degrees of freedom."""

_FILL = 0.16
_CORNERS = 65


@dataclass(frozen=True, eq=False)
class Ghost:
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
    turn = np.linspace(0.0, 2 * np.pi, _CORNERS)
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    outline: FloatArray = np.asarray(centre) + radius * (circle * np.sqrt(values.clip(0))) @ axes.T
    return outline


class GhostActor:
    """Draws ghosts.

    Parameters
    ----------
    stage : Stage
        Where to draw.
    state : str
        Whose colour of the theme they have.
    """

    def __init__(self, stage: Stage, state: str = "ghost") -> None:
        self._stage, self._state = stage, state
        self._ghosts: tuple[Ghost, ...] = ()
        self._fills: list[vtkActor] = []
        self._rings = PixelLines(stage.overlay)

    @property
    def ghosts(self) -> tuple[Ghost, ...]:
        """What is drawn."""
        return self._ghosts

    def show(self, ghosts: Sequence[Ghost]) -> None:
        """Draw these ghosts in place of those before."""
        self._drop()
        self._ghosts = tuple(ghosts)
        for ghost in self._ghosts:
            if ghost.active:
                fill = solid_actor(_ball(), self._stage.colours.states[self._state], _FILL)
                fill.SetUserMatrix(_ellipsoid(ghost))
                self._stage.base.AddActor(fill)
                self._fills.append(fill)

    def refresh(self, view: Viewpoint) -> list[Label]:
        """Bring the outlines up to date with the camera, and return the labels to draw."""
        colour, scale = self._stage.colours.states[self._state], self._stage.scale
        rings = [ellipse(*_projected(ghost, view)) for ghost in self._ghosts]
        widths = [(2.5 if ghost.active else 1.2) * scale for ghost in self._ghosts]
        self._rings.draw(rings, [colour] * len(rings), widths)
        return [
            Label(
                Text(ghost.label, self._stage.colours.word(self._state), bold=ghost.active),
                _upper_right(ring),
                3 * scale,
                float(ghost.active),
            )
            for ghost, ring in zip(self._ghosts, rings, strict=True)
            if ghost.label
        ]

    def close(self) -> None:
        """Let go of the ellipsoids and outlines."""
        self._drop()
        self._ghosts = ()
        self._rings.close()

    def _drop(self) -> None:
        for fill in self._fills:
            release(self._stage.base, fill)
        self._fills = []


def _ball() -> object:
    source = vtkSphereSource()
    source.SetRadius(1.0)
    source.SetThetaResolution(40)
    source.SetPhiResolution(24)
    source.Update()
    return source.GetOutput()


def _ellipsoid(ghost: Ghost) -> vtkMatrix4x4:
    """Place the unit ball as the 95 % ellipsoid."""
    values, axes = np.linalg.eigh(ghost.covariance)
    axes[:, 0] *= np.sign(np.linalg.det(axes))  # a mirrored ball would turn its faces inward, and be black
    matrix = np.eye(4)
    matrix[:3, :3] = RADIUS_95 * axes * np.sqrt(values.clip(1e-12))
    matrix[:3, 3] = ghost.mean
    return matrix_of(matrix)


def _projected(ghost: Ghost, view: Viewpoint) -> tuple[FloatArray, FloatArray]:
    """Return mean (2,) and covariance (2, 2) of a ghost in pixels: its silhouette is the same ellipse."""
    step = max(float(np.sqrt(np.trace(ghost.covariance))), 1e-3)
    around = ghost.mean + step * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
    pixels = view.display(around)[:, :2]
    slope = (pixels[1:4] - pixels[4:7]).T / (2 * step)
    return pixels[0], slope @ ghost.covariance @ slope.T


def _upper_right(ring: FloatArray) -> FloatArray:
    corner: FloatArray = ring[int((ring[:, 0] - ring[:, 1]).argmax())]
    return corner
