"""Edits of the orientation of the head in its scan; see `edits` for what an edit is."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

from gp_core.errors import GpError
from gp_labeler.document.head_frame import HeadFrame
from gp_labeler.document.state import SpecimenState

__all__ = ["ClearHeadFrame", "ConfirmLeft", "SetHeadFrame"]


@dataclass(frozen=True)
class SetHeadFrame:
    """Say how the head lies in its scan. No voxel and no point moves: only the views are turned."""

    do: ClassVar[str] = "set_head_frame"
    head: HeadFrame

    @property
    def text(self) -> str:
        """Such as ``straighten the head by symmetry``."""
        return f"straighten the head by {self.head.found_by}"

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state with this head frame."""
        return replace(state, head_frame=self.head)


@dataclass(frozen=True)
class ClearHeadFrame:
    """Remove the frame of the head from its scan."""

    do: ClassVar[str] = "clear_head_frame"

    @property
    def text(self) -> str:
        """``forget the head frame``."""
        return "forget the head frame"

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state without a head frame."""
        return replace(state, head_frame=None)


@dataclass(frozen=True)
class ConfirmLeft:
    """Keep that a person knows the left side of the file to be the animal's left."""

    do: ClassVar[str] = "confirm_left"

    @property
    def text(self) -> str:
        """``confirm which side is left``."""
        return "confirm which side is left"

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state with left confirmed; raises `GpError` before the head was straightened."""
        if state.head_frame is None:
            raise GpError("the head is not straightened yet", remedy="Straighten it first.")
        return replace(state, head_frame=replace(state.head_frame, left_confirmed=True))
