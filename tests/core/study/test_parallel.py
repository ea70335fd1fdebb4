"""The one map: same results and order wherever it runs, and an end when it is stopped."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor

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


def test_results_are_told_as_they_come() -> None:
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
