"""Count what a user does for all 37 landmarks of a head, with and without first labels, and the error left.

Run from the top of a checkout: ``python benchmarks/first_labels.py [--heads 201 202 203] [--labelled 5]``. It
needs no display: the real window is driven by real clicks, wheel notches and keys, and nothing else.

The labelled scans are synthetic heads with the seeds 1 to 5, the new heads those of other seeds. The
simulated user sees each feature where it truly is, and knows where to look:

- *without*, the user takes the features in the order that the window proposes. From the third on, ghosts say
  where to look. In the view in which the feature is best seen (axial for what is best seen in 3D), the user
  turns the wheel to the feature's slice, zooms in until a voxel is four pixels wide, and clicks.
- *one by one*, the user asks for suggestions. Each that is off by more than a voxel is corrected in the same
  way, with Ctrl held for the click; the others are confirmed by Enter.
- *in pages*, the user checks the same suggestions in pages of close views, and corrects there what is off by
  more than a voxel: a click with Ctrl held, in a picture that goes through a place within a voxel of the
  feature, or after a turn of the wheel. Where the feature lies beside both pictures, a click marks the
  suggestion. Enter confirms the others. What is left, also what is doubtful and right, comes up one by one.

Each key, click and notch of the wheel is an action. A stroke is a turn of the wheel without a pause. Memory
is that of the window and of its process for registration, pages that both hold counted once (Linux).
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT)]

import numpy as np  # noqa: E402

from gp_core.errors import GpError  # noqa: E402
from gp_core.io import load_specimens  # noqa: E402
from gp_core.landmarks.features import FEATURES, Side, feature  # noqa: E402
from gp_labeler.scene.planes import Plane  # noqa: E402

if __name__ == "__main__":  # the registration process imports this file, too: no window is part of its memory
    from gp_labeler.document.state import How
    from gp_labeler.scripting.events import click, press_keys, turn_wheel
    from gp_labeler.scripting.page_correction import pointing_at
    from gp_labeler.scripting.steps.first_labels import PATIENCE_SECONDS
    from gp_labeler.scripting.steps.scan import Open
    from gp_labeler.scripting.window_driver import WindowDriver
    from gp_labeler.views.panels.label.close_view_tile import CloseViewTile
    from gp_labeler.views.panels.label.suggest_row import SuggestRow
    from gp_labeler.views.panels.label.suggestion_page_dialog import SuggestionPageDialog
    from gp_labeler.views.window_commands.landmarks import AS_THE_FILE, FOLDER

_SLICES = tuple(plane.value for plane in Plane)
_VOXEL_PIXELS = 4.0
_ZOOM_PER_NOTCH = 1.15
_MOST, _TRIES = 200, 3
CODES = [row.code for row in FEATURES if not row.computed]


@dataclass
class Hand:
    """Mouse and keys of the simulated user, which count what is done."""

    driver: WindowDriver
    done: Counter[str] = field(default_factory=Counter)

    def key(self, keys: str) -> None:
        """Press a key in the view under the pointer."""
        view = self.driver.view("axial")
        view.setFocus()
        press_keys(view, keys)
        self.rest("keys")

    def click(self, widget, x: float, y: float, *, ctrl: bool = False) -> None:
        """Click with the left button."""
        click(widget, x, y, ctrl=ctrl)
        self.rest("clicks")

    def wheel(self, widget, x: float, y: float, notches: int, *, ctrl: bool = False) -> None:
        """Turn the wheel; every notch counts, and every stroke."""
        if notches:
            turn_wheel(widget, x, y, notches, ctrl=ctrl)
            self.rest("notches", abs(notches))
            self.done["strokes"] += 1

    def rest(self, kind: str, n: int = 1) -> None:
        """Count what was done, and wait until it is drawn."""
        self.done[kind] += n
        self.driver.wait_until_idle(in_passing=False)

    def place(self, code: str, position: np.ndarray, *, replace: bool) -> None:
        """Go to a (3,) scan position in the view of the feature, zoom in, and click."""
        name = feature(code).view if feature(code).view in _SLICES else "axial"
        view = self.driver.view(name)
        middle = view.width() / 2, view.height() / 2
        self.wheel(view, *middle, self._slices_to(name, position))
        x, y = view.pixel_at(position)
        if not (2 <= x < view.width() - 2 and 2 <= y < view.height() - 2):
            self.key("R")  # the whole head
            x, y = view.pixel_at(position)
        across = self.driver.voxel / _VOXEL_PIXELS / (view.across_mm / min(view.width(), view.height()))
        zoom = max(0, int(np.ceil(-np.log(across) / np.log(_ZOOM_PER_NOTCH))))
        self.wheel(view, x, y, zoom, ctrl=True)
        self.click(view, *view.pixel_at(position), ctrl=replace)

    def _slices_to(self, name: str, position: np.ndarray) -> int:
        view = self.driver.window.grid.slice_views[Plane(name)]
        source, shown = view.source, view.slice_plane
        here = source.snap(shown, shown.position_of(self.driver.workspace.view.crosshair))
        return round((source.snap(shown, shown.position_of(position)) - here) / source.step(shown))


@dataclass
class Labelled:
    """What a head cost, and how far its labels lie from the truth, mm."""

    done: Counter[str]
    errors: np.ndarray
    n_confirmed: int = 0
    suggested: np.ndarray | None = None
    cpu: float = 0.0
    memory: str = ""


def open_head(driver: WindowDriver, head: Path) -> Hand:
    """Open a fresh head in the step Label."""
    Open(path=str(head), discard=True).run(driver)
    (driver.workspace.scan.truth,) = load_specimens(head.parent.glob(f"{head.stem}_[LR].mrk.json"))
    driver.window.set_step("label")
    driver.wait_until_idle()
    return Hand(driver)


def errors_of(driver: WindowDriver) -> np.ndarray:
    """Return how far each label lies from the truth, mm; both labels of IN are one."""
    off = []
    for side in Side:
        for code in CODES:
            if side is Side.RIGHT and code == "IN":
                continue
            there = driver.placed(side, code)
            if there is None:
                raise GpError(f"{code} {side.word} was not labelled")
            off.append(float(np.linalg.norm(there - driver.truth(side, code))))
    return np.array(off)


def without(driver: WindowDriver, head: Path) -> Labelled:
    """Label a head as it was before there were first labels."""
    hand = open_head(driver, head)
    for _ in range(_MOST):
        active = driver.workspace.labels.active
        if active.code is None:
            break
        hand.place(active.code, driver.truth(active.side, active.code), replace=False)
    return Labelled(hand.done, errors_of(driver))


def suggest(hand: Hand, library: Path) -> tuple[float, str]:
    """Ask for first labels; return CPU seconds, and memory in words."""
    driver = hand.driver
    begun, before = cpu_seconds(), resident_mb()
    memory = PeakMemory()
    driver.prompts.prepare(files=[library], answers=(FOLDER, AS_THE_FILE))
    button = driver.window.findChild(SuggestRow).button
    click(button, button.width() / 2, button.height() / 2)
    hand.done["clicks"] += 4  # this one, the folder, its name, and which side is left
    driver.wait_until_idle(patience=PATIENCE_SECONDS)
    if driver.workspace.first_labels.proposal is None:
        raise GpError(driver.trouble(0) or "nothing was suggested")
    return cpu_seconds() - begun, f"{before:.0f} MB before, {memory.stop():.0f} at most"


class PeakMemory:
    """Watches the resident memory of this process and its children."""

    def __init__(self) -> None:
        self._peak, self._over = 0.0, threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()

    def _watch(self) -> None:
        while not self._over.wait(0.5):
            self._peak = max(self._peak, resident_mb())

    def stop(self) -> float:
        """Return the most there was, MB."""
        self._over.set()
        self._thread.join()
        return self._peak


def resident_mb() -> float:
    """Return the resident memory of this process and its children, MB; shared pages count once (Linux)."""
    pids, total = [os.getpid()], 0
    for pid in pids:
        try:
            rollup = Path(f"/proc/{pid}/smaps_rollup").read_text()
            total += next(int(line.split()[1]) for line in rollup.splitlines() if line.startswith("Pss:"))
            for task in Path(f"/proc/{pid}/task").iterdir():
                pids += map(int, (task / "children").read_text().split())
        except (OSError, StopIteration):  # it has just ended
            continue
    return total / 1024


def cpu_seconds() -> float:
    """Return the CPU seconds of this process and of those that it has ended."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in used)


