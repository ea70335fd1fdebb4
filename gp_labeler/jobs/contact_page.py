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

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["FeaturePictures", "contact_page", "feature_pictures"]

_ACROSS_MM = 12.0
_PIXELS = 150
_COLUMNS, _ROWS = 5, 4
_GAP, _CAPTION = 8, 50
"""Pixels between the pictures, and above each pair for its words."""

_A4_INCHES = (11.69, 8.27)
_BONE = np.array([0.93, 0.88, 0.78])
_PAPER, _EMPTY = 1.0, 0.94
_MARK = "#D65A00"
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
        plane = row.view if row.view in ("axial", "coronal", "sagittal") else "axial"
        near = CloseUp(volume, landmarks[row.code], _ACROSS_MM, _PIXELS)
        grey = np.nan_to_num(
            (near.slice(PICTURE_AXES[plane].turned(turn)) - low) / max(high - low, 1e-9)
        ).clip(0, 1)
        bone = near.bone(PICTURE_AXES[side.value].turned(turn), threshold)
        tinted = np.where(bone[..., None] > 0, bone[..., None] * _BONE, _EMPTY)
        pictures = np.concatenate([np.repeat(grey[..., None], 3, axis=2), tinted], axis=1)
        yield FeaturePictures(row.code, heading, note, plane, pictures.astype(np.float32))


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
    from matplotlib.figure import Figure  # here: Matplotlib loads slowly

    figure = Figure(figsize=_A4_INCHES, dpi=150)
    axes = figure.add_axes((0.02, 0.015, 0.96, 0.93))
    width, height = 2 * _PIXELS + _GAP, _PIXELS + _CAPTION + _GAP
    page = np.full((_ROWS * height, _COLUMNS * width, 3), _PAPER, np.float32)
    for n, each in enumerate(features):
        x, y = n % _COLUMNS * width, n // _COLUMNS * height + _CAPTION
        shown = each.pictures
        block = np.full((_PIXELS, 2 * _PIXELS, 3), _EMPTY, np.float32) if shown is None else shown
        page[y : y + _PIXELS, x : x + 2 * _PIXELS] = block
    axes.imshow(page, interpolation="nearest", aspect="equal")
    axes.set_axis_off()
    axes.set_anchor("N")
    for n, each in enumerate(features):
        _write(axes, each, n % _COLUMNS * width, n // _COLUMNS * height)
    _head(figure, state, side, scan)
    return figure


def _write(axes: Axes, each: FeaturePictures, x: int, y: int) -> None:
    axes.text(x, y + 20, each.heading, fontsize=7.5, fontweight="bold", color="#1b1f24")
    note = each.note if len(each.note) <= _LONGEST else each.note[: _LONGEST - 1] + "…"
    axes.text(x, y + 42, note, fontsize=6.5, color="#B3261E" if "GUESS" in note else "#4a525b")
    if each.pictures is None:
        return
    middle = y + _CAPTION + (_PIXELS - 1) / 2
    for column in (0, 1):
        centre = x + column * _PIXELS + (_PIXELS - 1) / 2
        axes.plot([centre], [middle], "o", markersize=7, markerfacecolor="none", markeredgecolor=_MARK)
        axes.plot([centre], [middle], ".", markersize=1.6, color=_MARK)
    axes.text(x + 4, y + _CAPTION + _PIXELS - 6, each.plane, fontsize=5.5, color="white")


_LONGEST = 46
_LEGEND = "Left: the slice through the label. Right: bone from the {}; what hides the label is cut away."


def _head(figure: Figure, state: SpecimenState, side: Side, scan: str) -> None:
    n = len(state.side(side).placed)
    who = labelling_text(state.labeller, state.round) + (", blind" if state.blind else "")
    words = f"{state.specimen}   {side.word} side"
    figure.text(0.025, 0.965, words, fontsize=12, fontweight="bold", color="#1b1f24")
    about = (
        f"{n} of {len(FEATURES)} placed   ·   {who}   ·   {scan}   ·   pictures are {_ACROSS_MM:g} mm wide"
    )
    figure.text(0.025, 0.02, _LEGEND.format(side.word), fontsize=7.5, color="#4a525b")
    figure.text(0.975, 0.965, about, fontsize=7.5, color="#4a525b", ha="right")
