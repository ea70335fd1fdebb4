"""The window as a whole: pages, files, what is asked, what is remembered, and that it always answers."""

from __future__ import annotations

import ast
import gc
import os
import subprocess
import sys
import threading
import time
import weakref
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from qtpy.QtCore import QEvent, QObject, Qt, QTimer
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QApplication, QMenu, QWidget
from window_cases import MIDDLE, Answers, ball_volume, close, one_turn, wait_until_idle

from gp_core.landmarks.features import Side
from gp_labeler.commands.actions import ACTIONS
from gp_labeler.document.recovery import find_recoveries
from gp_labeler.imaging.volume import Volume
from gp_labeler.scene.planes import Plane
from gp_labeler.views.application import make_window as make_plain
from gp_labeler.views.panels.label.landmark_table import LandmarkTable
from gp_labeler.views.questions import offer_recoveries
from gp_labeler.views.shortcuts_sheet import ShortcutsSheet
from gp_labeler.views.slice_view import SliceView
from gp_labeler.views.top_bar import TopBar

pytestmark = pytest.mark.machine


def test_a_long_message_can_be_read_whole_and_then_makes_room_again(window, qtbot) -> None:
    status, words = window.status, "the file is truncated after three gigabytes and cannot be read. " * 3
    height = status.height()
    status.say(f"/some/where/far/away/in_a_folder_of_the_lab/head_2026.nrrd: {words}", "error")
    qtbot.waitUntil(lambda: not status.where.isVisible() and status.height() > height)
    text = status.next_click
    assert text.width() > 0.7 * status.width()
    assert height < status.height() >= text.heightForWidth(text.width())
    window.commands.run("file.demo")
    qtbot.waitUntil(status.work.bar.isVisible)
    status.work.stop.click()
    wait_until_idle(qtbot, window)
    status.say("Saved", "info")
    qtbot.waitUntil(lambda: status.where.isVisible() and status.height() == height)


def test_the_first_page_gives_way_to_the_scan(qtbot, make_window, ball) -> None:
    window = make_window()
    assert window.pages.currentIndex() == 0
    assert "Open" in window.status.next_click.text()
    window.workspace.scan.begin(ball)
    wait_until_idle(qtbot, window)
    assert window.pages.currentIndex() == 1
    assert window.windowTitle().startswith("ball")
    assert window.rail.step == "label"
    assert window.status.next_click.text() == "Click on bone or a slice to place CA left"
    assert "bone above" in window.grid.frames["3d"].header.where.text()
    assert window.grid.frames["axial"].header.where.text().startswith("S 30")


def test_views_show_what_is_there(window) -> None:
    scene, axial = window.grid.scene_view, window.grid.slice_views
    picture = window.grab().toImage()
    assert (picture.width(), picture.height()) == (1100, 760)
    for view in (scene, *axial.values()):
        colours = {view.grab().toImage().pixel(x, y) for x in range(0, 200, 10) for y in range(0, 200, 10)}
        assert len(colours) > 3
    x, y = scene.pixel_at(MIDDLE)
    bone, background = (scene.grab().toImage().pixelColor(*at) for at in ((int(x) + 20, int(y) + 20), (3, 3)))
    assert bone.lightness() > background.lightness() + 60


def test_saved_specimens_open_again(qtbot, make_window, tmp_path) -> None:
    import SimpleITK as sitk  # noqa: N813

    volume = ball_volume()
    image = sitk.GetImageFromArray(volume.array)
    image.SetSpacing(volume.spacing)
    image.SetOrigin(volume.origin.tolist())
    sitk.WriteImage(image, str(tmp_path / "ball.nrrd"))
    window = make_window()
    window.open_path(tmp_path / "ball.nrrd")
    wait_until_idle(qtbot, window)
    window.workspace.labels.place(MIDDLE, side=Side.LEFT, code="CA")
    assert window.isWindowModified()
    window.prompts.files = [tmp_path / "one"]
    window.commands.run("file.save")
    saved = tmp_path / "one.gpspecimen.json"
    assert saved.exists()
    assert not window.isWindowModified()
    close(window)
    again = make_window()
    assert saved.resolve() in again.workspace.recent.all()
    again.open_path(saved)
    wait_until_idle(qtbot, again)
    np.testing.assert_array_equal(again.workspace.document.landmarks("L")["CA"], MIDDLE)
    assert again.workspace.scan.volume.size == volume.size
    assert again.workspace.bone.surfaces


