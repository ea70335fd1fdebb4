"""What a change costs: only what it changes is drawn again, and yet nothing on the screen is ever stale."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from panel_cases import ATLAS, PANEL_WIDTH, actions_of, deliver, in_scan, place
from qtpy.QtCore import QEvent, QModelIndex, QObject, QRect, QSize
from qtpy.QtGui import QColor, QImage, QPixmap, QRegion
from qtpy.QtWidgets import QApplication, QDialog, QWidget
from window_cases import image_bytes

from gp_core import PROBE
from gp_core.atlas.sampling import draw_animal
from gp_core.landmarks.features import CODES, Side, index_of
from gp_labeler.document.edits import MarkUnseen, PlacePoint, SwapSides
from gp_labeler.document.state import How, Provenance, SpecimenState
from gp_labeler.document.touches import TouchHow
from gp_labeler.jobs.runner import QueueDispatcher
from gp_labeler.models.workflow import Active
from gp_labeler.models.workspace import Workspace
from gp_labeler.views import feature_picture as pictures
from gp_labeler.views.feature_picture import FeaturePicture, feature_picture
from gp_labeler.views.panels.label.landmark_table_model import LandmarkTableModel
from gp_labeler.views.panels.label.panel import LabelPanel
from gp_labeler.views.panels.pose.touch_table_model import RESIDUAL, TouchTableModel
from gp_labeler.views.pictures import grab
from gp_labeler.views.theme import DARK, LIGHT, Theme, apply_theme, theme_of

pytestmark = pytest.mark.usefixtures("qapp")  # without one, Qt aborts at the first picture

LEFT, RIGHT = Side.LEFT, Side.RIGHT


@pytest.fixture
def panel(workspace: Workspace, qtbot) -> LabelPanel:
    panel = LabelPanel(workspace, actions_of(workspace, qtbot))
    apply_theme(panel, DARK)
    qtbot.addWidget(panel)
    panel.resize(PANEL_WIDTH, 698)
    panel.show()
    qtbot.waitExposed(panel)
    wait_until_idle()
    return panel


def wait_until_idle() -> None:
    for _ in range(6):  # layouts inside layouts take a turn each
        QApplication.processEvents()


class Painted(QObject):
    """What of a widget was painted since it was last asked."""

    def __init__(self, widget: QWidget) -> None:
        super().__init__(widget)
        self._region = QRegion()
        widget.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:  # noqa: N802 - Qt's name
        if event.type() is QEvent.Type.Paint:
            self._region += event.region()
        return False

    def taken(self) -> QRegion:
        wait_until_idle()
        region, self._region = self._region, QRegion()
        return region


def pixels(image: QImage | QPixmap) -> np.ndarray:
    """Return the (height, width, 4) bytes of a picture."""
    plain = (image.toImage() if isinstance(image, QPixmap) else image).convertToFormat(
        QImage.Format.Format_ARGB32_Premultiplied
    )
    return image_bytes(plain).reshape(plain.height(), -1, 4).astype(int)


def is_same(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether nobody can tell two pictures apart."""
    return a.shape == b.shape and int(np.abs(a - b).max()) < 24


def on_screen(widget: QWidget) -> np.ndarray:
    """Return what stands on the screen, unlike `grab`, which draws all again."""
    return pixels(widget.screen().grabWindow(widget.winId()))


def picture_of(code: str, side: Side, size: QSize, theme: Theme, ratio: float = 1.0) -> np.ndarray:
    return pixels(feature_picture(code, side, size, theme, ratio=ratio))


def edits(workspace: Workspace) -> Iterator[str]:
    """Do all sorts of things one after another, and name each when it is done."""
    document, labels = workspace.document, workspace.labels
    place(workspace, "CA", "RWP", "OS", "RWA")
    yield "placed, with ghosts of all others"
    document.do(PlacePoint(RIGHT, "MH", tuple(in_scan("MH", RIGHT)), Provenance(How.MESH)))
    yield "placed on the side that is not worked on"
    place(workspace, "IN", "FPP")
    labels.nudge((2.5, 0, 0), side=LEFT, code="FPP")
    yield "one is doubtful"
    labels.lock(side=LEFT, code="CA")
    yield "locked"
    document.undo()
    document.undo()
    yield "undone"
    document.do(SwapSides())
    yield "sides swapped"
    document.do(MarkUnseen(LEFT, "CC", Provenance(How.UNSEEN)))
    labels.set_active(Active(RIGHT, "IN"))
    yield "another active"
    labels.expect(None)
    yield "without an atlas"
    workspace.document.load(SpecimenState())
    yield "another specimen"


