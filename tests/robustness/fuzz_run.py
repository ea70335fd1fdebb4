"""A seeded fuzz run: bad files for every reader and command, each in bounded time and memory.

    python tests/robustness/fuzz_run.py --n 5000 --seed 1 --kinds scan touches

Each input ends with status 0, or with one line and status 2; nothing is written over, nothing is left behind.
A worker process is forked and tries one input after the other under a memory cap; where it dies, another is.
"""

from __future__ import annotations

import argparse
import contextlib
import logging
import os
import resource
import select
import shutil
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

import fuzz_targets
import numpy as np
from fuzz_mutations import replace_by_oddity, spoil
from fuzz_samples import make_samples
from fuzz_targets import TARGETS, Outcome, Target

__all__ = ["Result", "run"]

MORE_MEMORY_BYTES = 1_500_000_000
SLOWEST_SECONDS = 30.0
LONGEST_WAIT_SECONDS = 600.0  # by the clock: the machine may be busy otherwise
QT_SAYS = b"This plugin does not support propagateSizeHints()\n"  # of its own off-screen platform
NAMES = (b"", b"", b"", b"", b" with blank", b"-\xff", b"-\x1b[31m", b"-\xc3\xa4", b"-\n", b"-=1")


@dataclass
class Result:
    """What a run has seen."""

    n: int = 0
    statuses: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)
    slowest: tuple[float, str] = (0.0, "")
    peak_mb: float = 0.0
    begun: float = field(default_factory=time.monotonic)

    def text(self) -> str:
        """Return the figures."""
        statuses = ", ".join(f"{name} {count}" for name, count in sorted(self.statuses.items()))
        slow = f"slowest {self.slowest[0]:.1f} s ({self.slowest[1]})"
        seconds = time.monotonic() - self.begun
        figures = f"{self.n} inputs over {len(TARGETS)} readers and commands in {seconds:.0f} s"
        return f"{figures}; {statuses}; {slow}; peak {self.peak_mb:.0f} MB; {len(self.faults)} faults"


def run(
    n: int, seed: int, *, kinds: tuple[str, ...] = (), keep: Path | None = None, first: int = 0
) -> Result:
    """Try `n` inputs; those that fail are kept in a folder where one is given."""
    result = Result()
    with tempfile.TemporaryDirectory(prefix="fuzz-") as name:
        folder = Path(name)
        samples = make_samples(folder / "good")
        fuzz_targets.GOOD["folder"] = folder / "good"
        targets = [target for target in TARGETS if not kinds or target.kind in kinds]
        done = first
        while done < first + n:
            done = _worker(range(done, first + n), seed, targets, samples, folder, result, keep)
    return result


def _worker(
    cases: range,
    seed: int,
    targets: list[Target],
    samples: dict[str, list[Path]],
    folder: Path,
    result: Result,
    keep: Path | None,
) -> int:
    """Fork a process that tries these cases; return the first that is still to try."""
    reading, writing = os.pipe()
    sys.stdout.flush()
    pid = os.fork()
    if pid == 0:
        os.close(reading)
        _try_all(cases, seed, targets, samples, folder, writing)
    os.close(writing)
    current = cases.start
    with os.fdopen(reading, "rb", buffering=0) as pipe:
        rest = b""
        while True:
            ready = _awaited(pipe, pid)
            data = pipe.read(65536) if ready else b""
            if not data:
                break
            *lines, rest = (rest + data).split(b"\n")
            for line in lines:
                word, number, *more = line.decode().split("\t")
                current = int(number) + (word == "end")
                if word == "end":
                    _note(result, int(number), *more, folder=folder, keep=keep)
    if not ready:
        os.kill(pid, signal.SIGKILL)
    _, ended = os.waitpid(pid, 0)
    if current < cases.stop:
        how = "it hangs" if not ready else f"the process died ({_died(ended)})"
        _note(result, current, "?", "-1", "0", "0", how, folder=folder, keep=keep)
        return current + 1
    return cases.stop


def _awaited(pipe: IO[bytes], pid: int) -> bool:
    """Wait until a process says something; not for one that works for too long, or only waits itself."""
    begun, worked = time.monotonic(), _seconds_of_work(pid)
    while not select.select([pipe], [], [], SLOWEST_SECONDS)[0]:
        if (
            _seconds_of_work(pid) - worked > 2 * SLOWEST_SECONDS
            or time.monotonic() - begun > LONGEST_WAIT_SECONDS
        ):
            return False
    return True


