"""A seeded kill run: programs are killed at random moments, on full disks and in read-only folders.

    python tests/robustness/kill_run.py --n 200 --seed 1

After each kill: every edit that was confirmed is offered again, each file is whole (the old one or the new
one), what the killed program left behind is cleaned up, no process lives on, and the work goes on.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from gp_core import Atlas, load_specimens
from gp_core.atlas.sampling import draw_animal
from gp_core.errors import GpError
from gp_core.io import read_landmarks, write_csv, write_markups
from gp_labeler.document.opening import new_specimen, open_specimen, recover_specimen
from gp_labeler.document.recovery import find_recoveries
from gp_labeler.document.specimen_document import SpecimenDocument
from gp_labeler.document.specimen_edits import SetNotes
from gp_labeler.document.specimen_file import read_specimen

__all__ = ["KILLS", "Result", "run"]

LONGEST_SECONDS = 0.25  # a program lives before it is killed
PATIENCE_SECONDS = 60.0
SCRATCH_BYTES = 2_000_000


@dataclass
class Result:
    """What a run has seen."""

    counts: Counter[str] = field(default_factory=Counter)
    edits: int = 0
    faults: list[str] = field(default_factory=list)
    seconds: float = 0.0

    def text(self) -> str:
        """Return the figures."""
        counts = ", ".join(f"{name} {count}" for name, count in sorted(self.counts.items()))
        total = sum(self.counts.values())
        edits = f"{self.edits} confirmed edits found again"
        return f"{total} kills in {self.seconds:.0f} s: {counts}; {edits}; {len(self.faults)} faults"


def run(n: int, seed: int, *, kinds: tuple[str, ...] = ()) -> Result:
    """Kill `n` programs, of each kind in turn."""
    result, start = Result(), time.monotonic()
    names = [name for name in KILLS if not kinds or name in kinds]
    for number in range(n):
        name = names[number % len(names)]
        rng = np.random.default_rng([seed, number])
        with tempfile.TemporaryDirectory(prefix="kills-") as folder:
            try:
                result.edits += KILLS[name](Path(folder), rng)
            except Exception as error:
                result.faults.append(f"{number} {name}: {type(error).__name__}: {error}")
                sys.stdout.write(result.faults[-1] + "\n")
        result.counts[name] += 1
        result.seconds = time.monotonic() - start
        if number % 40 == 39:
            sys.stdout.write(f"so far {result.text()}\n")
            sys.stdout.flush()
    return result


def _killed(
    work: Callable[[int], None], rng: np.random.Generator, number: int = signal.SIGKILL
) -> list[bytes]:
    """Fork a program, kill it after a while, and return the lines that it wrote to its pipe."""
    reading, writing = os.pipe()
    pid = os.fork()
    if pid == 0:
        os.close(reading)
        with contextlib.suppress(GpError):  # such as a full disk, which the caller has said already
            work(writing)
        os._exit(0)
    os.close(writing)
    time.sleep(float(rng.uniform(0.0, LONGEST_SECONDS)))
    os.kill(pid, number)
    os.waitpid(pid, 0)
    with os.fdopen(reading, "rb") as pipe:
        return pipe.read().split(b"\n")[:-1]


def _edited(state: Path, rng: np.random.Generator, *, saved: Path | None = None) -> int:
    """Edit until the kill comes; then all that was confirmed must be offered, and can be gone on with."""

    def work(pipe: int) -> None:
        document = SpecimenDocument(new_specimen(state, specimen="GP-014"))
        if saved is not None:
            document.save(saved)
        for n in range(10_000):
            document.do(SetNotes(f"{n} " + "x" * int(rng.integers(2000))))
            os.write(pipe, b"%d\n" % n)
            if saved is not None and n % 7 == 6:
                document.save()

    said = _killed(work, rng)
    confirmed = int(said[-1]) if said else -1
    found = find_recoveries(state)
    notes = [recovery.state.notes for recovery in found]
    if saved is not None and saved.exists():
        notes.append(read_specimen(saved).notes)  # whole, whenever the kill came
    last = max((int(text.split()[0]) for text in notes if text), default=-1)
    assert last >= confirmed, f"edit {confirmed} was confirmed, {last} is left"
    for recovery in found:
        assert not recovery.content.damage, recovery.content.damage
        document = SpecimenDocument(recover_specimen(recovery, state))
        document.do(SetNotes("goes on"))
        document.close(discard=True)
    drafts = [file.name for file in state.rglob("*.tmp*")]
    assert not drafts, f"drafts are left: {drafts}"
    return confirmed + 1


def document_killed(folder: Path, rng: np.random.Generator) -> int:
    """A document that was never saved."""
    return _edited(folder / "state", rng)


def saving_killed(folder: Path, rng: np.random.Generator) -> int:
    """A document that is saved now and then."""
    saved = folder / "GP-014.gpspecimen.json"
    found = _edited(folder / "state", rng, saved=saved)
    if saved.exists():
        SpecimenDocument(open_specimen(saved, folder / "state", unsaved="leave")).close()
    return found


def export_killed(folder: Path, rng: np.random.Generator) -> int:
    """Landmark files, tables and figures that are written over and over."""
    from gp_core.study.distances import distances
    from gp_core.study.figures import distance_matrix, save_figure

    animals = [draw_animal(Atlas.published(), rng=rng) for _ in range(2)]

    def write(n: int) -> None:
        side = animals[n % 2].side("L")
        write_markups(folder / "A_L.mrk.json", side, specimen="A")
        write_csv(folder / "A_L.csv", side)
        if n % 5 == 0:
            save_figure(distance_matrix(distances(animals)), folder / "figure.png")

    write(0)
    old = (folder / "figure.png").read_bytes()

    def work(_: int) -> None:
        for n in range(10_000):
            write(n)

    _killed(work, rng)
    for name in ("A_L.mrk.json", "A_L.csv"):
        found = read_landmarks(folder / name, side="L")
        assert any(np.allclose(found["CA"], animal.side("L")["CA"]) for animal in animals), name
    assert (folder / "figure.png").read_bytes()[-12:] == old[-12:], "the figure is cut"
    write(0)
    names = sorted(file.name for file in folder.iterdir())
    assert names == ["A_L.csv", "A_L.mrk.json", "figure.png"], names
    return 0


def mesh_killed(folder: Path, rng: np.random.Generator) -> int:
    """A mesh that is written over and over."""
    from vtkmodules.vtkFiltersSources import vtkSphereSource

    from gp_labeler.imaging.surface_files import write_mesh

    source = vtkSphereSource()
    source.SetThetaResolution(200)
    source.SetPhiResolution(200)
    source.Update()
    path = folder / "bone.ply"
    write_mesh(source.GetOutput(), path)
    old = path.read_bytes()

    def work(_: int) -> None:
        while True:
            write_mesh(source.GetOutput(), path)

    _killed(work, rng)
    assert path.read_bytes() == old
    write_mesh(source.GetOutput(), path)
    assert list(folder.iterdir()) == [path]
    return 0


@contextlib.contextmanager
def _small_disk(folder: Path) -> Iterator[Path]:
    """Mount a disk of two megabytes, where that is allowed; elsewhere it is a plain folder."""
    disk = folder / "disk"
    disk.mkdir()
    words = ["mount", "-t", "tmpfs", "-o", f"size={SCRATCH_BYTES}", "tmpfs", str(disk)]
    mounted = os.geteuid() == 0 and subprocess.run(words, capture_output=True, check=False).returncode == 0
    try:
        yield disk
    finally:
        if mounted:
            subprocess.run(["umount", "-l", str(disk)], check=True)


def full_disk_killed(folder: Path, rng: np.random.Generator) -> int:
    """A document on a disk that fills up, and is killed there; all edits are found, on the full disk too."""
    with _small_disk(folder) as disk:
        state = disk / "state"

        def work(pipe: int) -> None:
            document = SpecimenDocument(new_specimen(state, specimen="GP-014"))
            with (disk / "rest").open("wb", buffering=0) as rest, contextlib.suppress(OSError):
                for _ in range(int(rng.integers(300, 600))):
                    rest.write(bytes(4096))
            for n in range(10_000):
                document.do(SetNotes(f"{n} " + "x" * int(rng.integers(20_000))))
                os.write(pipe, b"%d\n" % n)

        said = _killed(work, rng)
        confirmed = int(said[-1]) if said else -1
        found = find_recoveries(state)
        last = max((int(recovery.state.notes.split()[0]) for recovery in found), default=-1)
        assert confirmed <= last <= confirmed + 1, f"edit {confirmed} was confirmed, {last} is left"
        for recovery in found:
            SpecimenDocument(recover_specimen(recovery, folder / "elsewhere")).close(discard=True)
        return confirmed + 1


def read_only_killed(folder: Path, rng: np.random.Generator) -> int:
    """A state folder that may only be read after the kill."""
    with _small_disk(folder) as disk:
        state = disk / "state"

        def work(pipe: int) -> None:
            document = SpecimenDocument(new_specimen(state, specimen="GP-014"))
            for n in range(30):
                document.do(SetNotes(f"{n} note"))
                os.write(pipe, b"%d\n" % n)
            time.sleep(60)

        said = _killed(work, rng)
        if os.path.ismount(disk):
            subprocess.run(["mount", "-o", "remount,ro", str(disk)], check=True)
        found = find_recoveries(state)
        confirmed = int(said[-1]) if said else -1
        assert len(found) == 1 or confirmed < 0
        for recovery in found:
            assert int(recovery.state.notes.split()[0] or -1) >= confirmed
            document = SpecimenDocument(recover_specimen(recovery, folder / "elsewhere"))
            document.save(folder / "saved")
            document.close()
        return confirmed + 1


def study_killed(folder: Path, rng: np.random.Generator) -> int:
    """A search in two processes that writes a checkpoint; it goes on from there, and no process is left."""
    animals = folder / "animals"
    animals.mkdir()
    for name in "ABCD":
        write_markups(
            animals / f"{name}_L.mrk.json", draw_animal(Atlas.published(), rng=rng).side("L"), specimen=name
        )
    checkpoint = folder / "search.json"
    gp_core = [sys.executable, "-c", "import sys; from gp_labeler.cli.start import core; sys.exit(core())"]
    words = [*gp_core, "search", str(animals), "--workers", "2", "--checkpoint"]
    words += [str(checkpoint), "--max-iterations", "2", "--fewest-training", "8"]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True)
    time.sleep(float(rng.uniform(0.5, 8.0)))
    process.send_signal([signal.SIGKILL, signal.SIGTERM, signal.SIGINT][int(rng.integers(3))])
    _, error = process.communicate(timeout=PATIENCE_SECONDS)  # it ends where no worker holds the pipe
    assert b"Traceback" not in error, error[-300:]
    end = time.monotonic() + PATIENCE_SECONDS
    while _group(process.pid) and time.monotonic() < end:
        time.sleep(0.05)
    assert not _group(process.pid), "a worker lives on"
    if checkpoint.exists():
        content = json.loads(checkpoint.read_text())
        assert isinstance(content["results"], dict)
    assert len(load_specimens(animals)) == 4
    return 0


def _group(leader: int) -> list[int]:
    """Return the living processes of a document."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            name, _, rest = stat.read_text().rpartition(")")
            fields = rest.split()
            if int(fields[3]) == leader and fields[0] != "Z":
                found.append(int(name.split()[0]))
    return found


