"""Long work off the UI thread: frozen jobs in, results delivered on the thread that asked.

A job is a frozen value with a `title` and `run(progress)`. It knows neither document nor window; what it
makes is delivered through the dispatcher, so that only the main thread ever changes the document.
"""

from __future__ import annotations

import logging
import queue
import threading
import time
import weakref
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from enum import Enum
from typing import Any, Generic, Protocol, TypeVar

from gp_core.errors import GpError
from gp_labeler.document.signals import Signal
from gp_labeler.imaging.progress import Cancelled

__all__ = ["Cancelled", "Dispatcher", "Job", "Jobs", "Progress", "QueueDispatcher", "Task", "TaskState"]

_log = logging.getLogger(__name__)

R_co = TypeVar("R_co", covariant=True)
R = TypeVar("R")

Dispatcher = Callable[[Callable[[], None]], None]
"""Takes a call from any thread, and makes it on the thread it serves."""

_SECONDS_BETWEEN_REPORTS = 0.05


class Job(Protocol[R_co]):
    """Work that can be done anywhere: a frozen dataclass with everything it needs."""

    @property
    def title(self) -> str:
        """What the user reads while it runs, such as ``Reading GP-014``."""
        ...

    def run(self, progress: Progress) -> R_co:
        """Do the work, calling `progress` now and then."""
        ...


class Progress:
    """What a running job calls to tell that it gets on, and to learn that it is to stop."""

    def __init__(self, report: Callable[[float, str], None]) -> None:
        self._report = report
        self._stop = threading.Event()
        self._told = float("-inf")

    def __call__(self, fraction: float, text: str = "") -> None:
        """Tell the fraction done, 0 to 1.

        Raises
        ------
        Cancelled
            The job is to stop; let it through.
        """
        if self._stop.is_set():
            raise Cancelled
        now = time.monotonic()
        if now - self._told >= _SECONDS_BETWEEN_REPORTS or fraction >= 1:
            self._told = now
            self._report(min(max(fraction, 0.0), 1.0), text)

    def wait(self, seconds: float) -> None:
        """Do nothing for a while; raises `Cancelled` as soon as the job is to stop."""
        if self._stop.wait(seconds):
            raise Cancelled

    def cancelled(self) -> bool:
        """Return whether the job is to stop; for code that asks instead of being told."""
        return self._stop.is_set()

    def cancel(self) -> None:
        """Ask the job to stop."""
        self._stop.set()


class TaskState(str, Enum):
    """How far a task is."""

    WAITING = "waiting"
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"


class Task(Generic[R]):
    """A job that was handed in; changes only on the dispatcher's thread."""

    def __init__(self, job: Job[R], key: str, report: Callable[[Task[R], float, str], None]) -> None:
        self.job = job
        self.key = key
        self.state = TaskState.WAITING
        self.fraction = 0.0
        self.text = ""
        self.result: R | None = None
        self.error: Exception | None = None
        this = weakref.ref(
            self
        )  # else task and progress would hold each other, and scan and meshes with them

        def tell(fraction: float, text: str) -> None:
            if (task := this()) is not None:
                report(task, fraction, text)

        self.progress = Progress(tell)

    def cancel(self) -> None:
        """Ask it to stop; its result is not delivered from now on."""
        self.progress.cancel()

    @property
    def message(self) -> str:
        """What went wrong, for the user; empty where nothing did."""
        if self.error is None:
            return ""
        if isinstance(self.error, GpError):
            return str(self.error)
        if isinstance(self.error, MemoryError):
            return (
                f"{self.job.title}: there is not enough memory. Close other programs, or load a smaller part."
            )
        return f"{self.job.title}: failed unexpectedly ({type(self.error).__name__}: {self.error})"


