"""The files of an estimated pose, and an insertion path that is transformed to it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import permutations, product
from os import PathLike
from pathlib import Path

from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_core.pose.cochlea_pose import CochleaPose
from gp_core.pose.insertion_path import (
    angle_about,
    carry_path,
    read_path,
    rows_before_centre,
    winding_side,
    write_path,
)
from gp_core.validation import FloatArray
from gp_labeler.models.estimate import SideEstimate

__all__ = ["FORMATS", "InsertionPath", "save_pose", "says_its_state"]

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

_AXES = tuple(
    ",".join(sign + letter for sign, letter in zip(signs, letters, strict=True))
    for letters in permutations("xyz")
    for signs in product(("", "-"), repeat=3)
)
"""Every naming of three axes, the left-handed ones too, which `read_path` refuses."""


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


def says_its_state(path: str | PathLike[str]) -> bool:
    """Whether a file's format carries the state of a pose beside it, for whoever reads it."""
    name = Path(path).name.lower()
    return name.endswith(".json") and not name.endswith(".mrk.json")


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
    units, axes : str
        How the file was read; see `gp_core.pose.insertion_path.read_path`.
    rows : int, optional
        Of how many rows of it these are; None for all.
    """

    points: FloatArray
    side: Side
    source: Path
    units: str = "mm"
    axes: str = "x,y,z"
    rows: int | None = None

    @classmethod
    def read(
        cls, path: str | PathLike[str], side: Side | str, *, units: str, axes: str = "x,y,z"
    ) -> InsertionPath:
        """Read a path; see `gp_core.pose.insertion_path.read_path` for what is asked and raised."""
        return cls(read_path(path, units=units, axes=axes), Side.parse(side), Path(path), units, axes)

    @classmethod
    def readings(cls, path: str | PathLike[str], side: Side | str, *, units: str) -> dict[str, InsertionPath]:
        """Read a path by every naming of its axes that fits a cochlea, the likeliest first.

        Returns
        -------
        dict of str to InsertionPath
            ``"x,y,z"`` alone where the file is in the cochlea frame as it is. Otherwise by axes, such as
            ``"z,-y,x"``, which `gp_core.pose.insertion_path.read_path` explains; what begins nearest to the
            round window comes first.

        Raises
        ------
        GpError
            The file is no path of such an ear by any axes.
        """
        try:
            return {"x,y,z": cls.read(path, side, units=units)}
        except GpError:
            side = Side.parse(side)
            found = {axes: read for axes in _AXES if (read := _read_or_none(path, side, units, axes))}
            most = max((abs(read.turn) for read in found.values()), default=0.0)
            found = {axes: read for axes, read in found.items() if abs(read.turn) > 0.99 * most}
            fitting = {axes: read for axes, read in found.items() if read.fits}
            if any(replace(read, side=side.other).fits for read in found.values()) and not fitting:
                raise GpError(
                    f"winds as in a {side.other.word} ear", file=path, remedy="Check its side."
                ) from None
            if not fitting:
                raise
        return dict(sorted(fitting.items(), key=lambda item: -item[1].points[0, 1]))

    @property
    def turn(self) -> float:
        """How far it turns about the modiolar axis, rad, right-handed."""
        return angle_about(self.points[: self.n_before_centre], 0)

    @property
    def fits(self) -> bool:
        """Whether it winds as in an ear of its side, and runs towards the apex."""
        path = self.points[: self.n_before_centre]
        return winding_side(path) in (None, self.side) and bool(path[-1, 0] > path[0, 0])

    @property
    def n_before_centre(self) -> int | None:
        """How many points come before one that is CO itself, where no path can be; None without such."""
        return rows_before_centre(self.points)

    def first(self, n: int) -> InsertionPath:
        """Return the path of the first points only.

        Raises
        ------
        GpError
            There are not as many, or they are no path.
        """
        if not 2 <= n <= len(self.points):
            raise GpError(f"rows of the path must be 2 to {len(self.points)}, got {n}", file=self.source)
        return replace(self, points=self.points[:n], rows=n)

    def in_touches(self, estimate: SideEstimate) -> FloatArray | None:
        """Return the path (N, 3) in the frame of the touches, mm; None without a pose."""
        if estimate.pose is None:
            return None
        return carry_path(self.points, estimate.pose, path_side=self.side)

    def in_scan(self, estimate: SideEstimate) -> FloatArray | None:
        """Return the path (N, 3) in the scan, mm; None where the estimate does not lie in one."""
        carried = self.in_touches(estimate)
        if carried is None or estimate.registered is None:
            return None
        return estimate.registered.T_scan_touches.apply(carried)

    def save_carried(self, estimate: SideEstimate, path: str | PathLike[str]) -> Path:
        """Write the path in the frame of the touches, for the robot.

        Raises
        ------
        GpError
            There is no pose, or the file cannot be written.
        """
        carried = self.in_touches(estimate)
        if carried is None:
            raise GpError("there is no estimate for the path")
        write_path(path, carried)
        return Path(path)


def _read_or_none(path: str | PathLike[str], side: Side | str, units: str, axes: str) -> InsertionPath | None:
    try:
        return InsertionPath.read(path, side, units=units, axes=axes)
    except GpError:
        return None
