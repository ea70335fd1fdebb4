"""Steps straighten the head and turn the slices as the window does; a recording does it again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from document_cases import head_frame
from script_cases import SPECIMEN, content, place, run
from window_cases import MIDDLE, VOXEL_MM, Answers, ball_volume

from gp_core.errors import GpError
from gp_labeler.document.edit_tables import script_table
from gp_labeler.document.head_edits import SetHeadFrame
from gp_labeler.jobs.head import Straighten
from gp_labeler.scripting.script import StepError, make_script
from gp_labeler.scripting.window_driver import WindowDriver
from gp_labeler.views.recorder import Recorder

HEAD = head_frame((25, -15, 70), tuple(MIDDLE))
SET = script_table(SetHeadFrame(HEAD))


def test_a_click_in_the_frame_of_the_head_places_in_the_scan(tmp_path) -> None:
    where = MIDDLE + np.array([1.3, -2.2, 0.9])
    clicks = [
        place(code, where, view=view, within=0.6 * VOXEL_MM)
        for code, view in {"CA": "axial", "CB": "sagittal"}.items()
    ]
    turned = {"do": "view", "turn": {"axial": 20.0, "coronal": -35.0}}
    oblique = place("CC", where, view="coronal", within=0.6 * VOXEL_MM)
    report = run(tmp_path, SET, *clicks, turned, oblique, {"do": "view", "frame": "scan"}, {"do": "save"})
    assert report.ok, report.error
    saved = content(tmp_path / "out" / SPECIMEN)
    for code in ("CA", "CB", "CC"):
        assert np.abs(np.subtract(saved["landmarks"]["L"][code]["position"], where)).max() < 0.6 * VOXEL_MM
    assert saved["headFrame"]["shown"] is False
    np.testing.assert_allclose(saved["headFrame"]["T_head_scan"], HEAD.matrix)


def test_the_head_is_turned_by_hand_and_what_is_refused_ends_the_script(tmp_path, monkeypatch) -> None:
    report = run(tmp_path, SET, {"do": "turn_head", "yaw": 10.0}, {"do": "save"})
    assert report.ok, report.error
    turned = np.array(content(tmp_path / "out" / SPECIMEN)["headFrame"]["T_head_scan"])
    assert turned[2, :3] == pytest.approx(np.array(HEAD.matrix)[2, :3])
    assert turned[0, :3] @ np.array(HEAD.matrix)[0, :3] == pytest.approx(np.cos(np.radians(10)))
    refused = run(tmp_path, {"do": "straighten", "by": "landmarks"})
    assert not refused.ok
    assert "no landmark is placed" in refused.error


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"do": "straighten", "by": "luck"}, "by must be one of symmetry"),
        ({"do": "straighten", "by": "points", "midline": [0, 0, 0]}, "needs midline, left and right"),
        ({"do": "straighten", "left": [0, 0, 0]}, "is for by = 'points'"),
        ({"do": "straighten", "by": "landmarks", "near": [0, 0, 0]}, "is for by = 'symmetry'"),
        ({"do": "straighten", "by": "landmarks", "like": "a.gpspecimen.json"}, "is for by = 'symmetry'"),
        ({"do": "view", "plane": "up"}, "plane must be one of"),
        ({"do": "view", "frame": "atlas"}, "frame must be one of"),
        ({"do": "view", "turn": {"3d": 4.0}}, "turn must be one of"),
        ({"do": "set_head_frame", "head": {"matrix": [[1, 0, 0, 0]] * 4}}, "not rigid"),
    ],
)
def test_steps_that_cannot_be_done_are_refused_before_any_is(table, words) -> None:
    with pytest.raises(StepError, match=words):
        make_script([table])


def test_step_and_menu_take_another_head_as_the_template(tmp_path, monkeypatch) -> None:
    asked: list[Path | None] = []

    def remember(job: Straighten, progress: object) -> None:
        asked.append(job.like)
        raise GpError("enough")

    monkeypatch.setattr(Straighten, "run", remember)
    file = tmp_path / "one.gpspecimen.json"
    file.write_text("{}")
    report = run(tmp_path, {"do": "straighten", "like": file.name})
    assert "enough" in report.error
    driver = WindowDriver(tmp_path, tmp_path)
    try:
        driver.window.workspace.scan.begin(ball_volume())
        driver.window.prompts = Answers()
        driver.window.prompts.files = [file]
        assert driver.window.commands.run("head.like")
        driver.wait_until_idle()
    finally:
        driver.close()
    assert asked == [file, file]


def test_what_a_hand_turned_is_written_down_with_its_value(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(Straighten, "run", lambda job, progress: pytest.fail("it is an exact edit"))
    driver = WindowDriver(tmp_path, tmp_path)
    try:
        recorder = Recorder(driver.window)
        driver.workspace.document.do(SetHeadFrame(HEAD))
        driver.workspace.view.set_crosshair(MIDDLE)
        driver.workspace.view.planes_turned.emit("axial", np.radians(12.5))
        driver.workspace.interaction.set_tool("turn")
        tables = list(recorder.tables)
    finally:
        driver.close()
    assert SET in tables
    assert {"do": "action", "id": "head.by_hand"} in tables
    turned = next(table for table in tables if table["do"] == "view" and "turn" in table)
    assert turned["turn"]["axial"] == pytest.approx(12.5)
    assert turned["go_to"] == pytest.approx(MIDDLE.tolist())
    make_script(tables)
