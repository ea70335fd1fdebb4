"""Worker processes of a study: they leave Ctrl-C to the program that started them, and end with it."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import parent_process
from multiprocessing.context import SpawnContext, SpawnProcess
from typing import Any

__all__ = ["WorkerContext", "interrupts_held", "worker_context"]


class _Worker(SpawnProcess):
    """A process that ignores Ctrl-C from its start on, and does not outlive its parent."""

    def start(self) -> None:
        with interrupts_held(), _signal_is_blocked():  # it stays blocked in the new process
            super().start()

    def run(self) -> None:
        threading.Thread(target=_end_with_parent, daemon=True).start()
        super().run()


class WorkerContext(SpawnContext):
    """The multiprocessing context of the worker processes, for `concurrent.futures.ProcessPoolExecutor`.

    Workers are spawned, not forked: a fork would copy the locks of threads that it does not copy.
    """

    def __init__(self) -> None:
        super().__init__()
        self._workers: list[_Worker] = []

    def Process(self, *args: Any, **options: Any) -> SpawnProcess:  # type: ignore[override]  # noqa: N802
        """Return a new worker, as the executor asks for it.

        Parameters
        ----------
        *args, **options
            As of `multiprocessing.Process`.

        Returns
        -------
        multiprocessing.context.SpawnProcess
            Not yet started.
        """
        self._workers.append(_Worker(*args, **options))
        return self._workers[-1]

    def end_workers(self) -> None:
        """End all workers at once, whatever they are at: one task of a study may take minutes."""
        for worker in self._workers:
            if worker.pid is not None:
                worker.terminate()


def worker_context() -> WorkerContext:
    """Return a new context; it knows the workers that are started by it.

    Returns
    -------
    WorkerContext
        For one executor, or for processes of one's own.
    """
    return WorkerContext()


def _end_with_parent() -> None:
    """Wait until the parent has ended, killed or not, then exit at once: nobody needs the results."""
    parent = parent_process()
    if parent is not None:
        parent.join()
    os._exit(1)


@contextmanager
def _signal_is_blocked() -> Iterator[None]:
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def interrupts_held() -> Iterator[None]:
    """Let Ctrl-C wait while workers are started, which must get all that they begin with.

    To block the signal is not enough: another thread may take it.

    Yields
    ------
    None
    """
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or before is None:
        yield
        return
    came: list[int] = []
    signal.signal(signal.SIGINT, lambda number, _: came.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if came:
        signal.raise_signal(signal.SIGINT)
