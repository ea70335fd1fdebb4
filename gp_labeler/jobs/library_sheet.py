"""What the check of a library found, as pictures: each label, and where the other scans expect it, as PDF."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gp_core.disk import all_or_none
from gp_core.errors import GpError
from gp_core.landmarks.features import Side, feature
from gp_core.landmarks.labels import parse_label
from gp_core.landmarks.sets import LandmarkSet
from gp_core.validation import FloatArray
from gp_labeler.autolabel.cross_check import LibraryCheck, LibraryFinding
from gp_labeler.autolabel.labelled_scan import LabelledScan, side_and_code, sides_of_points
from gp_labeler.autolabel.prediction import Prediction
from gp_labeler.head_pose import straighten_by_landmarks
from gp_labeler.imaging.close_up import PICTURE_AXES, CloseUp
from gp_labeler.imaging.threshold import propose_threshold
from gp_labeler.imaging.volume import Volume
from gp_labeler.jobs.picture_page import (
    PIXELS,
    PageLayout,
    PictureBlock,
    bone_picture,
    grey_picture,
    marked,
    pdf_file,
    picture_page,
    picture_plane,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["draw_library_check", "finding_blocks", "head_rotation", "library_sheet_name"]

_LAYOUT = PageLayout(columns=3, rows=4, n_pictures=3)
_LEAST_MM, _MOST_MM = 12.0, 60.0
_AROUND = 1.6
"""Width of a picture, as so many times the distance between label and expected place."""

_WORST = 4
"""Labels that are shown where a finding concerns all."""

_LEGEND = (
    "Ring: the label. Diamond: where the other scans expect it; faint where it lies off the slice. "
    "Left: the slice through the label. Middle: through the expected place. "
    "Right: bone, cut away in front of the label."
)


@dataclass(frozen=True, eq=False)
class _Place:
    """A label, and where the other scans expect it."""

    name: str
    label: FloatArray
    expected: FloatArray

    @property
    def distance(self) -> float:
        return float(np.linalg.norm(self.label - self.expected))


def library_sheet_name(specimen: str) -> str:
    """Return the name of the file of one specimen."""
    return f"{specimen}_check.pdf"


def draw_library_check(
    check: LibraryCheck,
    scans: Sequence[LabelledScan],
    predictions: Mapping[str, Prediction],
    where: Path,
    tell: Callable[[str], object] = lambda name: None,
) -> tuple[Path, ...]:
    """Draw what was found; scans are opened one at a time.

    Parameters
    ----------
    check : LibraryCheck
    scans : sequence of LabelledScan
    predictions : mapping of str to Prediction
        Each scan predicted from the others, by name.
    where : Path
        A ``.pdf`` file for all specimens, or a folder for one file each.
    tell : callable, optional
        Told the name of each specimen before its scan is opened.

    Returns
    -------
    tuple of Path
        What was written; nothing where nothing was found.

    Raises
    ------
    GpError
        A scan cannot be read, or a file cannot be written.
    """
    wrong = [scan for scan in scans if check.of(scan.name)]
    if not wrong:
        return ()
    together = where.suffix.lower() == ".pdf"
    files = [where] if together else [where / library_sheet_name(scan.name) for scan in wrong]
    with all_or_none():
        for n, file in enumerate(files):
            with pdf_file(file) as pages:
                for scan in wrong if together else [wrong[n]]:
                    tell(scan.name)
                    for page in _pages(scan, check.of(scan.name), predictions[scan.name]):
                        pages.savefig(page)  # type: ignore[no-untyped-call]
    return tuple(files)


def _pages(
    scan: LabelledScan, findings: Sequence[LibraryFinding], prediction: Prediction
) -> Iterator[Figure]:
    volume = scan.load()
    turn = head_rotation(scan, prediction, volume)
    frame = "along the axes of the scan" if turn is None else "in the frame of the head"
    blocks = finding_blocks(scan, findings, prediction, volume, propose_threshold(volume), turn)
    each_page = _LAYOUT.columns * _LAYOUT.rows
    many = "1 finding" if len(findings) == 1 else f"{len(findings)} findings"
    for first in range(0, len(blocks), each_page):
        yield picture_page(
            blocks[first : first + each_page],
            _LAYOUT,
            title=f"{scan.name}   labels that the other scans contradict",
            about=f"{many}   ·   {volume.name}   ·   views {frame}",
            legend=_LEGEND,
        )


def head_rotation(scan: LabelledScan, prediction: Prediction, volume: Volume) -> FloatArray | None:
    """Return the rotation from the frame of the head into that of the scan, where it is known.

    It is the one that was said of the specimen. Else it is that of the guinea pig's features, where the other
    scans expect them, since labels may be exchanged. None where neither determines it.
    """
    T_head_scan, sides = scan.T_head_scan, sides_of_points(prediction.centres)
    if T_head_scan is None and sides is not None:
        placed = {side: LandmarkSet.from_mapping(points, side) for side, points in sides.items()}
        try:
            T_head_scan = straighten_by_landmarks(volume, placed, refine=False).T_head_scan
        except GpError:
            return None
    return None if T_head_scan is None else T_head_scan.rotation.T


def finding_blocks(
    scan: LabelledScan,
    findings: Sequence[LibraryFinding],
    prediction: Prediction,
    volume: Volume,
    threshold: float,
    turn: FloatArray | None = None,
) -> list[PictureBlock]:
    """Return the pictures of all labels that are named, or of the worst where a finding concerns all.

    Parameters
    ----------
    scan : LabelledScan
    findings : sequence of LibraryFinding
        Of this scan.
    prediction : Prediction
        From the other scans.
    volume : Volume
        The scan itself.
    threshold : float
        Where its bone begins.
    turn : (3, 3) array, optional
        Rotation from the head's frame, in which the pictures are made, into the scan's.
    """
    turn = np.eye(3) if turn is None else turn
    places = {
        name: _Place(name, scan.points[name], prediction.centres[name])
        for name in prediction.names
        if name in scan.points
    }
    left = turn[:, 0]
    middle = float(np.mean(scan.array @ left))
    blocks = []
    for finding in findings:
        worst = sorted(places, key=lambda name: -places[name].distance)[:_WORST]
        for name in finding.names or worst:
            side = parse_label(name).side
            side = side or (Side.LEFT if places[name].label @ left >= middle else Side.RIGHT)
            blocks.append(_block(places[name], side, _note(finding, places[name]), volume, threshold, turn))
    return blocks


def _note(finding: LibraryFinding, place: _Place) -> str:
    others = " and ".join(_short(name) for name in finding.names if name != place.name)
    kind = {
        "exchanged": f"exchanged with {others}?",
        "sides exchanged": "left and right exchanged?",
        "other scan": "labels of another scan?",
    }.get(finding.kind, f"usually {finding.expected:.2f} mm")
    return f"{place.distance:.2f} mm from where it is expected · {kind}"


def _heading(name: str) -> str:
    known = side_and_code(name)
    return name if known is None else f"{_short(name)}  {feature(known[1]).name}"


def _short(name: str) -> str:
    """Return a label's name with its side in words, such as ``RWA left``."""
    known = side_and_code(name)
    return name if known is None or feature(known[1]).shared else f"{known[1]} {known[0].word}"


