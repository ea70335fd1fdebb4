"""How kernels are compiled: once a machine, wherever Numba finds a folder that keeps them."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any, TypeVar

from numba import njit

__all__ = ["compiled"]

_Kernel = TypeVar("_Kernel", bound=Callable[..., Any])


def compiled(*, cache: bool = False, **options: Any) -> Callable[[_Kernel], _Kernel]:
    """Return the decorator that compiles a kernel free of the interpreter lock.

    With `cache` the machine code is kept for the next process; where the installation and the user's folders
    are read-only, it is compiled anew in each.
    """

    def decorate(kernel: _Kernel) -> _Kernel:
        if cache:
            with suppress(RuntimeError):  # Numba's word for: no folder to keep it in
                kept: _Kernel = njit(nogil=True, error_model="numpy", cache=True, **options)(kernel)
                return kept
        passing: _Kernel = njit(nogil=True, error_model="numpy", **options)(kernel)
        return passing

    return decorate
