"""The rail, the feature card and the table of landmarks, by real clicks and keys."""

from __future__ import annotations

import numpy as np
import pytest
from panel_cases import (
    PANEL_WIDTH,
    actions_of,
    cut_words,
    deliver,
    in_scan,
    place,
)
from qtpy.compat import isalive
from qtpy.QtCore import QCoreApplication, QEvent, QModelIndex, QObject, QPoint, QSize, Qt
from qtpy.QtGui import QFontMetrics, QGuiApplication
from qtpy.QtWidgets import QApplication, QLabel, QMenu, QWidget
from window_cases import one_turn

from gp_core.landmarks.features import CODES, FEATURES, Side, feature, index_of
from gp_labeler.document.edits import CheckPoint, SwapPoints
from gp_labeler.models.workflow import Active
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.chips import SHAPES, chip_pixmap
from gp_labeler.views.feature_picture import feature_picture
from gp_labeler.views.panels.label.feature_card import FeatureCard
from gp_labeler.views.panels.label.landmark_menu import landmark_menu
from gp_labeler.views.panels.label.landmark_table import LandmarkTable
from gp_labeler.views.panels.label.panel import LabelPanel
from gp_labeler.views.panels.rail import Rail
from gp_labeler.views.signals import attempt
from gp_labeler.views.theme import DARK, LIGHT, apply_theme, contrast

pytestmark = [
    pytest.mark.any_binding,
    pytest.mark.usefixtures("qapp"),  # without one, Qt aborts at the first picture
]

LEFT, RIGHT = Side.LEFT, Side.RIGHT
CLICK = Qt.MouseButton.LeftButton
LOWEST_PANEL = QSize(PANEL_WIDTH, 698)
"""What a window of 1280 x 800 leaves."""


@pytest.fixture
def asked() -> list[str]:
    return []


@pytest.fixture
def panel(workspace: Workspace, qtbot, asked) -> LabelPanel:
    panel = LabelPanel(workspace, actions_of(workspace, qtbot, asked))
    apply_theme(panel, DARK)
    qtbot.addWidget(panel)
    panel.resize(LOWEST_PANEL)
    panel.show()
    qtbot.waitExposed(panel)
    return panel


@pytest.mark.parametrize("short", [0, 1, 2, 60])
def test_the_rail_has_all_its_icons_or_none(workspace, qtbot, short) -> None:
    """In a window that is a pixel too low, heights are shared unevenly."""
    rail = Rail(workspace, actions_of(workspace, qtbot))
    apply_theme(rail, DARK)
    qtbot.addWidget(rail)
    rail.show()
    rail.resize(rail.width(), 1000)
    QApplication.processEvents()
    room = 1000 - (rail.keys_button.y() - rail.buttons["pose"].geometry().bottom() - 1) + 4
    rail.resize(rail.width(), room - short)
    for _ in range(3):
        QApplication.processEvents()
    buttons = [*rail.buttons.values(), rail.keys_button]
    assert len({button.height() for button in buttons}) == 1
    assert all(button.height() >= button.sizeHint().height() for button in buttons)


def test_the_next_action_stays_where_it_is_from_state_to_state(workspace, panel) -> None:
    """So that one button can be clicked again and again."""
    place(workspace, "CA", "CB", "RWP")
    deliver(workspace)
    workspace.labels.accept_all_ghosts(side=LEFT)
    workspace.labels.mark_unseen(side=LEFT, code="OI")
    tops = set()
    for code in ("CA", "RWA", "MN", "OI", "DTL", "FPP"):
        workspace.labels.set_active(Active(LEFT, code))
        for _ in range(3):  # layouts inside layouts take a turn each
            QApplication.processEvents()
        tops.add(panel.card.primary.mapTo(panel, QPoint()).y())
    assert len(tops) == 1


def click_cell(qtbot, table: LandmarkTable, code: str, column: int) -> None:
    where = table.view.visualRect(table.model.index(index_of(code), column)).center()
    qtbot.mouseClick(table.view.viewport(), CLICK, pos=where)


def word(table: LandmarkTable, code: str, side: Side) -> str:
    return table.model.index(index_of(code), 1 + [LEFT, RIGHT].index(side)).data()


# Table


