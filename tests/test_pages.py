"""What the README and the pages of docs/ show is true: every command is understood, Python runs as printed.

The tutorials and the how-to pages are run whole, with what they print, by test_tutorials.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from labeler.small_heads import save_markups, save_volume, small_head

import gp_core
from gp_core import Atlas, LandmarkSet, Measurement, Side, read_landmarks, write_markups, write_measurements
from gp_core.cli import main
from gp_core.cli.entry import make_parser as core_parser
from gp_core.settings import KEYS
from gp_labeler.cli.entry import make_parser as labeler_parser
from gp_labeler.cli.subcommands import SUBCOMMANDS
from gp_labeler.document.edits import PlacePoint
from gp_labeler.document.state import How, Provenance
from gp_labeler.imaging.readers import read_volume
from gp_labeler.imaging.volume import Volume
from gp_labeler.jobs.runner import QueueDispatcher
from gp_labeler.models.workspace import Workspace
from gp_labeler.phantom import make_phantom, save_phantom

_ROOT = Path(__file__).resolve().parents[1]
_DOCS = _ROOT / "docs"
_PAGES = [_ROOT / "README.md", *sorted(_DOCS.glob("*.md")), *sorted((_DOCS / "howto").glob("*.md"))]
_CODE = re.compile(r"^```(?:console)?\n(.*?)^```$|^ {4}(\S[^\n]*)$", re.MULTILINE | re.DOTALL)
_COMMAND = re.compile(r"^(?:\$ )?(gp-(?:core|labeler) .+)$", re.MULTILINE)
_BLOCK = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_TABLE = re.compile(r"^```toml\n(.*?)^```$", re.MULTILINE | re.DOTALL)

_MARKED = re.compile(r"<!-- not run: (gp-\w+ .+?): .+? -->")
"""A command that a page says is not run by the tests, and why."""

_OWN_PROCESS = ("offscreen", "reproduce")
"""Pages whose blocks are scripts with a window, or with worker processes."""


def _commands() -> list[tuple[str, str]]:
    text = [(page.stem, page.read_text(encoding="utf-8")) for page in _PAGES]
    return sorted({(name, line) for name, page in text for line in _lines_of(page)})


def _lines_of(page: str) -> list[str]:
    """Return what is typed of each line: no output, no remark beside it."""
    shown = ("".join(part) for part in _CODE.findall(page))
    return [re.split(r"  +|\s#\s", line)[0] for code in shown for line in _COMMAND.findall(code)]


@pytest.mark.parametrize(("page", "line"), _commands())
def test_every_command_line_is_understood(page: str, line: str, tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    for part in line.replace("`", "").split("|"):
        program, *words = shlex.split(re.sub(r"[<>] *\S+", "", part))
        if program not in ("gp-core", "gp-labeler"):
            continue
        with contextlib.suppress(_CompletedError):
            _parse(program, words)
    assert "error" not in capsys.readouterr().err


def _core_commands() -> list[tuple[str, str]]:
    """Return the commands of the core that are run: those that no page marks, and without other programs."""
    marked = {line for page in _PAGES for line in _MARKED.findall(page.read_text(encoding="utf-8"))}
    howto = {page.stem for page in _PAGES if page.parent.name == "howto"}  # run by test_tutorials
    rows = [(page, line) for page, line in _commands() if page not in howto and line not in marked]
    return [(page, line) for page, line in rows if line.startswith("gp-core ") and not set("|<>") & set(line)]


@pytest.mark.parametrize(("page", "line"), _core_commands())
def test_every_command_of_the_core_runs(page: str, line: str, folder, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("docs", "labelled", "reliability.json"):
        if f"--json {name}" not in line:
            Path(name).symlink_to(folder / name)
    if "--csv touches.csv" not in line:
        shutil.copy(_DOCS / "example" / "touches.csv", tmp_path)
    status = main(shlex.split(line)[1:])
    assert status in ((0, 1) if line.startswith("gp-core check") else (0,)), capsys.readouterr().err


class _CompletedError(Exception):
    """A command line that only prints something was understood; a loop without an end has printed."""


def _parse(program: str, words: list[str]) -> None:
    parser = core_parser() if program == "gp-core" else labeler_parser()
    if program == "gp-labeler" and words and words[0] in SUBCOMMANDS:
        parser, words = SUBCOMMANDS[words[0]].parser(), words[1:]
    try:
        parser.parse_args(words)
    except SystemExit as ended:
        if ended.code == 0:
            raise _CompletedError from None
        raise AssertionError(f"{program} {' '.join(words)} is not understood") from None


# Python


def _blocks() -> list[tuple[str, int, str]]:
    pages = [(page.stem, page.read_text(encoding="utf-8")) for page in _PAGES if page.parent.name != "howto"]
    return [(name, n, block) for name, text in pages for n, block in enumerate(_BLOCK.findall(text))]


@pytest.fixture(autouse=True)
def _closed() -> Iterator[None]:
    """Let pyvista, which keeps every plotter, forget those that a page leaves open."""
    yield
    if "pyvista" in sys.modules:
        sys.modules["pyvista"].close_all()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the blocks read: animals, labelled twice by each of two observers; a line; an error of labels."""
    here = tmp_path_factory.mktemp("pages")
    (here / "docs").symlink_to(_ROOT / "docs")
    drawn = ["draw", "-n", "3", "-o", str(here / "labelled"), "--observers", "AB", "CD", "--rounds", "2"]
    main([*drawn, "--label-error", "0.1"])
    main(["reliability", str(here / "labelled"), "--json", str(here / "reliability.json")])
    main(["draw", "-n", "1", "-o", str(here / "one")])
    side = read_landmarks(here / "one" / "drawn01_L.mrk.json")
    placed = {code: side[code] for code in side.placed if code not in ("CO", "MN")}  # MN is predicted
    for name in ("GP01", "GP-014"):
        landmarks = LandmarkSet.from_mapping(placed, "L", frame="scan")
        write_markups(here / f"{name}_L.mrk.json", landmarks, specimen=name)
    write_measurements(here, [Measurement("bulla width", [[1, 0, 0], [0, 0, 0]])], specimen="GP-014")
    (here / "scans").symlink_to(here / "labelled")
    mesh = pytest.importorskip("pyvista").Sphere()
    mesh.save(here / "implant.stl")
    save_phantom(make_phantom(7, spacing=0.4), here / "head.nrrd", labelled=True)
    return here


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A library of three labelled heads, and one to label, that are quick to register."""
    here = tmp_path_factory.mktemp("small")
    (here / "library").mkdir()
    for seed in range(3):
        volume, points = small_head(seed)
        save_volume(here / "library" / f"small-{seed}.nrrd", volume)
        save_markups(here / "library" / f"small-{seed}.mrk.json", points)
    save_volume(here / "head.nrrd", small_head(7)[0])
    return here


def _names(page: str, folder: Path) -> dict[str, object]:
    """Return what a page takes for known: a window's workspace, a scan, the landmarks of a side."""
    side = read_landmarks(folder / "GP01_L.mrk.json")
    wrong = {code: side[code] + (3.0 if code == "OS" else 0.0) for code in side.placed if code != "CO"}
    if page == "straight-heads":
        volume = read_volume(folder / "head.nrrd")
    else:
        volume = Volume.from_parts(np.full((20, 20, 20), 9, np.uint8), (0.5,) * 3, (0, 0, 0), name="GP01")
    dispatch = QueueDispatcher()
    workspace = Workspace(None, dispatch, atlas=Atlas.published(), author="tester")
    workspace.document.attach_volume(volume)
    workspace.scan.opened.emit(volume)
    if page == "straight-heads":
        truth = read_landmarks(folder / "head_L.mrk.json")
        for code in ("CA", "CB", "RWA", "RWP"):
            workspace.document.do(PlacePoint(Side.LEFT, code, truth[code], Provenance(How.SLICE)))
    return {
        "dispatch": dispatch,
        "workspace": workspace,
        "window": SimpleNamespace(workspace=workspace),
        "gp_core": gp_core,  # an earlier block imports it
        "volume": volume,
        "plane": workspace.view.planes["axial"],
        "position": 4.0,
        "side": side,
        "landmarks": LandmarkSet.from_mapping(wrong, "L", frame="scan"),
    }


