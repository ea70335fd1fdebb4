"""How kernels are compiled: once on each machine, wherever Numba finds a writable cache folder."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from types import FunctionType
from typing import Any, TypeVar

from numba import njit

__all__ = ["compiled", "compiled_together", "source_files"]

_Kernel = TypeVar("_Kernel", bound=Callable[..., Any])


def compiled(
    signature: str | None = None, *, cache: bool = False, **options: Any
) -> Callable[[_Kernel], _Kernel]:
    """Return a decorator that compiles a kernel and releases the global interpreter lock while it runs.

    With a `signature`, compilation happens at once; without one, at the first call. With `cache`, the machine
    code is cached for the next process; where no cache folder is writable, each process compiles it again.

    Parameters
    ----------
    signature : str, optional
        Numba signature, such as ``"float64(float64)"``.
    cache : bool
        Whether to cache the machine code.
    **options
        Passed to `numba.njit`.

    Returns
    -------
    callable
        The decorator.
    """

    def decorate(kernel: _Kernel) -> _Kernel:
        if cache:
            # Numba checks only the kernel's own file for changes; the digest in the name covers the others.
            kernel.__qualname__ += f"_{_digest(kernel)}"
            with suppress(RuntimeError):  # how Numba says that no cache folder is writable
                cached: _Kernel = _njit(signature, cache=True, **options)(kernel)
                return cached
        uncached: _Kernel = _njit(signature, **options)(kernel)
        return uncached

    return decorate


def compiled_together(
    kernels: Iterable[Callable[..., Any]],
    names: Mapping[str, Any],
    signatures: Mapping[str, str] | None = None,
) -> dict[str, Any]:
    """Compile plain functions so that they call each other compiled; the originals stay as they are.

    Parameters
    ----------
    kernels : iterable of functions of one module
        Each after those that it calls.
    names : mapping
        What else they use: the names of their module, with those already compiled.
    signatures : mapping, optional
        Of those that are compiled at once and cached for the next process.

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
    make: Any = njit  # its stubs cannot infer the type here
    return make(signature, nogil=True, error_model="numpy", **options)


def _digest(kernel: Callable[..., Any]) -> str:
    """Return a short digest of the files that a kernel is made of."""
    digest = hashlib.sha256()
    for file in sorted(source_files(kernel)):
        with suppress(OSError):  # a frozen application has no source files: Numba checks the executable
            digest.update(Path(file).read_bytes())
    return digest.hexdigest()[:12]


def source_files(kernel: Callable[..., Any]) -> set[str]:
    """Return the source files that a kernel is compiled from.

    Parameters
    ----------
    kernel : callable
        A plain function.

    Returns
    -------
    set of str
        This file, and the files of this package whose functions the kernel can call.
    """
    files = {__file__}
    pending: list[Any] = [kernel]
    while pending:
        function = pending.pop()
        if function.__code__.co_filename not in files:
            files.add(function.__code__.co_filename)
            callable_from = (getattr(value, "py_func", value) for value in function.__globals__.values())
            pending += [
                f
                for f in callable_from
                if isinstance(f, FunctionType) and str(f.__module__).startswith("gp_core.")
            ]
    return files
