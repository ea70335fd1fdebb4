"""Positions of the mean features of an atlas under an estimated pose."""

from __future__ import annotations

from gp_core.atlas.atlas import Atlas
from gp_core.constants import DEFINING_FEATURES
from gp_core.landmarks.anatomy import cochlea_frame, mirror_right
from gp_core.landmarks.features import Side
from gp_core.landmarks.sets import LandmarkSet
from gp_core.pose.cochlea_pose import CochleaPose
from gp_core.validation import FloatArray

__all__ = ["expected_features"]


def expected_features(pose: CochleaPose, atlas: Atlas) -> dict[str, FloatArray]:
    """Return where the mean features of an atlas lie under an estimate.

    Where the estimate registered the atlas, its registration is used: the distance of a touch from its
    feature is its residual. A method that registers no atlas (``jrmpc``) superimposes the mean cochlea on the
    estimated one.

    Parameters
    ----------
    pose : CochleaPose
        An estimate.
    atlas : Atlas
        The atlas to place.

    Returns
    -------
    dict of str to (3,) array, mm
        In the frame of the touches.
    """
    if pose.T_touches_atlas is not None:
        moved = pose.T_touches_atlas.apply(mirror_right(atlas.mean, pose.side))
    else:
        defining = LandmarkSet.from_mapping(
            {code: atlas[code] for code in DEFINING_FEATURES}, "L", frame="atlas"
        )
        local = cochlea_frame(defining).inverse().apply(atlas.mean)  # a right ear is its mirror in z there
        moved = pose.transform_to_touches.apply(local * (1, 1, 1 if pose.side is Side.LEFT else -1))
    return dict(zip(atlas.codes, moved, strict=True))
