"""Steps on labelled scans: suggesting landmarks from them, checking these, and checking labelled scans."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from gp_core.disk import write_text
from gp_core.errors import GpError
from gp_core.landmarks.features import Side, feature
from gp_labeler.models.suggestion_pages import PageEntry
from gp_labeler.scripting.events import click, press_keys
from gp_labeler.scripting.page_correction import correct_on_page
from gp_labeler.scripting.step import Step
from gp_labeler.scripting.window_driver import WindowDriver
from gp_labeler.views.panels.label.close_view_tile import CloseViewTile
from gp_labeler.views.panels.label.suggestion_page_dialog import SuggestionPageDialog

__all__ = ["PATIENCE_SECONDS", "CheckLabelledScans", "CheckPages", "SuggestLike"]

PATIENCE_SECONDS = 6 * 3600.0
"""The first time, every labelled scan is predicted from every other; a busy machine takes long for that."""


@dataclass(frozen=True)
class SuggestLike(Step):
    """Suggest the landmarks of the open scan from labelled scans, for a person to confirm.

    Parameters
    ----------
    labelled : text or texts
        Specimen files, landmark files beside their scans, and folders of them.
    left_confirmed : bool
        Whether left is known to be left as the file says; nothing in a scan can prove it. Needed unless a
        feature of one side is placed, or left was confirmed before.
    """

    do: ClassVar[str] = "suggest_like"
    labelled: tuple[str, ...]
    left_confirmed: bool = False

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        model = driver.workspace.first_labels
        if not (self.left_confirmed or model.knows_left):
            raise GpError(
                "suggest_like: which side is left is not known",
                remedy="Say left_confirmed = true if left is as the file says.",
            )
        before = model.proposal
        labelled = [driver.to_read(each) for each in self.labelled]
        model.suggest(labelled, left_confirmed=self.left_confirmed)
        driver.wait_until_idle(patience=PATIENCE_SECONDS)
        if model.proposal is None or model.proposal is before:
            raise GpError("suggest_like: nothing was suggested")
        proposal = model.proposal
        return f"{len(proposal.guesses)} suggested from {proposal.source}"


@dataclass(frozen=True)
class CheckPages(Step):
    """Check suggestions in pages of close views, as a person does: click those to look at again, press Enter.

    Parameters
    ----------
    look_at : text or texts
        Points such as ``CA L`` that shall be looked at in the views, so that they stay suggestions.
    within : float, optional
        Points that lie farther than this from their true place in the phantom, mm, are looked at, too.
    correct : bool
        Correct those on the page instead, also doubtful ones, where their close views show the true place.
    """

    do: ClassVar[str] = "check_pages"
    look_at: tuple[str, ...] = ()
    within: float | None = None
    correct: bool = False

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        if self.correct and self.within is None:
            raise GpError("check_pages: correct needs within", remedy="For example, within = 0.2.")
        pages, before = driver.workspace.pages, _n_suggested(driver)
        if not driver.window.commands.run("point.check_page"):
            raise GpError(driver.trouble(0) or "check_pages: nothing is suggested")
        (dialog,) = driver.window.findChildren(SuggestionPageDialog)
        n_pages, n_corrected = pages.n_pages, 0
        for _ in range(n_pages):
            driver.wait_until_idle()
            for tile in dialog.shown_tiles:
                dialog.area.ensureWidgetVisible(tile)
                driver.app.processEvents()
                n_corrected += self._judge(driver, tile)
            press_keys(dialog.tiles[0], "Return")
        driver.wait_until_idle()
        left = _n_suggested(driver)
        told = f"{before - left - n_corrected} confirmed on {n_pages} {'page' if n_pages == 1 else 'pages'}"
        return f"{told}, {n_corrected} corrected, {left} left" if self.correct else f"{told}, {left} left"

    def _judge(self, driver: WindowDriver, tile: CloseViewTile) -> bool:
        """Correct or mark what is not to be confirmed as it is; return whether it was corrected."""
        entry = tile.entry
        if entry is None or entry.suggestion is None:
            return False
        wanted, is_far = (entry.side, entry.code) in map(_point, self.look_at), self._is_far(driver, entry)
        if self.correct and is_far and not wanted:
            aim = driver.truth(entry.side, entry.code)
            if correct_on_page(driver, tile, aim, driver.voxel / 2):
                return True
        if (wanted or is_far) and entry.is_offered:
            click(tile, tile.width() / 2, tile.height() / 2)
        return False

    def _is_far(self, driver: WindowDriver, entry: PageEntry) -> bool:
        """Whether a suggestion lies farther from its true place than is allowed."""
        if self.within is None or entry.position is None:
            return False
        off = np.linalg.norm(np.array(entry.position) - driver.truth(entry.side, entry.code))
        return bool(off > self.within)


def _n_suggested(driver: WindowDriver) -> int:
    left, right = (driver.workspace.document.landmarks(side).suggested for side in Side)
    return len(left) + sum(not feature(code).shared for code in right)


def _point(text: str) -> tuple[Side, str]:
    """Return the point that a text such as ``CA L`` names."""
    code, _, side = text.partition(" ")
    return Side.parse(side or "L"), feature(code).code


@dataclass(frozen=True)
class CheckLabelledScans(Step):
    """Predict every labelled scan from the others, and draw the labels that contradict them.

    Parameters
    ----------
    labelled : text or texts
        Specimen files, landmark files beside their scans, and folders of them; three scans or more.
    path : str
        Where labels that were found are drawn: a ``.pdf`` file for all, or a folder for one file each.
    findings : str, optional
        Where to write what was found, JSON.
    strict : bool
        Whether a finding fails the step.
    """

    do: ClassVar[str] = "check_library"
    labelled: tuple[str, ...]
    path: str = "labels.pdf"
    findings: str | None = None
    strict: bool = False

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        model = driver.workspace.specimens
        labelled = [driver.to_read(each) for each in self.labelled]
        model.check_library_of(labelled, driver.to_write(self.path))
        driver.wait_until_idle(patience=PATIENCE_SECONDS)
        found = model.library_checked
        if found is None:
            raise GpError("check_library: nothing was checked")
        driver.wrote(*found.files)
        if self.findings is not None:
            file = driver.to_write(self.findings)
            write_text(file, json.dumps(dict(found.content), indent=1) + "\n")
            driver.wrote(file)
        if self.strict and found.findings:
            raise GpError(f"check_library: {'; '.join(found.findings[:3])}")
        return " ".join(found.lines)
