"""Python and scripts on the README and the pages of docs/ run as printed.

Commands are run by test_page_commands; the tutorials and the how-to pages whole, with what they print, by
test_tutorials.
"""

from __future__ import annotations

import ast
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from page_cases import DOCS, PAGES, ROOT, make_animals, make_small_heads

import gp_core
from gp_core import Atlas, LandmarkSet, Side, read_landmarks
from gp_core.settings import KEYS
from gp_labeler.document.edits import PlacePoint
from gp_labeler.document.state import How, Provenance
from gp_labeler.imaging.readers import read_volume
from gp_labeler.imaging.volume import Volume
from gp_labeler.jobs.runner import QueueDispatcher
from gp_labeler.models.workspace import Workspace

_BLOCK = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_TABLE = re.compile(r"^```toml\n(.*?)^```$", re.MULTILINE | re.DOTALL)

_OWN_PROCESS = ("offscreen", "reproduce")
"""Pages whose blocks are scripts with a window, or with worker processes."""


def _blocks() -> list[tuple[str, int, str]]:
    pages = [(page.stem, page.read_text(encoding="utf-8")) for page in PAGES if page.parent.name != "howto"]
    return [(name, n, block) for name, text in pages for n, block in enumerate(_BLOCK.findall(text))]


@pytest.fixture(autouse=True)
def _closed() -> Iterator[None]:
    """Let pyvista, which keeps every plotter, forget those that a page leaves open."""
    yield
    if "pyvista" in sys.modules:
        sys.modules["pyvista"].close_all()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with what most blocks read."""
    here = tmp_path_factory.mktemp("pages")
    make_animals(here)
    return here


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A library, and a head to label, that are quick to register."""
    here = tmp_path_factory.mktemp("small")
    make_small_heads(here)
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
            with pytest.raises(_PrintedError, match="RecordedTouch"):
                exec(block.replace("18944", port), {"print": _end_with})
        finally:
            simulator.kill()


class _PrintedError(Exception):
    """A loop without an end has printed."""


def _end_with(told: object) -> None:
    raise _PrintedError(type(told).__name__)


@pytest.mark.parametrize(
    ("page", "table"),
    [(page.stem, table) for page in PAGES for table in _TABLE.findall(page.read_text(encoding="utf-8"))],
    ids=lambda each: str(each)[:12],
)
def test_every_script_runs_and_settings_are_known(page: str, table: str, folder: Path) -> None:
    tomllib = pytest.importorskip("tomllib")
    read = tomllib.loads(table)
    if page == "settings":
        assert read.keys() <= {key.name for key in KEYS}
    elif page != "extensions":  # whose example package is installed by tests/labeler/test_extensions.py
        _run_script_of_steps(read["step"], folder)


_READERS = ROOT / "gp_labeler" / "imaging" / "readers"


def _acceptable(call: ast.Call) -> bool:
    """Whether a call makes a problem of a scan that ``--accept`` resolves."""
    is_problem = isinstance(call.func, ast.Name) and call.func.id == "Problem"
    return is_problem and "'accept'" in ast.unparse(call)


def test_the_page_of_files_lists_every_code_that_can_be_accepted() -> None:
    trees = [ast.parse(file.read_text(encoding="utf-8")) for file in sorted(_READERS.glob("*.py"))]
    calls = [node for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Call)]
    codes = {ast.literal_eval(call.args[0]) for call in calls if _acceptable(call)}
    page = (DOCS / "files.md").read_text(encoding="utf-8")
    table = page.partition("| `--accept` code |")[2].partition("\n\n")[0]
    assert codes == set(re.findall(r"^\| `([a-z-]+)` \|", table, re.MULTILINE))


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
