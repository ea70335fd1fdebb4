"""The step Atlas by real clicks: the atlas in use, how labels fit it, fitting one, leave-one-out, drops."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from animal_cases import drawn_animals, write_animals, write_side
from panel_cases import actions_of, cut_words, deliver, in_scan, place, workspace_with_scan
from qtpy.QtCore import QMimeData, QPoint, QPointF, Qt, QUrl
from qtpy.QtGui import QDropEvent, QFontMetrics
from qtpy.QtWidgets import QApplication, QPushButton
from window_cases import close, wait_until_idle

from gp_core.atlas.atlas import Atlas
from gp_core.landmarks.features import Side, feature
from gp_labeler.document.landmark_import import ImportLandmarks
from gp_labeler.document.specimen_document import utc_now
from gp_labeler.document.specimen_file import write_specimen
from gp_labeler.document.state import How, Provenance, SpecimenState
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.panels.atlas.feature_table import DOUBTFUL_ROLE
from gp_labeler.views.panels.atlas.panel import AtlasCard, AtlasPanel
from gp_labeler.views.panels.label.card_content import content_of
from gp_labeler.views.panels.parts import Notice
from gp_labeler.views.theme import DARK, LIGHT, apply_theme

CLICK = Qt.MouseButton.LeftButton
L, R = Side.LEFT, Side.RIGHT


@pytest.fixture
def workspace() -> Iterator[Workspace]:
    workspace = workspace_with_scan()
    deliver(workspace)
    yield workspace
    workspace.close(discard=True)


@pytest.fixture
def asked() -> list[str]:
    return []


@pytest.fixture
def panel(workspace, qtbot, asked) -> AtlasPanel:
    panel = AtlasPanel(workspace, actions_of(workspace, qtbot, asked))
    apply_theme(panel, DARK)
    qtbot.addWidget(panel)
    panel.resize(panel.width(), 900)
    panel.show()
    qtbot.waitExposed(panel)
    return panel


@pytest.fixture
def folder(tmp_path):
    return write_animals(tmp_path / "animals", drawn_animals(3))


def test_cards_follow_each_other_however_tall_the_panel_is(panel, qtbot) -> None:
    panel.resize(panel.width(), 1700)
    QApplication.processEvents()
    ends = [card.mapTo(panel, QPoint()).y() for card in (panel.which, panel.labels, panel.own, panel.trial)]
    heights = [card.height() for card in (panel.which, panel.labels, panel.own)]
    gaps = np.diff(ends) - heights
    assert gaps.max() == gaps.min() <= 8


def cell(panel, code: str, column: int, role: int = Qt.ItemDataRole.DisplayRole):
    rows = panel.labels.table.rows
    return rows.data(rows.index(rows.codes.index(code), column), role)


def drop(window, *paths) -> None:
    mime = QMimeData()
    mime.setUrls([QUrl.fromLocalFile(str(path)) for path in paths])
    action, no_keys = Qt.DropAction.CopyAction, Qt.KeyboardModifier.NoModifier
    window.dropEvent(QDropEvent(QPointF(300, 300), action, mime, CLICK, no_keys))


def test_the_published_atlas_is_described(panel) -> None:
    assert panel.which.name.toolTip() == "The published atlas"
    assert panel.which.facts.values["Made from"].text() == "11 animals, 22 sides"
    assert not panel.which.published.isEnabled()
    assert panel.which.save.isEnabled()
    assert not panel.trial.run.isEnabled()
    assert panel.labels.table.rows.rowCount() == 19
    assert float(cell(panel, "RWA", 1)) < float(cell(panel, "ZL", 1))
    assert cell(panel, "RWA", 2) == "–"  # noqa: RUF001


def test_labels_are_compared_with_it_and_problems_flagged(workspace, panel, qtbot) -> None:
    place(workspace, "CA", "CB", "RWA", "RWP", "OS", "LLI")
    workspace.labels.place(np.add(in_scan("OI"), [0, 0, 3.0]), side=L, code="OI")
    deliver(workspace)
    distance, n_sd = cell(panel, "OI", 2).split(" · ")
    assert float(distance) == pytest.approx(3, abs=0.5)
    assert float(n_sd) > 5
    assert cell(panel, "OI", 2, DOUBTFUL_ROLE)
    assert not cell(panel, "CA", 2, DOUBTFUL_ROLE)
    assert cell(panel, "CA", 3) == "–"  # noqa: RUF001
    assert panel.labels.verdict.text() == "1 of 7 labels should be reviewed."
    table = panel.labels.table
    index = table.rows.index(table.rows.codes.index("OI"), 2)
    qtbot.mouseClick(table.viewport(), CLICK, pos=table.visualRect(index).center())
    assert (workspace.labels.active.side, workspace.labels.active.code) == (L, "OI")
    for key in (Qt.Key.Key_Down, Qt.Key.Key_Return):  # the same by keys
        qtbot.keyClick(table, key)
    assert (workspace.labels.active.side, workspace.labels.active.code) == (L, "OS")


def test_points_with_another_problem_are_named_beside_the_table(workspace, panel) -> None:
    place(workspace, "CA", "CB", "RWP", "OS", "LLI")
    workspace.labels.place(in_scan("LLI"), side=L, code="RWA")  # half a millimetre off, and on LLI
    deliver(workspace)
    assert panel.labels.verdict.text() == (
        "All 6 labels that can be checked fit the atlas; 2 have other problems: LLI left, RWA left."
    )
    workspace.labels.place(in_scan("RWA"), side=L, code="RWA")
    deliver(workspace)
    assert panel.labels.verdict.text() == "All 6 labels that can be checked fit the atlas."


def test_an_atlas_is_fitted_and_tried_out(workspace, panel, asked, folder, qtbot) -> None:
    for button in (panel.own.files, panel.own.folder, panel.which.open, panel.which.save):
        qtbot.mouseClick(button, CLICK)
    assert asked == ["atlas.fit_files", "atlas.fit_folder", "atlas.open", "atlas.save"]
    animal = drawn_animals(1)[0]
    write_side(folder, "torn", animal.side(L))
    (folder / "torn_L.mrk.json").write_text("{")
    workspace.atlas.fit([folder])
    assert workspace.jobs.running
    deliver(workspace)
    assert panel.which.name.toolTip() == "3 animals, 6 sides"
    QApplication.processEvents()
    words = [notice.words for notice in panel.own.findChildren(Notice) if notice.isVisibleTo(panel)]
    assert words == ["3 animals, 6 sides were read.", "Skipped torn_L.mrk.json"]
    assert panel.trial.run.isEnabled()
    workspace.atlas.try_out()
    QApplication.processEvents()  # commands are refreshed once a turn
    assert not panel.trial.run.isEnabled()
    deliver(workspace)
    assert [row[0] for row in panel.trial.figures] == ["Robust", "JRMPC"]
    assert all(float(mean) <= float(most) for _, mean, most, *_ in panel.trial.figures)
    assert "6 sides of 3 animals" in panel.trial.words.text()


def test_fitting_can_be_stopped(workspace, panel, folder, qtbot) -> None:
    workspace.atlas.fit([folder])
    assert panel.own.stop.isVisibleTo(panel)
    qtbot.mouseClick(panel.own.stop, CLICK)
    deliver(workspace)
    assert workspace.atlas.is_published
    assert not panel.own.stop.isVisibleTo(panel)


@pytest.mark.parametrize("theme", [DARK, LIGHT])
@pytest.mark.parametrize("wide", [False, True])
def test_no_word_is_cut(workspace, panel, folder, theme, wide) -> None:
    workspace.atlas.fit([folder])
    deliver(workspace)
    workspace.atlas.try_out()
    deliver(workspace)
    apply_theme(panel, theme)
    panel.set_wide(wide)
    panel.resize(1100 if wide else panel.width(), 900)
    assert list(cut_words(panel)) == []


def test_beside_no_scan_the_names_of_features_stand_in_full(panel, qtbot) -> None:
    panel.set_wide(True)
    panel.resize(1190, 700)  # what a window of 1280 x 800 leaves
    table = panel.labels.table
    widest = max(QFontMetrics(table.font()).horizontalAdvance(feature(c).name) for c in table.rows.codes)
    qtbot.waitUntil(lambda: table.columnWidth(0) >= widest + 55)  # the code stands before it


def test_the_window_needs_no_scan_for_an_atlas(make_window, folder, tmp_path, qtbot) -> None:
    window = make_window(atlas=True)
    wait_until_idle(qtbot, window)
    assert not window.rail.buttons["label"].isEnabled()
    qtbot.mouseClick(window.rail.buttons["atlas"], CLICK)
    assert window.panels.currentWidget().isVisible()
    assert not window.grid.isVisible()
    drop(window, folder)
    wait_until_idle(qtbot, window)
    workspace = window.workspace
    assert workspace.atlas.current.n_samples == 6
    window.prompts.files = [tmp_path / "own.json"]
    window.commands.run("atlas.save")
    assert Atlas.load(tmp_path / "own.json").n_samples == 6
    window.commands.run("atlas.published")
    wait_until_idle(qtbot, window)
    assert workspace.atlas.is_published
    assert not window.commands.actions["atlas.published"].isEnabled()
    qtbot.mouseClick(window.rail.buttons["scan"], CLICK)
    assert window.welcome.isVisible()
    drop(window, tmp_path / "own.json")
    wait_until_idle(qtbot, window)
    assert workspace.atlas.current.n_samples == 6
    assert workspace.scan.volume is None
    window.commands.run("atlas.show")
    assert window.rail.step == "atlas"
    window.prompts.files = [folder]
    window.commands.run("atlas.fit_folder")
    wait_until_idle(qtbot, window)
    assert len(workspace.atlas.specimens) == 3
    window.commands.run("atlas.try")
    wait_until_idle(qtbot, window, 180)  # compiling may be part of it
    assert workspace.atlas.trial.n_sides == 6


def test_an_atlas_that_is_gone_at_the_next_start_is_told_until_another_is_chosen(
    make_window, folder, tmp_path, qtbot
) -> None:
    window = make_window(atlas=True)
    wait_until_idle(qtbot, window)
    window.workspace.atlas.fit([folder])
    wait_until_idle(qtbot, window)
    window.workspace.atlas.save(tmp_path / "own.json")
    window.workspace.atlas.open(tmp_path / "own.json")
    wait_until_idle(qtbot, window)
    close(window)
    (tmp_path / "own.json").unlink()
    again = make_window(atlas=True)
    wait_until_idle(qtbot, again)
    again.commands.run("atlas.show")
    notice = again.findChild(AtlasCard).notices
    assert notice.isVisible()
    assert "The atlas of own.json is no longer available" in notice.shown[0][1]
    qtbot.mouseClick(again.findChild(AtlasCard).published, CLICK)
    wait_until_idle(qtbot, again)
    assert not notice.isVisible()
    assert not again.commands.actions["atlas.published"].isEnabled()


def test_a_damaged_atlas_dropped_on_the_window_is_named(make_window, tmp_path, qtbot) -> None:
    window = make_window(atlas=True)
    wait_until_idle(qtbot, window)
    file = tmp_path / "half.json"
    file.write_text('{"gpAtlas": 1,')
    drop(window, file)
    wait_until_idle(qtbot, window)
    assert "half.json" in window.status.next_click.text()
    assert window.workspace.atlas.is_published


def _wrong_animals(tmp_path):
    """Six animals as specimen files, three of them with mistakes, eight findings in all."""
    animals = drawn_animals(6)
    folder = tmp_path / "specimens"
    folder.mkdir()
    for animal in animals:
        sides = dict(animal.sides)
        if animal.name == "GP02":
            sides[L] = sides[L].with_point("CA", sides[L]["CB"]).with_point("CB", sides[L]["CA"])
        if animal.name == "GP04":
            for code in ("LLI", "MH", "DTM", "FPA", "RWA", "RWL", "RWP"):
                sides[R] = sides[R].with_point(
                    code, sides[R][code] + np.random.default_rng(1).normal(size=3) * 9
                )
        edit = ImportLandmarks(tuple(sides.values()), Provenance(How.IMPORTED, "AB", utc_now()))
        write_specimen(folder / f"{animal.name}.gpspecimen.json", edit.apply(SpecimenState(animal.name)))
    return folder


def _tick(qtbot, box) -> None:
    qtbot.mouseClick(box, CLICK, pos=QPoint(10, box.height() // 2))  # its words end before its middle


def test_what_is_left_out_is_listed_and_opens_where_it_is(make_window, tmp_path, qtbot) -> None:
    folder = _wrong_animals(tmp_path)
    window = make_window(atlas=True)
    wait_until_idle(qtbot, window)
    workspace, own = window.workspace, window.findChild(AtlasPanel).own
    qtbot.mouseClick(window.rail.buttons["atlas"], CLICK)
    workspace.atlas.fit([folder])
    wait_until_idle(qtbot, window)
    words = [notice.words for notice in own.findings.findChildren(Notice)]
    assert words[1] == "GP02 left: CA and CB look exchanged"
    assert len(words) == 5
    more = next(b for b in own.findings.findChildren(QPushButton) if "more" in b.text())
    qtbot.mouseClick(more, CLICK)
    assert len(own.findings.findChildren(Notice)) > 5
    assert list(cut_words(window.findChild(AtlasPanel))) == []
    spread = workspace.atlas.current.variances(["CA"])[0]
    _tick(qtbot, own.keep_doubtful)
    wait_until_idle(qtbot, window)
    assert workspace.atlas.current.variances(["CA"])[0] > 10 * spread
    _tick(qtbot, own.keep_doubtful)
    wait_until_idle(qtbot, window)
    assert workspace.atlas.current.variances(["CA"])[0] == spread
    show = next(b for b in own.findings.findChildren(QPushButton) if "GP02" in b.accessibleName())
    qtbot.mouseClick(show, CLICK)
    wait_until_idle(qtbot, window)
    assert workspace.document.state.specimen == "GP02"
    assert (workspace.labels.active.side, workspace.labels.active.code) == (L, "CA")


def test_the_card_names_the_atlas_that_is_not_the_published_one(workspace, folder) -> None:
    place(workspace, "CA", "RWP", "OS")
    workspace.labels.go_to(L, "CB")
    assert (
        "By the atlas" not in content_of(workspace.labels, has_scan=True, atlas=workspace.atlas.text).status
    )
    workspace.atlas.fit([folder])
    deliver(workspace)
    status = content_of(workspace.labels, has_scan=True, atlas=workspace.atlas.text).status
    assert status.endswith("By the atlas of 3 animals, 6 sides.")