def test_a_file_that_is_no_scan_is_said_in_words(qtbot, make_window, tmp_path) -> None:
    (tmp_path / "notes.nrrd").write_text("milk, bread")
    window = make_window()
    window.open_path(tmp_path / "notes.nrrd")
    wait_until_idle(qtbot, window)
    assert "notes.nrrd" in window.status.next_click.text()
    assert window.pages.currentIndex() == 0


def test_a_scan_without_a_voxel_size_is_asked_about(qtbot, make_window, tmp_path) -> None:
    import tifffile

    tifffile.imwrite(tmp_path / "ball.tif", ball_volume().array.astype(np.uint16))
    window = make_window()
    window.prompts.answers = ["Keep the order of the slices", "Go on"]
    window.open_path(tmp_path / "ball.tif")
    wait_until_idle(qtbot, window)
    assert window.prompts.asked
    if window.workspace.scan.volume is not None:
        assert window.workspace.document.state.import_choices


@pytest.mark.parametrize("answer", ["", "Save", "Do not save"])
def test_closing_with_unsaved_edits_asks(window, tmp_path, answer) -> None:
    window.workspace.labels.place(MIDDLE, side=Side.LEFT, code="CA")
    window.prompts.answers = [answer]
    window.prompts.files = [tmp_path / "saved"]
    assert window.close() is (answer != "")
    assert window.prompts.asked == ["Not saved"]
    assert (tmp_path / "saved.gpspecimen.json").exists() is (answer == "Save")
    if answer == "Do not save":
        assert find_recoveries(tmp_path / "state") == ()


def test_edits_that_are_not_wanted_are_not_offered_again(qtbot, window, tmp_path) -> None:
    window.workspace.labels.place(MIDDLE, side=Side.LEFT, code="CA")
    (tmp_path / "x.gpspecimen.json").write_text("{}")
    window.prompts.answers = ["Do not save"]
    window.open_path(tmp_path / "x.gpspecimen.json")  # no specimen: the edits are still there
    assert "CA" in window.workspace.document.landmarks("L")
    window.workspace.scan.begin(ball_volume())
    wait_until_idle(qtbot, window)
    assert find_recoveries(tmp_path / "state") == ()


def test_what_a_killed_program_left_is_offered(qtbot, window, make_window, tmp_path) -> None:
    window.workspace.labels.place(MIDDLE, side=Side.LEFT, code="CA")
    window.workspace.close()  # as if killed: nothing asked, nothing saved
    again = make_window()
    again.prompts.answers = ["Recover"]
    offer_recoveries(again.workspace, again.prompts, find_recoveries(tmp_path / "state"), again)
    assert "CA" in again.workspace.document.landmarks("L")
    assert again.workspace.document.undo_text == "place CA left"


_KILLED = """
import sys
from pathlib import Path
from qtpy.QtCore import QPoint, Qt, QTimer
from qtpy.QtTest import QTest
from gp_labeler.views.application import make_application, make_window
from window_cases import MIDDLE, ball_volume
app = make_application()
window = make_window(Path(sys.argv[1]), atlas=False)
window.show()
window.workspace.scan.begin(ball_volume())
view = window.grid.scene_view
while window.workspace.jobs.running or not view.scene.is_fine:
    app.processEvents()
x, y = view.pixel_at(MIDDLE)
for dx in (0, 15, 30):
    QTest.mouseClick(view, Qt.MouseButton.LeftButton, pos=QPoint(int(x) + dx, int(y)))
marks = window.workspace.document.landmarks("L")
print(repr({code: marks[code].tolist() for code in marks.placed}), flush=True)
app.exec()
"""


@pytest.mark.slow
def test_a_window_killed_in_the_middle_loses_nothing(make_window, tmp_path) -> None:
    paths = os.pathsep.join([str(Path(__file__).parents[1]), str(Path(__file__).parents[3])])
    process = subprocess.Popen(
        [sys.executable, "-c", _KILLED, str(tmp_path / "state")],
        stdout=subprocess.PIPE,
        text=True,
        env=dict(os.environ, PYTHONPATH=paths),
    )
    placed = ast.literal_eval(process.stdout.readline())
    process.kill()
    process.communicate()
    assert sorted(placed) == ["CA", "OS", "RWP"]
    window = make_window()
    window.prompts.answers = ["Recover"]
    offer_recoveries(window.workspace, window.prompts, find_recoveries(tmp_path / "state"), window)
    document = window.workspace.document
    for code, where in placed.items():
        np.testing.assert_array_equal(document.landmarks("L")[code], where)
    assert document.undo_text == "place OS left"


