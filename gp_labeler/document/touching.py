"""What touching means: a few functions on the document, for panels, actions and scripts alike."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gp_core.errors import GpError, blaming
from gp_core.io import label_names, read_points, read_touches
from gp_core.io.file_names import named_side
from gp_core.landmarks.features import CODES, Side
from gp_core.landmarks.labels import same_label, tidy_label
from gp_core.validation import FloatArray
from gp_labeler.document.edits import as_position
from gp_labeler.document.specimen_document import SpecimenDocument
from gp_labeler.document.touch_edits import (
    LeaveOutTouch,
    MoveTouches,
    RecordTouch,
    RemoveTouches,
    SetSkull,
    SwapTouches,
    TakeTouches,
)
from gp_labeler.document.touches import Touch, TouchHow, touch_name

__all__ = [
    "clear_touches",
    "leave_out",
    "load_skull",
    "load_touches",
    "mark_skull",
    "misnamed_files",
    "move_touches",
    "record_touch",
    "swap_touches",
]


def record_touch(
    document: SpecimenDocument,
    side: Side | str,
    name: str,
    position: ArrayLike,
    how: TouchHow = TouchHow.TYPED,
    *,
    keep: bool = False,
    **details: Any,
) -> bool:
    """Record one touch, in place of an earlier one of the same name, or beside it.

    Parameters
    ----------
    document : SpecimenDocument
    side : Side or str
    name : str
        An external feature, or a skull feature such as ``S1``.
    position : (3,) array_like
        Tracker frame, mm; scan frame where `how` is ``TouchHow.SCAN``.
    how : TouchHow
    keep : bool
        Whether the touches of this name that are there count too; they are in the same frame.
    **details
        `source`, `n_samples` and `spread_mm` of `Touch`.

    Returns
    -------
    bool
        Whether anything changed.

    Raises
    ------
    GpError
        The feature cannot be touched, or the side's other touches are in another frame.
    """
    where, wanted = as_position(position, name), Side.parse(side)
    before = document.state.touches.get((wanted, touch_name(name))) if keep else None
    earlier = () if before is None else before.positions
    touch = Touch(where, how, time=document.now(), by=document.author, earlier=earlier, **details)
    return document.do(RecordTouch(Side.parse(side), name, touch))


def load_touches(document: SpecimenDocument, path: str | PathLike[str], side: Side | str) -> tuple[str, ...]:
    """Take the touches of a file in place of all that side has.

    Returns
    -------
    tuple of str
        What the user should know: what the tracker did not see, a file named for the other side.

    Raises
    ------
    GpError
        As `gp_core.read_touches`.
    """
    touched = read_touches(path, side)
    about: dict[str, Any] = {"how": TouchHow.FILE, "time": document.now(), "by": document.author}
    points, repeats = {**touched.as_mapping(), **touched.extra}, touched.repeats
    source = Path(path).name
    with blaming(path):
        taken = {
            name: _touch_of(
                np.atleast_2d(repeats[name].points if name in repeats else p), name, source, about
            )
            for name, p in points.items()
        }
    if not taken:
        raise GpError(
            "contains no touch that the tracker has seen", file=path, remedy="Touch the features again."
        )
    with blaming(path):
        document.do(TakeTouches(Side.parse(side), taken))
    named, unseen = named_side(source), " ".join(sorted(touched.unseen))
    warnings = [f"Not seen by the tracker: {unseen}"] if unseen else []
    if named not in (None, Side.parse(side)):
        warnings.append(f"Its name indicates the {named.word} side: check the side")
    return tuple(warnings)


def _touch_of(rows: FloatArray, name: str, source: str, about: dict[str, Any]) -> Touch:
    """Return the touch of a feature of a file, with its repeats, (n, 3) mm."""
    *earlier, last = (as_position(row, name) for row in rows)
    return Touch(last, source=source, earlier=tuple(earlier), **about)


def misnamed_files(document: SpecimenDocument, side: Side) -> tuple[str, ...]:
    """Return the files that touches of a side are from, and whose names tell the other one."""
    touches = (touch for (of, _), touch in document.state.touches.items() if of is side)
    files = {touch.source for touch in touches if touch.how is TouchHow.FILE}
    return tuple(sorted(file for file in files if named_side(file) is side.other))


def leave_out(document: SpecimenDocument, side: Side | str, name: str, left_out: bool = True) -> bool:
    """Exclude a touch from the estimate, or include it again."""
    return document.do(LeaveOutTouch(Side.parse(side), name, left_out))


def swap_touches(document: SpecimenDocument, side: Side | str, name: str, other: str) -> bool:
    """Give each of two touches of a side the other's name; raises `GpError` where one is not touched."""
    return document.do(SwapTouches(Side.parse(side), touch_name(name), touch_name(other)))


def move_touches(document: SpecimenDocument, side: Side | str) -> bool:
    """Give all touches of a side to the other one; raises `GpError` where that was touched too."""
    return document.do(MoveTouches(Side.parse(side)))


def clear_touches(document: SpecimenDocument, side: Side | str, name: str | None = None) -> bool:
    """Forget one touch of a side, or all of them."""
    return document.do(RemoveTouches(Side.parse(side), name))


def load_skull(document: SpecimenDocument, path: str | PathLike[str]) -> tuple[str, ...]:
    """Take the skull's registration features from a landmark file of the scan; returns their names.

    Raises
    ------
    GpError
        The file cannot be read, or names nothing beside the 20 features.
    """
    points = read_points(path)
    named = zip(label_names(points), points.points, strict=True)
    skull = {name: p.position for name, p in named if p.position is not None and name not in CODES}
    if not skull:
        raise GpError(
            "names no skull feature",
            file=path,
            remedy="Use the same names as in the touches, such as S1 to S8.",
        )
    with blaming(path):
        document.do(SetSkull({name: as_position(point, name) for name, point in skull.items()}))
    return tuple(skull)


def mark_skull(document: SpecimenDocument, name: str, position: ArrayLike | None) -> bool:
    """Say where one skull feature is on the scan, (3,) mm, or forget it (None)."""
    name = tidy_label(name)
    skull = {n: p for n, p in document.state.skull.items() if not same_label(n, name)}
    if position is not None:
        skull[name] = as_position(position, name)
    return document.do(SetSkull(skull))
