"""How repeatable labels are, in the step Atlas: read from specimen files, shown, used, saved."""

from __future__ import annotations

import json

import pytest
from panel_cases import actions_of, cut_words, deliver, workspace_with_scan
from qtpy.QtCore import Qt
from qtpy.QtWidgets import QPushButton
from repeated_cases import SITTINGS, write_repeated
from window_cases import wait_until_idle

from gp_core import load_specimens, reliability
from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_labeler.document.animals import read_animals
from gp_labeler.document.landmark_export import export_landmarks
from gp_labeler.document.repeated_labels import read_labellings
from gp_labeler.document.specimen_file import read_specimen
from gp_labeler.jobs.runner import QueueDispatcher
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.panels.atlas.repeatability_card import RepeatabilityCard

CODES = ("CA", "CB", "RWA", "RWP", "OS", "LLI")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("repeated")
    write_repeated(folder, 3, codes=CODES)
    return folder


@pytest.fixture
def workspace():
    workspace = workspace_with_scan()
    yield workspace
    workspace.close()


def test_specimen_files_and_their_exports_hold_the_same_labellings(folder, tmp_path):
    for file in folder.glob("*.gpspecimen.json"):
        export_landmarks(read_specimen(file), tmp_path)
    direct, exported, both = (read_labellings(p) for p in ([folder], [tmp_path], [folder, tmp_path]))
    who = [(each.specimen.name, each.observer, each.round) for each in direct.labellings]
    assert who == [(f"GP{i}", *sitting) for i in range(3) for sitting in SITTINGS]
    expected = reliability(direct.labellings).as_dict()
    for read in (exported, both):
        assert reliability(read.labellings).as_dict() == expected
        assert read.skipped == ()
    assert set(both.files) == {"GP0", "GP1", "GP2"}
    assert not exported.files


def test_an_atlas_takes_the_mean_of_the_labellings_of_a_specimen_file(folder, tmp_path):
    for file in folder.glob("*.gpspecimen.json"):
        export_landmarks(read_specimen(file), tmp_path)
    animals, expected = read_animals([folder]), load_specimens(tmp_path)
    assert [animal.name for animal in animals.specimens] == ["GP0", "GP1", "GP2"]
    for animal, mean in zip(animals.specimens, expected, strict=True):
        for side in Side:
            assert animal.sides[side].array(CODES) == pytest.approx(mean.sides[side].array(CODES), abs=1e-12)
    assert "GP0 left: the mean of 3 labellings is taken." in animals.screened.notes


def test_the_card_shows_uses_and_saves_what_was_measured(workspace, folder, qtbot, tmp_path):
    card = RepeatabilityCard(workspace, actions_of(workspace, qtbot))
    qtbot.addWidget(card)
    card.resize(470, 900)
    card.show()
    assert not card.table.isVisible()
    workspace.reliability.measure([folder])
    deliver(workspace)
    report = reliability(read_labellings([folder]).labellings)
    cells = [card.table.item(0, column).text() for column in range(3)]
    assert cells == ["All", f"{report.overall.intra.mean_mm:.2f}", f"{report.overall.inter.mean_mm:.2f}"]
    assert card.table.rowCount() == 1 + len(CODES)
    assert "18 labellings of 6 sides (3 animals) by AB, CD" in card.words.text()
    assert list(cut_words(card)) == []
    asked = []
    card.disagreement_asked.connect(asked.append)
    card.findings.chosen.emit(report.disagreements[0])
    assert asked == [report.disagreements[0]]
    heard = []
    workspace.atlas.expectations_changed.connect(lambda: heard.append(True))
    card.use.setChecked(True)
    error = workspace.atlas.predict.args[0].labelling_error
    assert heard
    assert error.other_mm == report.overall.inter.sd_mm
    assert "measured on 3 animals, 2 observers" in workspace.atlas.labelling_error_text
    for name in ("a.csv", "a.json", "a.png"):
        workspace.reliability.save(tmp_path / name)
    assert json.loads((tmp_path / "a.json").read_text()) == report.as_dict()
    assert (tmp_path / "a.csv").read_text().startswith("feature,intra_n_pairs")
    card.use.setChecked(False)
    assert workspace.atlas.labelling_error_text == "0.1 mm per coordinate, assumed"


def test_show_opens_the_animal_at_the_disagreement(folder, one_window, qtbot):
    window, workspace = one_window, one_window.workspace
    workspace.reliability.measure([folder])
    wait_until_idle(qtbot, window)
    window.set_step("atlas")
    card = window.findChild(RepeatabilityCard)
    row = workspace.reliability.report.disagreements[0]
    show = next(b for b in card.findings.findChildren(QPushButton) if b.text() == "Show")
    qtbot.mouseClick(show, Qt.MouseButton.LeftButton)
    wait_until_idle(qtbot, window)
    active = workspace.labels.active
    assert workspace.document.state.specimen == row.specimen
    assert (active.side, active.code) == (row.side, row.code)
    (point,) = workspace.references.points
    assert row.code in point.name


def test_two_labels_are_looked_at_together_but_not_while_labelling_blind(folder):
    workspace = Workspace(None, QueueDispatcher(), author="CD")
    workspace.reliability.measure([folder])
    deliver(workspace)
    row = next(r for r in workspace.reliability.report.disagreements if "CD, round 1" in r.labellings)
    file = workspace.reliability.file_of(row)
    workspace.document.open(file)
    workspace.reliability.show(row)
    observer, number = row.labellings[0].split(", round ")
    state = workspace.document.state
    assert (state.labeller, state.round) == (observer, int(number))
    (point,) = workspace.references.points
    assert point.name == f"{row.code} {row.side.value} (CD, round 1)"
    away = point.position - state.side(row.side)[row.code]
    assert (away @ away) ** 0.5 == pytest.approx(row.distance_mm)
    workspace.label_again("EF")
    assert not workspace.references.points
    with pytest.raises(GpError, match="labelled blind, so its other labels are hidden"):
        workspace.reliability.file_of(row)
    workspace.close(discard=True)


def test_the_measured_error_is_remembered(folder, tmp_path):
    for expected in (None, 1):
        workspace = Workspace(tmp_path, QueueDispatcher())
        assert (workspace.atlas.labelling_error is not None) is bool(expected)
        workspace.reliability.measure([folder])
        deliver(workspace)
        workspace.reliability.use_error(True)
        workspace.close()


def test_files_without_repeats_say_what_is_needed(tmp_path):
    write_repeated(tmp_path, 1, codes=CODES, sittings=SITTINGS[:1])
    workspace, said = Workspace(None, QueueDispatcher()), []
    workspace.messages.said.connect(lambda text, level: said.append((text, level)))
    workspace.reliability.measure([tmp_path])
    deliver(workspace)
    assert "no side was labelled twice" in said[-1][0]
    assert said[-1][1] == "error"
    workspace.close()