def test_a_click_on_a_cell_makes_that_point_active_and_goes_there(workspace, panel, qtbot):
    place(workspace, "OS", side=RIGHT)
    click_cell(qtbot, panel.table, "OS", 2)
    assert workspace.labels.active == Active(RIGHT, "OS")
    np.testing.assert_allclose(workspace.view.crosshair, in_scan("OS", RIGHT))
    click_cell(qtbot, panel.table, "MN", 1)
    assert workspace.labels.active == Active(LEFT, "MN")


def test_a_click_on_a_name_stays_on_the_side_being_worked_on(workspace, panel, qtbot):
    workspace.labels.set_active(Active(RIGHT, "CA"))
    click_cell(qtbot, panel.table, "FPP", 0)
    assert workspace.labels.active == Active(RIGHT, "FPP")


def test_a_click_on_the_computed_origin_shows_it_and_keeps_the_active_point(workspace, panel, qtbot):
    place(workspace, "CA", "CB", "RWA", "RWP")
    before = workspace.labels.active
    click_cell(qtbot, panel.table, "CO", 1)
    assert workspace.labels.active == before
    np.testing.assert_allclose(workspace.view.crosshair, workspace.document.landmarks(LEFT)["CO"])


def test_arrow_keys_walk_through_the_points(workspace, panel, qtbot):
    click_cell(qtbot, panel.table, "CA", 1)
    qtbot.keyClick(panel.table.view, Qt.Key.Key_Down)
    assert workspace.labels.active == Active(LEFT, "CB")
    qtbot.keyClick(panel.table.view, Qt.Key.Key_Right)
    assert workspace.labels.active == Active(RIGHT, "CB")


def test_delete_clears_the_point_of_the_cell(workspace, panel, qtbot):
    place(workspace, "CA")
    click_cell(qtbot, panel.table, "CA", 1)
    qtbot.keyClick(panel.table.view, Qt.Key.Key_Delete)
    assert "CA" not in workspace.document.landmarks(LEFT)


def test_the_table_follows_the_active_point_without_changing_it(workspace, panel):
    asked = []
    workspace.labels.active_changed.connect(asked.append)
    workspace.labels.set_active(Active(RIGHT, "ZL"))
    current = panel.table.view.currentIndex()
    assert (current.row(), current.column()) == (index_of("ZL"), 2)
    assert asked == [Active(RIGHT, "ZL")]


def test_every_state_has_its_word(workspace, panel):
    place(workspace, "CA", "CB", "RWA", "RWP", "OS", "LLI", "MH")
    workspace.labels.place(np.add(in_scan("OI"), [0, 0, 3.0]), side=LEFT, code="OI")
    workspace.labels.mark_unseen(side=LEFT, code="RWM")
    workspace.document.do(CheckPoint(LEFT, "CA"))
    deliver(workspace)
    table = panel.table
    assert word(table, "CA", LEFT) == "checked"
    assert word(table, "CB", LEFT) == "placed"
    assert word(table, "CO", LEFT) == "computed"
    assert word(table, "RWM", LEFT) == "unseen"
    assert word(table, "FPA", LEFT) == "ghost"
    assert word(table, "FPA", RIGHT) == "to do"
    assert word(table, "CO", RIGHT) == "automatic", "nobody places it"
    distance = workspace.labels.problems(LEFT)["OI"].deviation_of("OI").distance
    assert word(table, "OI", LEFT) == f"{distance:.1f} mm"


def test_the_header_counts_each_side(workspace, panel):
    place(workspace, "CA", "CB", "RWA", "RWP")
    header = [panel.table.model.headerData(n, Qt.Orientation.Horizontal) for n in range(3)]
    assert header == ["Feature", "Left 5/20", "Right 0/20"]


def test_all_rows_and_words_fit_at_the_smallest_window(workspace, panel, qtbot):
    view = panel.table.view
    place(workspace, "CA")  # the offers to straighten and to suggest, which stand above, are gone now
    qtbot.waitUntil(lambda: view.verticalScrollBar().maximum() == 0)
    metrics = QFontMetrics(view.font())
    room = view.columnWidth(0) - 8 - 35 - 1
    assert [row.name for row in FEATURES if metrics.horizontalAdvance(row.name) > room] == []
    states = view.columnWidth(1) - 8 - 12 - 4
    words = [*SHAPES, "0.99 mm", "12.4 mm"]
    assert [w for w in words if w != "doubtful" and metrics.horizontalAdvance(w) > states] == []


# Menu


def menu_actions(menu: QMenu) -> dict:
    return {a.text(): a for a in menu.actions() if a.text()}


