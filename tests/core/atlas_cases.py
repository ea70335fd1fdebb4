"""Animals and touches for the tests of the atlas: real ones held out, and drawn ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gp_core import Atlas, LandmarkSet, Side, Specimen
from gp_core.frames import RigidTransform, mirror_x
from gp_core.landmarks.anatomy import modiolar_axis, with_cochlea_origin


def draw_side(atlas: Atlas, rng: np.random.Generator, side: Side = Side.LEFT) -> LandmarkSet:
    """Draw one side from an atlas, in the atlas frame (mirrored for a right side)."""
    flat = rng.multivariate_normal(atlas.mean.ravel(), atlas.covariance)
    points = flat.reshape(-1, 3)
    placed = points if side is Side.LEFT else mirror_x(points)
    named = dict(zip(atlas.codes, placed, strict=True))
    return with_cochlea_origin(LandmarkSet.from_mapping(named, side, frame="scan"))


def draw_specimens(atlas: Atlas, n: int, rng: np.random.Generator) -> list[Specimen]:
    """Draw animals whose two sides are independent, each in a head pose, and so in a frame, of its own."""

    def drawn(side: Side) -> LandmarkSet:
        return draw_side(atlas, rng, side).moved(random_pose(rng, dst=f"{side.word} head"))

    return [Specimen(f"S{i:02}", {side: drawn(side) for side in Side}) for i in range(n)]


def random_pose(rng: np.random.Generator, dst: str = "tracker", src: str = "scan") -> RigidTransform:
    """A random rigid transform, some centimetres away."""
    rotation = Rotation.random(random_state=rng).as_matrix()
    return RigidTransform.from_parts(rotation, 50 * rng.normal(size=3), dst=dst, src=src)


def errors(pose: object, truth: LandmarkSet) -> tuple[float, float]:
    """Distance of the origins (mm) and angle between the axes (rad)."""
    axis = modiolar_axis(truth["CA"], truth["CB"])
    cosine = float(np.clip(pose.axis @ axis, -1, 1))  # type: ignore[attr-defined]
    return float(np.linalg.norm(pose.origin - truth["CO"])), float(np.arccos(cosine))  # type: ignore[attr-defined]


def noisy(points: NDArray[np.float64], noise: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """Add Gaussian noise to every coordinate, mm."""
    return points + noise * rng.normal(size=points.shape)
