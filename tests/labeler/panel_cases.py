"""Shared by the tests of the panels: a workspace with a small scan, points of the atlas placed in it."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
from qtpy.QtGui import QFontMetrics
from qtpy.QtWidgets import QAbstractButton, QApplication, QCheckBox, QLabel, QWidget

from gp_core import Atlas
from gp_core.landmarks.features import Side
from gp_labeler.imaging.volume import Volume
from gp_labeler.jobs.runner import QueueDispatcher
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.commands import Commands
from gp_labeler.views.panels.action_button import Actions

ATLAS = Atlas.published()
PANEL_WIDTH = 472
"""What a window of 1280 x 800 gives its panels, logical pixels."""


def grey_volume(seed: int = 0) -> Volume:
    """Noise around two grey values, as air and bone have; 60 mm wide."""
    rng = np.random.default_rng(seed)
    array = rng.normal(40, 12, (40, 40, 40))
    array[12:28, 12:28, 12:28] = rng.normal(180, 15, (16, 16, 16))
    return Volume.from_parts(array.clip(0, 255).astype(np.uint8), (1.5,) * 3, (-20, -40, -30), name="GP-014")


def workspace_with_scan(**options) -> Workspace:
    """Make a workspace on that scan, with the atlas, whose jobs wait to be delivered."""
    workspace = Workspace(None, QueueDispatcher(), atlas=ATLAS, author="tester", **options)
    volume = grey_volume()
    workspace.document.attach_volume(volume)
    workspace.scan.opened.emit(volume)
    return workspace


def deliver(workspace: Workspace) -> None:
    """Let the jobs of a workspace come to their end."""
    dispatcher = workspace.jobs.dispatcher
    assert isinstance(dispatcher, QueueDispatcher)
    dispatcher.deliver_until_idle(workspace.jobs, timeout=180)  # compiling may be part of it


def in_scan(code: str, side: Side = Side.LEFT) -> np.ndarray:
    """Lay a mean feature of the atlas into the scan: its axes are anterior, outwards and superior."""
    ahead, out, up = ATLAS[code]
    return np.array([(out + 5.0) * (1 if side is Side.LEFT else -1), -ahead - 10.0, up])


def place(workspace: Workspace, *codes: str, side: Side = Side.LEFT) -> None:
    """Place features where the atlas has them."""
    for code in codes:
        workspace.labels.place(in_scan(code, side), side=side, code=code)


def actions_of(workspace: Workspace, qtbot, asked: list[str] | None = None) -> Actions:
    """Make the window's actions, for panels that are tried alone; what needs the window goes to `asked`."""
    calls = [] if asked is None else asked
    window = QWidget()
    qtbot.addWidget(window)
    vars(qtbot).setdefault("windows", []).append(window)  # which keeps no widget alive by itself
    return Commands(workspace, lambda id: partial(calls.append, id), window, window).actions


def cut_words(root: QWidget) -> Iterator[str]:
    """Yield what cannot be read in full: words of visible labels and buttons that do not fit."""
    for _ in range(3):  # layouts inside layouts take a turn each
        QApplication.processEvents()
    for label in root.findChildren(QLabel):
        if label.isVisible() and label.text() and label.pixmap().isNull():
            need = label.heightForWidth(label.width()) if label.wordWrap() else label.sizeHint().height()
            longest = max(label.text().split(), key=len) if label.wordWrap() else label.text()
            wide = QFontMetrics(label.font()).horizontalAdvance(longest)
            if label.height() < need or label.contentsRect().width() < wide:
                yield f"{label.text()!r}: {label.size()} needs {wide} x {need}"
    for button in root.findChildren(QAbstractButton):
        if button.isVisible() and button.text() and button.objectName() != "recent":
            inside = 20 if isinstance(button, QCheckBox) else 6
            if button.width() < QFontMetrics(button.font()).horizontalAdvance(button.text()) + inside:
                yield f"button {button.text()!r} is {button.width()} wide"