def test_the_menu_locks_swaps_checks_and_clears(workspace, panel):
    place(workspace, "RWA", "RWP", "CA")
    before = {code: workspace.document.landmarks(LEFT)[code].copy() for code in ("RWA", "RWP")}
    menu = landmark_menu(workspace, LEFT, "RWA", panel)
    swaps = next(m for m in menu.findChildren(QMenu) if m.title() == "Exchange with")
    next(a for a in swaps.actions() if a.text().startswith("RWP")).trigger()
    np.testing.assert_allclose(workspace.document.landmarks(LEFT)["RWP"], before["RWA"])
    workspace.document.undo()
    menu_actions(menu)["Mark as checked"].trigger()
    assert workspace.document.state.landmark(LEFT, "RWA").checked
    menu_actions(menu)["Lock"].trigger()
    assert workspace.document.state.landmark(LEFT, "RWA").locked
    locked = menu_actions(landmark_menu(workspace, LEFT, "RWA", panel))
    assert not locked["Clear"].isEnabled()
    locked["Unlock"].trigger()
    menu_actions(landmark_menu(workspace, LEFT, "RWA", panel))["Clear"].trigger()
    assert "RWA" not in workspace.document.landmarks(LEFT)


def test_the_menu_copies_a_position_in_mm(workspace, panel):
    place(workspace, "CA")
    menu_actions(landmark_menu(workspace, LEFT, "CA", panel))["Copy position (LPS, mm)"].trigger()
    copied = [float(x) for x in QGuiApplication.clipboard().text().split()]
    np.testing.assert_allclose(copied, in_scan("CA"), atol=1e-4)


def test_a_computed_point_offers_nothing_to_edit(workspace, panel):
    assert set(menu_actions(landmark_menu(workspace, LEFT, "CO", panel))) == {
        "Go to CO left",
        "Copy position (LPS, mm)",
    }


def test_a_right_click_opens_the_menu(workspace, panel, qtbot):
    where = panel.table.view.visualRect(panel.table.model.index(0, 1)).center()
    panel.table.view.customContextMenuRequested.emit(QPoint(where))
    menus = [m for m in panel.table.findChildren(QMenu) if m.title() == ""]
    assert len(menus) == 1
    assert menus[0].isVisible()
    menus[0].close()


# Card


def test_the_primary_button_suggests_the_ghost_and_goes_on(workspace, panel, qtbot):
    place(workspace, "CA", "RWP", "OS")
    active = workspace.labels.active
    ghost = workspace.labels.ghosts(active.side)[active.code].position.copy()
    assert panel.card.content.action == "ghost"
    qtbot.mouseClick(panel.card.primary, CLICK)
    suggestion = workspace.document.landmarks(active.side).suggested[active.code]
    np.testing.assert_allclose(suggestion.position, ghost)
    assert workspace.labels.active != active


def test_without_a_ghost_it_places_at_the_crosshair(workspace, panel, qtbot):
    workspace.view.set_crosshair([1.0, 2.0, 3.0])
    qtbot.mouseClick(panel.card.primary, CLICK)
    np.testing.assert_allclose(workspace.document.landmarks(LEFT)["CA"], [1, 2, 3])


def test_labels_of_the_other_side_are_swapped_by_the_primary_button(workspace, panel, qtbot):
    codes = [feature.code for feature in FEATURES if not feature.computed and not feature.shared]
    for code in codes:
        workspace.labels.place(in_scan(code, RIGHT), side=LEFT, code=code)
    deliver(workspace)
    workspace.labels.go_to(LEFT, "CL")
    assert "fit the right side" in panel.card.content.status
    assert panel.card.primary.text().startswith("Exchange left and right")
    assert list(cut_words(panel)) == []
    qtbot.mouseClick(panel.card.primary, CLICK)
    assert set(workspace.document.landmarks(RIGHT).placed) >= set(codes)
    assert not set(workspace.document.landmarks(LEFT).placed) & set(codes)


def test_a_placed_point_can_be_checked_and_a_locked_one_unlocked(workspace, panel, qtbot):
    place(workspace, "CA")
    workspace.labels.go_to(LEFT, "CA")
    one_turn()  # the card is refreshed once a turn
    qtbot.mouseClick(panel.card.primary, CLICK)
    assert workspace.document.state.landmark(LEFT, "CA").checked
    workspace.labels.lock(side=LEFT, code="CA")
    assert panel.card.content.action == "unlock"
    qtbot.mouseClick(panel.card.primary, CLICK)
    assert not workspace.document.state.landmark(LEFT, "CA").locked


