"""Edits of what was touched with the probe; see `edits` for what an edit is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_core.landmarks.labels import same_label
from gp_labeler.document.edits import as_position
from gp_labeler.document.state import Position, SpecimenState
from gp_labeler.document.touches import Touch, touch_name

__all__ = [
    "LeaveOutTouch",
    "MoveTouches",
    "RecordTouch",
    "RemoveTouches",
    "SetSkull",
    "SwapTouches",
    "TakeTouches",
]


@dataclass(frozen=True)
class RecordTouch:
    """Record one touch, in place of an earlier one of the same name; `Touch.earlier` says which count too."""

    do: ClassVar[str] = "record_touch"
    side: Side
    name: str
    touch: Touch

    def __post_init__(self) -> None:
        object.__setattr__(self, "side", Side.parse(self.side))
        object.__setattr__(self, "name", touch_name(self.name))
        position = as_position(self.touch.position, self.name)
        earlier = tuple(as_position(place, self.name) for place in self.touch.earlier)
        object.__setattr__(self, "touch", replace(self.touch, position=position, earlier=earlier))

    @property
    def text(self) -> str:
        """Such as ``touch MN left``."""
        return f"touch {self.name} {self.side.word}"

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state with the touch; raises `GpError` where the others are in another frame."""
        others = {key: touch for key, touch in state.touches.items() if not self._replaces(key)}
        return replace(state, touches={**others, (self.side, self.name): self.touch})

    def _replaces(self, key: tuple[Side, str]) -> bool:
        return key[0] is self.side and same_label(key[1], self.name)


@dataclass(frozen=True)
class TakeTouches:
    """Take these touches of one side in place of all it had."""

    do: ClassVar[str] = "take_touches"
    side: Side
    touches: Mapping[str, Touch]

    @property
    def text(self) -> str:
        """Such as ``take 6 left touches``."""
        return f"take {len(self.touches)} {self.side.word} touches"

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state with these touches."""
        others = {key: touch for key, touch in state.touches.items() if key[0] is not self.side}
        taken = {(self.side, touch_name(name)): touch for name, touch in self.touches.items()}
        return replace(state, touches={**others, **taken})


@dataclass(frozen=True)
class RemoveTouches:
    """Forget one touch of a side, or all of them."""

    do: ClassVar[str] = "remove_touches"
    side: Side
    name: str | None = None

    @property
    def text(self) -> str:
        """Such as ``clear left touches``."""
        return f"clear {self.side.word} touches" if self.name is None else f"clear touch {self._point}"

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state without."""
        return replace(state, touches={k: t for k, t in state.touches.items() if not self._names(k)})

    @property
    def _point(self) -> str:
        return f"{self.name} {self.side.word}"

    def _names(self, key: tuple[Side, str]) -> bool:
        return key[0] is self.side and self.name in (None, key[1])


@dataclass(frozen=True)
class LeaveOutTouch:
    """Exclude a touch from the estimate, or include it again."""

    do: ClassVar[str] = "leave_out_touch"
    side: Side
    name: str
    left_out: bool = True

    @property
    def text(self) -> str:
        """Such as ``leave out MN left``."""
        return f"{'leave out' if self.left_out else 'take in'} {self.name} {self.side.word}"

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state with the touch out or in; raises `GpError` where there is none."""
        key = (self.side, self.name)
        if key not in state.touches:
            raise GpError(
                f"{self.name} {self.side.word} is not touched yet",
                landmark=self.name,
                remedy="Touch it first.",
            )
        changed = replace(state.touches[key], left_out=self.left_out)
        return replace(state, touches={**state.touches, key: changed})


@dataclass(frozen=True)
class SwapTouches:
    """Give each of two touches of a side the other's name."""

    do: ClassVar[str] = "swap_touches"
    side: Side
    name: str
    other: str

    @property
    def text(self) -> str:
        """Such as ``exchange MN and OS left``."""
        return f"exchange {self.name} and {self.other} {self.side.word}"

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state with the names exchanged; raises `GpError` where one of them is not touched."""
        one, other = (self.side, self.name), (self.side, self.other)
        if one == other:
            raise GpError(f"{self.name} cannot be exchanged with itself", remedy="Give two names.")
        for key in (one, other):
            if key not in state.touches:
                raise GpError(
                    f"{key[1]} {self.side.word} is not touched yet", landmark=key[1], remedy="Touch it first."
                )
        swapped = {one: state.touches[other], other: state.touches[one]}
        return replace(state, touches={**state.touches, **swapped})


@dataclass(frozen=True)
class MoveTouches:
    """Say that all touches of a side are those of the other one."""

    do: ClassVar[str] = "move_touches"
    side: Side

    @property
    def text(self) -> str:
        """Such as ``move left touches to the right``."""
        return f"move {self.side.word} touches to the {self.side.other.word}"

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state with the touches moved; raises `GpError` where the other side was touched too."""
        other = self.side.other
        if any(side is other for side, _ in state.touches):
            raise GpError(f"the {other.word} side was touched too", remedy="Clear its touches first.")
        return replace(state, touches={(other, name): touch for (_, name), touch in state.touches.items()})


@dataclass(frozen=True)
class SetSkull:
    """Say where the skull's registration features are on the scan, in place of all that was said."""

    do: ClassVar[str] = "set_skull"
    skull: Mapping[str, Position]

    @property
    def text(self) -> str:
        """Such as ``set 8 skull features``."""
        return f"set {len(self.skull)} skull features"

    def apply(self, state: SpecimenState) -> SpecimenState:
        """Return the state with these skull features."""
        return replace(state, skull={name: as_position(point, name) for name, point in self.skull.items()})
