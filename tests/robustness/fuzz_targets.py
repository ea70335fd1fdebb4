"""What is tried on a bad file: every reader, and every command that takes such a file."""

from __future__ import annotations

import contextlib
import io
import itertools
import json
import logging
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from fuzz_window import Window

import gp_core
from gp_core.atlas.atlas import Atlas
from gp_core.cli import main as gp_core_main
from gp_core.errors import GpError
from gp_core.io import (
    import_mat,
    load_labellings,
    load_specimens,
    read_authors_mat,
    read_lab_names,
    read_points,
)
from gp_core.io.pose_json import read_pose
from gp_core.io.stl import read_stl
from gp_core.io.tracker_recordings import read_marker_poses, read_recording
from gp_core.pose.insertion_path import read_path
from gp_core.registration.pivot import calibrate_pivot
from gp_core.study.checkpoint import Checkpoint
from gp_labeler.cli.entry import main as gp_labeler_main
from gp_labeler.document.animals import read_animals
from gp_labeler.document.atlas_memory import AtlasMemory
from gp_labeler.document.journal import read_journal
from gp_labeler.document.landmark_import import import_landmarks
from gp_labeler.document.opening import recover_specimen
from gp_labeler.document.recent_files import RecentFiles
from gp_labeler.document.recovery import find_recoveries
from gp_labeler.document.specimen_document import SpecimenDocument
from gp_labeler.document.specimen_file import read_specimen
from gp_labeler.document.touching import load_skull, load_touches
from gp_labeler.imaging.mesh_files import read_mesh
from gp_labeler.imaging.readers import inspect_volume, read_volume
from gp_labeler.scripting.script import read_script
from gp_labeler.views.window_state import WindowState

__all__ = ["TARGETS", "Outcome", "Target"]

MARKS = "{good}/landmarks"
TABLES = "{good}/tables"
FEW = "--settings estimation --max-iterations 3 --json {out}"
COMMANDS = (
    ("touches", "estimate {in} --side L --json {out}"),
    ("touches", "estimate {in} --side R --tfm {out} --accept-warnings"),
    ("touches", f"register {{in}} {MARKS}/one_L.csv --side L --json {{out}}"),
    ("landmarks", f"register {MARKS}/touches.csv {{in}} --side L --json {{out}}"),
    ("landmarks", "check {in} --json {out}"),
    ("atlas", f"check {MARKS}/one_L.csv --atlas {{in}} --json {{out}}"),
    ("atlas", f"estimate {MARKS}/touches.dat --side L --atlas {{in}} --json {{out}}"),
    (
        "path",
        f"estimate {MARKS}/touches.dat --side L --path {{in}} --path-units mm --path-side L "
        "--path-out {out}",
    ),
    ("poses", "pivot {in} --json {out}"),
    ("recording", "pivot {in} --json {out}"),
    ("recording", "touches {in} --tip 0,0,100 --order CL,MN -o {dir}.csv"),
    ("tip", f"touches {TABLES}/a.igs.mha --tip {{in}} --order CL,MN -o {{dir}}.csv"),
    ("animals", "conditions {in} --groups shared --repeats 1 --animals 3 --workers 1 --json {out}"),
    ("names", f"check {MARKS}/one_L.csv --names {{in}} --json {{out}}"),
    ("animals", "fit {in} -o {out}"),
    ("animals", "check {in} --json {out}"),
    ("animals", "distances {in} --json {out} --figure {dir}.png"),
    ("animals", f"leave-one-out {{in}} {FEW}"),
    ("animals", f"simulate {{in}} --n 3 {FEW}"),
    ("animals", f"compare {{in}} --repeats 1 --workers 1 {FEW}"),
    (
        "checkpoint",
        f"search {MARKS}/animals --checkpoint {{in}} --workers 1 --fewest-training 6 {FEW} "
        "--training CA CB RWA RWP LLI OS",
    ),
    ("physical", f"simulate {MARKS}/animals --n 3 --physical {{in}} --figure {{dir}}.png {FEW}"),
    (
        "stl",
        f"physical --touches {MARKS}/touches.csv --ct-landmarks {MARKS}/one_L.csv --side L --bone {{in}} "
        "--n 3 --json {out}",
    ),
    ("mat", "import-mat {in} {in} -o {dir}"),
    ("animals", "reliability {in} --json {out} --csv {dir}.csv"),
    ("labellings", "reliability {in} --json {out} --csv {dir}.csv"),
    ("labellings", "check {in} --json {out}"),
)

STEPS: tuple[tuple[str, dict[str, object]], ...] = (
    ("scan", {"do": "open", "path": "{in}"}),
    ("specimen", {"do": "open", "path": "{in}"}),
    ("atlas", {"do": "atlas", "path": "{in}"}),
    ("animals", {"do": "atlas", "specimens": ["{in}"]}),
    ("landmarks", {"do": "import", "files": ["{in}"], "side": "L"}),
    ("touches", {"do": "touches", "side": "L", "points": "{in}"}),
    ("landmarks", {"do": "skull", "points": "{in}"}),
    ("path", {"do": "path", "path": "{in}", "side": "L", "units": "mm"}),
)