def one_by_one(hand: Hand) -> int:
    """Confirm or correct all suggestions as they come up; return how many were confirmed."""
    driver, n_confirmed = hand.driver, 0
    for _ in range(_MOST):
        active = driver.workspace.labels.active
        if active.code is None or not any(
            driver.workspace.document.landmarks(side).suggested for side in Side
        ):
            break
        if is_within_a_voxel(driver, active.side, active.code):
            hand.key("Return")
            n_confirmed += driver.placed(active.side, active.code) is not None
        else:
            hand.place(active.code, driver.truth(active.side, active.code), replace=True)
    return n_confirmed


def in_pages(hand: Hand) -> int:
    """Check all suggestions in pages, then what is left one by one; return how many the pages confirmed."""
    driver, pages = hand.driver, hand.driver.workspace.pages
    button = driver.window.findChild(SuggestRow).check
    hand.click(button, button.width() / 2, button.height() / 2)
    (dialog,) = driver.window.findChildren(SuggestionPageDialog)
    for _ in range(pages.n_pages):
        driver.wait_until_idle(in_passing=False)
        for tile in dialog.shown_tiles:
            dialog.area.ensureWidgetVisible(tile)
            driver.app.processEvents()
            if not is_within_a_voxel(driver, tile.entry.side, tile.entry.code):
                correct(hand, tile)
        press_keys(dialog.shown_tiles[0], "Return")
        hand.rest("keys")
    driver.window.activateWindow()  # as a desktop does once the dialog has closed
    driver.wait_until_idle()
    marks = driver.workspace.document.state.landmarks.values()
    hows = Counter(mark.provenance.how for mark in marks if mark.position is not None and mark.provenance)
    hand.done["on a page"] = hows[How.CORRECTED]
    one_by_one(hand)
    return hows[How.PAGE]


