"""The pictures of the site: drawn by the window without a display when the site is built, never committed.

A page asks for one by a comment, which a forge does not show: ``<!-- screenshot NAME: what it shows -->``.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import landmark_atlas

SPACING_MM = 0.2
WINDOW = (1440, 900)

SCREENSHOTS: dict[str, list[dict[str, object]]] = {
    "tracker": [
        {"do": "open", "empty": True, "discard": True},
        {"do": "observer", "name": "AB"},
        {"do": "view", "panel": "pose", "size": WINDOW},
        {"do": "touches", "side": "L", "points": "touches.csv", "how": "tracked probe"},
        {"do": "estimate", "side": "L"},
        {"do": "screenshot", "path": "pictures/tracker.png", "what": "window"},
    ],
}
"""The steps that draw each screenshot, over what `prepare` makes."""

_WANTED = re.compile(r"<!-- screenshot (\w+): (.+?) -->")


def with_screenshots(text: str) -> str:
    """Return a page with pictures in place of the comments that ask for them."""
    return _WANTED.sub(lambda found: f"![{found[2]}](/pictures/{found[1]}.png)", text)


def wanted(text: str) -> list[str]:
    """Return the names of the screenshots that a page asks for."""
    return [name for name, _ in _WANTED.findall(text)]


def script() -> Iterator[dict[str, object]]:
    """Yield the steps that draw all pictures of the site."""
    yield from landmark_atlas.script()
    for steps in SCREENSHOTS.values():
        yield from steps


def draw(source: Path, work: Path) -> None:
    """Draw all pictures into the source of the site.

    Parameters
    ----------
    source : Path
        Folder of the pages.
    work : Path
        For the script and what it needs.
    """
    prepare(work)
    (work / "pictures.json").write_text(json.dumps(list(script())), encoding="utf-8")
    run("gp_labeler", "--offscreen", "pictures.json", "--output", str(source.resolve()), folder=work)


def prepare(work: Path) -> None:
    """Make what the pictures show: a synthetic head with its landmarks, and touches of a drawn animal."""
    work.mkdir(parents=True, exist_ok=True)
    run("gp_labeler", "phantom", "-o", "head.nrrd", "--spacing", f"{SPACING_MM}", "--labelled", folder=work)
    run("gp_core.cli", "draw", "--csv", "touches.csv", "--seed", "3", folder=work)


def run(module: str, *words: str, folder: Path) -> None:
    """Run a command of ours in a folder, quietly."""
    command = [sys.executable, "-m", module, *words]
    subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)
