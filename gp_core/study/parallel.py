"""The one map of the study: a function over a list, here, in processes, or on a cluster."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import (
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    as_completed,
)
from contextlib import contextmanager
from importlib import import_module
from typing import Any, TypeVar

from gp_core.errors import GpError

__all__ = ["n_cores", "open_executor", "run_map"]

Item = TypeVar("Item")
Result = TypeVar("Result")


def run_map(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    executor: Executor | None = None,
    *,
    done: Callable[[int, Result], None] | None = None,
) -> list[Result]:
    """Apply a function to every item and return the results in the order of the items.

    Parameters
    ----------
    function : callable
        For processes and clusters, one that pickle can carry.
    items : sequence
    executor : concurrent.futures.Executor, optional
        Threads, processes or a cluster; by default everything runs here, one after the other.
    done : callable, optional
        Told the index and the result of each item as it comes in, in any order. What it raises stops the map:
        what has not started never will.

    Raises
    ------
    GpError
        A worker process died.
    """
    if executor is None:
        return [_told(i, function(item), done) for i, item in enumerate(items)]
    futures: dict[Future[Result], int] = {}
    found: dict[int, Result] = {}
    try:
        futures = {executor.submit(function, item): i for i, item in enumerate(items)}
        for future in as_completed(futures):
            found[futures[future]] = _told(futures[future], future.result(), done)
    except BrokenExecutor:
        raise GpError(
            "a worker process died", remedy="Free some memory, or try again with fewer workers."
        ) from None
    except CancelledError:  # Dask cancels what it cannot reach any more
        raise _scheduler_gone() from None
    except Exception as error:
        if type(error).__name__ == "KilledWorker":  # of Dask, which is not imported here
            remedy = "Start workers with more memory; a search with --checkpoint goes on where it was."
            raise GpError("the Dask workers that took a part of this died", remedy=remedy) from None
        raise
    finally:
        for future in futures:
            future.cancel()
    return [found[i] for i in range(len(items))]


def _scheduler_gone() -> GpError:
    remedy = "Start it again; a search with --checkpoint goes on where it was."
    return GpError("the Dask scheduler is gone", remedy=remedy)


def _told(index: int, result: Result, done: Callable[[int, Result], None] | None) -> Result:
    if done is not None:
        done(index, result)
    return result


@contextmanager
def open_executor(workers: int | None = None, scheduler: str | None = None) -> Iterator[Executor | None]:
    """Open what `run_map` runs on, and close it at the end.

    Parameters
    ----------
    workers : int, optional
        Number of processes, by default one a core; 1: none, all runs here.
    scheduler : str, optional
        Address of a Dask scheduler, such as ``tcp://host:8786``, used instead of processes.

    Raises
    ------
    GpError
        A number below 1, Dask is not installed, or nothing answers at the address.
    """
    count = n_cores() if workers is None else workers
    if count < 1:
        raise GpError(f"the number of workers must be 1 or more, got {count}")
    if scheduler is not None:
        with _cluster(scheduler) as executor:
            yield executor
    elif count == 1:
        yield None
    else:
        from gp_core.study.worker_processes import worker_context  # here: most commands need no processes

        with ProcessPoolExecutor(count, mp_context=worker_context()) as executor:
            yield executor


def n_cores() -> int:
    """Return how many cores this process may use."""
    usable = getattr(os, "sched_getaffinity", None)
    return len(usable(0)) if usable else os.cpu_count() or 1


@contextmanager
def _cluster(address: str) -> Iterator[Executor]:
    try:
        client_class: Any = import_module("distributed").Client
    except ImportError:
        raise GpError(
            "a scheduler needs Dask", remedy="Install it with: pip install 'gp-labeler[cluster]'"
        ) from None
    try:
        client = client_class(address, timeout="10s")
    except (OSError, ValueError) as error:
        raise GpError(
            f"no Dask scheduler answers at {address} ({error})",
            remedy="Start one with: dask scheduler, and workers with: dask worker ADDRESS.",
        ) from None
    for name in ("distributed", "distributed.client", "tornado", "asyncio"):  # what matters is said by us
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    try:
        with client:
            yield client.get_executor()
    except (OSError, RuntimeError, TimeoutError):
        if client.status == "running":
            raise
        raise _scheduler_gone() from None
