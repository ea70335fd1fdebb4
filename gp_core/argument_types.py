"""Type checks of the arguments of public functions, by their annotations: a wrong type is a `GpError`.

Only the annotated types are checked; whether a value makes sense is left to the function.
"""

from __future__ import annotations

import functools
import inspect
import numbers
import types
import typing
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import fields
from typing import Any, ParamSpec, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from gp_core.errors import GpError

__all__ = ["check_fields", "checks_arguments", "checks_arguments_but", "is_scalar_array"]

_P = ParamSpec("_P")
_R = TypeVar("_R")

_UNIONS = (typing.Union, types.UnionType)

_BY_PLACE = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)

_MANY = 1000
"""Elements of a sequence that are looked at."""

_WORDS = {
    float: "a number",
    int: "a whole number",
    bool: "true or false",
    str: "a text",
    type(None): "None",
    np.ndarray: "an array of numbers",
}


def checks_arguments_but(*leaving_out: str) -> Callable[[Callable[_P, _R]], Callable[_P, _R]]:
    """Return `checks_arguments` that leaves out arguments of which the function says more itself.

    Parameters
    ----------
    *leaving_out : str
        Their names.

    Returns
    -------
    callable
        The decorator.
    """

    def decorate(function: Callable[_P, _R]) -> Callable[_P, _R]:
        return _checking(function, leaving_out)

    return decorate


