"""Features that are touched several times in the window: kept, asked for again, averaged, taken back."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from gp_core import Atlas, Side
from gp_core.errors import GpError
from gp_labeler.document.specimen_json import document_of, state_of
from gp_labeler.document.touches import TouchHow
from gp_labeler.models.workspace import Workspace

ATLAS = Atlas.published()
L = Side.LEFT


@pytest.fixture
def workspace() -> Iterator[Workspace]:
    workspace = Workspace(atlas=ATLAS, author="AB")
    yield workspace
    workspace.close(discard=True)


def _touched(workspace: Workspace, name: str) -> int:
    touch = workspace.document.state.touches.get((L, name))
    return 0 if touch is None else len(touch.positions)


def test_a_feature_is_asked_for_as_often_as_wanted(workspace: Workspace) -> None:
    pose, rng = workspace.pose, np.random.default_rng(0)
    pose.choose(touches_each=3)
    asked = []
    for _ in range(9):
        asked.append(pose.require_target())
        pose.record(ATLAS[asked[-1]] + rng.normal(0, 0.1, 3), TouchHow.TRACKED)
    assert asked == [code for code in ("CL", "MN", "OS") for _ in range(3)] or len(set(asked)) == 3
    assert all(_touched(workspace, name) == 3 for name in asked)
    estimate = pose.estimate
    assert estimate is not None
    assert estimate.pose is not None
    assert {len(one.points) for one in estimate.pose.repeats.values()} == {3}
    workspace.document.undo()
    assert _touched(workspace, asked[-1]) == 2
    with pytest.raises(GpError, match="1 to 9"):
        pose.choose(touches_each=0)


def test_the_probe_confirms_or_corrects_a_touch(workspace: Workspace) -> None:
    pose, at = workspace.pose, ATLAS["MN"]
    pose.record(at, TouchHow.TRACKED, name="MN")
    pose.record(at + np.array([0, 0, 0.4]), TouchHow.TRACKED, name="MN")
    assert _touched(workspace, "MN") == 2  # confirmed: both count
    pose.record(at + np.array([0, 0, 9.0]), TouchHow.TRACKED, name="MN")
    assert _touched(workspace, "MN") == 3  # of three, the odd one is found and named
    for name in ("CL", "OS", "RWA", "RWP"):
        pose.record(ATLAS[name], TouchHow.TRACKED, name=name)
    estimate = pose.estimate
    assert estimate is not None
    assert estimate.pose is not None
    assert estimate.pose.repeats["MN"].outliers == (3,)
    assert any("touch 3 of 3 of MN" in warning for warning in estimate.pose.warnings)
    pose.record(ATLAS["CL"] + np.array([4, 0, 0]), TouchHow.TRACKED, name="CL")
    assert _touched(workspace, "CL") == 1  # of two that disagree, the later one: a correction


@pytest.mark.parametrize("how", [TouchHow.TYPED, TouchHow.SCAN])
def test_what_is_typed_or_clicked_again_is_a_correction(workspace: Workspace, how: TouchHow) -> None:
    workspace.pose.record(ATLAS["MN"], how, name="MN")
    workspace.pose.record(ATLAS["MN"] + np.array([0, 0, 0.2]), how, name="MN")
    assert _touched(workspace, "MN") == 1


def test_repeats_of_a_file_come_and_stay(workspace: Workspace, tmp_path: Path) -> None:
    file = tmp_path / "touches.csv"
    rows = [
        (code, ATLAS[code] + np.array([0, 0, 0.1 * n]))
        for code in ("CL", "MN", "OS", "RWA")
        for n in range(3)
    ]
    file.write_text("name,x,y,z\n" + "".join(f"{code},{x},{y},{z}\n" for code, (x, y, z) in rows))
    workspace.pose.load(file)
    assert _touched(workspace, "MN") == 3
    state = workspace.document.state
    assert state_of(document_of(state)).touches == state.touches
    np.testing.assert_allclose(state.touched(L)["MN"], ATLAS["MN"] + np.array([0, 0, 0.1]))
