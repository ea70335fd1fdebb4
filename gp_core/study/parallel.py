"""The one parallel map of the study: in this process, in worker processes, or on a cluster."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import (
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    InvalidStateError,
    ProcessPoolExecutor,
)
from contextlib import contextmanager
from importlib import import_module
from queue import SimpleQueue
from typing import Any, TypeVar

from gp_core.errors import GpError
from gp_core.extras import missing_package
from gp_core.processors import n_cores
from gp_core.settings import setting

__all__ = ["open_executor", "run_map"]

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
        For processes and clusters, one that can be pickled.
    items : sequence
        Its arguments.
    executor : concurrent.futures.Executor, optional
        Threads, processes or a cluster; by default everything runs here, one item after the other.
    done : callable, optional
        Receives the index and the result of each item as soon as it is ready, in any order. If it raises, the
        map stops: items that have not started never will.

    Returns
    -------
    list
        Results, in the order of the items.

    Raises
    ------
    GpError
        A worker process died.
    """
    if executor is None:
        return [_told(i, function(item), done) for i, item in enumerate(items)]
    from gp_core.study.worker_processes import interrupts_held  # here: most commands need no processes

    futures: dict[Future[Result], int] = {}
    finished: SimpleQueue[Future[Result]] = SimpleQueue()
    found: dict[int, Result] = {}
    try:
        # Ctrl-C must not leave locks of the executor or of a future that is not done held: its thread would
        # wait for them for ever. `as_completed` takes the locks of all futures.
        with interrupts_held():
            for i, item in enumerate(items):
                future = executor.submit(function, item)
                futures[future] = i
                future.add_done_callback(finished.put)
        for _ in items:
            future = finished.get()
            found[futures[future]] = _told(futures[future], future.result(), done)
    except BrokenExecutor:
        raise GpError(
            "a worker process died", remedy="Free some memory, or try again with fewer workers."
        ) from None
    except CancelledError:  # Dask cancels tasks of workers that it cannot reach
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
    """Open an executor for `run_map`, and close it at the end.

    Parameters
    ----------
    workers : int, optional
        Number of processes, by default one per core; 1: none, everything runs here.
    scheduler : str, optional
        Address of a Dask scheduler, such as ``tcp://host:8786``, used instead of processes.

    Yields
    ------
    concurrent.futures.Executor or None
        None: everything runs here.

    Raises
    ------
    GpError
        A number below 1, Dask is not installed, or nothing answers at the address.
    """
    count = (setting("workers") or n_cores()) if workers is None else workers
    if count < 1:
        raise GpError(f"the number of workers must be 1 or more, got {count}")
    if scheduler is not None:
        with _cluster(scheduler) as executor:
            yield executor
    elif count == 1:
        yield None
    else:
        # here: most commands need no processes
        from gp_core.study.worker_processes import interrupts_held, worker_context

        context = worker_context()
        with ProcessPoolExecutor(count, mp_context=context) as executor:
            try:
                with interrupts_held():  # each task starts a worker while none is idle
                    for _ in range(count):
                        executor.submit(int)
                yield executor
            except BaseException:
                with _cancelled_is_no_error():
                    context.end_workers()  # else leaving waits for what runs, and for all that was submitted
                    executor.shutdown(cancel_futures=True)
                raise


@contextmanager
def _cancelled_is_no_error() -> Iterator[None]:
    """Keep the thread of an executor from printing a traceback for futures that were cancelled.

    Before Python 3.12, it fails to tell them that the workers have ended.
    """
    before = threading.excepthook

    def report(error: threading.ExceptHookArgs) -> None:
        if not issubclass(error.exc_type, InvalidStateError):
            before(error)

    threading.excepthook = report
    try:
        yield
    finally:
        threading.excepthook = before


@contextmanager
def _cluster(address: str) -> Iterator[Executor]:
    try:
        client_class: Any = import_module("distributed").Client
    except ImportError:
        raise missing_package("distributed") from None
    try:
        client = client_class(address, timeout="10s")
    except (OSError, ValueError) as error:
        raise GpError(
            f"no Dask scheduler answers at {address} ({error})",
            remedy="Start one with: dask scheduler, and workers with: dask worker ADDRESS.",
        ) from None
    for name in (
        "distributed",
        "distributed.client",
        "tornado",
        "asyncio",
    ):  # our error replaces its log
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    try:
        with client:
            yield client.get_executor()
    except (OSError, RuntimeError, TimeoutError):
        if client.status == "running":
            raise
        raise _scheduler_gone() from None