def test_one_point_draws_the_cell_of_that_point_alone(workspace, panel):
    view = panel.table.view
    place(workspace, "CA", "RWP", "OS")  # from here on the others have ghosts
    painted = Painted(view.viewport())
    painted.taken()
    workspace.document.do(PlacePoint(RIGHT, "MH", tuple(in_scan("MH", RIGHT)), Provenance(How.MESH)))
    cell = view.visualRect(panel.table.model.index(index_of("MH"), 2))
    assert painted.taken() == QRegion(cell)


def test_a_change_of_the_active_point_draws_two_rows(workspace, panel):
    view = panel.table.view
    workspace.labels.set_active(Active(LEFT, "OS"))
    painted = Painted(view.viewport())
    painted.taken()
    workspace.labels.set_active(Active(LEFT, "MH"))
    region, port = painted.taken(), view.viewport().rect()
    lines = (QRect(0, y, port.width(), 1) for y in range(port.height()))
    rows = {view.rowAt(line.y()) for line in lines if region.intersects(line)}
    assert rows == {index_of("OS"), index_of("MH")}


def test_what_changes_nothing_draws_nothing(workspace, panel):
    painted = Painted(panel.table.view.viewport())
    painted.taken()
    workspace.labels.problems_changed.emit()
    workspace.labels.ghosts_changed.emit()
    assert painted.taken().isEmpty()


def test_problems_are_announced_where_there_are_any_and_judging_is_always(workspace):
    told: list[str] = []
    workspace.labels.checked.connect(lambda: told.append("judged"))
    workspace.labels.problems_changed.connect(lambda: told.append("problems"))
    place(workspace, "CA", "RWP", "OS", "RWA", "FPP", "MH")
    deliver(workspace)
    assert set(told) == {"judged"}
    workspace.labels.nudge((2.5, 0, 0), side=LEFT, code="FPP")
    deliver(workspace)
    assert told[-2:] == ["judged", "problems"]


def test_what_was_drawn_bit_by_bit_is_what_drawing_all_again_gives(workspace, panel):
    for what in edits(workspace):
        deliver(workspace)
        wait_until_idle()
        assert is_same(on_screen(panel), pixels(panel.grab())), what


def test_the_table_is_never_stale(workspace, qtbot):
    model = LandmarkTableModel(workspace)
    for what in edits(workspace):
        deliver(workspace)  # until then, one made now may know of problems that nobody told of
        fresh = LandmarkTableModel(workspace)
        for row in range(len(CODES)):
            cells = [[m.itemData(m.index(row, column)) for column in range(3)] for m in (model, fresh)]
            assert cells[0] == cells[1], (what, CODES[row])


@pytest.mark.parametrize("code", ["RWA", "MN", "IN"])
def test_a_picture_on_a_ground_that_was_kept_is_the_same(code):
    """Grounds are shared by features, not by sides, sizes, themes or screens."""
    kinds = [
        (side, size, theme, ratio)
        for side in Side
        for size in (QSize(200, 120), QSize(120, 200))
        for theme in (DARK, LIGHT)
        for ratio in (1.0, 2.0)
    ]
    for kind in kinds:  # letters of a size differ a little the first time
        picture_of(code, *kind)
    pictures.ground_picture.cache_clear()
    first = [picture_of(code, *kind) for kind in kinds]
    again = [picture_of(code, *kind) for kind in reversed(kinds)]
    assert all(is_same(a, b) for a, b in zip(first, again[::-1], strict=True))
    assert not any(is_same(a, b) for n, a in enumerate(first) for b in first[n + 1 :])


