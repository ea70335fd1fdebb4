"""Steps that are edits: what a recorder writes, made exactly as it was made, without a click."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from gp_core.landmarks.features import Side
from gp_labeler.document.edit_tables import EDITS, edit_of, redone
from gp_labeler.document.edits import Edit, PlacePoint
from gp_labeler.document.specimen_edits import SetThreshold
from gp_labeler.document.touch_edits import MoveTouches
from gp_labeler.scripting.step import Step
from gp_labeler.scripting.window_driver import WindowDriver

__all__ = ["EDIT_STEPS", "EditStep"]


@dataclass(frozen=True)
class EditStep(Step):
    """Make an edit; its keys are the fields of the edit.

    Parameters
    ----------
    edit : Edit
        What is done.
    merge : bool
        Whether it continues the gesture before it: both are one undo.
    """

    edit: Edit = field(kw_only=True)
    merge: bool = field(default=False, kw_only=True)

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> EditStep:
        """Return the step of these keys; raises `GpError` for a key or a value that it does not take."""
        keys = dict(given)
        merge = keys.pop("merge", False)
        return cls(edit=edit_of({"do": cls.do, **keys}), merge=merge is True)

    @property
    def title(self) -> str:
        """What it does, as undo says it."""
        return self.edit.text

    def run(self, driver: WindowDriver) -> None:
        """Make it, as whoever runs the script."""
        workspace, edit = driver.workspace, self.edit
        side, code = getattr(edit, "side", None), getattr(edit, "code", None)
        if isinstance(side, Side) and code is not None:
            workspace.labels.choose(side, code)
        elif isinstance(side, Side) and "touch" in self.do:
            workspace.pose.choose(side=side.other if isinstance(edit, MoveTouches) else side)
        workspace.document.do(redone(edit, workspace.document), merge=self.merge)
        if isinstance(edit, PlacePoint):
            workspace.view.set_crosshair(edit.position)
        if isinstance(edit, SetThreshold):
            driver.wait_until_idle()


EDIT_STEPS: Mapping[str, type[EditStep]] = MappingProxyType(
    {do: type(f"{kind.__name__}Step", (EditStep,), {"do": do}) for do, kind in EDITS.items()}
)
"""A step for each edit, by its name."""
