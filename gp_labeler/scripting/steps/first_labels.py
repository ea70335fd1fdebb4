"""The step that suggests landmarks from labelled scans."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from gp_core.errors import GpError
from gp_labeler.scripting.step import Step
from gp_labeler.scripting.window_driver import WindowDriver

__all__ = ["PATIENCE_SECONDS", "SuggestLike"]

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