def test_skip_unseen_and_side_buttons(workspace, panel, qtbot):
    qtbot.mouseClick(panel.card.skip, CLICK)
    assert workspace.labels.active == Active(LEFT, "RWP")
    qtbot.mouseClick(panel.card.unseen, CLICK)
    assert workspace.document.state.landmark(LEFT, "RWP").unseen
    code = workspace.labels.active.code
    qtbot.mouseClick(panel.card.sides[RIGHT], CLICK)
    assert workspace.labels.active == Active(RIGHT, code)


def test_the_card_tells_common_mistakes_once_asked_and_for_all_that_follow(workspace, panel, qtbot):
    def told() -> str:
        one_turn()  # the card is refreshed once a turn
        texts = [label.text() for label in panel.card.findChildren(QLabel) if label.isVisible()]
        return next((row.mistakes for row in FEATURES if row.mistakes in texts), "")

    workspace.labels.set_active(Active(LEFT, "CA"))
    assert told() == ""
    qtbot.keyClick(panel.card.mistakes, Qt.Key.Key_Space)
    assert told() == feature("CA").mistakes
    workspace.labels.set_active(Active(RIGHT, "OS"))
    assert told() == feature("OS").mistakes
    qtbot.mouseClick(panel.card.mistakes, CLICK)
    assert told() == ""


class HeightsSeen(QObject):
    """The heights that a widget takes from now on."""

    def __init__(self, widget: QWidget) -> None:
        super().__init__(widget)
        self.seen: set[int] = set()
        widget.installEventFilter(self)

    def eventFilter(self, watched, event) -> bool:  # noqa: N802 - Qt's name
        if event.type() is QEvent.Type.Resize:
            self.seen.add(watched.height())
        return False


def test_the_card_keeps_its_height_while_points_are_placed_one_after_the_other(workspace, panel, qtbot):
    """A point that is placed is not the active one for a moment: its row would move the table below."""
    workspace.labels.go_to(LEFT, "CA")
    one_turn()
    heights = HeightsSeen(panel.card)
    for _ in range(4):
        place(workspace, workspace.labels.active.code)
        one_turn()
    assert heights.seen == set()


def test_an_error_is_told_and_nothing_else_happens(workspace, panel, qtbot):
    told = []
    workspace.messages.said.connect(lambda text, level: told.append((text, level)))
    place(workspace, "CA")
    workspace.labels.lock(side=LEFT, code="CA")
    workspace.labels.go_to(LEFT, "CA")
    one_turn()  # the card is refreshed once a turn
    assert not panel.card.unseen.isEnabled()
    assert not attempt(workspace, workspace.labels.clear)
    assert [level for _, level in told] == ["error"]
    assert "CA left is locked" in told[0][0]
    assert "CA" in workspace.document.landmarks(LEFT)


def test_everything_done_offers_the_export(workspace, panel, asked, qtbot):
    for side in Side:
        for row in FEATURES:
            if not row.computed:
                workspace.labels.mark_unseen(side=side, code=row.code)
    assert panel.card.content.name == "Everything is labelled"
    one_turn()  # card and commands are refreshed once a turn
    qtbot.mouseClick(panel.card.primary, CLICK)
    assert asked == ["file.export"]


def test_without_a_scan_the_card_offers_to_open_one(qtbot):
    workspace = Workspace(None)
    asked = []
    card = FeatureCard(workspace, actions_of(workspace, qtbot, asked))
    qtbot.addWidget(card)
    card.show()
    qtbot.mouseClick(card.primary, CLICK)
    assert asked == ["file.open"]
    workspace.close(discard=True)


def test_on_a_very_high_screen_the_picture_is_no_tower(panel, qtbot):
    panel.resize(PANEL_WIDTH, 2000)
    picture = panel.card.picture
    qtbot.waitUntil(lambda: 200 < picture.width() >= picture.height())  # layouts take a few turns
    assert panel.table.geometry().top() - panel.card.geometry().bottom() < 12  # nor is there a gap


@pytest.mark.parametrize("theme", [DARK, LIGHT], ids=lambda t: t.name)
def test_no_word_of_any_feature_is_cut_off_at_1280_by_800(workspace, panel, qtbot, theme):
    place(workspace, "CA", "RWP", "OS")
    apply_theme(panel, theme)
    cut = []
    for row in FEATURES:
        if not row.computed:
            workspace.labels.go_to(LEFT, row.code)
            cut += [f"{row.code}: {words}" for words in cut_words(panel.card)]
    assert cut == []


