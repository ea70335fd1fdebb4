"""Suggestions as files that 3D Slicer shows, and that this program takes as suggestions, never as labels."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gp_core.errors import GpError
from gp_core.io import FileHeader, LabelledPoint, landmark_file_name, write_suggestions
from gp_core.io.labelled_points import suggested_description
from gp_core.io.markups import write_point_lists
from gp_core.landmarks.sets import LandmarkSet, Status
from gp_labeler.autolabel.labelled_scan import sides_of_points
from gp_labeler.autolabel.proposal import Proposal

__all__ = ["write_proposal"]


def write_proposal(
    folder: Path, specimen: str, proposal: Proposal, volume: Mapping[str, Any] | None = None
) -> tuple[Path, ...]:
    """Write a proposal's guesses as suggestions.

    Parameters
    ----------
    folder : Path
        Made where it is not there.
    specimen : str
        Name of the head.
    proposal : Proposal
    volume : mapping, optional
        Name, size, spacing and checksum of the scan.

    Returns
    -------
    tuple of Path
        ``<specimen>_L_suggested.mrk.json`` and ``_R_``; of another scheme than the guinea pig's features,
        ``<specimen>_suggested.mrk.json``.

    Raises
    ------
    GpError
        Nothing was guessed, or a file cannot be written.
    """
    if not proposal.guesses:
        raise GpError("all landmarks are predicted outside the scan", specimen=specimen)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise GpError(f"cannot be made ({error})", file=folder) from None
    if sides_of_points(proposal.positions) is None:
        return (_write_any(folder, specimen, proposal, volume),)
    files = []
    for side, suggestions in proposal.suggestions().items():
        if suggestions:
            landmarks = LandmarkSet.empty(side).with_suggestions(suggestions)
            path = folder / landmark_file_name(specimen, side, suggested=True)
            write_suggestions(path, landmarks, specimen=specimen, volume=volume)
            files.append(path)
    return tuple(files)


def _write_any(folder: Path, specimen: str, proposal: Proposal, volume: Mapping[str, Any] | None) -> Path:
    """Write guesses of any scheme as one list, in the order of the scheme."""
    path = folder / f"{specimen}_suggested.mrk.json"
    by_name = {guess.name: guess for guess in proposal.guesses}
    points = [
        LabelledPoint(
            name,
            by_name[name].position,
            Status.PLACED,
            suggested_description(proposal.suggestion(by_name[name])),
        )
        for name in proposal.scheme
        if name in by_name
    ]
    header = FileHeader(specimen=specimen, volume=volume, extra=tuple(point.label for point in points))
    write_point_lists(path, {"Fiducial": points}, header)
    return path
