"""Points of another list, shown grey for comparison: no landmarks, and no part of the specimen."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gp_core.errors import GpError
from gp_core.io import LabelledPoint, read_points
from gp_core.validation import FloatArray
from gp_labeler.document.signals import Signal
from gp_labeler.document.specimen_document import SpecimenDocument
from gp_labeler.models.messages import Messages
from gp_labeler.models.scan import ScanModel

__all__ = ["ReferencePoint", "ReferencePointsModel"]

_MOST = 500
"""More names would hide the scan, and each point is tested for bone in front of it in every frame."""


class ReferencePoint(NamedTuple):
    """A named place, (3,) mm in the scan frame."""

    name: str
    position: FloatArray


class ReferencePointsModel:
    """The reference points that are shown; another scan clears them.

    Parameters
    ----------
    document : SpecimenDocument
        Another specimen clears them.
    scan : ScanModel
        What they are compared in; another scan clears them.
    messages : Messages
        What the user is told by.
    """

    changed = Signal()

    def __init__(self, document: SpecimenDocument, scan: ScanModel, messages: Messages) -> None:
        self._scan, self._messages = scan, messages
        self._points: tuple[ReferencePoint, ...] = ()
        self._files: tuple[Path, ...] = ()
        for signal in (document.reset, scan.opened):
            signal.connect(self._on_scan)

    @property
    def points(self) -> tuple[ReferencePoint, ...]:
        """What is shown."""
        return self._points

    @property
    def files(self) -> tuple[Path, ...]:
        """Where they were read from."""
        return self._files

    def show(self, *paths: str | PathLike[str]) -> None:
        """Show the points of landmark files, under any names, in place of those shown before.

        Raises
        ------
        GpError
            A file cannot be read, is in the tracker frame, has no point with a position, or there are too
            many points. What was shown before stays.
        """
        points = tuple(point for path in paths for point in _read(path))
        if len(points) > _MOST:
            raise GpError(
                f"{len(points)} reference points are too many",
                file=paths[0],
                remedy=f"Show at most {_MOST} at a time.",
            )
        self._points, self._files = points, tuple(Path(path) for path in paths)
        self.changed.emit()
        self._report()

    def show_points(self, points: tuple[ReferencePoint, ...]) -> None:
        """Show points that are not from a file, in place of those shown before."""
        self._points, self._files = points, ()
        self.changed.emit()

    def clear(self) -> None:
        """Show none."""
        if self._points:
            self._points, self._files = (), ()
            self.changed.emit()

    def _on_scan(self, *_: object) -> None:
        self.clear()

    def _report(self) -> None:
        """Say how many are shown, and how many lie where there is no scan."""
        places, volume = np.array([point.position for point in self._points]), self._scan.volume
        n, inside = len(places), 0 if volume is None else int(volume.contains(places).sum())
        if inside == n:
            self._messages.say(f"Reference points shown: {n}")
        else:
            text = f"{n - inside} of {n} reference points lie outside the scan and are not shown"
            self._messages.say(text, "warning")


def _read(path: str | PathLike[str]) -> list[ReferencePoint]:
    read = read_points(path)
    if read.frame != "scan":
        raise GpError(
            f"its points are in the {read.frame} frame, not in the frame of the scan",
            file=path,
            remedy="Open it with Estimate > Open touches.",
        )
    found = [ReferencePoint(_name(point), at) for point in read.points if (at := _place(point)) is not None]
    if not found:
        raise GpError("no point in it has a position", file=path)
    return found


def _name(point: LabelledPoint) -> str:
    return point.label if point.side is None else f"{point.label} {point.side.value}"


def _place(point: LabelledPoint) -> FloatArray | None:
    """Return where a point is, or is suggested to be."""
    return point.position if point.suggestion is None else np.array(point.suggestion.position)