def _seconds_of_work(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _died(status: int) -> str:
    if os.WIFSIGNALED(status):
        return signal.Signals(os.WTERMSIG(status)).name
    return f"status {os.WEXITSTATUS(status)}"


def _note(
    result: Result,
    number: int,
    target: str,
    status: str,
    seconds: str,
    megabytes: str,
    fault: str,
    *,
    folder: Path,
    keep: Path | None,
) -> None:
    result.n += 1
    if result.n % 1000 == 0:
        sys.stdout.write(f"so far {result.text()}\n")
    result.statuses[f"status {status}"] += 1
    result.slowest = max(result.slowest, (float(seconds), f"{number} {target}"))
    result.peak_mb = max(result.peak_mb, float(megabytes))
    if fault:
        result.faults.append(f"{number} {target}: {fault}")
        sys.stdout.write(result.faults[-1] + "\n")
        sys.stdout.flush()
        if keep is not None:
            with contextlib.suppress(OSError, shutil.Error):
                shutil.copytree(folder / "case", keep / str(number), symlinks=True, dirs_exist_ok=True)


def _try_all(
    cases: range,
    seed: int,
    targets: list[Target],
    samples: dict[str, list[Path]],
    folder: Path,
    pipe: int,
) -> None:
    warnings.simplefilter("ignore")
    noise = os.open(folder / "noise", os.O_RDWR | os.O_CREAT | os.O_TRUNC)
    os.dup2(noise, 2)
    size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + MORE_MEMORY_BYTES,) * 2)
    for number in cases:
        os.write(pipe, f"begin\t{number}\n".encode())
        os.ftruncate(noise, 0)
        os.lseek(noise, 0, os.SEEK_SET)
        rng = np.random.default_rng([seed, number])
        target = targets[int(rng.integers(len(targets)))]
        start = time.process_time()
        outcome = _tried(target, samples, folder / "case", rng)
        seconds = time.process_time() - start  # of work: the machine may be busy otherwise
        fault = outcome.fault or _left(folder / "case")
        said = (folder / "noise").read_bytes().replace(QT_SAYS, b"")
        if said and not fault:
            fault = f"a library speaks: {said!r:.200}"
        if seconds > SLOWEST_SECONDS and not fault:
            fault = f"takes {seconds:.0f} s"
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1000
        line = [f"{number}", target.name, f"{outcome.status}", f"{seconds:.2f}", f"{peak:.0f}", fault]
        os.write(pipe, ("end\t" + "\t".join(" ".join(word.split()) for word in line) + "\n").encode())
    os._exit(0)


def _tried(target: Target, samples: dict[str, list[Path]], folder: Path, rng: np.random.Generator) -> Outcome:
    if folder.exists():
        shutil.rmtree(folder)
    folder.mkdir()
    path = _bad_input(samples[target.kind], folder, rng)
    logging.getLogger().handlers[:] = [logging.NullHandler()]  # commands set up their own
    try:
        return target.run(path, folder)
    except Exception as error:
        where = traceback.extract_tb(error.__traceback__)[-3:]
        lines = " < ".join(f"{Path(f.filename).name}:{f.lineno}" for f in reversed(where))
        return Outcome(-1, f"{type(error).__name__}: {error!s:.150} at {lines}")


def _bad_input(samples: list[Path], folder: Path, rng: np.random.Generator) -> Path:
    sample = samples[int(rng.integers(len(samples)))]
    stem, dot, suffix = sample.name.partition(".")
    odd = NAMES[int(rng.integers(len(NAMES)))]
    side = "_L" if stem.endswith("_L") else ""
    path = folder / f"{stem.removesuffix('_L')}{os.fsdecode(odd)}{side}{dot}{suffix}"
    if sample.is_dir():
        shutil.copytree(sample, path)
        files = sorted(file for file in path.iterdir() if file.is_file())
        chosen = files[int(rng.integers(len(files)))]
    else:
        shutil.copy(sample, path)
        chosen = path
    if rng.random() < 0.06:
        replace_by_oddity(chosen, rng)
    elif rng.random() < 0.97:  # a few stay good
        chosen.write_bytes(spoil(chosen.read_bytes(), rng))
    return path


def _left(folder: Path) -> str:
    drafts = [file.name for file in folder.rglob("*") if ".tmp" in file.name or file.name.startswith(".")]
    return f"left behind: {drafts}" if drafts else ""


def main() -> int:
    """Run as told; status 1 where something was found."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--n", type=int, default=5000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="number of the first input, to repeat one")
    parser.add_argument("--kinds", nargs="+", default=(), help="only these kinds of files")
    parser.add_argument("--keep", type=Path, help="copy what fails to this folder")
    args = parser.parse_args()
    result = run(args.n, args.seed, kinds=tuple(args.kinds), keep=args.keep, first=args.first)
    sys.stdout.write(result.text() + "\n")
    return int(bool(result.faults))


if __name__ == "__main__":
    sys.exit(main())
