"""The one map: same results and order wherever it runs, and an end when it is stopped."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import pytest

from gp_core import GpError
from gp_core.study.parallel import open_executor, run_map


def square(number: int) -> int:
    if number < 0:
        raise GpError(f"{number} is below 0")
    return number * number


def die(number: int) -> int:
    import os

    os._exit(number)


def test_results_are_in_order() -> None:
    expected = [square(i) for i in range(20)]
    assert run_map(square, range(20)) == expected
    with ThreadPoolExecutor(3) as threads:
        assert run_map(square, range(20), threads) == expected
    assert run_map(square, []) == []


def test_results_are_reported_as_they_come() -> None:
    told: list[tuple[int, int]] = []
    with ThreadPoolExecutor(3) as threads:
        run_map(square, [3, 4, 5], threads, done=lambda i, result: told.append((i, result)))
    assert sorted(told) == [(0, 9), (1, 16), (2, 25)]


def test_what_done_raises_stops_the_rest() -> None:
    started: list[int] = []
    stopped = threading.Event()

    def slow(number: int) -> int:
        started.append(number)
        assert number == 0 or stopped.wait(600)
        return number

    def stop(index: int, _: int) -> None:
        raise KeyboardInterrupt

    with ThreadPoolExecutor(1) as threads:
        with pytest.raises(KeyboardInterrupt):
            run_map(slow, range(100), threads, done=stop)
        stopped.set()
    assert len(started) <= 2


class _Interrupted(ThreadPoolExecutor):
    """Gets Ctrl-C with each task that it is given, when it holds locks; counts the tasks."""

    n_submitted = 0

    def submit(self, *args, **options) -> Future:
        signal.raise_signal(signal.SIGINT)
        self.n_submitted += 1
        return super().submit(*args, **options)


@pytest.fixture
def ctrl_c() -> Iterator[None]:
    """Ctrl-C raises KeyboardInterrupt, also in the background of a shell, which has it ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_waits_until_everything_is_submitted() -> None:
    with _Interrupted(1) as threads, pytest.raises(KeyboardInterrupt):
        run_map(square, range(5), threads)
    assert threads.n_submitted == 5


def _stop_while_one_works(error: type[BaseException], stopped: list[float]) -> None:
    with open_executor(2) as executor:
        running = executor.submit(time.sleep, 60)
        while not running.running():
            time.sleep(0.01)
        stopped.append(time.monotonic())
        raise error("stop")


@pytest.mark.parametrize("error", [KeyboardInterrupt, GpError])
def test_an_error_ends_what_runs(error: type[BaseException]) -> None:
    stopped: list[float] = []
    with pytest.raises(error):
        _stop_while_one_works(error, stopped)
    assert time.monotonic() - stopped[0] < 40


def test_processes() -> None:
    with open_executor(2) as executor:
        assert run_map(square, [1, 2, 3], executor) == [1, 4, 9]
        with pytest.raises(GpError, match="-1 is below 0"):
            run_map(square, [1, -1], executor)
        with pytest.raises(GpError, match="a worker process died"):
            run_map(die, [3], executor)


def test_one_worker_is_this_process() -> None:
    with open_executor(1) as executor:
        assert executor is None


def test_bad_choices_are_refused() -> None:
    with pytest.raises(GpError, match="workers must be 1 or more, got 0"), open_executor(0):
        pass
    pytest.importorskip("distributed")
    with pytest.raises(GpError, match="no Dask scheduler answers at nowhere"):  # noqa: SIM117
        with open_executor(scheduler="nowhere://x"):
            pass


def test_a_dask_scheduler_that_is_killed_is_one_line(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("distributed")
    file = tmp_path / "scheduler.json"
    words = ["-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard"]
    with subprocess.Popen(
        [sys.executable, *words, "--scheduler-file", str(file)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    ) as scheduler:
        try:
            address = _address_in(file, scheduler)
            with pytest.raises(GpError, match="the Dask scheduler is gone"):
                _map_until_killed(address, scheduler)
        finally:
            scheduler.kill()
    assert capfd.readouterr().err == ""


def _map_until_killed(address: str, scheduler: subprocess.Popen[bytes]) -> None:
    with open_executor(scheduler=address) as executor:
        threading.Timer(0.2, scheduler.kill).start()  # while it waits: there are no workers
        run_map(square, range(20), executor)


def _address_in(file: Path, scheduler: subprocess.Popen[bytes]) -> str:
    """Wait until a scheduler has written where it is."""
    while scheduler.poll() is None:
        with suppress(OSError, ValueError, KeyError):
            return str(json.loads(file.read_text())["address"])
        time.sleep(0.05)
    raise AssertionError("no scheduler")


class KilledWorker(Exception):  # noqa: N818 - Dask's name
    """What Dask raises once a part has killed several workers."""


def test_dask_workers_that_die_are_one_line() -> None:
    def die_at_work(_: int) -> int:
        raise KilledWorker

    with ThreadPoolExecutor(1) as threads, pytest.raises(GpError, match=r"the Dask workers .* died"):
        run_map(die_at_work, [1], threads)
