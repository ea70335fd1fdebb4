"""A pose as plain numbers, and as landmarks for 3D Slicer."""

from __future__ import annotations

import json
from collections.abc import Mapping
from os import PathLike
from typing import TYPE_CHECKING, Any

from gp_core.disk import write_text
from gp_core.io.header import FileHeader
from gp_core.io.labelled_points import LabelledPoint
from gp_core.io.markups import write_point_lists
from gp_core.io.text import rows_text
from gp_core.landmarks.sets import Status

if TYPE_CHECKING:
    from gp_core.pose.cochlea_pose import CochleaPose

__all__ = ["AXIS_POINT_MM", "pose_text", "write_csv", "write_landmarks"]

AXIS_POINT_MM = 5.0
"""Distance of the point ``axis`` in a landmark file from CO, towards the apex: about a cochlea's height."""


def pose_text(content: Mapping[str, Any]) -> str:
    """Return the JSON text of a pose; what it was made from is kept short, a line for each entry.

    Parameters
    ----------
    content : mapping
        As `CochleaPose.content` returns it, perhaps with more entries.

    Returns
    -------
    str
        With a final line end. Numbers have full precision.
    """
    about = content.get("inputs")
    told = json.dumps({key: value for key, value in content.items() if key != "inputs"}, indent=1)
    if about is None:
        return told + "\n"
    lines = ",\n".join(f"  {json.dumps(key)}: {json.dumps(value)}" for key, value in about.items())
    return told.removesuffix("\n}") + ',\n "inputs": {\n' + lines + "\n }\n}\n"


def write_csv(path: str | PathLike[str], pose: CochleaPose) -> None:
    """Write ``T_tracker_cochlea`` as four comma-separated lines of four numbers, and nothing else.

    Rows of the matrix in mm; it acts on column vectors: its first column is the modiolar axis CB->CA, its
    last one CO. Numbers have full precision.

    Parameters
    ----------
    path : path-like
        Where to write.
    pose : CochleaPose
        An estimate.

    Raises
    ------
    GpError
        The file cannot be written.
    """
    write_text(path, rows_text(pose.transform))


def write_landmarks(path: str | PathLike[str], pose: CochleaPose) -> None:
    """Write CO and a point of the axis as 3D Slicer markups: a point list, and the line between them.

    The points are ``CO`` and ``axis``, which lies `AXIS_POINT_MM` from CO towards the apex. The coordinates
    are those of the touches' frame, which ``gpLabeler`` in the file names; Slicer takes them as LPS. So a
    pose in a tracker's frame appears in a scan only after the registration of the two.

    Parameters
    ----------
    path : path-like
        Where to write.
    pose : CochleaPose
        An estimate.

    Raises
    ------
    GpError
        The file cannot be written.
    """
    end = pose.origin + AXIS_POINT_MM * pose.axis
    points = (
        LabelledPoint("CO", pose.origin, Status.PLACED, f"Cochlea origin, {pose.side.word} side, estimated"),
        LabelledPoint("axis", end, Status.PLACED, f"{AXIS_POINT_MM:g} mm from CO towards the apex"),
    )
    header = FileHeader(side=pose.side, frame=pose.transform_to_touches.dst, extra=("axis",))
    write_point_lists(path, {"Fiducial": points, "Line": points}, header)
