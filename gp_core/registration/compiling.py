"""How kernels are compiled: once a machine, wherever Numba finds a folder that keeps them."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from types import FunctionType
from typing import Any, TypeVar

from numba import njit

__all__ = ["compiled", "compiled_together"]

_Kernel = TypeVar("_Kernel", bound=Callable[..., Any])


def compiled(
    signature: str | None = None, *, cache: bool = False, **options: Any
) -> Callable[[_Kernel], _Kernel]:
    """Return the decorator that compiles a kernel free of the interpreter lock.

    With a `signature` it is compiled at once, without one when it is first called. With `cache` the machine
    code is kept for the next process; where the installation and the user's folders are read-only, it is
    compiled anew in each.
    """

    def decorate(kernel: _Kernel) -> _Kernel:
        if cache:
            # Numba asks whether the kernel's own file has changed; the name it is kept by tells of others.
            kernel.__qualname__ += f"_{_digest(kernel)}"
            with suppress(RuntimeError):  # Numba's word for: no folder to keep it in
                kept: _Kernel = _njit(signature, cache=True, **options)(kernel)
                return kept
        passing: _Kernel = _njit(signature, **options)(kernel)
        return passing

    return decorate


def compiled_together(
    kernels: Iterable[Callable[..., Any]],
    names: Mapping[str, Any],
    signatures: Mapping[str, str] | None = None,
) -> dict[str, Any]:
    """Compile plain functions such that they call each other compiled; they themselves stay as they are.

    Parameters
    ----------
    kernels : iterable of functions of one module
        Each after those it calls.
    names : mapping
        What else they call or read: the names of their module, with what is compiled already.
    signatures : mapping, optional
        Of those that are compiled at once, and kept for the next process.

    Returns
    -------
    dict
        The compiled functions by name.
    """
    known, together = dict(names), {}
    for kernel in kernels:
        copy = FunctionType(kernel.__code__, known, kernel.__name__)
        copy.__module__ = kernel.__module__
        signature = (signatures or {}).get(kernel.__name__)
        known[kernel.__name__] = together[kernel.__name__] = compiled(signature, cache=bool(signature))(copy)
    return together


def _njit(signature: str | None, **options: Any) -> Any:
    make: Any = njit  # its stubs tell signatures from functions, but not here
    return make(signature, nogil=True, error_model="numpy", **options)


def _digest(kernel: Callable[..., Any]) -> str:
    """Return a short digest of the files that a kernel is made of."""
    digest = hashlib.sha256()
    for file in sorted(_files(kernel)):
        with suppress(OSError):  # an application frozen into one file has none: Numba looks at that one
            digest.update(Path(file).read_bytes())
    return digest.hexdigest()[:12]


def _files(kernel: Callable[..., Any]) -> set[str]:
    """Return this file, which says how, and those of this package whose functions the kernel has at hand."""
    files = {__file__}
    waiting: list[Any] = [kernel]
    while waiting:
        function = waiting.pop()
        if function.__code__.co_filename not in files:
            files.add(function.__code__.co_filename)
            at_hand = (getattr(value, "py_func", value) for value in function.__globals__.values())
            waiting += [
                f for f in at_hand if isinstance(f, FunctionType) and str(f.__module__).startswith("gp_core.")
            ]
    return files