def _kept(window) -> str:
    return window.findChild(TopBar).saved.text()


def test_a_second_window_on_a_specimen_is_noticed(qtbot, window, make_window, tmp_path) -> None:
    saved = window.workspace.document.save(tmp_path / "one")
    other = make_window()
    other.prompts.answers = [""]
    other.open_path(saved)
    assert other.prompts.asked == ["Open elsewhere"]
    other.prompts.answers = ["Open a copy"]
    other.open_path(saved)
    assert other.workspace.document.path is None
    assert other.workspace.document.state.specimen == "ball"
    titles = [each.windowTitle().replace("[*]", "") for each in (window, other)]
    original = tmp_path / "one"
    assert titles == [f"ball – {original} – gp-labeler", f"ball – copy of {original} – gp-labeler"]  # noqa: RUF001
    assert _kept(other) == "• a copy"
    other.prompts.files = [tmp_path / "ball"]
    other.commands.run("file.save_as")
    assert other.windowTitle().replace("[*]", "") == f"ball – {tmp_path} – gp-labeler"  # noqa: RUF001
    assert _kept(other) == "• saved"


def test_landmarks_are_exported_and_imported(window, make_window, tmp_path) -> None:
    document, labels = window.workspace.document, window.workspace.labels
    labels.place(MIDDLE, side=Side.LEFT, code="CA")
    folder = tmp_path / "out"
    folder.mkdir()
    window.prompts.files = [folder]
    window.commands.run("file.export")
    assert [f.name for f in folder.iterdir()] == ["ball_L.mrk.json"]
    assert "right side is not labelled" in window.status.next_click.text()
    labels.clear(side=Side.LEFT, code="CA")
    window.prompts.files = [folder / "ball_L.mrk.json"]
    window.prompts.answers = ["Import anyway"]
    window.commands.run("file.import")
    np.testing.assert_allclose(document.landmarks("L")["CA"], MIDDLE)


def test_the_look_is_remembered(window, make_window) -> None:
    window.commands.run("view.theme")
    window.commands.run("view.labels_visible")
    assert window.theme_name == "light"
    close(window)
    again = make_window()
    assert again.theme_name == "light"
    assert not again.workspace.view.state.labels_visible


def test_damaged_memory_does_no_harm(make_window, tmp_path) -> None:
    (tmp_path / "state").mkdir()
    (tmp_path / "state" / "window.json").write_text(
        '{"geometry": 3, "theme": "pink", "view": {"outline_visible": 7}}'
    )
    window = make_window()
    assert window.workspace.view.state.outline_visible is True
    assert window.isVisible()


def test_the_sheet_lists_every_key(window) -> None:
    from qtpy.QtWidgets import QLabel

    QTest.keyClick(window.grid.scene_view, "?")
    sheet = next(child for child in window.findChildren(ShortcutsSheet))
    words = " ".join(label.text() for label in sheet.findChildren(QLabel))
    for row in ACTIONS.values():
        assert not row.shortcuts or row.title.rstrip("…") in words
    sheet.close()


def test_no_key_means_two_things() -> None:
    keys = [key for row in ACTIONS.values() for key in row.shortcuts]
    assert sorted(keys) == sorted(set(keys))


def test_every_action_can_be_run_at_any_time(window, make_window) -> None:
    risky = {"file.close", "file.demo", "help.shortcuts", "help.about"}
    for target in (window, make_window()):
        target.prompts.answers = ["CB"] * 40
        for id in ACTIONS:
            if id not in risky and not id.startswith("file."):
                target.commands.run(id)
        assert target.isVisible()


@dataclass(frozen=True)
class Slow:
    """Work as VTK and SimpleITK do it, letting other threads run; it goes on until enough is done."""

    enough: threading.Event = field(default_factory=threading.Event)
    title: str = "Slow work"

    def run(self, progress) -> bool:
        values, end = np.random.default_rng(0).normal(size=1_000_000), time.monotonic() + 60
        while not self.enough.is_set() and time.monotonic() < end:
            values = np.sin(values)
            progress(0.5)
        return self.enough.is_set()