def test_the_picture_follows_feature_side_size_and_theme(qtbot):
    picture = FeaturePicture()
    apply_theme(picture, DARK)
    qtbot.addWidget(picture)
    picture.resize(200, 120)
    picture.show()
    qtbot.waitExposed(picture)

    def shows(code: str, side: Side, theme: Theme) -> bool:
        wait_until_idle()
        inside = (slice(8, -8), slice(8, -8))  # of the round corners
        wanted = picture_of(code, side, picture.size(), theme, picture.devicePixelRatioF())
        return is_same(on_screen(picture)[inside], wanted[inside])

    picture.show_feature("RWA", LEFT)
    qtbot.waitUntil(lambda: shows("RWA", LEFT, DARK))
    picture.show_feature("RWA", RIGHT)
    qtbot.waitUntil(lambda: shows("RWA", RIGHT, DARK))
    picture.show_feature("IN", RIGHT)
    qtbot.waitUntil(lambda: shows("IN", RIGHT, DARK))
    apply_theme(picture, LIGHT)
    qtbot.waitUntil(lambda: shows("IN", RIGHT, LIGHT))
    picture.resize(160, 160)
    qtbot.waitUntil(lambda: shows("IN", RIGHT, LIGHT))


def test_what_is_grabbed_has_the_picture_that_is_drawn_a_moment_later(qtbot):
    picture = FeaturePicture()
    apply_theme(picture, DARK)
    qtbot.addWidget(picture)
    picture.resize(200, 120)
    picture.show_feature("RWA", LEFT)
    picture.show()
    qtbot.waitExposed(picture)
    for size in (QSize(200, 120), QSize(160, 160)):
        picture.resize(size)
        grabbed = pixels(grab(picture))
        wanted = picture_of("RWA", LEFT, size, DARK, picture.devicePixelRatioF())
        assert is_same(grabbed[8:-8, 8:-8], wanted[8:-8, 8:-8])  # inside the round corners


@pytest.mark.parametrize("side", list(Side))
def test_a_shared_ground_is_the_one_that_each_feature_would_draw(side):
    size = QSize(200, 120)
    for code in CODES:  # letters differ a little the first time
        picture_of(code, side, size, DARK)
    shared = {code: picture_of(code, side, size, DARK) for code in CODES}
    for code in CODES:
        pictures.ground_picture.cache_clear()
        assert is_same(shared[code], picture_of(code, side, size, DARK)), code


@pytest.mark.parametrize("theme", [DARK, LIGHT])
def test_a_ground_has_the_colours_of_its_theme(theme):
    wanted = QColor(theme.scene.bottom)
    for _ in range(2):
        shown = picture_of("RWA", LEFT, QSize(200, 120), theme)[-2, 100, :3]
        np.testing.assert_allclose(shown, (wanted.blue(), wanted.green(), wanted.red()), atol=8)


def test_a_touch_repaints_its_row_and_the_residuals_that_changed() -> None:
    animal = draw_animal(ATLAS, rng=np.random.default_rng(3)).side("L")
    workspace = Workspace(None, QueueDispatcher(), atlas=ATLAS)
    for code in (*PROBE, "ZL"):
        workspace.pose.record(animal[code], TouchHow.TYPED, name=code)
    model, painted = TouchTableModel(workspace, lambda _: None), set()

    def note(first: QModelIndex, last: QModelIndex) -> None:
        columns = range(first.column(), last.column() + 1)
        painted.update((row, c) for row in range(first.row(), last.row() + 1) for c in columns)

    model.dataChanged.connect(note)
    for far in (0.02, 6.0, 0.0):  # within the scale of the bars, beyond it, and back
        before, largest = model.rows, model.largest
        painted.clear()
        workspace.pose.record(animal["ZL"] + far, TouchHow.TYPED, name="ZL")
        model.refresh()
        for n, (new, old) in enumerate(zip(model.rows, before, strict=True)):
            if new.name == "ZL":
                assert {(n, column) for column in range(model.columnCount())} <= painted
            if new.residual != old.residual or (model.largest != largest and new.residual is not None):
                assert (n, RESIDUAL) in painted
            if replace(new, residual=old.residual) == old:
                assert not {(n, column) for column in range(model.columnCount())} & painted - {(n, RESIDUAL)}
        assert far != 6.0 or model.largest != largest
    workspace.close(discard=True)


def test_a_dialog_has_the_theme_of_the_window_that_opened_it(qtbot) -> None:
    window = QWidget()
    qtbot.addWidget(window)
    dialog = QDialog(window)
    inside = QWidget(QWidget(dialog))
    for theme in (LIGHT, DARK):
        apply_theme(window, theme)
        assert theme_of(inside) is theme_of(dialog) is theme_of(window) is theme
