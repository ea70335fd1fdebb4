"""How kernels are compiled: once a machine, wherever Numba finds a folder that keeps them."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any, TypeVar

from numba import njit

__all__ = ["compiled"]

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
            with suppress(RuntimeError):  # Numba's word for: no folder to keep it in
                kept: _Kernel = _njit(signature, cache=True, **options)(kernel)
                return kept
        passing: _Kernel = _njit(signature, **options)(kernel)
        return passing

    return decorate


def _njit(signature: str | None, **options: Any) -> Any:
    make: Any = njit  # its stubs tell signatures from functions, but not here
    return make(signature, nogil=True, error_model="numpy", **options)