class Jobs:
    """Runs jobs on worker threads.

    Parameters
    ----------
    dispatcher : callable, optional
        Brings results to the main thread (Qt: a queued signal; scripts: a `QueueDispatcher`). By default they
        are delivered on the worker's thread, which no document accepts.
    n_workers : int
        Threads.
    """

    started = Signal(Task)
    progressed = Signal(Task)
    done = Signal(Task)
    failed = Signal(Task)
    """With `Task.error`; nobody else is told of it."""
    cancelled = Signal(Task)

    def __init__(self, dispatcher: Dispatcher | None = None, *, n_workers: int = 2) -> None:
        self.dispatcher = dispatcher or (lambda call: call())
        self._pool = ThreadPoolExecutor(n_workers, thread_name_prefix="gp-job")
        self._tasks: dict[Task[Any], Callable[[Any], None] | None] = {}
        # what a task calls when it is done stays here, not with the worker: a worker that let go of a dialog
        # last would destroy it on its own thread
        self._closed = False

    @property
    def running(self) -> tuple[Task[Any], ...]:
        """Tasks that are not finished, oldest first."""
        return tuple(self._tasks)

    def submit(
        self, job: Job[R], done: Callable[[R], None] | None = None, *, key: str = "", after: float = 0.0
    ) -> Task[R]:
        """Hand in a job.

        Parameters
        ----------
        job : Job
            The work.
        done : callable, optional
            Receives the result on the dispatcher's thread, unless the task was cancelled.
        key : str
            What it is for. A task with the same key is cancelled: its result is out of date.
        after : float
            Seconds until it begins; where a newer one takes its place in time, it never does.
        """
        if self._closed:
            raise RuntimeError("these jobs are closed")
        if key:
            self.cancel(key)
        new = Task(job, key, self._report)
        self._tasks[new] = done
        self.started.emit(new)
        self._pool.submit(self._run, new, after)
        return new

    def is_running(self, *keys: str) -> bool:
        """Whether a task with one of these keys is not finished, and not cancelled either."""
        return any(task.key in keys and not task.progress.cancelled() for task in self._tasks)

    def cancel(self, *keys: str) -> None:
        """Ask the tasks with these keys to stop."""
        for task in self._tasks:
            if task.key in keys:
                task.cancel()

    def cancel_all(self) -> None:
        """Ask every task to stop."""
        for task in self._tasks:
            task.cancel()

    def close(self) -> None:
        """Cancel everything, wait for the workers, and deliver nothing any more."""
        self._closed = True
        self.cancel_all()
        self._pool.shutdown(wait=True, cancel_futures=True)
        self._tasks.clear()

    def _run(self, task: Task[R], after: float) -> None:
        """On the worker: whatever the job does, the worker lives on."""
        result: R | None = None
        error: Exception | None = None
        state = TaskState.DONE
        try:
            task.progress.wait(after)
            result = task.job.run(task.progress)
        except Cancelled:
            state = TaskState.CANCELLED
        except Exception as caught:
            if not isinstance(caught, GpError):
                _log.exception("%s failed", task.job.title)
            state, error = TaskState.FAILED, _without_frames(caught)
        self.dispatcher(lambda: self._finish(task, state, result, error))

    def _finish(self, task: Task[R], state: TaskState, result: R | None, error: Exception | None) -> None:
        if self._closed or task not in self._tasks:
            return
        done = self._tasks.pop(task)
        if task.progress.cancelled():  # it may have come to its end before it noticed
            state, result, error = TaskState.CANCELLED, None, None
        task.state, task.result, task.error = state, result, error
        if state is TaskState.DONE and done is not None:
            done(result)
        {TaskState.DONE: self.done, TaskState.FAILED: self.failed}.get(state, self.cancelled).emit(task)

    def _report(self, task: Task[Any], fraction: float, text: str) -> None:
        def tell() -> None:
            if not self._closed and task in self._tasks and not task.progress.cancelled():
                task.fraction, task.text = fraction, text or task.text
                self.progressed.emit(task)

        self.dispatcher(tell)


def _without_frames(error: Exception) -> Exception:
    """Return an error, and those behind it, without the frames that they hold, and so the voxels in them."""
    behind: BaseException | None = error
    while behind is not None:
        behind.__traceback__ = None
        behind = behind.__cause__ or behind.__context__
    return error


class QueueDispatcher:
    """Delivers on the thread that asks for it, for programs without an event loop."""

    def __init__(self) -> None:
        self._calls: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()

    @property
    def n_waiting(self) -> int:
        """How many calls wait to be made."""
        return self._calls.qsize()

    def __call__(self, call: Callable[[], None]) -> None:
        """Take a call, from any thread."""
        self._calls.put(call)

    def deliver(self, *, timeout: float = 0.0) -> bool:
        """Make one waiting call, waiting for it up to `timeout` seconds; return whether there was one."""
        try:
            call = self._calls.get(timeout=timeout) if timeout > 0 else self._calls.get_nowait()
        except queue.Empty:
            return False
        call()
        return True

    def deliver_until_idle(self, jobs: Jobs, *, timeout: float = 600.0) -> None:
        """Make calls until no task is left.

        Raises
        ------
        GpError
            That took longer than `timeout` seconds.
        """
        end = time.monotonic() + timeout
        while jobs.running or not self._calls.empty():
            self.deliver(timeout=0.05)
            if time.monotonic() > end and jobs.running:
                titles = ", ".join(task.job.title for task in jobs.running)
                raise GpError(f"still not finished after {timeout:g} s: {titles}")
