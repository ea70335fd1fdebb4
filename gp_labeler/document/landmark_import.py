"""Taking over the landmarks of files, with a look at whether they can belong to this scan."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gp_core.errors import GpError, blaming
from gp_core.io import PointList, landmarks_of, read_points, sides_of
from gp_core.landmarks.features import Side, feature
from gp_core.landmarks.labels import LabelNames
from gp_core.landmarks.sets import LandmarkSet
from gp_core.validation import FloatArray
from gp_labeler.document.edits import point_text
from gp_labeler.document.import_edit import ImportLandmarks
from gp_labeler.document.labelling_edits import labelling_text
from gp_labeler.document.specimen_document import SpecimenDocument
from gp_labeler.document.specimen_json import provenance_of
from gp_labeler.document.state import How, Provenance, SpecimenState

__all__ = ["ImportLandmarks", "OffBoneError", "Predicate", "import_landmarks"]

Predicate = Callable[[FloatArray], NDArray[np.bool_]]
"""Tells for (N, 3) points, mm, scan frame, whether each is inside, or near bone."""

_TURN_RAS = np.array([-1.0, -1.0, 1.0])


class OffBoneError(GpError):
    """Landmarks cannot belong to this scan: they lie outside it, or most lie off the bone."""


def import_landmarks(
    document: SpecimenDocument,
    paths: Iterable[str | PathLike[str]],
    *,
    side: Side | str | None = None,
    names: Mapping[str, str] | None = None,
    near_bone: Predicate | None = None,
    accept_off_bone: bool = False,
    replace_placed: bool = True,
) -> tuple[str, ...]:
    """Take over the landmarks of one or more files; one edit, all or nothing.

    A valid header proves nothing: real files exist whose points all lie outside their scan. So the loaded
    volume is asked whether the points lie in it.

    Parameters
    ----------
    document : SpecimenDocument
        Where to.
    paths : iterable of path
        Any landmark file that `gp_core.io` reads.
    side : Side or str, optional
        Where the files do not say it, or hold both and one is wanted.
    names : mapping of str to str, optional
        Our code by the lab's own name of a point; see `gp_core.landmarks.labels.LabelNames`.
    near_bone : callable, optional
        Tells which points are near bone.
    accept_off_bone : bool
        Import anyway.
    replace_placed : bool
        Whether placed points give way; otherwise only what is still to do is filled.

    Returns
    -------
    tuple of str
        What the user should know.

    Raises
    ------
    OffBoneError
        Points lie outside the volume, or more than half are off the bone.
    GpError
        A file cannot be read, or a point that would change is locked.
    """
    paths = list(paths)
    lists = [read_points(path, names=LabelNames(names or {})) for path in paths]
    if not lists:
        raise GpError("no landmark file was given")
    read = [(points, one) for points in lists for one in _sides(points, side)]
    sets = tuple(one for _, one in read)
    off_bone = _check_bone(document, sets, near_bone, accept_off_bone)
    known = {key: found for points, one in read for key, found in _known(points, one.side).items()}
    source = ", ".join(points.source.name for points in lists)
    asked = {
        "files": [str(Path(path).absolute()) for path in paths],
        "side": None if side is None else Side.parse(side).value,
        "names": dict(names or {}),
        "accept_misfit": accept_off_bone,
    }
    new = document.provenance(How.IMPORTED, source=source)
    other = _other_labelling(document.state, sets, source)
    with blaming(source):
        document.do(ImportLandmarks(sets, new, known, replace_placed=replace_placed, asked=asked))
    return (*other, *_doubtful_origin(document, lists), *off_bone, *_suggested(sets))


def _sides(points: PointList, side: Side | str | None) -> tuple[LandmarkSet, ...]:
    return sides_of(points) if side is None else (landmarks_of(points, side=side),)


def _other_labelling(state: SpecimenState, sets: tuple[LandmarkSet, ...], source: str) -> tuple[str, ...]:
    """Say so where labels of one observer, or round, are put among those of another."""
    here = (state.labeller.casefold(), state.round)
    theirs = {(each.observer, each.round) for each in sets if each.observer}
    if not state.labeller or not any(mark.decided for mark in state.landmarks.values()):
        return ()
    named = [labelling_text(*who) for who in sorted(theirs) if (who[0].casefold(), who[1]) != here]
    if not named:
        return ()
    mine = labelling_text(state.labeller, state.round)
    return (
        f"{source} is by {' and '.join(named)}, and is now part of the labelling by {mine}: to keep them "
        "apart, undo, and begin a labelling for it first",
    )


def _suggested(sets: tuple[LandmarkSet, ...]) -> list[str]:
    names = dict.fromkeys(
        point_text(landmarks.side, code) for landmarks in sets for code in landmarks.suggested
    )
    if not names:
        return []
    many = "is only a suggestion" if len(names) == 1 else "are only suggestions"
    return [f"{_shortened(list(names))} {many}: confirm or correct each"]


def _check_bone(
    document: SpecimenDocument, sets: tuple[LandmarkSet, ...], near_bone: Predicate | None, accepted: bool
) -> tuple[str, ...]:
    observed = {(s.side, code): s[code] for s in sets for code in s.placed if not feature(code).computed}
    suggested = {
        (s.side, code): np.array(found.position) for s in sets for code, found in s.suggested.items()
    }
    if not (located := suggested | observed):
        return ()
    names, points = [point_text(*key) for key in located], np.array(list(located.values()))
    contains: Predicate | None = getattr(document.volume, "contains", None)
    problem, remedy = "", ""
    if contains is not None and not (inside := contains(points)).all():
        problem = f"{_listed(names, ~inside)} lie outside the scan"
        turned = bool(contains(points * _TURN_RAS).all())
        remedy = (
            "With x and y negated, all are inside: the file may be RAS, although it says LPS."
            if turned
            else ""
        )
    off = np.zeros(len(points), bool) if near_bone is None else ~near_bone(points)
    if not problem and off.mean() > 0.5:
        problem = f"{_listed(names, off)} lie off the bone"
    if problem and not accepted:
        remedy = remedy or "They may belong to another scan. Import them only if you know why."
        raise OffBoneError(problem, specimen=document.state.specimen, remedy=remedy)
    warning = problem or (f"{_listed(names, off)} lie off the bone" if off.any() else "")
    return (warning,) if warning else ()


def _listed(names: list[str], chosen: NDArray[np.bool_]) -> str:
    wanted = [name for name, is_chosen in zip(names, chosen, strict=True) if is_chosen]
    return f"{len(wanted)} of {len(names)} points ({_shortened(wanted)})"


def _shortened(names: list[str]) -> str:
    return ", ".join(names[:6]) + (", ..." if len(names) > 6 else "")


def _known(points: PointList, side: Side) -> dict[tuple[Side, str], Provenance]:
    """Return the provenance that a file of this program carries; what cannot be read is passed over."""
    found = {}
    for label, content in (points.header.provenance if points.header else {}).items():
        try:
            found[side, feature(label).code] = provenance_of(content, label)
        except GpError:
            continue
    return found


def _doubtful_origin(document: SpecimenDocument, lists: list[PointList]) -> list[str]:
    found = []
    for points in lists:
        header, reference = points.header, document.state.volume
        if header is None:
            continue
        if header.specimen and header.specimen != document.state.specimen:
            found.append(f"{points.source.name} is of specimen {header.specimen}")
        theirs = (header.volume or {}).get("checksum")
        if reference and reference.checksum and theirs and theirs != reference.checksum:
            found.append(f"{points.source.name} was labelled on another scan")
    return found
