"""Type checks of the arguments of public functions, by their annotations: a wrong type is a `GpError`.

Only the annotated types are checked; whether a value makes sense is left to the function.
"""

from __future__ import annotations

import functools
import inspect
import itertools
import numbers
import types
import typing
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
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
    tests: dict[str, _Type] = {}

    @functools.wraps(function)
    def checked(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        if not tests:
            hints = typing.get_type_hints(function)
            tests.update((name, _type_of(hint)) for name, hint in hints.items() if name not in leaving_out)
        for values in (zip(names, args, strict=False), kwargs.items()):
            for name, value in values:  # without binding them, which takes longer than many functions
                if name in tests and not tests[name].fits(value):
                    _raise_for(_named(signature, args, kwargs), signature, tests)
        return function(*args, **kwargs)

    return checked


def _raise_for(values: Mapping[str, Any], signature: inspect.Signature, tests: Mapping[str, _Type]) -> None:
    """Raise `GpError` for the first argument of a wrong type; a default is right even where it is not."""
    for name, value in values.items():
        if name in tests and signature.parameters[name].default is not value:
            tests[name].check(value, name)


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
    types_of_fields = _fields_of(instance.__class__)
    for one in fields(instance):
        if one.name not in leaving_out:
            types_of_fields[one.name].check(getattr(instance, one.name), one.name)


@functools.cache
def _fields_of(cls: Any) -> dict[str, _Type]:
    return {name: _type_of(hint) for name, hint in typing.get_type_hints(cls).items()}


@dataclass(frozen=True)
class _Type:
    """An annotated type, made once so that values are tested quickly.

    Parameters
    ----------
    hint : type or alias
        As annotated.
    exact : frozenset of type
        Classes whose instances fit without further tests.
    test : callable
        Whether any other value fits.
    """

    hint: Any
    exact: frozenset[type]
    test: Callable[[Any], bool]

    def fits(self, value: Any) -> bool:
        """Whether a value is of the type."""
        return type(value) in self.exact or self.test(value)

    def check(self, value: Any, name: str) -> None:
        """Raise `GpError`, with the name of the argument, unless the value is of the type."""
        if not self.fits(value):
            shown = repr(value)
            if len(shown) > 60 or "\n" in shown:
                shown = type(value).__name__
            raise GpError(f"{name} must be {_words(self.hint)}, got {shown}")


@functools.cache
def _type_of(hint: Any) -> _Type:
    """Return the tests of an annotation; where it is not understood, everything fits."""
    meant = _meant(hint)
    origin, arguments = typing.get_origin(meant), typing.get_args(meant)
    if meant is Any or _takes_arrays(meant):
        return _Type(hint, frozenset(), _anything)
    if origin in _UNIONS:
        members = [_type_of(one) for one in arguments]
        together = frozenset(each for one in members for each in one.exact)
        return _Type(hint, together, lambda value: any(one.test(value) for one in members))
    if origin is None:
        is_plain = isinstance(meant, type) and meant is not int  # a whole number may be too large
        return _Type(hint, frozenset([meant] if is_plain else []), functools.partial(_fits_class, hint=meant))
    return _Type(hint, frozenset(), _test_of(origin, arguments))


def _test_of(origin: Any, arguments: tuple[Any, ...]) -> Callable[[Any], bool]:
    """Return the test of a generic alias such as ``list[float]``: its origin is list."""
    if origin is np.ndarray:
        return _is_numeric
    if not isinstance(origin, type):
        return _anything
    if origin is tuple and arguments[-1] is not Ellipsis:
        return functools.partial(_fits_tuple, members=[_type_of(one) for one in arguments])
    if issubclass(origin, Mapping):
        keys, values = map(_type_of, arguments)
        return functools.partial(_fits_mapping, keys=keys, values=values)
    if issubclass(origin, Iterable) and arguments:
        return functools.partial(_fits_iterable, origin=origin, element=_type_of(arguments[0]))
    return lambda value: isinstance(value, origin)


def _anything(_: Any) -> bool:
    return True


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


def _fits_tuple(value: Any, members: Sequence[_Type]) -> bool:
    return (
        isinstance(value, Sequence)
        and len(value) == len(members)
        and all(member.fits(one) for member, one in zip(members, value, strict=True))
    )


def _fits_mapping(value: Any, keys: _Type, values: _Type) -> bool:
    return isinstance(value, Mapping) and all(
        keys.fits(key) and values.fits(one) for key, one in value.items()
    )


def _fits_iterable(value: Any, origin: type, element: _Type) -> bool:
    """Whether it may be gone through, and holds what it should; a text is no list of letters."""
    if isinstance(value, str | bytes) or not isinstance(value, Iterable) or is_scalar_array(value):
        return False
    if issubclass(origin, Sequence) and not isinstance(value, Sequence):
        return False
    if isinstance(value, Collection):
        return all(element.fits(one) for one in itertools.islice(value, _MANY))
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
    if type(value) is np.ndarray and value.dtype.kind in "fiu":
        return True
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