def test_the_window_answers_while_work_goes_on(qtbot, window) -> None:
    work, answered = Slow(), [0]

    def answer() -> None:
        answered[0] += window.status.work.bar.isVisible()
        if answered[0] > 20:
            work.enough.set()

    timer = QTimer(interval=5)
    timer.timeout.connect(answer)
    timer.start()
    task = window.workspace.jobs.submit(work)
    wait_until_idle(qtbot, window)
    timer.stop()
    assert task.result, "on the thread of the window, work would have waited for its answers for ever"


def test_work_can_be_stopped(qtbot, window) -> None:
    window.workspace.jobs.submit(Slow())
    qtbot.waitUntil(lambda: window.status.work.bar.isVisible())
    QTest.mouseClick(window.status.work.stop, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: not window.workspace.jobs.running)
    assert not window.status.work.bar.isVisible()


@pytest.mark.slow
def test_twenty_windows_leave_nothing_behind(qtbot) -> None:
    from qtpy.QtWidgets import QApplication, QWidget

    remains = []
    for _ in range(20):
        window = make_plain(None, atlas=False)
        window.prompts = Answers()
        window.show()
        window.workspace.scan.begin(ball_volume())
        wait_until_idle(qtbot, window)
        remains += [weakref.ref(window.grid.scene_view.scene), weakref.ref(window.workspace)]
        close(window)
        del window

    def left() -> list[object]:
        gc.unfreeze()  # what the program leaves out until it rests
        gc.collect()
        return [ref() for ref in remains if ref() is not None]

    other = QWidget()  # PyQt6 keeps the window that had the focus last, until another one has it
    other.show()
    qtbot.waitUntil(lambda: left() == [])
    other.close()
    assert [w for w in QApplication.topLevelWidgets() if w.isVisible()] == []


def write_ball(file: Path) -> None:
    import SimpleITK as sitk  # noqa: N813

    sitk.WriteImage(sitk.GetImageFromArray(ball_volume().array), str(file))


def test_a_first_window_fits_the_screen_and_offers_to_open_a_scan(qapp) -> None:
    window = make_plain(None, atlas=False)
    window.prompts = Answers()
    room = window.screen().availableSize()
    least = window.minimumSize()
    assert window.width() <= max(room.width(), least.width())
    assert window.height() <= max(room.height(), least.height())
    window.show()
    window.activateWindow()
    QTest.qWaitForWindowExposed(window)
    assert window.focusWidget() is window.welcome.open_scan
    close(window)


def test_a_specimen_is_opened_where_its_labelling_goes_on(qtbot, make_window, tmp_path) -> None:
    first, file = make_window(), tmp_path / "ball.mha"
    write_ball(file)
    first.workspace.scan.open(file, spacing=0.25)
    wait_until_idle(qtbot, first)
    saved = first.workspace.document.save(tmp_path / "one")
    close(first)
    window = make_window()
    assert window.rail.step == "scan"
    window.open_path(saved)
    assert window.steps["label"].card.content.name == "The scan is not open"
    qtbot.waitUntil(lambda: window.rail.step == "label")
    wait_until_idle(qtbot, window)
    assert window.steps["label"].card.content.code == "CA"


class PaintOrder(QObject):
    """Tells in which turn of the event loop widgets of two kinds are painted first."""

    def __init__(self, window: QWidget, *kinds: type[QWidget]) -> None:
        super().__init__(window)
        self.first: dict[type[QWidget], int] = {}
        self._window, self._kinds, self._turn = window, kinds, 0
        QApplication.instance().installEventFilter(self)

    def eventFilter(self, watched, event) -> bool:  # noqa: N802 - Qt's name
        if event.type() is QEvent.Type.UpdateRequest and watched is self._window:
            self._turn += 1
        if event.type() is QEvent.Type.Paint and isinstance(watched, self._kinds):
            self.first.setdefault(type(watched), self._turn)
        return False


def test_the_panel_and_the_views_are_painted_in_turns_of_their_own(qtbot, make_window) -> None:
    """Either takes some 20 ms: the window answers between begin, panel and views."""
    window = make_window()
    one_turn()
    order = PaintOrder(window, LandmarkTable, SliceView)
    window.workspace.scan.begin(ball_volume())
    wait_until_idle(qtbot, window)
    assert order.first[LandmarkTable] < order.first[SliceView]


