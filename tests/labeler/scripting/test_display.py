"""The window on a real display, with mouse and keys that come from outside the process."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from window_cases import VOXEL_MM

pytestmark = pytest.mark.machine

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[2]
TOOLS = ("xvfb-run", "xdotool")


@pytest.mark.slow
@pytest.mark.skipif(not all(shutil.which(tool) for tool in TOOLS), reason="needs xvfb-run and xdotool")
def test_real_mouse_and_keys_label_on_a_real_display() -> None:
    env = os.environ | {
        "QT_QPA_PLATFORM": "xcb",
        "PYTHONPATH": os.pathsep.join(map(str, (ROOT, HERE.parent))),
    }
    screen = ["xvfb-run", "-a", "-s", "-screen 0 1400x900x24"]
    done = subprocess.run(
        [*screen, sys.executable, str(HERE / "clicked_window.py")],
        cwd=ROOT,
        env=env,
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    found = json.loads(done.stdout.splitlines()[-1])
    assert found["platform"] == "xcb"
    assert found["slice_off"] < VOXEL_MM
    assert found["bone_off"] < VOXEL_MM
    assert found["turned_deg"] > 5  # a drag turns the head, and places nothing
    assert found["placed"] == ["CA", "RWP"]
    assert found["after_undo"] == ["CA"]
    assert found["layout"] == "axial"
