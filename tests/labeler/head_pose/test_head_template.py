"""A straightened head that was saved says which way is front and up in other heads."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from small_heads import save_volume

from gp_core.errors import GpError
from gp_core.frames import RigidTransform
from gp_labeler.cli.entry import main
from gp_labeler.document.head_frame import HeadFrame
from gp_labeler.document.head_template import read_head_template
from gp_labeler.document.specimen_file import write_specimen
from gp_labeler.document.state import SpecimenState
from gp_labeler.document.volume_reference import VolumeReference
from gp_labeler.imaging.readers import read_volume
from gp_labeler.phantom import HeadVariation, make_phantom

PITCH_DEG = 30.0
"""By which a user turned the saved head after it was straightened."""


def phantom(seed: int, turn: tuple[float, float, float]):
    return make_phantom(seed, spacing=0.5, variation=HeadVariation().having({"turn": turn}))


@pytest.fixture(scope="module")
def saved(tmp_path_factory) -> Path:
    """A specimen file of a head whose pitch was set by hand, its scan beside it."""
    folder = tmp_path_factory.mktemp("saved")
    known, scan = phantom(21, (0.0, 0.0, 0.0)), folder / "known.nrrd"
    save_volume(scan, known.volume)
    pitched = _pitched(known.T_head_scan)
    state = SpecimenState(
        "known", volume=VolumeReference.of(read_volume(scan)), head_frame=HeadFrame.of(pitched)
    )
    write_specimen(folder / "known.gpspecimen.json", state)
    return folder / "known.gpspecimen.json"


def _pitched(T_head_scan: RigidTransform) -> RigidTransform:
    """Return the frame turned about its own left axis."""
    c, s = np.cos(np.radians(PITCH_DEG)), np.sin(np.radians(PITCH_DEG))
    turn = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    return RigidTransform.from_parts(
        turn @ T_head_scan.rotation, turn @ T_head_scan.translation, dst="head", src="scan"
    )


def test_the_pitch_of_a_saved_head_is_that_of_another_one_like_it(saved, tmp_path, capsys) -> None:
    other = phantom(25, (20.0, 70.0, -40.0))
    scan, found = tmp_path / "other.nrrd", tmp_path / "pose.json"
    save_volume(scan, other.volume)
    assert main(["straighten", str(scan), "--like", str(saved), "--json", str(found)]) == 0
    assert "known" in capsys.readouterr().out
    rotation = np.array(json.loads(found.read_text())["T_head_scan"])[:3, :3]
    turn = rotation @ _pitched(other.T_head_scan).rotation.T
    assert np.degrees(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1))) < 4.0


def test_what_cannot_be_a_template_is_named_with_the_remedy(saved, tmp_path) -> None:
    def refused(path: Path, words: str) -> None:
        with pytest.raises(GpError, match=words) as caught:
            read_head_template(path)
        assert str(path) in str(caught.value)

    plain = tmp_path / "plain.gpspecimen.json"
    write_specimen(plain, SpecimenState("plain"))
    refused(plain, "no head frame.*Straighten its head")
    content = json.loads(saved.read_text())
    content["volume"] = {
        **content["volume"],
        "path": str(tmp_path / "gone.nrrd"),
        "relative_path": "gone.nrrd",
    }
    lost = tmp_path / "lost.gpspecimen.json"
    lost.write_text(json.dumps(content))
    refused(lost, "scan is not there")
    refused(saved.with_name("known.nrrd"), "is not a specimen file")
