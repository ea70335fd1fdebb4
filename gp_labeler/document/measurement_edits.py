"""Edits of rulers and angles; see `edits` for what an edit is."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

from gp_core.errors import GpError
from gp_core.landmarks.measurements import Measurement
from gp_labeler.document.state import Position, SpecimenState

__all__ = ["AddMeasurements", "MoveMeasurement", "RemoveMeasurements", "RenameMeasurement"]


@dataclass(frozen=True)
class AddMeasurements:
    """Add rulers and angles, placed or read from files."""

    do: ClassVar[str] = "add_measurements"
    measurements: tuple[Measurement, ...]

    @property
    def text(self) -> str:
        """Such as ``measure Ruler 1`` or ``add 3 measurements``."""
        if len(self.measurements) == 1:
            return f"measure {self.measurements[0].name}"
        return f"add {len(self.measurements)} measurements"

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state with them; raises `GpError` where one has the name of another."""
        return replace(state, measurements=(*state.measurements, *self.measurements))


@dataclass(frozen=True)
class MoveMeasurement:
    """Move the points of a ruler or an angle; as many as it has."""

    do: ClassVar[str] = "move_measurement"
    name: str
    points: tuple[Position, ...]

    @property
    def text(self) -> str:
        """Such as ``move Ruler 1``."""
        return f"move {self.name}"

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state with the points there; raises `GpError` where there is none, or not so many."""
        old = state.measurement(self.name)
        new = Measurement(self.name, self.points)
        if new.kind != old.kind:
            raise GpError(f"{self.name} has {len(old.points)} points, got {len(new.points)}")
        return replace(state, measurements=tuple(new if each is old else each for each in state.measurements))


@dataclass(frozen=True)
class RenameMeasurement:
    """Give a ruler or an angle another name."""

    do: ClassVar[str] = "rename_measurement"
    name: str
    new_name: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "new_name", " ".join(self.new_name.split()))

    @property
    def text(self) -> str:
        """Such as ``rename Ruler 1 to bulla width``."""
        return f"rename {self.name} to {self.new_name}"

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state with the name; raises `GpError` where there is none, or another is called so."""
        old = state.measurement(self.name)
        new = replace(old, name=self.new_name)
        return replace(state, measurements=tuple(new if each is old else each for each in state.measurements))


@dataclass(frozen=True)
class RemoveMeasurements:
    """Remove rulers and angles."""

    do: ClassVar[str] = "remove_measurements"
    names: tuple[str, ...]

    @property
    def text(self) -> str:
        """Such as ``remove Ruler 1`` or ``remove 3 measurements``."""
        return f"remove {self.names[0] if len(self.names) == 1 else f'{len(self.names)} measurements'}"

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state without them; raises `GpError` where there is no such."""
        gone = [state.measurement(name) for name in self.names]
        return replace(state, measurements=tuple(each for each in state.measurements if each not in gone))