def test_all_of_the_card_can_be_reached_by_keyboard(workspace, panel, qtbot):
    panel.card.primary.setFocus()
    reached = set()
    for _ in range(12):
        focused = panel.focusWidget()
        reached.add(focused)
        qtbot.keyClick(focused, Qt.Key.Key_Tab)
    assert {panel.card.primary, panel.card.skip, panel.card.unseen, panel.table.view} <= reached


# Rail


def test_the_rail_tells_of_steps_that_are_built_and_only_those(workspace, qtbot):
    rail = Rail(workspace, actions_of(workspace, qtbot))
    qtbot.addWidget(rail)
    rail.show()
    told = []
    rail.step_chosen.connect(told.append)
    for step in ("label", "atlas", "pose", "scan"):
        qtbot.mouseClick(rail.buttons[step], CLICK)
    assert told == [step for step in ("label", "atlas", "pose", "scan") if rail.buttons[step].isEnabled()]
    assert {"label", "pose", "scan"} <= set(told)
    assert rail.step == "scan"
    rail.buttons["label"].setFocus()
    qtbot.keyClick(rail.buttons["label"], Qt.Key.Key_Return)
    assert rail.step == "label"


# Looks


def test_a_panel_that_is_gone_hears_nothing_more(workspace, qtbot):
    panel = LabelPanel(workspace, actions_of(workspace, qtbot))
    panel.show()
    panel.close()
    panel.deleteLater()
    QCoreApplication.sendPostedEvents(panel, QEvent.Type.DeferredDelete)
    assert not isalive(panel)
    place(workspace, "CA")  # would raise in a slot of a deleted widget


@pytest.mark.parametrize("theme", [DARK, LIGHT], ids=lambda t: t.name)
def test_words_stand_out_from_every_ground(theme):
    grounds = [theme.window, theme.panel, theme.card, theme.raised, theme.field, theme.selected]
    words = [theme.text, theme.muted, theme.accent_text, theme.warning, theme.danger, theme.good]
    assert min(contrast(w, g) for w in words for g in grounds) >= 4.5
    assert min(contrast(theme.faint, g) for g in (theme.window, theme.panel, theme.card, theme.field)) >= 4.5
    assert min(contrast(c, g) for c in theme.states.values() for g in (theme.card, theme.selected)) >= 4.5
    assert contrast(theme.on_accent, theme.accent) >= 4.5


def test_no_two_states_have_the_same_shape():
    drawn = {state: chip_pixmap(state, 24, DARK).toImage().createAlphaMask() for state in SHAPES}
    pairs = [(a, b) for a in drawn for b in drawn if a < b]
    assert [pair for pair in pairs if drawn[pair[0]] == drawn[pair[1]]] == []


@pytest.mark.parametrize("side", list(Side))
def test_every_feature_has_a_picture_of_its_own(side):
    size = QSize(200, 120)
    pictures = {code: feature_picture(code, side, size, DARK, ratio=1).toImage() for code in CODES}
    assert all(not picture.isNull() for picture in pictures.values())
    codes = list(CODES)
    assert all(pictures[a] != pictures[b] for n, a in enumerate(codes) for b in codes[n + 1 :])


def test_left_and_right_pictures_are_of_different_ears():
    size = QSize(200, 120)
    for code in CODES:
        left, right = (feature_picture(code, side, size, DARK, ratio=1).toImage() for side in Side)
        assert left != right, code


def test_an_index_outside_the_table_has_no_data(workspace, qtbot):
    table = LandmarkTable(workspace)
    qtbot.addWidget(table)
    assert table.model.data(QModelIndex()) is None


def test_names_that_look_exchanged_are_exchanged_by_the_card(panel, workspace, qtbot):
    place(workspace, "CA", "CB", "RWP", "OS", "MH", "LLI")
    workspace.document.do(SwapPoints(LEFT, "CA", "CB"))
    deliver(workspace)
    workspace.labels.go_to(LEFT, "CB")
    card = panel.card
    qtbot.waitUntil(lambda: card.primary.text().startswith("Exchange CA and CB"))
    qtbot.mouseClick(card.primary, CLICK)
    deliver(workspace)
    assert not workspace.labels.known_problems(LEFT)
    np.testing.assert_allclose(workspace.document.landmarks(LEFT)["CA"], in_scan("CA"))
