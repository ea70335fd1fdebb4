"""Edits of a specimen that concern none of its points; see `edits` for what an edit is."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

from gp_labeler.document.state import PoseCheck, SpecimenState

__all__ = ["RecordPoseCheck", "RenameSpecimen", "SetNotes", "SetThreshold"]


@dataclass(frozen=True)
class SetThreshold:
    """Set the bone threshold, in grey values of the scan."""

    do: ClassVar[str] = "set_threshold"
    threshold: float

    @property
    def text(self) -> str:
        """Such as ``set threshold to 1200``."""
        return f"set threshold to {self.threshold:g}"

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state with this threshold."""
        return replace(state, threshold=self.threshold)


@dataclass(frozen=True)
class SetNotes:
    """Replace the notes on the specimen."""

    do: ClassVar[str] = "set_notes"
    notes: str

    @property
    def text(self) -> str:
        """``edit notes``."""
        return "edit notes"

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state with these notes."""
        return replace(state, notes=self.notes)


@dataclass(frozen=True)
class RenameSpecimen:
    """Give the specimen another name."""

    do: ClassVar[str] = "rename_specimen"
    name: str

    @property
    def text(self) -> str:
        """Such as ``rename to GP-014``."""
        return f"rename to {self.name}"

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state with this name; raises `GpError` where a file cannot have it."""
        return replace(state, specimen=self.name)


@dataclass(frozen=True)
class RecordPoseCheck:
    """Keep a person's verdict on an estimated pose."""

    do: ClassVar[str] = "record_pose_check"
    check: PoseCheck

    @property
    def text(self) -> str:
        """Such as ``accept left pose``."""
        return f"{self.check.verdict} {self.check.side.word} pose"

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state with the verdict added."""
        return replace(state, pose_checks=(*state.pose_checks, self.check))
