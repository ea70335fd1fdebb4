"""Steps that say who labels, and begin or open a labelling of the specimen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from gp_labeler.document.labelling_edits import labelling_text
from gp_labeler.scripting.step import Step
from gp_labeler.scripting.window_driver import WindowDriver

__all__ = ["LabelAgain", "Observer", "OpenOther"]


@dataclass(frozen=True)
class Observer(Step):
    """Say who labels from now on.

    Parameters
    ----------
    name : str
        Name or initials.
    """

    do: ClassVar[str] = "observer"
    says: ClassVar[tuple[str, ...]] = ("name",)
    name: str

    def run(self, driver: WindowDriver) -> None:  # noqa: D102
        driver.workspace.set_observer(self.name)


@dataclass(frozen=True)
class LabelAgain(Step):
    """Begin another labelling of the specimen, from nothing; the earlier ones are kept apart.

    Parameters
    ----------
    observer : str
        Who labels; by default the one who labels now.
    blind : bool
        Whether undo shall not go back to the other labellings.
    """

    do: ClassVar[str] = "label_again"
    says: ClassVar[tuple[str, ...]] = ("observer",)
    observer: str | None = None
    blind: bool = True

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        driver.workspace.label_again(self.observer or "", blind=self.blind)
        driver.wait_until_idle()
        state = driver.workspace.document.state
        return labelling_text(state.observer, state.round)


@dataclass(frozen=True)
class OpenOther(Step):
    """Take up a labelling of the specimen that was made before.

    Parameters
    ----------
    observer : str
        Who made it.
    round : int
        Which of the observer's labellings, from 1.
    """

    do: ClassVar[str] = "labelling"
    says: ClassVar[tuple[str, ...]] = ("observer", "round")
    observer: str
    round: int = 1

    def run(self, driver: WindowDriver) -> None:  # noqa: D102
        driver.workspace.open_labelling(self.observer, self.round)
        driver.wait_until_idle()