OLD = b'{"what was": "there before"}\n'


@dataclass(frozen=True)
class Outcome:
    """How it ended: the status, and what is wrong with that; nothing where all is well."""

    status: int
    fault: str = ""


@dataclass(frozen=True)
class Target:
    """One thing to try.

    Parameters
    ----------
    name : str
    kind : str
        The kind of file it takes.
    run : callable
        Takes the bad file and a folder to work in.
    """

    name: str
    kind: str
    run: Callable[[Path, Path], Outcome]


def _reader(read: Callable[[Path], object]) -> Callable[[Path, Path], Outcome]:
    def run(path: Path, folder: Path) -> Outcome:
        try:
            read(path)
        except GpError as error:
            text = str(error)
            if "\n" in text or not text or any(c < " " or "\x7f" <= c < "\xa0" for c in text):
                return Outcome(2, f"not one plain line: {text!r:.200}")
            if path.name not in text and error.file is None and error.specimen is None:
                return Outcome(2, f"names no file: {text}")
            return Outcome(2)
        return Outcome(0)

    return run


def _command(main: Callable[[list[str]], int], *words: str) -> Callable[[Path, Path], Outcome]:
    """Run a command; ``{in}`` is the bad file, ``{good}`` the samples, ``{out}`` an old file."""

    def run(path: Path, folder: Path) -> Outcome:
        output = folder / "old.json"
        output.write_bytes(OLD)
        named = {"{in}": str(path), "{out}": str(output), "{dir}": str(folder / "made")}
        said, error = io.StringIO(), io.StringIO()
        logging.getLogger().handlers.clear()
        given = [_filled(word, named) for word in words]
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(error):
            try:
                status = main(given)
            except SystemExit as end:
                status = int(end.code or 0)
        fault = _fault(status, said.getvalue(), error.getvalue(), output, is_json="--json" in words)
        return Outcome(status, fault)

    return run


def _in_window(table: dict[str, object]) -> Callable[[Path, Path], Outcome]:
    def run(path: Path, folder: Path) -> Outcome:
        def filled(value: object) -> object:
            if isinstance(value, list):
                return [filled(each) for each in value]
            return value.replace("{in}", str(path)) if isinstance(value, str) else value

        fault = WINDOW.fault({key: filled(value) for key, value in table.items()}, folder)
        return Outcome(0, fault)

    return run


def _with_settings(run: Callable[[Path, Path], Outcome]) -> Callable[[Path, Path], Outcome]:
    """Run a command with the bad file as the user's settings, under a name that no other run has."""

    def with_settings(path: Path, folder: Path) -> Outcome:
        named = folder / f"settings-{next(_NUMBERS)}.toml"
        named.symlink_to(path)
        os.environ["GP_LABELER_SETTINGS"] = str(named)
        try:
            return run(path, folder)
        finally:
            del os.environ["GP_LABELER_SETTINGS"]

    return with_settings


def _tracker_dialog(path: Path, folder: Path) -> Outcome:
    return Outcome(0, WINDOW.tracker_fault(path, folder))


def _physical_dialog(kind: str) -> Callable[[Path, Path], Outcome]:
    def run(path: Path, folder: Path) -> Outcome:
        marks = GOOD["folder"] / "landmarks"
        skull, touches = marks / "one_L.csv", marks / "touches.csv"
        given = {"touches": (skull, path), "landmarks": (path, touches)}[kind]
        return Outcome(0, WINDOW.physical_fault(*given, skull, folder))

    return run


_NUMBERS = itertools.count()
WINDOW = Window()


def _filled(word: str, named: dict[str, str]) -> str:
    for slot, text in {**named, "{good}": str(GOOD["folder"])}.items():
        word = word.replace(slot, text)
    return word


_COMMANDS = ("gp-core: ", "gp-labeler: ")

GOOD: dict[str, Path] = {"folder": Path()}
"""Where the good samples are; set by the run."""


def _fault(status: int, said: str, error: str, output: Path, *, is_json: bool) -> str:
    text = said + error
    if "Traceback" in text:
        return "a traceback"
    if any((c < " " and c not in "\n\t\r") or "\x7f" <= c < "\xa0" for c in text):
        return f"control characters: {text!r:.200}"
    if status not in (0, 1, 2, 3):
        return f"status {status}"
    if status == 2:
        lines = error.splitlines()
        if not lines or not lines[-1].startswith(_COMMANDS):
            return f"no line for status 2: {error!r:.200}"
        if stray := next((line for line in lines if not line.startswith(_COMMANDS)), ""):
            return f"a line of a library before that of status 2: {stray!r:.200}"
        if output.read_bytes() != OLD:
            return "the old file is gone"
    elif is_json and output.read_bytes() != OLD:
        try:
            json.loads(output.read_bytes())
        except ValueError:
            return "the new file is cut"
    return ""


