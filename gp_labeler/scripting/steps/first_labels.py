"""Steps on labelled scans: suggesting landmarks from them, and checking them against each other."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import ClassVar

from gp_core.disk import write_text
from gp_core.errors import GpError
from gp_labeler.scripting.step import Step
from gp_labeler.scripting.window_driver import WindowDriver

__all__ = ["PATIENCE_SECONDS", "CheckLabelledScans", "SuggestLike"]

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
