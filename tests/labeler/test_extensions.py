"""Packages that extend gp-labeler: the example works, and one that fails is named and left out."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
from importlib.metadata import PathDistribution
from pathlib import Path

import numpy as np
import pytest

import gp_core
from gp_core.extensions import Extensions

_ROOT = Path(__file__).resolve().parents[2]
_EXAMPLE = _ROOT / "integrations" / "example"

_BROKEN = """
[gp_labeler.checks]
always = broken:nowhere
duplicates = broken:check
fails = broken:check

[gp_labeler.estimators]
odd = broken:estimate

[gp_labeler.landmark_formats]
bad = broken:read

[gp_labeler.readers]
tif = broken:read
bad = broken:read
worse = broken:reader
"""
_BROKEN_MODULE = """
def check(landmarks, atlas):
    raise ZeroDivisionError("a fault")

def estimate(given):
    return "no pose"

def read(path):
    raise KeyError("x")

def __getattr__(name):  # only a test of scans imports the readers
    from gp_labeler.imaging.readers.plan import ScanReader

    if name != "reader":
        raise AttributeError(name)
    return ScanReader(("worse",), lambda path: path.suffix == ".worse", lambda *_: 1 / 0)
"""


@pytest.fixture(scope="module")
def example(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the example installed, and touches to try it on."""
    folder = tmp_path_factory.mktemp("example")
    install = ["install", "--quiet", "--no-deps", "--target", str(folder), str(_EXAMPLE)]
    done = subprocess.run(
        [sys.executable, "-m", "pip", *install], capture_output=True, text=True, check=False
    )
    if "No matching distribution" in done.stderr:
        pytest.skip("no network to fetch the build backend")
    assert done.returncode == 0, done.stderr
    return folder


def _run(folder: Path, code: str, *words: object) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(folder), "QT_QPA_PLATFORM": "offscreen"}
    command = [sys.executable, "-c", code, *map(str, words)]
    return subprocess.run(
        command, capture_output=True, text=True, check=False, env=environment, cwd=folder, timeout=120
    )


_CORE = "import sys; from gp_core.cli import main; sys.exit(main(sys.argv[1:]))"


@pytest.mark.slow
def test_the_example_adds_a_format_a_method_and_a_check(example: Path) -> None:
    atlas = gp_core.Atlas.published()
    lines = (" ".join([code, *map(repr, atlas[code].tolist())]) + "\n" for code in gp_core.PROBE)
    (example / "touches.xyz").write_text("".join(lines))
    words = ["estimate", "touches.xyz", "--side", "L", "--method", "centroid", "--json", "pose.json"]
    done = _run(example, _CORE, *words, "--accept-warnings")
    assert done.returncode == 0, done.stderr
    assert "method centroid" in done.stdout
    done = _run(example, "import gp_core; print(gp_core.read_pose('pose.json').method)")
    assert done.stdout == "centroid\n", done.stderr
    points = {code: np.round(atlas[code]) if code == "OS" else atlas[code] for code in atlas.codes}
    labelled = gp_core.LandmarkSet.from_mapping(points, "L", frame="scan")
    gp_core.write_markups(example / "A_L.mrk.json", labelled, specimen="A")
    done = _run(example, _CORE, "check", "A_L.mrk.json")
    assert done.returncode == 1, done.stderr
    assert "OS lies at whole millimetres" in done.stdout
    assert "nobody is named who placed these labels" in done.stdout


