"""Registration in a process of its own: the window stays alive, and it can be stopped at once."""

from __future__ import annotations

from collections.abc import Callable
from multiprocessing.connection import Connection
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gp_core.errors import GpError
from gp_core.study.worker_processes import worker_context
from gp_labeler.autolabel.registration import ENGINES, Field
from gp_labeler.imaging.progress import Cancelled

__all__ = ["HereRegistration", "ProcessRegistration"]

_LOOK_EVERY_S = 0.1


class HereRegistration:
    """Registers in this process, where nothing else waits.

    Parameters
    ----------
    name : {"greedy", "demons"}
    """

    def __init__(self, name: str) -> None:
        self.name = name

    def register(
        self,
        fixed: NDArray[np.float32],
        moving: NDArray[np.float32],
        step: float,
        iterations: str,
        cancel: Callable[[], bool] | None = None,
    ) -> Field:
        """Return the displacements; see `gp_labeler.autolabel.registration.RegisterImages`.

        Raises
        ------
        Cancelled
            `cancel` says so, before it begins.
        GpError
            The registration failed.
        """
        if cancel is not None and cancel():
            raise Cancelled
        try:
            return ENGINES[self.name](fixed, moving, step, iterations)
        except (ImportError, RuntimeError) as error:
            raise _failed(_in_words(error)) from error


class ProcessRegistration:
    """Registers in a process of its own, which is started when it is needed first.

    Use it in a ``with`` statement, which ends the process.

    Parameters
    ----------
    name : {"greedy", "demons"}
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self._process: Any = None
        self._connection: Connection | None = None

    def __enter__(self) -> ProcessRegistration:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, frames: TracebackType | None
    ) -> None:
        self.close()

    def register(
        self,
        fixed: NDArray[np.float32],
        moving: NDArray[np.float32],
        step: float,
        iterations: str,
        cancel: Callable[[], bool] | None = None,
    ) -> Field:
        """Return the displacements; see `gp_labeler.autolabel.registration.RegisterImages`.

        Raises
        ------
        Cancelled
            `cancel` says so; the process is ended.
        GpError
            The registration failed, or its process died.
        """
        try:
            connection = self._started(cancel)
            connection.send((fixed, moving, step, iterations))
            found = self._received(connection, cancel)
        except (EOFError, OSError):
            self.close()
            raise GpError(
                "the registration process ended unexpectedly", remedy="Free some memory, and try again."
            ) from None
        if isinstance(found, str):
            raise _failed(found)
        return np.asarray(found, dtype=np.float32)

    def close(self) -> None:
        """End the process, whatever it does."""
        process, self._process = self._process, None
        connection, self._connection = self._connection, None
        if process is not None:
            process.terminate()
            process.join()
        if connection is not None:
            connection.close()

    def _started(self, cancel: Callable[[], bool] | None) -> Connection:
        """Return the connection to the process, once that listens: until then, sending images would wait."""
        if self._connection is None:
            context = worker_context()
            ours, theirs = context.Pipe()
            process = context.Process(target=_serve, args=(theirs, self.name), daemon=True)
            process.start()
            theirs.close()
            self._process, self._connection = process, ours
            self._received(self._connection, cancel)
        return self._connection

    def _received(self, connection: Connection, cancel: Callable[[], bool] | None) -> Any:
        """Return what the process sends next; end it where `cancel` says so."""
        while not connection.poll(_LOOK_EVERY_S):
            if cancel is not None and cancel():
                self.close()
                raise Cancelled
        return connection.recv()


def _serve(connection: Connection, name: str) -> None:
    """In the process: say that it listens, and register what comes, until the other end is closed."""
    connection.send(name)
    while True:
        try:
            fixed, moving, step, iterations = connection.recv()
        except EOFError:
            return
        try:
            connection.send(ENGINES[name](fixed, moving, step, iterations))
        except Exception as error:  # whatever a library raises is told, in words
            connection.send(_in_words(error))


def _in_words(error: Exception) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())}"


def _failed(why: str) -> GpError:
    return GpError(f"the registration failed ({why})")
