"""Shared by the tests of scripts: the ball of bone as a file, and scripts written and run in one call."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import SimpleITK
from window_cases import ball_volume

from gp_labeler.scripting.report import RunReport
from gp_labeler.scripting.runner import run_script
from gp_labeler.scripting.script import make_script

SPECIMEN = "ball.gpspecimen.json"


def write_ball(path: Path) -> Path:
    """Write the ball of bone as a scan file."""
    volume = ball_volume()
    image = SimpleITK.GetImageFromArray(volume.array)
    image.SetSpacing(volume.spacing)
    image.SetOrigin(volume.origin.tolist())
    SimpleITK.WriteImage(image, str(path))
    return path


def run(folder: Path, *tables: dict[str, Any]) -> RunReport:
    """Run steps on the ball, which is opened first; files go to ``folder / "out"``."""
    ball = folder / "ball.nrrd"
    if not ball.exists():
        write_ball(ball)
    script = make_script([{"do": "open", "path": "ball.nrrd"}, *tables], folder=folder)
    return run_script(script, folder / "out")


def place(code: str, at: Any, **more: Any) -> dict[str, Any]:
    """Make a step that places a left feature by a click."""
    return {"do": "place", "feature": code, "side": "L", "at": [float(x) for x in at], "view": "3d", **more}


def content(path: Path) -> Any:
    """Read a JSON file."""
    return json.loads(path.read_text())


def untimed(path: Path) -> str:
    """Return a landmark file without the times at which its points were placed."""
    found = content(path)
    marks = found["gpLabeler"][0]["provenance"]
    for mark in marks.values():
        mark.pop("time")
    return re.sub(r" \[time: [^]]*\]|; time: [^]]*", "", json.dumps(found, indent=1))
