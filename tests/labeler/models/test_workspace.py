"""The workspace without a window: opening, meshing, dragging, saving; what goes wrong is said."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from window_cases import BALL_MM, MIDDLE, VOXEL_MM, ball_volume, write_ball

from gp_core.atlas.atlas import Atlas
from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_core.landmarks.sets import LandmarkSet, Specimen
from gp_labeler.commands.actions import ACTIONS, run
from gp_labeler.document.recovery import find_recoveries
from gp_labeler.document.state import How
from gp_labeler.imaging.volume import Volume
from gp_labeler.jobs.mesh import MeshEars
from gp_labeler.jobs.runner import QueueDispatcher
from gp_labeler.models.workflow import Active
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.panels.label.card_content import content_of


class QueuedWorkspace(Workspace):
    """A workspace whose results are delivered on demand, and that remembers what it said."""

    def __init__(self, directory: Path | None = None) -> None:
        self.calls = QueueDispatcher()
        self.said: list[tuple[str, str]] = []
        super().__init__(directory, self.calls, author="AB")
        self.messages.said.connect(lambda text, level: self.said.append((level, text)))

    def wait(self) -> None:
        self.calls.deliver_until_idle(self.jobs)


@pytest.fixture
def workspace(tmp_path):
    made = QueuedWorkspace(tmp_path / "state")
    yield made
    made.close(discard=True)


@pytest.fixture
def on_ball(workspace, ball):
    workspace.scan.begin(ball)
    workspace.wait()
    return workspace


@pytest.fixture
def ball_file(tmp_path) -> Path:
    return write_ball(tmp_path / "ball.mha")


def test_a_scan_becomes_bone(workspace, ball_file) -> None:
    seen = []
    workspace.bone.surfaces_changed.connect(lambda: seen.append(len(workspace.bone.surfaces)))
    workspace.open(ball_file)
    workspace.wait()
    assert 700 < workspace.scan.threshold < 1400
    assert seen[-1] >= 1
    hit = workspace.bone.surfaces[0].pick(MIDDLE - [0, 20, 0], [0, 1, 0])
    assert abs(np.linalg.norm(hit.point - MIDDLE) - BALL_MM) < VOXEL_MM
    assert workspace.document.state.specimen == "ball"
    assert workspace.document.state.volume.checksum
    assert not workspace.document.dirty
    np.testing.assert_allclose(workspace.view.crosshair, MIDDLE)


def test_a_threshold_is_an_edit_and_a_proposal_is_none(on_ball) -> None:
    proposed = on_ball.scan.threshold
    assert on_ball.document.undo_text is None
    previews = []
    on_ball.scan.threshold_previewed.connect(previews.append)
    on_ball.scan.preview_threshold(1100.0)
    on_ball.scan.set_threshold(1000.0)
    assert previews == [1100.0, None]
    on_ball.wait()
    before = on_ball.bone.surfaces[0].n_triangles
    assert on_ball.scan.threshold == 1000.0
    on_ball.document.undo()
    on_ball.wait()
    assert on_ball.scan.threshold == proposed
    assert on_ball.bone.surfaces[0].n_triangles != before


def test_ears_are_meshed_finely_once_their_place_is_known(workspace) -> None:
    ball = ball_volume()
    large = np.kron(ball.array, np.ones((5, 5, 5), dtype=np.uint8)).astype(np.uint16)
    volume = Volume.from_parts(large, [VOXEL_MM / 5] * 3, ball.origin, name="large")
    workspace.scan.begin(volume)
    workspace.wait()
    assert {part.stride for part in workspace.bone.surfaces} == {2}
    for code, offset in (("CA", (5, 0, 0)), ("RWP", (5, 2, 0)), ("OS", (5, 0, 2))):
        workspace.labels.place(MIDDLE + np.array(offset), side=Side.LEFT, code=code)
    workspace.bone.mesh_ears(half_mm=1.0)
    workspace.wait()
    assert {part.stride for part in workspace.bone.surfaces} == {1, 2}


def test_an_ear_is_meshed_again_only_where_it_moved(workspace) -> None:
    ball = ball_volume()
    large = np.kron(ball.array, np.ones((5, 5, 5), dtype=np.uint8)).astype(np.uint16)
    workspace.scan.begin(Volume.from_parts(large, [VOXEL_MM / 5] * 3, ball.origin, name="large"))
    near = ["CA", "CB", "RWA", "RWP", "RWL", "RWM", "FPA", "FPP", "OS", "OI", "LLI", "MH", "CC"]

    def place(side: Side, x: float, y: float, codes: Sequence[str]) -> None:
        for code in codes:
            apart = 0.05 * np.array([near.index(code), near.index(code) ** 2 / 9, 0])
            workspace.labels.place(MIDDLE + np.array([x, y, 0]) + apart, side=side, code=code)
        workspace.wait()

    place(Side.LEFT, 5.0, 0.0, near)
    place(Side.RIGHT, -5.0, 0.0, near)
    workspace.bone.mesh_ears(half_mm=1.5)
    workspace.wait()
    fine = [part for part in workspace.bone.surfaces if part.stride == 1]
    assert len(fine) == 2
    jobs: list[MeshEars] = []
    workspace.jobs.started.connect(
        lambda task: jobs.append(task.job) if isinstance(task.job, MeshEars) else None
    )
    for y in (5.0, -5.0, 5.0, -5.0):  # clicks that contradict each other
        place(Side.LEFT, 5.0, y, near[:3])
    place(Side.LEFT, 5.0, 1.5, near)
    assert jobs == []
    place(Side.RIGHT, -5.0, 2.5, near)
    (job,) = jobs
    assert set(job.boxes) == {Side.RIGHT}
    still_fine = [part for part in workspace.bone.surfaces if part.stride == 1]
    assert len(still_fine) == 2
    assert len(set(map(id, fine)) & set(map(id, still_fine))) == 1  # the left ear is the one it was


def test_a_drag_shows_at_once_and_is_one_edit(on_ball) -> None:
    seen, document, labels = [], on_ball.document, on_ball.labels
    labels.place(MIDDLE, side=Side.LEFT, code="CA")
    on_ball.interaction.dragged.connect(
        lambda drag: seen.append(None if drag is None else drag.position.copy())
    )
    assert on_ball.interaction.begin_drag(Side.LEFT, "CA")
    for x in (1.0, 2.0, 3.0):
        on_ball.interaction.drag_to(MIDDLE + np.array([x, 0, 0]), How.SLICE)
        np.testing.assert_array_equal(document.landmarks("L")["CA"], MIDDLE)
    assert on_ball.interaction.end_drag()
    assert seen[-1] is None
    np.testing.assert_array_equal(document.landmarks("L")["CA"], MIDDLE + np.array([3, 0, 0]))
    document.undo()
    np.testing.assert_array_equal(document.landmarks("L")["CA"], MIDDLE)


def test_a_drag_that_comes_home_is_no_edit(on_ball) -> None:
    on_ball.labels.place(MIDDLE, side=Side.LEFT, code="CA")
    on_ball.interaction.begin_drag(Side.LEFT, "CA")
    on_ball.interaction.drag_to(MIDDLE + np.array([1, 0, 0]), How.SLICE)
    on_ball.interaction.drag_to(MIDDLE, How.SLICE)
    assert not on_ball.interaction.end_drag()
    assert not on_ball.interaction.begin_drag(Side.RIGHT, "CA")  # not placed
    on_ball.labels.lock(side=Side.LEFT, code="CA")
    assert not on_ball.interaction.begin_drag(Side.LEFT, "CA")


def test_listeners_follow_from_one_specimen_to_the_next(on_ball, ball) -> None:
    seen = []
    on_ball.document.landmarks_changed.connect(seen.append)
    on_ball.labels.place(MIDDLE, side=Side.LEFT, code="CA")
    on_ball.scan.begin(ball)
    assert not on_ball.document.landmarks(Side.LEFT).placed
    on_ball.labels.place(MIDDLE, side=Side.LEFT, code="CB")
    assert [sorted(code for _, code in changed) for changed in seen] == [["CA"], ["CB"]]


def test_arrow_keys_have_a_point_to_move(on_ball) -> None:
    assert on_ball.interaction.nudged_point() is None
    on_ball.labels.place(MIDDLE, side=Side.LEFT, code="CA")
    assert on_ball.labels.active != Active(Side.LEFT, "CA")
    assert on_ball.interaction.nudged_point() == (Side.LEFT, "CA")  # the one placed last
    on_ball.labels.go_to(Side.LEFT, "CA")
    on_ball.labels.place(MIDDLE + 1, side=Side.LEFT, code="CB")
    assert on_ball.interaction.nudged_point() == (Side.LEFT, "CA")  # the chosen one


def test_a_specimen_finds_its_scan(workspace, ball_file, tmp_path) -> None:
    workspace.open(ball_file)
    workspace.wait()
    workspace.labels.place(MIDDLE, side=Side.LEFT, code="CA")
    saved = workspace.document.save(tmp_path / "one")
    workspace.scan.begin(ball_volume())
    workspace.open(saved)
    workspace.wait()
    assert workspace.scan.volume.name == "ball"
    assert workspace.bone.surfaces
    assert "CA" in workspace.document.landmarks("L")


def test_where_a_specimen_is_kept_tells_two_of_one_name_apart(workspace, ball, tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("USERPROFILE", str(tmp_path))
    workspace.scan.begin(ball)
    assert workspace.document.location == ""
    for name, place in (("ball", "~"), ("study/ball", "~/study"), ("study/ball 2", "~/study/ball 2")):
        (tmp_path / "study").mkdir(exist_ok=True)
        saved = workspace.document.save(tmp_path / name)
        assert workspace.document.location == str(Path(place))
    workspace.open_specimen(saved, as_copy=True)
    assert workspace.document.location == f"copy of {Path('~/study/ball 2')}"
    workspace.scan.begin(ball)
    assert workspace.document.location == ""


def test_a_scan_that_moved_is_named_and_found_again(workspace, ball_file, tmp_path) -> None:
    workspace.open(ball_file)
    workspace.wait()
    saved = workspace.document.save(tmp_path / "one")
    workspace.scan.begin(ball_volume())
    moved = ball_file.rename(tmp_path / "elsewhere.mha")
    workspace.open(saved)
    workspace.wait()
    assert workspace.scan.volume is None
    assert any("ball" in text and level == "warning" for level, text in workspace.said)
    workspace.scan.find(moved)
    workspace.wait()
    assert workspace.scan.volume is not None


def test_a_phantom_which_is_in_no_file_is_made_again(workspace, tmp_path) -> None:
    workspace.scan.open_demo(seed=3, spacing=0.5)
    workspace.wait()
    workspace.labels.place(workspace.scan.truth.side("L")["CA"], side=Side.LEFT, code="CA")
    saved = workspace.document.save(tmp_path / "one")
    workspace.scan.begin(ball_volume())
    workspace.wait()
    workspace.open(saved)
    workspace.wait()
    assert workspace.scan.volume is not None
    assert workspace.scan.volume.name == "phantom-3"
    assert workspace.scan.truth is not None
    assert [text for level, text in workspace.said if level != "info"] == []


def test_a_scan_that_changed_is_noticed(workspace, ball_file, tmp_path) -> None:
    import SimpleITK as sitk  # noqa: N813

    workspace.open(ball_file)
    workspace.wait()
    saved = workspace.document.save(tmp_path / "one")
    image = sitk.ReadImage(str(ball_file))
    sitk.WriteImage(image + 1.0, str(ball_file))
    differs = []
    workspace.scan.differs.connect(lambda error, volume: differs.append((error, volume)))
    workspace.scan.begin(ball_volume())
    workspace.open(saved)
    workspace.wait()
    assert workspace.scan.volume is None
    (error, volume), *_ = differs
    assert "voxels" in str(error)
    workspace.scan.accept(volume)
    assert workspace.scan.volume is volume


def test_what_cannot_be_read_is_said_and_leaves_all_as_it_was(on_ball, tmp_path) -> None:
    (tmp_path / "x.nrrd").write_text("no scan")
    state = on_ball.document.state
    on_ball.open(tmp_path / "x.nrrd")
    on_ball.wait()
    assert on_ball.said[-1][0] == "error"
    assert "x.nrrd" in on_ball.said[-1][1]
    assert on_ball.document.state is state


def test_reading_can_be_stopped(workspace, ball_file) -> None:
    workspace.open(ball_file)
    workspace.jobs.cancel_all()
    workspace.wait()
    assert workspace.scan.volume is None
    assert workspace.said == []


def test_the_atlas_brings_ghosts(on_ball) -> None:
    on_ball.atlas.load()
    on_ball.wait()
    from gp_core.atlas.atlas import Atlas

    atlas = Atlas.published()
    for code in ("CA", "RWP", "OS"):
        where = atlas.mean[atlas.codes.index(code)] + MIDDLE
        on_ball.labels.place(where, side=Side.LEFT, code=code)
    ghosts = on_ball.labels.ghosts(Side.LEFT)
    for code in ("CB", "RWA", "LLI"):
        expected = atlas.mean[atlas.codes.index(code)] + MIDDLE
        assert np.linalg.norm(ghosts[code].position - expected) < 0.1


def test_actions_say_why_they_cannot(on_ball) -> None:
    on_ball.labels.place(MIDDLE, side=Side.LEFT, code="CA")
    on_ball.labels.lock(side=Side.LEFT, code="CA")
    on_ball.labels.go_to(Side.LEFT, "CA")
    assert not run("point.clear", on_ball)  # not even offered
    assert not ACTIONS["point.clear"].enabled(on_ball)
    assert not run("edit.swap_sides", on_ball)
    assert on_ball.said[-1][0] == "warning"
    with pytest.raises(GpError, match="unknown action"):
        run("edit.dance", on_ball)
    with pytest.raises(GpError, match="tool must be one of"):
        on_ball.interaction.set_tool("hammer")


def test_the_mesh_is_written(on_ball, tmp_path) -> None:
    on_ball.bone.save_mesh(tmp_path / "ball.ply")
    on_ball.wait()
    assert (tmp_path / "ball.ply").stat().st_size > 1000
    assert on_ball.said[-1] == ("info", "Wrote ball.ply")


def test_the_published_atlas_is_loaded_behind_the_window(workspace) -> None:
    assert workspace.atlas.current is None
    workspace.atlas.load()
    workspace.wait()
    assert workspace.atlas.current is Atlas.published()
    assert workspace.atlas.specimens == ()


def test_an_atlas_in_use_stays_for_the_next_specimen_and_is_not_loaded_over(workspace, ball) -> None:
    told = []
    workspace.atlas.changed.connect(lambda: told.append(workspace.atlas.current.name))
    animal = Specimen("A", {Side.LEFT: LandmarkSet.empty("L")})
    own = replace(Atlas.published(), name="own")
    workspace.atlas.use(own, [animal])
    workspace.atlas.load()
    workspace.scan.begin(ball)
    workspace.wait()
    assert told == ["own"]
    assert (workspace.atlas.current, workspace.atlas.specimens) == (own, (animal,))
    for code in ("CA", "CB", "RWA"):
        workspace.labels.place(own[code] + MIDDLE, How.SLICE, side=Side.LEFT, code=code)
    np.testing.assert_allclose(
        workspace.labels.ghosts(Side.LEFT)["RWP"].position, own["RWP"] + MIDDLE, atol=0.01
    )


def test_small_parts_are_left_out_as_asked(workspace) -> None:
    array = ball_volume().array.copy()
    array[60:62, 60:62, 60:62] = 1400  # half a millimetre across
    volume = Volume.from_parts(array, [VOXEL_MM] * 3, [0, 0, 0], name="ball")
    workspace.scan.begin(volume)
    workspace.wait()
    corner = volume.voxel_to_scan(np.array([[61.0, 61, 61]]))[0]

    def has_speck() -> bool:
        points = np.concatenate([part.points for part in workspace.bone.surfaces])
        return bool((np.linalg.norm(points - corner, axis=1) < 1).any())

    assert workspace.bone.smallest_part_mm == 1.0
    assert not has_speck()
    workspace.bone.set_smallest_part(0)
    workspace.wait()
    assert has_speck()
    with pytest.raises(GpError, match=r"a length in mm from 0, got -1"):
        workspace.bone.set_smallest_part(-1)
    with pytest.raises(GpError, match=r"a length in mm from 0, got nan"):
        workspace.bone.set_smallest_part(float("nan"))


def test_bone_too_thin_for_the_first_look_is_shown_by_the_second(workspace) -> None:
    array = np.zeros((200, 200, 200), np.uint8)
    array[100, 20:180, 20:180] = 200  # one voxel thick
    workspace.scan.begin(Volume.from_parts(array, [0.1] * 3, [0, 0, 0], name="sheet"))
    workspace.wait()
    seen = []
    workspace.bone.surfaces_changed.connect(
        lambda: seen.append(sum(part.n_triangles for part in workspace.bone.surfaces))
    )
    workspace.scan.set_threshold(150)
    workspace.wait()
    assert seen[-1] > 60_000
    assert not [text for level, text in workspace.said if level == "error"]


def test_what_is_edited_while_another_scan_loads_is_kept_and_told(on_ball, ball_file) -> None:
    workspace = on_ball
    workspace.labels.place(MIDDLE + np.array([0, 0, 6]), How.MESH, side=Side.LEFT, code="CA")
    workspace.document.abandon()
    workspace.open(ball_file)
    workspace.labels.place(MIDDLE + np.array([0, 6, 0]), How.MESH, side=Side.LEFT, code="CB")
    workspace.wait()
    assert not workspace.document.dirty
    assert any(
        "Unsaved edits of ball are kept" in text for level, text in workspace.said if level == "warning"
    )
    (kept,) = find_recoveries(workspace.directory)
    workspace.document.recover(kept)
    assert {"CA", "CB"} <= set(workspace.document.state.side(Side.LEFT).placed)


def test_what_is_given_up_is_not_offered_again(on_ball, ball_file) -> None:
    on_ball.labels.place(MIDDLE + np.array([0, 0, 6]), How.MESH, side=Side.LEFT, code="CA")
    on_ball.document.abandon()
    on_ball.open(ball_file)
    on_ball.wait()
    assert not any("kept" in text for _, text in on_ball.said)
    assert find_recoveries(on_ball.directory) == ()


def test_a_single_point_off_the_bone_is_found_by_the_scan(on_ball) -> None:
    on_ball.atlas.use(Atlas.published())
    out = np.array([0.0, 0.0, 1.0])
    on_ball.labels.place(MIDDLE + (BALL_MM + 1.0) * out, side=Side.LEFT, code="IN")
    on_ball.wait()
    problem = on_ball.labels.known_problems(Side.LEFT)["IN"]
    assert problem.kind == "off bone"
    distance = float(problem.text.split()[2])
    assert distance == pytest.approx(1.0, abs=VOXEL_MM)
    on_ball.labels.go_to(Side.LEFT, "IN")
    assert "from bone" in content_of(on_ball.labels, has_scan=True).status
    on_ball.labels.place(MIDDLE + BALL_MM * out, side=Side.LEFT, code="IN")
    on_ball.wait()
    assert not on_ball.labels.known_problems(Side.LEFT)
    on_ball.labels.place(MIDDLE + (BALL_MM - 2.0) * out, side=Side.LEFT, code="IN")
    on_ball.wait()
    assert not on_ball.labels.known_problems(Side.LEFT), "within bone it is not off it"


def test_the_scan_is_asked_again_when_its_threshold_changes(on_ball) -> None:
    on_ball.atlas.use(Atlas.published())
    on_ball.labels.place(MIDDLE + np.array([0, 0, BALL_MM]), side=Side.LEFT, code="IN")
    on_ball.wait()
    assert not on_ball.labels.known_problems(Side.LEFT)
    on_ball.scan.set_threshold(float(on_ball.scan.volume.array.max()) + 1)
    on_ball.wait()
    assert on_ball.labels.known_problems(Side.LEFT)["IN"].text == "IN is far from bone"