def test_every_menu_fits_a_small_screen_in_one_column(window) -> None:
    menus = window.menuBar().findChildren(QMenu)  # PySide6 6.8 takes those of `QAction.menu` for gone
    assert max(menu.sizeHint().height() for menu in menus) < 480  # 1366 x 768 at 150 %
    assert {"&File", "Look from", "Cut bone", "Text size"} <= {menu.title() for menu in menus}


def test_a_slice_looks_the_same_after_other_views_were_maximised(qtbot, window) -> None:
    long = Volume.from_parts(ball_volume().array[:, 12:52, 24:40], [0.25] * 3, [0, 0, 0], name="long")
    window.workspace.scan.begin(long)
    wait_until_idle(qtbot, window)
    view = window.grid.slice_views[Plane.AXIAL]

    def visit(*layouts: str) -> None:
        for layout in layouts:
            window.workspace.view.update(layout=layout)
            one_turn()

    whole = view.shown
    visit("axial")
    assert view.shown.scan_to_pixel(long.extent).min() > 0  # the whole of it, as large as can be
    assert (view.shown.scan_to_pixel(long.extent) < view.shown.size).all()
    assert view.shown.mm_per_pixel < whole.mm_per_pixel
    visit("four-up", "3d", "axial", "sagittal", "four-up")
    assert view.shown.looks_like(whole)
    view.shown = close = view.shown.zoomed(3.0).panned(5.0, -4.0)
    visit("3d", "axial", "four-up")
    assert view.shown.mm_per_pixel == pytest.approx(close.mm_per_pixel)
    np.testing.assert_allclose(view.shown.centre, close.centre)


def test_a_scan_that_moved_is_asked_for_where_the_next_action_stands(qtbot, make_window, tmp_path) -> None:
    window, file = make_window(), tmp_path / "ball.mha"
    write_ball(file)
    window.workspace.scan.open(file, spacing=0.25)
    wait_until_idle(qtbot, window)
    window.workspace.labels.place(np.array([8.0, 8.0, 8.0]), side=Side.LEFT, code="CA")
    saved = window.workspace.document.save(tmp_path / "one")
    window.workspace.scan.begin(ball_volume())
    moved = file.rename(tmp_path / "elsewhere.mha")
    window.open_path(saved)
    wait_until_idle(qtbot, window)
    card = window.steps["label"].card
    window.set_step("label")
    assert (card.content.name, card.primary.accessibleName()) == ("The scan was not found", "Find scan…")
    window.status.set_without_scan("")  # as once the message has gone
    assert "Find scan" in window.status.next_click.text()
    window.prompts.files = [moved]
    QTest.mouseClick(card.primary, Qt.MouseButton.LeftButton)
    wait_until_idle(qtbot, window)
    assert window.workspace.scan.volume is not None
    assert "CA" in window.workspace.document.landmarks(Side.LEFT)


def test_high_dpi_pictures_have_as_many_pixels(window) -> None:
    """The scene is drawn in device pixels, whatever they are; here they are logical ones."""
    view = window.grid.scene_view
    assert view.scene.target.size == (round(view.width() * view.devicePixelRatioF()), view.height())


def test_another_volume_replaces_the_first(qtbot, window) -> None:
    window.workspace.labels.place(MIDDLE, side=Side.LEFT, code="CA")
    other = Volume.from_parts(ball_volume().array, [0.5] * 3, [0, 0, 0], name="other")
    window.workspace.scan.begin(other)
    wait_until_idle(qtbot, window)
    assert window.workspace.document.state.specimen == "other"
    assert not window.grid.scene_view.scene.marks.marks
    for view in window.grid.slice_views.values():
        assert view.source.volume is other


def test_the_panels_follow_the_width_of_the_window(qtbot, window):
    """What they ask for is a share of it, which a layout keeps until it is told."""
    for width in (1600, 1150, 1500, 1100):
        window.resize(width, 760)
        wait_until_idle(qtbot, window)
        expected = min(window.panels.preferred_width, max(round(0.37 * width), window.panels.needed_width))
        qtbot.waitUntil(lambda: window.panels.width() == expected)  # noqa: B023
