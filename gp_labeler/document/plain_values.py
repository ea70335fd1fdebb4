"""Records as texts, numbers, lists and tables, and back: what edits and specimen files consist of.

What is as it is by default has no entry. `msgspec` reads the types of the fields, and checks them.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache
from types import MappingProxyType
from typing import Any, TypeVar

import msgspec

from gp_core.errors import GpError

__all__ = ["plain", "record_of"]

T = TypeVar("T")

_WORDS = {
    "object": "an object",
    "array": "a list",
    "str": "text",
    "bool": "true or false",
    "int": "a whole number",
    "float": "a number",
}
_PLAIN = (str, float, int, bool, Enum)
_SAME: Mapping[str, str] = MappingProxyType({})


def plain(
    value: Any, *, names: Mapping[str, str] = _SAME, left_out: tuple[str, ...] = (), full: bool = False
) -> Any:
    """Return texts, numbers, lists and tables.

    Parameters
    ----------
    value : dataclass, enum, mapping, list, tuple, str, number or None
        What to say.
    names : mapping of str to str, optional
        Fields that have another name outside.
    left_out : tuple of str
        Fields that are not said.
    full : bool
        Whether to say a field that is as it is by default, too.
    """

    def said(each: Any) -> Any:
        if each is None or isinstance(each, _PLAIN):
            return each.value if isinstance(each, Enum) else each
        if is_dataclass(each) and not isinstance(each, type):
            there = ((name, getattr(each, name), default) for name, default in _fields_of(type(each)))
            return {
                names.get(name, name): said(part)
                for name, part, default in there
                if name not in left_out and (full or part != default)
            }
        if isinstance(each, Mapping):
            return {said(key): said(part) for key, part in each.items()}
        if isinstance(each, (list, tuple)):
            return [said(part) for part in each]
        return each

    return said(value)


@cache
def _fields_of(kind: type[Any]) -> tuple[tuple[str, Any], ...]:
    """Return the names of a record's fields, each with its default."""
    return tuple((field.name, field.default) for field in fields(kind))


def record_of(kind: type[T], content: Any, where: str, *, names: Mapping[str, str] = _SAME) -> T:
    """Return the record that a table says; entries it does not know are left out.

    Parameters
    ----------
    kind : type
        A dataclass, or any type that `msgspec.convert` knows.
    content : JSON value
        What was read.
    where : str
        What to call it in a message; may be empty.
    names : mapping of str to str, optional
        Fields that have another name outside.

    Raises
    ------
    GpError
        An entry is missing, of another type or not finite; the message names it. Also what the record itself
        raises.
    """
    _check_finite(content, where)
    try:
        return msgspec.convert(_with_own_names(content, names), kind)
    except msgspec.ValidationError as error:
        problem, _, path = str(error).replace("`", "").partition(" - at $")
        for own, outside in names.items():
            path = re.sub(rf"\.{own}\b", f".{outside}", path)
            problem = problem.replace(f"field {own}", f"field {outside}")
        raise GpError(_sentence(problem, f"{where}{path}".lstrip("."), content, path)) from None


def _with_own_names(content: Any, names: Mapping[str, str]) -> Any:
    if not isinstance(content, Mapping):
        return content
    own = {outside: name for name, outside in names.items()}
    return {own.get(key, key): each for key, each in content.items()}


def _check_finite(value: Any, where: str) -> None:
    if isinstance(value, (float, int)) and not abs(value) <= sys.float_info.max:  # so written, NaN is refused
        raise GpError(f"{where} must be finite, got {value!r:.20}")
    if isinstance(value, Mapping):
        for key, each in value.items():
            _check_finite(each, f"{where}.{key}".lstrip("."))
    elif isinstance(value, (list, tuple)):
        for n, each in enumerate(value):
            _check_finite(each, f"{where}[{n}]")


def _sentence(problem: str, where: str, content: Any, path: str) -> str:
    """Say what `msgspec` found, in words and with the value, if its path names it."""
    got = "" if "[...]" in path else f", got {_at(content, path)!r:.60}"
    if missing := re.fullmatch(r"Object missing required field (\w+)", problem):
        return f"{where}.{missing[1]} is missing".lstrip(".")
    if problem.startswith("Invalid enum value"):
        return f"{where} is unknown{got.replace(', got', ':', 1)}"
    if length := re.match(r"Expected array of length (\d+)", problem):
        kind = "three numbers" if length[1] == "3" else f"a list of length {length[1]}"
        return f"{where} must be {kind}{got}"
    if expected := re.match(r"Expected ([\w| ]+)(?:, got|$)", problem):
        kinds = [_WORDS.get(each, each) for each in expected[1].split(" | ") if each != "null"]
        return f"{where} must be {' or '.join(kinds)}{got}"
    return f"{where}: {problem[:1].lower()}{problem[1:]}"


def _at(content: Any, path: str) -> Any:
    """Return what is at a path such as ``.points[0]``."""
    for key, index in re.findall(r"\.(\w+)|\[(\d+)\]", path):
        content = content[key] if key else content[int(index)]
    return content