@pytest.mark.parametrize(("page", "n", "block"), _blocks(), ids=lambda each: str(each)[:20].split("\n")[0])
def test_every_python_block_runs(page, n, block, folder, small, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir({"first-labels": small, "phantoms": tmp_path}.get(page, folder))
    monkeypatch.setattr("pyvista.OFF_SCREEN", True)
    if page in _OWN_PROCESS:
        _run_as_script(block)
    elif "while True:" in block:
        _run_until_it_prints(block)
    else:
        names = _names(page, folder)
        exec(block, names)
        names["dispatch"].deliver_until_idle(names["workspace"].jobs)
        assert page != "straight-heads" or names["workspace"].head.frame or n == 0


def _run_as_script(block: str) -> None:
    """Run a block in a process of its own, in the present folder."""
    Path("block.py").write_text(block, encoding="utf-8")
    environment = {**os.environ, "QT_QPA_PLATFORM": "offscreen"}
    command = [sys.executable, "block.py"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 0, done.stderr


def _run_until_it_prints(block: str) -> None:
    """Run a loop that has no end, with the simulated probe, until a touch is printed."""
    command = [sys.executable, "-m", "gp_labeler", "simulate-tracker", "--port", "0"]
    with subprocess.Popen(
        [*command, "--reference", "ReferenceToTracker"], stdout=subprocess.PIPE, text=True
    ) as simulator:
        assert simulator.stdout is not None
        port = simulator.stdout.readline().strip().rpartition(":")[2]
        try:
            with pytest.raises(_CompletedError, match="RecordedTouch"):
                exec(block.replace("18944", port), {"print": _end_with})
        finally:
            simulator.kill()


def _end_with(told: object) -> None:
    raise _CompletedError(type(told).__name__)


@pytest.mark.parametrize(
    ("page", "table"),
    [(page.stem, table) for page in _PAGES for table in _TABLE.findall(page.read_text(encoding="utf-8"))],
    ids=lambda each: str(each)[:12],
)
def test_every_script_runs_and_settings_are_known(page: str, table: str, folder: Path) -> None:
    tomllib = pytest.importorskip("tomllib")
    read = tomllib.loads(table)
    if page == "settings":
        assert read.keys() <= {key.name for key in KEYS}
    elif page != "extensions":  # whose example package is installed by tests/labeler/test_extensions.py
        _run_script_of_steps(read["step"], folder)


def _run_script_of_steps(steps: list[dict[str, object]], folder: Path) -> None:
    """Run a script in a window of its own; where it opens no scan, over one with some labels."""
    truth = read_landmarks(folder / "head_L.mrk.json")
    opened: list[dict[str, object]] = [{"do": "open", "path": "head.nrrd"}]
    for code in ("CA", "CB", "RWA", "RWP"):
        opened += [{"do": "place_point", "side": "L", "code": code, "position": truth[code].tolist()}]
    whole = steps if steps[0]["do"] == "open" else opened + steps
    (folder / "script.json").write_text(json.dumps(whole), encoding="utf-8")
    words = ["--offscreen", folder / "script.json", "--output", folder / "out"]
    done = subprocess.run(
        [sys.executable, "-m", "gp_labeler", *words], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
