"""The window that a script drives, and what its steps have found so far."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np
from qtpy.QtCore import QCoreApplication, QEvent
from qtpy.QtTest import QTest

from gp_core.disk import make_folder, protect
from gp_core.errors import GpError
from gp_core.landmarks.features import Side, feature, index_of
from gp_core.validation import FloatArray
from gp_labeler.document.animals import labelled_files
from gp_labeler.models.workflow import Active
from gp_labeler.scene.planes import Plane
from gp_labeler.scripting.events import click
from gp_labeler.scripting.prompts import ScriptPrompts
from gp_labeler.views.panels.table import fault_text

if TYPE_CHECKING:
    from gp_labeler.scripting.steps.pose import Estimated
    from gp_labeler.views.scene_view import SceneView
    from gp_labeler.views.slice_view import SliceView

__all__ = ["VIEWS", "WindowDriver", "use_no_display"]

VIEWS = ("3d", *(plane.value for plane in Plane))

_SIZE = (1440, 900)
_PATIENCE_SECONDS = 600.0
_PAUSE_SECONDS = 0.002
_IN_PASSING = ("checking",)
"""Work whose result changes only how things look: nobody waits for it between clicks."""


def use_no_display() -> None:
    """Let Qt draw in memory, on every system, unless the environment asks for something else."""
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")


class WindowDriver:
    """A real window, with someone who answers its questions.

    Parameters
    ----------
    output : Path
        Folder for what is written.
    folder : Path
        What paths of files to read are relative to.
    """

    def __init__(self, output: Path, folder: Path) -> None:
        from gp_labeler.views.application import make_application, make_window

        self.app = make_application()
        self.output, self.folder = output, folder
        self.prompts = ScriptPrompts()
        self.window = make_window(None)
        self.window.prompts = self.prompts
        self.workspace = self.window.workspace
        self.messages: list[tuple[str, str]] = []
        self.faults: list[BaseException] = []
        self.spacing: Any = None  # of the next scan
        self.poses: dict[Side, Estimated] = {}
        self.files: list[Path] = []
        self.workspace.messages.said.connect(self._hear)
        self.window.resize(*_SIZE)
        self.window.show()
        QTest.qWaitForWindowExposed(self.window)
        self.window.activateWindow()
        self.wait_until_idle()

    def _hear(self, text: str, level: str) -> None:
        self.messages.append((text, level))

    # Paths

    def to_read(self, path: str) -> Path:
        """Return a path to read, relative to the script's folder; no step writes over it."""
        file = self.folder / path
        own = {os.path.realpath(written) for written in self.files}
        for read in labelled_files(file) if file.is_dir() else [file]:
            if os.path.realpath(read) not in own:  # a step may read what an earlier one wrote
                protect(read)
        return file

    def saved_specimen(self) -> Path:
        """Return the file of the open specimen; raises `GpError` where it is not saved as it stands."""
        document = self.workspace.document
        if document.path is None or document.dirty:
            raise GpError("the open specimen is not saved", remedy='Save it first: do = "save".')
        return document.path

    def to_write(self, path: str) -> Path:
        """Return a path to write, relative to the output folder, which is made if need be."""
        file = self.output / path
        make_folder(file.parent)
        return file

    def wrote(self, *files: Path) -> str:
        """Remember files that were written, and return their names."""
        self.files += [file for file in files if file not in self.files]
        return ", ".join(file.name for file in files)

    # Waiting

    def wait_until_idle(self, *, in_passing: bool = True, patience: float = _PATIENCE_SECONDS) -> None:
        """Wait until all background work is done and delivered, and all is drawn.

        Parameters
        ----------
        in_passing : bool
            Whether to wait also for what changes only how points look.
        patience : float
            Seconds after which it gives up.
        """
        end = time.monotonic() + patience
        while any(in_passing or not task.key.startswith(_IN_PASSING) for task in self.workspace.jobs.running):
            self.app.processEvents()
            time.sleep(_PAUSE_SECONDS)  # QTest.qWait would keep Python's lock from the work it waits for
            if time.monotonic() > end:
                titles = ", ".join(task.job.title for task in self.workspace.jobs.running)
                raise GpError(f"still not finished after {patience:g} s: {titles}")
        self.app.processEvents()

    # What is there

    @property
    def voxel(self) -> float:
        """Smallest voxel edge, mm.

        Raises
        ------
        GpError
            No scan is open.
        """
        if self.workspace.scan.volume is None:
            raise GpError("no scan is open", remedy="Add an open step before it.")
        return min(self.workspace.scan.volume.spacing)

    def truth(self, side: Side, code: str) -> FloatArray:
        """Return where a feature of the phantom really is, (3,) mm, scan frame."""
        if self.workspace.scan.truth is None:
            raise GpError("the truth is known only for a phantom", landmark=code)
        return self.workspace.scan.truth.side(side)[code]

    def placed(self, side: Side, code: str) -> FloatArray | None:
        """Return where a feature is placed or computed, (3,) mm, scan frame."""
        landmarks = self.workspace.document.landmarks(side)
        return landmarks[code] if feature(code).code in landmarks else None

    def shown_at(self, side: Side, code: str) -> FloatArray | None:
        """Return where a feature is placed, computed or suggested, (3,) mm, scan frame."""
        suggestion = self.workspace.document.landmarks(side).suggested.get(feature(code).code)
        return self.placed(side, code) if suggestion is None else np.array(suggestion.position)

    # The views

    @property
    def scene(self) -> SceneView:
        """The 3D view."""
        return self.window.grid.scene_view

    def view(self, name: str) -> SceneView | SliceView:
        """Return a view by its name, and see to it that it is on the screen."""
        if name not in VIEWS:
            raise GpError(f"view must be one of {', '.join(VIEWS)}, got {name!r}")
        layout = self.workspace.view.state.layout
        if layout not in ("four-up", name) and name not in self.window.grid.shown:
            self.workspace.view.update(layout=name)
            self.app.processEvents()
        return self.scene if name == "3d" else self.window.grid.slice_views[Plane(name)]

    def bring(self, position: FloatArray) -> None:
        """Bring a (3,) scan position into view in every view, as a click on a row does."""
        self.workspace.view.set_crosshair(position)
        self.workspace.view.point_shown.emit(np.asarray(position, dtype=np.float64))

    def choose(self, side: Side, code: str) -> None:
        """Choose a point by a click on its cell in the table.

        Raises
        ------
        GpError
            It cannot be chosen, as CO cannot.
        """
        code = feature(code).code
        self.window.set_step("label")
        table = self.window.steps["label"].table  # type: ignore[attr-defined]
        cell = table.model.index(index_of(code), 1 + list(Side).index(side))
        table.view.scrollTo(cell)
        middle = table.view.visualRect(cell).center()
        click(table.view.viewport(), middle.x(), middle.y())
        if self.workspace.labels.active != Active(side, code):
            raise GpError(f"{code} {side.word} cannot be chosen", landmark=code)

    # Life

    @contextmanager
    def watching(self) -> Iterator[None]:
        """Catch what goes wrong inside Qt's own calls, where nobody else would."""
        before = sys.excepthook

        def note(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
            self.faults.append(error)

        sys.excepthook = note
        try:
            yield
        finally:
            sys.excepthook = before

    def trouble(self, since: int) -> str:
        """Return what went wrong while a step was done, as the window said it; empty where nothing did."""
        errors = [text for text, level in self.messages[since:] if level == "error"]
        asked = [f"the window asks: {text}" for text in self.prompts.unanswered]
        return " ".join([*errors, *asked, *map(fault_text, self.faults)])

    def warnings(self, since: int) -> Sequence[str]:
        """Return what the window warned of since so many messages."""
        return [text for text, level in self.messages[since:] if level == "warning"]

    def close(self) -> None:
        """Close the window and everything it holds; edits that no step saved are dropped."""
        self.prompts.prepare(answers=("Do not save",))
        self.window.close()
        self.workspace.messages.said.disconnect(self._hear, missing_ok=True)
        self.window.deleteLater()
        QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete.value)