def checks_arguments(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Return a function that checks the types of its arguments.

    Parameters
    ----------
    function : callable
        With annotations.

    Returns
    -------
    callable
        The same function, with the check.

    Raises
    ------
    GpError
        When it is called: an argument has another type than annotated, or does not exist.

    Examples
    --------
    >>> @checks_arguments
    ... def double(length: float) -> float:
    ...     return 2 * length
    >>> double("x")
    Traceback (most recent call last):
        ...
    gp_core.errors.GpError: length must be a number, got 'x'
    """
    return _checking(function, ())


def _checking(function: Callable[_P, _R], leaving_out: Collection[str]) -> Callable[_P, _R]:
    signature = inspect.signature(function)
    names = tuple(name for name, one in signature.parameters.items() if one.kind in _BY_PLACE)
    hints: dict[str, Any] = {}

    @functools.wraps(function)
    def checked(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        if not hints:
            hints.update(typing.get_type_hints(function))
            for name in leaving_out:
                hints.pop(name, None)
        if not _all_fit(names, args, kwargs, hints):
            for name, value in _named(signature, args, kwargs).items():
                if name in hints and signature.parameters[name].default is not value:
                    _check(value, hints[name], name)
        return function(*args, **kwargs)

    return checked


def _all_fit(
    names: tuple[str, ...], args: tuple[Any, ...], kwargs: Mapping[str, Any], hints: Mapping[str, Any]
) -> bool:
    """Whether all arguments fit, seen without binding them, which takes longer than many functions."""
    return (
        len(args) <= len(names)
        and all(_fits(value, hints.get(name, Any)) for name, value in zip(names, args, strict=False))
        and all(_fits(value, hints.get(name, Any)) for name, value in kwargs.items())
    )


def _named(
    signature: inspect.Signature, args: tuple[Any, ...], kwargs: Mapping[str, Any]
) -> Mapping[str, Any]:
    """Return arguments by name; none where they do not match, which the call itself then says."""
    try:
        return signature.bind(*args, **kwargs).arguments
    except TypeError:
        return {}


def check_fields(instance: Any, *, leaving_out: Collection[str] = ()) -> None:
    """Raise `GpError` unless the fields of a dataclass are of the types that are annotated.

    Parameters
    ----------
    instance : dataclass
    leaving_out : collection of str
        Fields that take more than they are annotated with, and say so themselves.
    """
    hints = _hints_of(instance.__class__)
    for one in fields(instance):
        if one.name not in leaving_out:
            _check(getattr(instance, one.name), hints[one.name], one.name)


@functools.cache
def _hints_of(cls: Any) -> dict[str, Any]:
    return typing.get_type_hints(cls)


def _check(value: Any, hint: Any, name: str) -> None:
    if not _fits(value, hint):
        shown = repr(value)
        if len(shown) > 60 or "\n" in shown:
            shown = type(value).__name__
        raise GpError(f"{name} must be {_words(hint)}, got {shown}")


def _fits(value: Any, hint: Any) -> bool:
    """Whether a value is of an annotated type; what is not understood fits."""
    if type(value) is hint and hint is not int:  # as usual; a whole number may be too large
        return True
    anything, origin, arguments = _parts(hint)
    if anything:
        return True
    if origin in _UNIONS:
        return any(_fits(value, one) for one in arguments)
    if origin is None:
        return _fits_class(value, hint)
    if origin is np.ndarray:
        return _is_numeric(value)
    if origin is tuple and arguments[-1] is not Ellipsis:
        return (
            isinstance(value, Sequence) and len(value) == len(arguments) and all(map(_fits, value, arguments))
        )
    if isinstance(origin, type) and issubclass(origin, Mapping):
        keys, values = arguments
        return isinstance(value, Mapping) and all(
            _fits(key, keys) and (_fits(one, values)) for key, one in value.items()
        )
    if isinstance(origin, type) and issubclass(origin, Iterable) and arguments:
        return _fits_iterable(value, origin, arguments[0])
    return not isinstance(origin, type) or isinstance(value, origin)


@functools.cache
def _parts(hint: Any) -> tuple[bool, Any, tuple[Any, ...]]:
    """Return whether anything fits, and what an annotation is made of."""
    hint = _meant(hint)
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    return hint is Any or _takes_arrays(hint), origin, arguments


def _meant(hint: Any) -> Any:
    """Return what an annotation stands for: NumPy 2.5 and later name theirs as aliases of Python 3.12."""
    return getattr(hint, "__value__", hint)


def _takes_arrays(hint: Any) -> bool:
    """Whether an annotation is ArrayLike, or a union with it, which may have taken its members in."""
    if typing.get_origin(hint) not in _UNIONS:
        return False
    arguments = typing.get_args(hint)
    return ArrayLike in arguments or all(one in arguments for one in typing.get_args(_meant(ArrayLike)))


def _fits_class(value: Any, hint: Any) -> bool:
    if not isinstance(hint, type):
        return True
    if hint is float:
        return _is_number(value, numbers.Real)
    if hint is int:
        return _is_number(value, numbers.Integral)
    if hint is bool:
        return isinstance(value, bool | np.bool_)
    return isinstance(value, hint)


def _fits_iterable(value: Any, origin: type, element: Any) -> bool:
    """Whether it may be gone through, and holds what it should; a text is no list of letters."""
    if isinstance(value, str | bytes) or not isinstance(value, Iterable) or is_scalar_array(value):
        return False
    if issubclass(origin, Sequence) and not isinstance(value, Sequence):
        return False
    if isinstance(value, Collection):
        return all(_fits(one, element) for _, one in zip(range(_MANY), value, strict=False))
    return True  # a generator, which can be gone through but once


def is_scalar_array(value: Any) -> bool:
    """Whether a value is an array of no dimension, which has the methods of a list, but is none.

    Parameters
    ----------
    value : object
        Any value.

    Returns
    -------
    bool
        True for such as ``np.array(1.0)``.
    """
    return isinstance(value, np.ndarray) and value.ndim == 0


def _is_number(value: Any, kind: type) -> bool:
    if isinstance(value, bool | np.bool_) or not isinstance(value, kind):
        return False
    number: Any = value
    try:
        float(number)
    except OverflowError:
        return False
    return True


def _is_numeric(value: Any) -> bool:
    try:
        np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        return False
    return not isinstance(value, str | bytes)


def _words(hint: Any) -> str:
    """Say an annotation in words."""
    if hint in (ArrayLike, _meant(ArrayLike)):
        return "numbers"
    hint = _meant(hint)
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin in _UNIONS:
        words = list(dict.fromkeys(_words(one) for one in arguments if one is not type(None)))
        words += ["None"] if type(None) in arguments else []
        return " or ".join(words)
    if isinstance(origin, type):
        if issubclass(origin, Mapping):
            return f"a mapping of {_word(arguments[0])} to {_word(arguments[1])}"
        if origin is not np.ndarray and issubclass(origin, Iterable) and arguments:
            return f"a list of {_word(arguments[0])}"
        return _WORDS.get(origin, "a path" if origin.__name__ == "PathLike" else f"a {origin.__name__}")
    name = getattr(hint, "__name__", str(hint))
    return _WORDS.get(hint, f"{'an' if name[0] in 'AEIO' else 'a'} {name}")


def _word(hint: Any) -> str:
    """Say an annotation as what a list is of."""
    words = _words(hint)
    return words.removeprefix("a ").removeprefix("an ") if hint is not ArrayLike else words
