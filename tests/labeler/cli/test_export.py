"""`gp-labeler export`: what the window's export writes, from the shell."""

from __future__ import annotations

from functools import partial

import numpy as np
from document_cases import Editing

from gp_core.cli import main as core
from gp_core.io import load_specimens, read_measurements
from gp_core.landmarks.measurements import Measurement
from gp_labeler.cli.entry import main
from gp_labeler.document.measurement_edits import AddMeasurements
from gp_labeler.document.specimen_file import read_specimen, write_specimen
from gp_labeler.imaging.bone_distance import scan_evidence
from gp_labeler.imaging.volume import Volume


def _specimen(folder):
    editing = Editing()
    editing.labels.place((1, 2, 3), side="L", code="CA")
    editing.labels.suggest((4, 5, 6), side="L", code="OS", radius_95=0.5, source="atlas")
    write_specimen(folder / "GP1.gpspecimen.json", editing.document.state)
    return str(folder / "GP1.gpspecimen.json")


def test_suggestions_are_left_out_unless_asked_for(tmp_path, capsys) -> None:
    file = _specimen(tmp_path)
    assert main(["export", file, "-o", str(tmp_path / "plain")]) == 0
    assert [path.name for path in (tmp_path / "plain").iterdir()] == ["unnamed_L.mrk.json"]
    assert "suggested, not confirmed: OS" in capsys.readouterr().out
    assert main(["export", file, "-o", str(tmp_path / "both"), "--suggested"]) == 0
    (animal,) = load_specimens(tmp_path / "both")
    assert animal.side("L").placed == ("CA",)
    assert set(animal.side("L").suggested) == {"OS"}


def test_rulers_are_written_where_asked_for(tmp_path) -> None:
    editing = Editing()
    editing.labels.place((1, 2, 3), side="L", code="CA")
    ruler = Measurement("width", ((0, 0, 0), (1, 2, 2)))
    editing.document.do(AddMeasurements((ruler,)))
    file, out = tmp_path / "GP1.gpspecimen.json", tmp_path / "out"
    write_specimen(file, editing.document.state)
    assert main(["export", str(file), "-o", str(out), "--measurements"]) == 0
    assert read_measurements(out / "unnamed_width.mrk.json") == (ruler,)
    assert [animal.name for animal in load_specimens(out)] == ["unnamed"]


def test_nothing_is_replaced_unasked(tmp_path, capsys) -> None:
    file, out = _specimen(tmp_path), str(tmp_path / "out")
    assert main(["export", file, "-o", out]) == 0
    assert main(["export", file, "-o", out]) == 2
    assert "already exists" in capsys.readouterr().err
    assert main(["export", file, "-o", out, "--replace"]) == 0
    assert main(["export", file, "-o", out, "--format", ".xyz"]) == 2


def test_distances_from_bone_reach_check_by_way_of_the_specimen_file(tmp_path, capsys) -> None:
    bone = np.zeros((40, 40, 40), np.int16)
    bone[:, :, :10] = 1000
    volume = Volume(bone, np.diag([0.5, 0.5, 0.5, 1.0]), name="block")
    editing = Editing()
    editing.document.measure = partial(scan_evidence, volume, 500.0)
    editing.labels.place((12.65, 10, 10), side="L", code="IN")
    editing.labels.place((4.5, 10, 10), side="L", code="ZL")
    file = editing.document.save(tmp_path / "GP1.gpspecimen.json")
    assert main(["export", str(file), "-o", str(tmp_path / "out")]) == 0
    assert core(["check", str(tmp_path / "out")]) == 1
    told = capsys.readouterr().out
    assert "IN is 7.9 mm from bone" in told
    assert "ZL is" not in told

    again = Editing(read_specimen(file))  # without the scan
    again.labels.place((12.65, 10, 11), side="L", code="IN")
    file = again.document.save(tmp_path / "GP2.gpspecimen.json")
    assert main(["export", str(file), "-o", str(tmp_path / "moved")]) == 0
    (animal,) = load_specimens(tmp_path / "moved")
    assert set(animal.side("L").scan_evidence.bone_distances) == {"ZL"}
    assert core(["check", str(tmp_path / "moved")]) == 0
