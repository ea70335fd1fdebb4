"""Jobs: results on the right thread, cancel, failures that kill nothing."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass, field

import pytest

from gp_core.errors import GpError
from gp_labeler.imaging.progress import Report
from gp_labeler.jobs.runner import Jobs, QueueDispatcher, TaskState

PATIENCE = 120.0
"""Seconds: only a failure lasts that long."""


@dataclass(frozen=True)
class Double:
    value: int
    title: str = "Doubling"

    def run(self, progress):
        progress(0.5, "half")
        return 2 * self.value


@dataclass(frozen=True)
class Forever:
    """Runs until it is cancelled."""

    entered: threading.Event = field(default_factory=threading.Event)
    title: str = "Waiting"

    def run(self, progress):
        report = Report(progress, progress.cancelled)  # as the imaging functions take it
        self.entered.set()
        while True:
            report(0.3)
            time.sleep(0.001)


@dataclass(frozen=True)
class Fail:
    error: Exception
    title: str = "Failing"

    def run(self, progress):
        raise self.error


@pytest.fixture
def queue():
    return QueueDispatcher()


@pytest.fixture
def jobs(queue):
    made = Jobs(queue)
    yield made
    made.close()


def test_results_come_on_the_thread_that_asks(jobs, queue):
    results, threads = [], []
    jobs.done.connect(lambda task: threads.append(threading.get_ident()))
    tasks = [jobs.submit(Double(i), results.append) for i in range(20)]
    assert results == []
    queue.deliver_until_idle(jobs)
    assert sorted(results) == list(range(0, 40, 2))
    assert set(threads) == {threading.get_ident()}
    assert [task.result for task in tasks] == list(range(0, 40, 2))
    assert jobs.running == ()


def test_progress_is_told(jobs, queue):
    told = []
    jobs.progressed.connect(lambda task: told.append((task.fraction, task.text)))
    jobs.submit(Double(1))
    queue.deliver_until_idle(jobs)
    assert told == [(0.5, "half")]


def test_cancel_stops_and_delivers_nothing(jobs, queue):
    results, cancelled = [], []
    jobs.cancelled.connect(cancelled.append)
    job = Forever()
    task = jobs.submit(job, results.append)
    assert job.entered.wait(PATIENCE)
    task.cancel()
    queue.deliver_until_idle(jobs, timeout=PATIENCE)
    assert (task.state, results, cancelled) == (TaskState.CANCELLED, [], [task])


def test_a_result_that_came_too_late_is_not_delivered(jobs, queue):
    results = []
    task = jobs.submit(Double(1), results.append)
    while not queue.n_waiting > 1:  # progress and result wait for delivery
        time.sleep(0.001)
    task.cancel()
    queue.deliver_until_idle(jobs)
    assert (task.state, task.result, results) == (TaskState.CANCELLED, None, [])


def test_the_newest_of_a_key_wins(jobs, queue):
    results = []
    old = jobs.submit(Forever(), results.append, key="surface")
    other = jobs.submit(Double(5), results.append, key="else")
    new = jobs.submit(Double(7), results.append, key="surface")
    queue.deliver_until_idle(jobs, timeout=PATIENCE)
    assert sorted(results) == [10, 14]
    assert (old.state, other.state, new.state) == (TaskState.CANCELLED, TaskState.DONE, TaskState.DONE)


def test_a_job_for_later_is_spared_where_a_newer_one_comes_in_time(jobs, queue):
    spared, results = Forever(), []
    first = jobs.submit(spared, results.append, key="judging", after=60.0)
    jobs.submit(Double(2), results.append, key="judging", after=0.01)
    queue.deliver_until_idle(jobs, timeout=PATIENCE)
    assert results == [4]
    assert first.state is TaskState.CANCELLED
    assert not spared.entered.is_set()


def test_closing_waits_for_no_job_for_later(jobs):
    begun = time.monotonic()
    jobs.submit(Double(2), after=60.0)
    jobs.close()
    assert time.monotonic() - begun < 30


def test_failures_are_told_and_kill_no_worker(jobs, queue, caplog):
    failed, results = [], []
    jobs.failed.connect(lambda task: failed.append(task.message))
    for error in (GpError("no slices", file="x.tif"), ZeroDivisionError("oops"), MemoryError()) * 3:
        jobs.submit(Fail(error), results.append)
    queue.deliver_until_idle(jobs)
    jobs.submit(Double(3), results.append)
    queue.deliver_until_idle(jobs)
    assert sorted(set(failed)) == [
        "Failing: failed unexpectedly (ZeroDivisionError: oops)",
        "Failing: there is not enough memory. Close other programs, or load a smaller part.",
        "x.tif: no slices",
    ]
    assert len(failed) == 9
    assert results == [6]
    assert "ZeroDivisionError" in caplog.text


def test_closing_waits_for_no_result(queue):
    jobs = Jobs(queue, n_workers=1)
    results = []
    job = Forever()
    jobs.submit(job, results.append)
    waiting = jobs.submit(Double(1), results.append)
    assert job.entered.wait(PATIENCE)
    jobs.close()
    while queue.deliver():
        pass
    assert results == []
    assert waiting.state is TaskState.WAITING
    with pytest.raises(RuntimeError, match="closed"):
        jobs.submit(Double(1))


def test_waiting_too_long_says_for_what(jobs, queue):
    task = jobs.submit(Forever())
    with pytest.raises(GpError, match=r"still not finished after 0.1 s: Waiting"):
        queue.deliver_until_idle(jobs, timeout=0.1)
    task.cancel()


def test_without_a_dispatcher_results_come_at_once():
    jobs = Jobs()
    done = threading.Event()
    jobs.submit(Double(1), lambda result: done.set())
    assert done.wait(30)
    jobs.close()
