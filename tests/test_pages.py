"""What the README and the pages of docs/ show is true: every command is understood, Python runs as printed.

The tutorials and the how-to pages are run whole, with what they print, by test_tutorials.
"""

from __future__ import annotations

import ast
import contextlib
import re
import shlex
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import gp_core
from gp_core import Atlas, LandmarkSet, Measurement, read_landmarks, write_markups, write_measurements
from gp_core.cli import main
from gp_core.cli.entry import make_parser as core_parser
from gp_core.settings import KEYS
from gp_labeler.cli.entry import make_parser as labeler_parser
from gp_labeler.cli.subcommands import SUBCOMMANDS
from gp_labeler.imaging.volume import Volume
from gp_labeler.jobs.runner import QueueDispatcher
from gp_labeler.models.workspace import Workspace

_ROOT = Path(__file__).resolve().parents[1]
_DOCS = _ROOT / "docs"
_PAGES = [_ROOT / "README.md", *sorted(_DOCS.glob("*.md")), *sorted((_DOCS / "howto").glob("*.md"))]
_CODE = re.compile(r"^```(?:console)?\n(.*?)^```$|^ {4}(\S[^\n]*)$", re.MULTILINE | re.DOTALL)
_COMMAND = re.compile(r"^(?:\$ )?(gp-(?:core|labeler) .+)$", re.MULTILINE)
_BLOCK = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_TABLE = re.compile(r"^```toml\n(.*?)^```$", re.MULTILINE | re.DOTALL)

TOO_LONG = {
    "first-labels": "registers heads for minutes: its tutorial is run by tools/gate-long",
    "offscreen": "draws the window over a head: tests/labeler/scripting does",
    "phantoms": "makes a head: tests/labeler/phantom does",
    "pyvista": "opens a window of VTK; the block of figures is run by tests/labeler/test_plotting.py",
    "reproduce": "a search on eight processors: tests/core/study does",
    "straight-heads": "straightens a head: tests/labeler/head_pose does",
    "tracker": "goes on for ever: tests/labeler/tracker does",
}
"""Pages of whose blocks only the imports are tried, and why."""


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


class _CompletedError(Exception):
    """A command line that only prints something was understood."""


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
    (here / "scans").mkdir()
    mesh = pytest.importorskip("pyvista").Sphere()
    mesh.save(here / "implant.stl")
    return here


@pytest.fixture
def names(folder: Path) -> dict[str, object]:
    """What the pages take for known: a window's workspace, a scan, the landmarks of a side."""
    side = read_landmarks(folder / "GP01_L.mrk.json")
    wrong = {code: side[code] + (3.0 if code == "OS" else 0.0) for code in side.placed if code != "CO"}
    volume = Volume.from_parts(np.zeros((20, 20, 20), np.uint8) + 9, (0.5,) * 3, (0, 0, 0), name="GP01")
    workspace = Workspace(None, QueueDispatcher(), atlas=Atlas.published(), author="tester")
    workspace.document.attach_volume(volume)
    workspace.scan.opened.emit(volume)
    return {
        "workspace": workspace,
        "window": SimpleNamespace(workspace=workspace),
        "volume": volume,
        "plane": workspace.view.planes["axial"],
        "position": 4.0,
        "side": side,
        "landmarks": LandmarkSet.from_mapping(wrong, "L", frame="scan"),
    }


@pytest.mark.parametrize(("page", "n", "block"), _blocks(), ids=lambda each: str(each)[:20].split("\n")[0])
def test_every_python_block_runs(page, n, block, folder, names, monkeypatch, capsys) -> None:
    code = ast.parse(block, filename=f"{page}.md")
    if page in TOO_LONG:
        code.body = [node for node in code.body if isinstance(node, ast.Import | ast.ImportFrom)]
    monkeypatch.chdir(folder)

    exec(compile(code, f"{page}.md", "exec"), {**names, "gp_core": gp_core})  # an earlier block imports it


@pytest.mark.parametrize(
    ("page", "table"),
    [(page.stem, table) for page in _PAGES for table in _TABLE.findall(page.read_text(encoding="utf-8"))],
    ids=lambda each: str(each)[:12],
)
def test_every_script_and_settings_file_is_valid(page: str, table: str, tmp_path: Path) -> None:
    tomllib = pytest.importorskip("tomllib")
    read = tomllib.loads(table)
    if page == "settings":
        assert read.keys() <= {key.name for key in KEYS}
    elif page != "extensions":  # whose example package is installed by tests/labeler/test_extensions.py
        make = import_module("gp_labeler.scripting.script").make_script
        assert len(make(read["step"], name=page).steps) == len(read["step"])
