"""Correcting a suggestion on its page as a person does: turn to the slice of the feature, point at it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gp_core.validation import FloatArray
from gp_labeler.models.suggestion_pages import PageEntry, SuggestionPagesModel
from gp_labeler.scripting.events import click, turn_wheel
from gp_labeler.scripting.window_driver import WindowDriver
from gp_labeler.views.panels.label.close_view_tile import CloseViewTile

__all__ = ["Pointing", "correct_on_page", "pointing_at"]


@dataclass(frozen=True)
class Pointing:
    """How a position is pointed at: the picture, notches of the wheel, then where in the picture, 0 to 1."""

    number: int
    n_notches: int
    across: float
    down: float


def pointing_at(
    pages: SuggestionPagesModel, entry: PageEntry, aim: FloatArray, near_mm: float
) -> Pointing | None:
    """Return how to point at a (3,) scan position, mm, in a close view that is drawn.

    Parameters
    ----------
    pages : SuggestionPagesModel
    entry : PageEntry
        Whose close view.
    aim : (3,) array, mm, scan frame
    near_mm : float
        How far from it a click may come to lie without another slice being turned to.

    Returns
    -------
    Pointing, optional
        None where neither picture shows the position, nor has a slice that does.
    """
    slices = []
    for number, picture in enumerate(entry.pictures):
        place = picture.place_of(aim)
        seen = picture.position_at(*place)
        if seen is not None and np.linalg.norm(seen - aim) <= near_mm:
            return Pointing(number, 0, *place)
        if seen is not None and picture.depths is None:
            n_slices = round(pages.slices_to(entry.side, entry.code, number, aim))
            slices.append(Pointing(number, n_slices, *place))
    return min(slices, key=lambda each: abs(each.n_notches), default=None)


def correct_on_page(driver: WindowDriver, tile: CloseViewTile, aim: FloatArray, near_mm: float) -> bool:
    """Correct a suggestion to a (3,) scan position, mm; False where its close view does not show that."""
    if tile.entry is None:
        return False
    how = pointing_at(driver.workspace.pages, tile.entry, aim, near_mm)
    if how is None:
        return False
    pixel = tile.pixel_of_place(how.number, how.across, how.down)
    turn_wheel(tile, *pixel, how.n_notches)
    driver.wait_until_idle(in_passing=False)
    click(tile, *pixel, ctrl=True)
    driver.wait_until_idle(in_passing=False)
    return True
