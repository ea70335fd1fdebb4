"""Everything that is written of an estimated pose, and an insertion path carried to it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from gp_core.atlas.insertion import carry_path, read_path, write_path
from gp_core.atlas.pose import CochleaPose
from gp_core.checks import FloatArray
from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_labeler.session.estimate import Estimate

__all__ = ["FORMATS", "InsertionPath", "save_pose"]

_WRITERS: Mapping[str, Callable[[CochleaPose, str | PathLike[str]], None]] = {
    ".mrk.json": CochleaPose.save_landmarks,
    ".json": CochleaPose.save,
    ".tfm": CochleaPose.save_tfm,
    ".csv": CochleaPose.save_csv,
}

FORMATS: Mapping[str, str] = {
    ".json": "Pose",
    ".tfm": "ITK and Slicer transform",
    ".csv": "4 x 4 matrix",
    ".mrk.json": "CO and axis for Slicer",
}
"""Endings of the files that `save_pose` writes, and what each is."""


def save_pose(pose: CochleaPose, path: str | PathLike[str]) -> Path:
    """Write a pose in the format that the file's name asks for, one of `FORMATS`.

    Returns
    -------
    Path

    Raises
    ------
    GpError
        Another ending, or the file cannot be written.
    """
    name = Path(path).name.lower()
    for suffix, write in _WRITERS.items():
        if name.endswith(suffix):
            write(pose, path)
            return Path(path)
    raise GpError("has no ending of a pose file", file=path, remedy=f"End it with {', '.join(FORMATS)}.")


@dataclass(frozen=True, eq=False)
class InsertionPath:
    """A path drawn in a cochlea.

    Parameters
    ----------
    points : (N, 3) array
        Cochlea frame, mm.
    side : Side
        The ear it was drawn for.
    source : Path
        Its file.
    """

    points: FloatArray
    side: Side
    source: Path

    @classmethod
    def read(
        cls, path: str | PathLike[str], side: Side | str, *, units: str, axes: str = "x,y,z"
    ) -> InsertionPath:
        """Read a path; see `gp_core.atlas.insertion.read_path` for what is asked and raised."""
        return cls(read_path(path, units=units, axes=axes), Side.parse(side), Path(path))

    def in_touches(self, estimate: Estimate) -> FloatArray | None:
        """Return the path (N, 3) in the frame of the touches, mm; None without a pose."""
        if estimate.pose is None:
            return None
        return carry_path(self.points, estimate.pose, path_side=self.side)

    def in_scan(self, estimate: Estimate) -> FloatArray | None:
        """Return the path (N, 3) in the scan, mm; None where the estimate does not lie in one."""
        carried = self.in_touches(estimate)
        if carried is None or estimate.registered is None:
            return None
        return estimate.registered.T_scan_touches.apply(carried)

    def save_carried(self, estimate: Estimate, path: str | PathLike[str]) -> Path:
        """Write the path in the frame of the touches, for the robot.

        Raises
        ------
        GpError
            There is no pose, or the file cannot be written.
        """
        carried = self.in_touches(estimate)
        if carried is None:
            raise GpError("there is no estimate to carry the path to")
        write_path(path, carried)
        return Path(path)
