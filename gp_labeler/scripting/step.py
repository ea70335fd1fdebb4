"""A step of a script: a frozen value, made of a table whose every key and value is checked."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, dataclass, fields
from types import UnionType
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar, Union, get_args, get_origin, get_type_hints

from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_core.validation import near_matches

if TYPE_CHECKING:
    from gp_labeler.scripting.window_driver import WindowDriver

__all__ = [
    "Lengths",
    "Options",
    "Pair",
    "Places",
    "Positions",
    "Ranges",
    "Step",
    "Texts",
    "Triple",
    "make_step",
]

Pair = tuple[float, float]
Triple = tuple[float, float, float]
Positions = dict[str, Triple]
Lengths = dict[str, float]
Texts = dict[str, str]
Options = dict[str, Any]
Places = tuple[str | Triple, ...]
Ranges = tuple[tuple[int, int], tuple[int, int], tuple[int, int]]
S = TypeVar("S", bound="Step")


@dataclass(frozen=True)
class Step:
    """One step; its fields are the keys that a script gives, and its docstring is its manual."""

    do: ClassVar[str] = ""
    says: ClassVar[tuple[str, ...]] = ()
    """Fields that its title names."""

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> Step:
        """Return the step of these keys; raises `GpError` for a key or a value that it does not take."""
        return _filled(cls, given)

    def run(self, driver: WindowDriver) -> str | None:
        """Do it, and return what is worth telling.

        Raises
        ------
        GpError
            It cannot be done.
        """
        raise NotImplementedError

    @property
    def title(self) -> str:
        """The step in a few words, such as ``place CA left``."""
        values = [getattr(self, name) for name in self.says]
        return " ".join([self.do, *(_word(value) for value in values if value is not None)])


def _word(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(getattr(value, "word", value))


def make_step(kinds: Mapping[str, type[Step]], table: Any) -> Step:
    """Make the step that a table describes.

    Parameters
    ----------
    kinds : mapping
        Classes of steps by what they do.
    table : mapping
        ``do`` and the fields of that step.

    Raises
    ------
    GpError
        No such step, or a key or value that it does not take.
    """
    if not isinstance(table, Mapping):
        raise GpError(f"must be a table such as do = 'save', got {table!r:.60}")
    does = table.get("do")
    if does is None:
        raise GpError("has no key do", remedy=f"Give do = one of {', '.join(kinds)}.")
    if not isinstance(does, str) or does not in kinds:
        near = _nearest(does, kinds)
        raise GpError(
            f"unknown step {does!r:.40}{near}", remedy="" if near else f"There are {', '.join(kinds)}."
        )
    return kinds[does].of({key: value for key, value in table.items() if key != "do"})


def _filled(kind: type[S], given: Mapping[str, Any]) -> S:
    hints, known = get_type_hints(kind), {field.name: field for field in fields(kind)}
    for key in given:
        if key not in known:
            allowed = f"It takes {', '.join(known)}." if known else "It takes nothing."
            raise GpError(f"{kind.do}: unknown key {key!r}{_nearest(key, known)}", remedy=allowed)
    for name, field in known.items():
        if name not in given and field.default is MISSING and field.default_factory is MISSING:
            raise GpError(f"{kind.do}: {name} is missing")
    return kind(**{key: _converted(f"{kind.do}: {key}", hints[key], value) for key, value in given.items()})


def _nearest(word: object, allowed: Iterable[str]) -> str:
    return near_matches(str(word), allowed).lower()


def _converted(name: str, hint: Any, value: Any) -> Any:
    """Return a value as its field wants it."""
    choices = get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)
    kinds = [kind for kind in choices if kind is not type(None)]
    for kind in kinds:
        try:
            return _KINDS[kind][1](value)
        except (TypeError, ValueError, AttributeError, OverflowError):  # such as 10**400
            continue
        except GpError as error:
            raise GpError(f"{name}: {error.problem}", remedy=error.remedy) from None
    raise GpError(f"{name} must be {' or '.join(_KINDS[kind][0] for kind in kinds)}, got {value!r:.60}")


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise TypeError
    return float(value)


def _whole(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise TypeError
    return value


def _flag(value: Any) -> bool:
    if not isinstance(value, bool):
        raise TypeError
    return value


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError
    return value


def _numbers(count: int) -> Callable[[Any], tuple[float, ...]]:
    def convert(value: Any) -> tuple[float, ...]:
        if not isinstance(value, (list, tuple)) or len(value) != count:
            raise TypeError
        return tuple(_number(each) for each in value)

    return convert


def _ranges(value: Any) -> tuple[tuple[int, int], ...]:
    if len(_sequence(value)) != 3 or not all(len(_sequence(pair)) == 2 for pair in value):
        raise TypeError
    return tuple((_whole(low), _whole(high)) for low, high in value)


def _texts(value: Any) -> tuple[str, ...]:
    return (value,) if isinstance(value, str) else tuple(_text(each) for each in _sequence(value))


def _sequence(value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise TypeError
    return value


def _places(value: Any) -> tuple[str | Triple, ...]:
    convert: Any = _numbers(3)
    return tuple(each if isinstance(each, str) else convert(each) for each in _sequence(value))


def _positions(value: Any) -> dict[str, Triple]:
    convert: Any = _numbers(3)
    return {_text(key): convert(each) for key, each in value.items()}


def _lengths(value: Any) -> dict[str, float]:
    return {_text(name): _number(length) for name, length in value.items()}


def _options(value: Any) -> dict[str, Any]:
    return {_text(key): each for key, each in value.items()}


def _table_of_texts(value: Any) -> dict[str, str]:
    return {_text(key): _text(text) for key, text in value.items()}


_KINDS: Mapping[Any, tuple[str, Callable[[Any], Any]]] = {
    str: ("text", _text),
    float: ("a number", _number),
    int: ("a whole number", _whole),
    bool: ("true or false", _flag),
    Side: ("L or R", Side.parse),
    Pair: ("two numbers", _numbers(2)),
    Triple: ("three numbers", _numbers(3)),
    Ranges: ("three pairs of whole numbers", _ranges),
    tuple[str, ...]: ("texts", _texts),
    Places: ("positions, or points such as CA L", _places),
    Positions: ("a table of positions", _positions),
    Lengths: ("a table of numbers", _lengths),
    Texts: ("a table of texts", _table_of_texts),
    Options: ("a table", _options),
}
