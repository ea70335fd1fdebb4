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
from gp_labeler.scripting.step import Step
from gp_labeler.scripting.window_driver import WindowDriver
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
    """

    do: ClassVar[str] = "check_pages"
    look_at: tuple[str, ...] = ()
    within: float | None = None

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        pages, before = driver.workspace.pages, _n_suggested(driver)
        if not driver.window.commands.run("point.check_page"):
            raise GpError(driver.trouble(0) or "check_pages: nothing is suggested")
        (dialog,) = driver.window.findChildren(SuggestionPageDialog)
        wanted, n_pages = {_point(each) for each in self.look_at}, pages.n_pages
        for _ in range(n_pages):
            driver.wait_until_idle()
            for tile in dialog.shown_tiles:
                dialog.area.ensureWidgetVisible(tile)
                driver.app.processEvents()
                if self._is_wanted(driver, tile.entry, wanted):
                    click(tile, tile.width() / 2, tile.height() / 2)
            press_keys(dialog.tiles[0], "Return")
        driver.wait_until_idle()
        left = _n_suggested(driver)
        return f"{before - left} confirmed on {n_pages} {'page' if n_pages == 1 else 'pages'}, {left} left"

    def _is_wanted(
        self, driver: WindowDriver, entry: PageEntry | None, wanted: set[tuple[Side, str]]
    ) -> bool:
        """Whether a person wants to look at a suggestion that the page offers to confirm."""
        if entry is None or entry.suggestion is None or not entry.is_offered:
            return False
        if self.within is None or (entry.side, entry.code) in wanted:
            return (entry.side, entry.code) in wanted
        off = np.linalg.norm(np.array(entry.suggestion.position) - driver.truth(entry.side, entry.code))
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