@pytest.mark.slow
def test_the_example_adds_a_reader_a_panel_and_a_step(example: Path) -> None:
    (example / "scans").mkdir()
    with (example / "scans" / "head.npyscan").open("wb") as file:
        np.savez(file, values=np.arange(24.0, dtype=np.float32).reshape(2, 3, 4), spacing=[10.0, 11.0, 12.0])
    code = (
        "from gp_labeler.imaging.readers import read_volume\n"
        "from gp_labeler.scripting.script import make_script\n"
        "volume = read_volume('scans')\n"
        "print(*volume.size, *volume.spacing)\n"
        "print(make_script([{'do': 'count', 'least': 3}]).steps[0].title)\n"
        "from gp_labeler.models.workspace import Workspace\n"
        "from gp_labeler.views.application import make_application\n"
        "from gp_labeler.views.panels.table import added_panels\n"
        "app = make_application()\n"
        "workspace = Workspace(None)\n"
        "workspace.document.attach_volume(volume)\n"
        "workspace.labels.place([0, 0, 0], side='L', code='CA')\n"
        "workspace.labels.place([0, 3, 4], side='L', code='CB')\n"
        "((name, panel),) = added_panels(workspace, {})\n"
        "workspace.labels.choose('L', 'CA')\n"
        "print(name, *(panel.table.item(0, column).text() for column in (0, 1)))\n"
        "panel.table.cellClicked.emit(0, 0)\n"
        "print(workspace.labels.active.code)\n"
    )
    done = _run(example, code)
    expected = ["4 3 2 10.0 11.0 12.0", "count", "distances CB 5.00", "CB"]
    assert done.stdout.splitlines() == expected, done.stderr


def _break(folder: Path) -> None:
    """Install a package whose extensions fail."""
    info = folder / "broken-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: broken\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(_BROKEN)
    (folder / "broken.py").write_text(_BROKEN_MODULE)


def test_what_fails_is_named_and_left_out(tmp_path: Path) -> None:
    _break(tmp_path)
    (tmp_path / "touches.bad").write_text("x")
    code = (
        "import gp_core\n"
        "atlas = gp_core.Atlas.published()\n"
        "side = gp_core.LandmarkSet.from_mapping({c: atlas[c] for c in atlas.codes}, 'L', frame='scan')\n"
        "for finding in gp_core.check_side(side, atlas).findings: print(finding.kind, finding.text)\n"
        "for work in (lambda: gp_core.estimate_pose(side, 'L', method='odd'),\n"
        "             lambda: gp_core.read_touches('touches.bad', 'L')):\n"
        "    try: work()\n"
        "    except gp_core.GpError as error: print(error)\n"
    )
    done = _run(tmp_path, code)
    assert done.returncode == 0, done.stderr
    assert "the check 'always' of the package broken is left out: AttributeError" in done.stderr
    assert "the check 'duplicates' of the package broken is left out: duplicates is built in" in done.stderr
    assert "unchecked the check 'fails' of the package broken failed (ZeroDivisionError" in done.stdout
    assert "the estimator 'odd' of the package broken gave no CochleaPose" in done.stdout
    assert "touches.bad: the landmark format 'bad' of the package broken failed (KeyError" in done.stdout


def test_a_reader_that_fails_is_named_and_one_of_a_built_in_format_left_out(tmp_path: Path) -> None:
    _break(tmp_path)
    for name in ("head.bad", "head.worse"):
        (tmp_path / name).write_text("x")
    code = (
        "from gp_core import GpError\n"
        "from gp_labeler.imaging.readers import read_volume\n"
        "for name in ('head.bad', 'head.worse'):\n"
        "    try: read_volume(name)\n"
        "    except GpError as error: print(error)\n"
    )
    done = _run(tmp_path, code)
    assert "the reader 'tif' of the package broken is left out: tif is built in" in done.stderr
    first, second = done.stdout.splitlines()
    assert "head.bad: the reader 'bad' of the package broken failed (KeyError: 'x')" in first
    assert "head.worse: the reader 'worse' of the package broken failed (ZeroDivisionError" in second


def test_the_table_of_what_is_built_in_needs_no_look_at_packages(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(**_: object) -> PathDistribution:
        raise AssertionError("it looked")

    monkeypatch.setattr("gp_core.extensions.entry_points", refuse)
    found = Extensions("gp_labeler.estimators", {"robust": 1})
    with caplog.at_level(logging.WARNING):
        assert found.get("robust") == 1
    assert caplog.text == ""
