"""The pages of a contact sheet: every feature of a side, its best slice and the bone around it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gp_core.landmarks.features import FEATURES, Feature, Side
from gp_core.validation import FloatArray
from gp_labeler.document.labelling_edits import labelling_text
from gp_labeler.document.state import SpecimenState
from gp_labeler.imaging.close_up import PICTURE_AXES, CloseUp
from gp_labeler.imaging.volume import Volume
from gp_labeler.jobs.picture_page import (
    PIXELS,
    PageLayout,
    PictureBlock,
    PictureMark,
    bone_picture,
    grey_picture,
    picture_page,
    picture_plane,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["FeaturePictures", "contact_page", "feature_pictures"]

_ACROSS_MM = 12.0
_LAYOUT = PageLayout(columns=5, rows=4, n_pictures=2)
_LEGEND = "Left: the slice through the label. Right: bone from the {}; what hides the label is cut away."
_WORDS = {"fair": "fair", "guess": "GUESS", "sure": "sure"}


@dataclass(frozen=True)
class FeaturePictures:
    """What a sheet shows of one feature.

    Parameters
    ----------
    code, heading, note : str
        Such as ``CA``, ``CA  Cochlea apex``, ``fair · broken bulla``.
    plane : str
        In which plane the slice lies; empty where there are no pictures.
    pictures : (pixels, 2 pixels, 3) array, optional
        Slice and bone beside each other, RGB from 0 to 1; None where the feature has no position.
    """

    code: str
    heading: str
    note: str
    plane: str = ""
    pictures: NDArray[np.float32] | None = None


def feature_pictures(
    state: SpecimenState, side: Side, volume: Volume, threshold: float, tell: Callable[[float], object]
) -> Iterator[FeaturePictures]:
    """Yield the 20 features of one side, in the table's order."""
    low, high = volume.intensity_range
    turn = _turn(state)
    for n, row in enumerate(FEATURES):
        tell(n / len(FEATURES))
        landmarks = state.side(side)
        heading, note = f"{row.code}  {row.name}", _note(state, side, row)
        if row.code not in landmarks:
            yield FeaturePictures(row.code, heading, note)
            continue
        plane = picture_plane(row)
        near = CloseUp(volume, landmarks[row.code], _ACROSS_MM, PIXELS)
        grey = grey_picture(near.slice(PICTURE_AXES[plane].turned(turn)), low, high)
        bone = bone_picture(near.bone(PICTURE_AXES[side.value].turned(turn), threshold))
        yield FeaturePictures(row.code, heading, note, plane, np.concatenate([grey, bone], axis=1))


def _turn(state: SpecimenState) -> FloatArray:
    """Return the (3, 3) rotation from the head's frame, where that is known, into the scan's."""
    if state.head_frame is None:
        return np.eye(3)
    rotation: FloatArray = state.head_frame.T_head_scan.matrix[:3, :3].T
    return rotation


def _note(state: SpecimenState, side: Side, row: Feature) -> str:
    """Return how certain a label is, who checked it and what was noted, or why it has no position."""
    if row.computed:
        return "computed" if row.code in state.side(side) else "not yet computed"
    mark = state.landmark(side, row.code)
    if mark.position is None:
        word = "not seen" if mark.unseen else "suggested, not confirmed" if mark.suggestion else "to do"
        return f"{word} · {mark.note}" if mark.note else word
    words = [_WORDS[mark.certainty.value]] if mark.certainty else []
    words += ["checked" + (f" by {mark.checked_by}" if mark.checked_by else "")] if mark.checked else []
    return " · ".join([*words, *([mark.note] if mark.note else [])])


def contact_page(state: SpecimenState, side: Side, features: list[FeaturePictures], scan: str) -> Figure:
    """Lay out the pictures of one side as a page, A4 landscape."""
    n = len(state.side(side).placed)
    who = labelling_text(state.labeller, state.round) + (", blind" if state.blind else "")
    about = (
        f"{n} of {len(FEATURES)} placed   ·   {who}   ·   {scan}   ·   pictures are {_ACROSS_MM:g} mm wide"
    )
    return picture_page(
        [_block(each) for each in features],
        _LAYOUT,
        title=f"{state.specimen}   {side.word} side",
        about=about,
        legend=_LEGEND.format(side.word),
    )


def _block(each: FeaturePictures) -> PictureBlock:
    middle = (PIXELS - 1) / 2
    return PictureBlock(
        each.heading,
        each.note,
        each.pictures,
        tuple(PictureMark(n, middle, middle) for n in range(_LAYOUT.n_pictures)),
        (each.plane,),
        alarming="GUESS" in each.note,
    )