def _plane_of(name: str) -> str:
    known = side_and_code(name)
    return picture_plane(None if known is None else feature(known[1]))


def _block(
    place: _Place, side: Side, note: str, volume: Volume, threshold: float, turn: FloatArray
) -> PictureBlock:
    across = float(np.clip(_AROUND * place.distance, _LEAST_MM, _MOST_MM))
    plane = _plane_of(place.name)
    low, high = volume.intensity_range
    pictures, marks = [], []
    views = ((plane, place.label), (plane, place.expected), (side.value, place.label))
    for n, (look, through) in enumerate(views):
        axes = PICTURE_AXES[look].turned(turn)
        middle = (place.label + place.expected) / 2
        centre = middle + axes.away * float((through - middle) @ axes.away)
        near = CloseUp(volume, centre, across, PIXELS)
        is_slice = n < 2
        picture = (
            grey_picture(near.slice(axes), low, high)
            if is_slice
            else bone_picture(near.bone(axes, threshold))
        )
        pictures.append(picture)
        thick = min(volume.spacing)
        for mark, at in (("label", place.label), ("expected", place.expected)):
            off = abs(float((at - centre) @ axes.away))
            marks.append(marked(n, at, centre, axes, across, mark, faint=is_slice and off > thick))
    captions = (f"{plane}, label", f"{plane}, expected", f"{PICTURE_AXES[side.value].name}, {across:.0f} mm")
    return PictureBlock(
        _heading(place.name), note, np.concatenate(pictures, axis=1), tuple(marks), captions, alarming=True
    )
