"""Figures show what they are given, where it lies, in one frame; the examples of the docs run."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import pyvista
from PIL import ImageColor

from gp_core import PROBE, Atlas, GpError, RigidTransform, Side, Specimen, estimate_pose
from gp_core.landmarks.sets import LandmarkSet
from gp_labeler.imaging.surface import extract_isosurface
from gp_labeler.imaging.volume import Volume
from gp_labeler.plotting import compare, plot
from gp_labeler.scene.colours import LIGHT

ROOT = Path(__file__).resolve().parents[2]
ATLAS = Atlas.published()
LOOK = {"off_screen": True, "window_size": (320, 240)}
IN_SCAN = RigidTransform.identity(dst="scan", src="tracker")


def pose_of(side: Side = Side.LEFT, shift: float = 0.0):
    mirror = np.array([1.0 if side is Side.LEFT else -1.0, 1.0, 1.0])
    return estimate_pose({code: mirror * ATLAS[code] + [shift, 0, 0] for code in PROBE}, side, ATLAS)


@pytest.fixture(autouse=True)
def _closed():
    """Let pyvista, which keeps every plotter, forget those that a test or an example leaves open."""
    yield
    pyvista.close_all()


@pytest.fixture(scope="module")
def bone():
    index = np.moveaxis(np.indices((24, 24, 24)), 0, -1) - 11.5
    volume = Volume.from_parts(
        (9 - np.linalg.norm(index, axis=-1)).astype(np.float32), [1.0] * 3, [-11.5] * 3
    )
    return extract_isosurface(volume, 0.0)


def drawn(plotter) -> np.ndarray:
    picture = plotter.screenshot(return_img=True)
    plotter.close()
    return picture[..., :3].astype(int)


def share_of(picture: np.ndarray, colour: str, within: int = 60) -> float:
    return float((np.abs(picture - ImageColor.getrgb(colour)).max(axis=-1) < within).mean())


@pytest.mark.parametrize("side", list(Side))
def test_a_pose_is_drawn_in_the_middle(side: Side) -> None:
    picture = drawn(plot(pose_of(side), **LOOK))
    blue = picture[..., 2] - picture[..., 0] > 40
    assert 0.05 < blue.mean() < 0.6
    np.testing.assert_allclose(np.argwhere(blue).mean(axis=0), [120, 160], atol=40)
    assert not blue[:3].any()
    assert not blue[-3:].any()


def test_bone_is_drawn_around_a_pose(bone) -> None:
    alone, over = (drawn(plot(pose_of(), over=each, T_scan_data=IN_SCAN, **LOOK)) for each in (None, bone))
    assert (np.abs(alone - over).max(axis=-1) > 8).mean() > 0.3


def test_frames_that_do_not_meet_are_refused(bone) -> None:
    with pytest.raises(
        GpError, match=r"the bone is in the frame scan, what is drawn over it in tracker.*T_scan"
    ):
        plot(pose_of(), over=bone, **LOOK)
    with pytest.raises(GpError, match="must lead from tracker to scan, got scan to tracker"):
        plot(pose_of(), over=bone, T_scan_data=IN_SCAN.inverse(), **LOOK)
    moved = replace(pose_of(), transform_to_touches=IN_SCAN @ pose_of().transform_to_touches)
    with pytest.raises(GpError, match="in the frames scan and tracker"):
        compare([pose_of(), moved], **LOOK)


def test_landmarks_and_atlases_are_drawn_with_their_names(bone) -> None:
    labels = LandmarkSet.from_mapping({"CA": [0, 0, 0], "IN": [8.0, 0, 0]}, "L")
    for data, colour in (
        (labels, "placed"),
        (Specimen("GP", {Side.LEFT: labels}), "placed"),
        (ATLAS, "ghost"),
    ):
        with_names, without = (drawn(plot(data, names=names, **LOOK)) for names in (True, False))
        assert share_of(without, LIGHT.states[colour]) > 0.001
        assert 0.001 < (np.abs(with_names - without).max(axis=-1) > 60).mean() < 0.2


def test_scans_and_surfaces_are_drawn(bone) -> None:
    assert drawn(plot(bone, **LOOK)).std() > 10
    scan = Volume(np.random.default_rng(0).integers(0, 255, (9, 9, 9), np.uint8), np.eye(4))
    assert drawn(plot(scan, **LOOK)).std() > 10


def test_poses_are_compared_in_colours_and_words() -> None:
    plotter = compare({"first": pose_of(), "second": pose_of(shift=0.5)}, **LOOK)
    words = " ".join(actor.GetInput() for actor in plotter.actors.values() if hasattr(actor, "GetInput"))
    assert "first" in words
    assert "second: 0.50 mm, 0.0 deg" in words
    picture = drawn(plotter)
    assert (picture[..., 0] - picture[..., 2] > 40).mean() > 0.02
    assert (picture[..., 2] - picture[..., 0] > 20).mean() > 0.02


def test_none_and_too_many_poses_are_refused() -> None:
    for poses in ([], [pose_of()] * 7):
        with pytest.raises(GpError, match=rf"between 1 and 6 poses can be compared, got {len(poses)}"):
            compare(poses, **LOOK)
    with pytest.raises(GpError, match="no pyvista dataset can be made of str"):
        plot("head.nrrd")


def test_the_example_of_the_docs_runs(tmp_path: Path, monkeypatch, capfd) -> None:
    (tmp_path / "docs").symlink_to(ROOT / "docs")
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "docs" / "pyvista.md").read_text(encoding="utf-8").partition("## Figures")[2]
    code = re.search(r"```python\n(.*?)```", text, re.DOTALL)[1]
    exec(compile(code, "docs/pyvista.md", "exec"), {})
    assert {path.name for path in tmp_path.glob("*.png")} == {"atlas.png", "pose.png", "compare.png"}
    assert capfd.readouterr().err == ""