def _journal(path: Path) -> None:
    """Recover a journal as a start of the window does, and go on with it."""
    state = path.parent / "state"
    (state / "journals").mkdir(parents=True)
    if path.is_file() and not path.is_symlink() and path.stat().st_size < 10_000_000:
        (state / "journals" / "unsaved-a.jsonl").write_bytes(path.read_bytes())
    for recovery in find_recoveries(state):
        assert "\n" not in recovery.text
        SpecimenDocument(recover_specimen(recovery, state)).close(discard=True)
    read_journal(path)


def _memories(path: Path) -> None:
    """Read every small file of the state directory, all of which may be damaged."""
    for name in ("recent.json", "atlas.json", "window.json"):
        target = path.with_name(name)
        if target != path:
            target.unlink(missing_ok=True)
            target.symlink_to(path.name)
    RecentFiles(path.parent).all()
    AtlasMemory(path.parent).recall()
    WindowState(path.parent / "window.json").fields("geometry")


def _pivot(path: Path) -> None:
    poses = read_marker_poses(path)
    try:
        calibrate_pivot(poses)
    except GpError as error:
        raise GpError(error.problem, file=path, remedy=error.remedy) from None


def _volume(path: Path) -> None:
    inspect_volume(path)
    read_volume(path, spacing=0.1)


def _all() -> Iterator[Target]:
    readers: list[tuple[str, Callable[[Path], object]]] = [
        ("landmarks", read_points),
        ("landmarks", load_specimens),
        ("landmarks", lambda p: gp_core.read_landmarks(p, side="L", unknown="extra")),
        ("landmarks", lambda p: import_landmarks(SpecimenDocument(), [p], side="L")),
        ("landmarks", lambda p: load_skull(SpecimenDocument(), p)),
        ("touches", lambda p: gp_core.read_touches(p, "L", unknown="extra")),
        ("touches", lambda p: load_touches(SpecimenDocument(), p, "L")),
        ("animals", load_specimens),
        ("animals", lambda p: read_animals([p])),
        ("atlas", Atlas.load),
        ("pose", read_pose),
        ("poses", _pivot),
        ("recording", read_recording),
        ("names", read_lab_names),
        ("path", lambda p: read_path(p, units="mm")),
        ("mat", lambda p: read_authors_mat(p, p)),
        ("mat", lambda p: import_mat(p, p, p.parent / "made")),
        ("stl", read_stl),
        ("mesh", read_mesh),
        ("labellings", load_labellings),
        ("checkpoint", lambda p: Checkpoint(p, "0" * 32)),
        ("specimen", read_specimen),
        ("specimen", lambda p: read_animals([p])),
        ("journal", _journal),
        ("script", read_script),
        ("state", _memories),
        ("scan", inspect_volume),
        ("scan", _volume),
    ]
    for n, (kind, read) in enumerate(readers):
        yield Target(f"read {kind} {n}", kind, _reader(read))
    for kind, line in COMMANDS:
        yield Target(f"gp-core {line.split()[0]} ({kind})", kind, _command(gp_core_main, *line.split()))
    mesh = "mesh {in} -o {dir}.ply --spacing 0.1 --threshold 100"
    yield Target("gp-labeler mesh", "scan", _command(gp_labeler_main, *mesh.split()))
    straighten = "straighten {in} --spacing 0.1 --threshold 100 --json {out}"
    yield Target("gp-labeler straighten", "scan", _command(gp_labeler_main, *straighten.split()))
    export = "export {in} -o {dir} --suggested"
    yield Target("gp-labeler export", "specimen", _command(gp_labeler_main, *export.split()))
    estimate = f"estimate {MARKS}/touches.dat --side L --json {{out}}"
    yield Target("settings", "settings", _with_settings(_command(gp_core_main, *estimate.split())))
    yield Target("dialog of the tracker", "tracker", _tracker_dialog)
    for kind in ("touches", "landmarks"):
        yield Target(f"dialog of the physical test ({kind})", kind, _physical_dialog(kind))
    for kind, table in STEPS:
        yield Target(f"window {table['do']} ({kind})", kind, _in_window(table))
    offscreen = ("--offscreen", "{in}", "--output", "{dir}")
    yield Target("gp-labeler --offscreen", "script", _command(_offscreen, *offscreen))


def _offscreen(words: list[str]) -> int:
    """Run a script only where it cannot be read: what its steps do is tried elsewhere."""
    try:
        read_script(words[1])
    except GpError:
        return gp_labeler_main(words)
    return 0


TARGETS = tuple(_all())