def correct(hand: Hand, tile: CloseViewTile) -> None:
    """Point at a feature in its close view until it is within a voxel, or mark its suggestion."""
    entry, driver = tile.entry, hand.driver
    aim = driver.truth(entry.side, entry.code)
    for _ in range(_TRIES):
        how = pointing_at(driver.workspace.pages, tile.entry, aim, driver.voxel)
        if how is None:
            break
        pixel = tile.pixel_of_place(how.number, how.across, how.down)
        hand.wheel(tile, *pixel, how.n_notches)
        hand.click(tile, *pixel, ctrl=True)
        placed = driver.placed(entry.side, entry.code)
        if placed is not None and np.linalg.norm(placed - aim) <= driver.voxel:
            return
    if tile.entry.is_offered:
        hand.click(tile, tile.width() / 2, tile.height() / 2)


def is_within_a_voxel(driver: WindowDriver, side: Side, code: str) -> bool:
    """Whether a feature is suggested, and that no farther than a voxel from where it is."""
    found = driver.workspace.document.landmarks(side).suggested.get(code)
    truth = driver.truth(side, code)
    return found is not None and np.linalg.norm(np.array(found.position) - truth) <= driver.voxel


def with_first_labels(driver: WindowDriver, head: Path, library: Path) -> tuple[Labelled, Labelled]:
    """Label a head that has first labels, one by one and then, from the same suggestions, in pages."""
    hand = open_head(driver, head)
    cpu, memory = suggest(hand, library)
    document, before = driver.workspace.document, Counter(hand.done)
    suggested_alone = document.state
    suggested = np.array(
        [
            np.linalg.norm(np.array(found.position) - driver.truth(side, code))
            for side in Side
            for code, found in document.landmarks(side).suggested.items()
            if not (side is Side.RIGHT and code == "IN")
        ]
    )
    n_confirmed = one_by_one(hand)
    single = Labelled(hand.done, errors_of(driver), n_confirmed, suggested, cpu, memory)
    while document.state != suggested_alone and document.undo():
        pass
    driver.wait_until_idle()
    hand = Hand(driver, before)
    n_confirmed = in_pages(hand)
    return single, Labelled(hand.done, errors_of(driver), n_confirmed, suggested, cpu, memory)