def window_killed(folder: Path, rng: np.random.Generator) -> int:
    """A window, off screen, that is edited and killed."""
    state = folder / "state"
    code = (
        "import sys; from pathlib import Path; from gp_labeler.views.application import make_window\n"
        "from gp_labeler.document.specimen_edits import SetNotes\n"
        "from gp_labeler.document.touching import record_touch\n"
        "window = make_window(Path(sys.argv[1])); window.show(); document = window.workspace.document\n"
        "record_touch(document, 'L', 'OS', (1, 2, 3))\n"
        "for n in range(10000):\n"
        "    document.do(SetNotes(f'{n} note')); print(n, flush=True); window.grab()\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code, str(state)],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=dict(os.environ, QT_QPA_PLATFORM="offscreen"),
    )
    assert process.stdout is not None
    process.stdout.readline()
    time.sleep(float(rng.uniform(0.0, 2.0)))
    process.kill()
    said = process.communicate()[0].split()
    confirmed = int(said[-1]) if said else 0
    (recovery,) = find_recoveries(state)
    assert int(recovery.state.notes.split()[0]) >= confirmed
    return confirmed + 1


KILLS: dict[str, Callable[[Path, np.random.Generator], int]] = {
    "document": document_killed,
    "saving": saving_killed,
    "export": export_killed,
    "mesh": mesh_killed,
    "full disk": full_disk_killed,
    "read only": read_only_killed,
    "study": study_killed,
    "window": window_killed,
}


def main() -> int:
    """Run as told; status 1 where something was found."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--n", type=int, default=240)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kinds", nargs="+", default=(), choices=tuple(KILLS), help="only these")
    args = parser.parse_args()
    result = run(args.n, args.seed, kinds=tuple(args.kinds))
    sys.stdout.write(result.text() + "\n")
    return int(bool(result.faults))


if __name__ == "__main__":
    sys.exit(main())