def tell(name: str, found: Labelled) -> None:
    """Print a row."""
    kinds = [found.done[kind] for kind in ("keys", "clicks", "notches", "strokes")]
    middle, most = np.percentile(found.errors, [50, 90])
    counts = "".join(f"{n:>9}" for n in (*kinds, every(found), presses(found)))
    print(f"{name:<16}{counts}{middle:>9.3f}{most:>7.3f}{found.errors.max():>7.2f}", flush=True)


def every(found: Labelled) -> int:
    """Return the number of actions, each notch of the wheel one."""
    return sum(found.done[kind] for kind in ("keys", "clicks", "notches"))


def presses(found: Labelled) -> int:
    """Return the number of actions, each stroke of the wheel one, however far it goes."""
    return sum(found.done[kind] for kind in ("keys", "clicks", "strokes"))


def labelled_heads(folder: Path, seeds: Iterable[int], spacing: float) -> list[Path]:
    """Return labelled heads, made by ``gp-labeler phantom --labelled`` where they are not there yet."""
    paths = []
    for seed in seeds:
        paths.append(folder / f"phantom-{seed}.nrrd")
        if not paths[-1].exists():
            words = ["phantom", "--seed", seed, "--labelled", "--spacing", spacing, "-o", paths[-1]]
            subprocess.run([sys.executable, "-m", "gp_labeler", *map(str, words)], check=True)
    return paths


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--heads", type=int, nargs="+", default=[201, 202, 203], metavar="SEED")
    parser.add_argument("--labelled", type=int, default=5, metavar="N")
    parser.add_argument("--spacing", type=float, default=0.2)
    parser.add_argument(
        "--folder", type=Path, help="where scans and templates are kept; thrown away by default"
    )
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as thrown_away:
        folder = options.folder or Path(thrown_away)
        os.environ["XDG_CACHE_HOME"] = str(folder / "cache")
        library = folder / f"labelled-{options.labelled}-{options.spacing:g}"
        labelled_heads(library, range(1, options.labelled + 1), options.spacing)
        heads = labelled_heads(folder / f"new-{options.spacing:g}", options.heads, options.spacing)
        driver = WindowDriver(folder, folder)
        print(
            f"{'':<16}{'keys':>9}{'clicks':>9}{'notches':>9}{'strokes':>9}{'all':>9}{'presses':>9}"
            f"{'median':>9}{'90 %':>7}{'most':>7}"
        )
        for head in heads:
            report(driver, head, library)
        driver.close()


def report(driver: WindowDriver, head: Path, library: Path) -> None:
    """Print the rows of one head."""
    started, name = time.monotonic(), head.stem.removeprefix("phantom-")
    bare = without(driver, head)
    tell(f"{name} without", bare)
    single, paged = with_first_labels(driver, head, library)
    assert single.suggested is not None
    within = int((single.suggested <= driver.voxel).sum())
    print(
        f"{'':<16}{within} of {len(single.suggested)} suggestions within a voxel (median "
        f"{np.median(single.suggested):.3f} mm, most {single.suggested.max():.2f}); suggesting took "
        f"{single.cpu:.0f} CPU s, {single.memory}; {time.monotonic() - started:.0f} s"
    )
    for how, found in (("one by one", single), ("in pages", paged)):
        tell(f"{name} {how}", found)
        print(
            f"{'':<16}{found.n_confirmed} confirmed, {found.done['on a page']} corrected on a page; all "
            f"actions {every(found) / every(bare):.2f} of those without, presses "
            f"{presses(found) / presses(bare):.2f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
