"""A command with several outputs replaces none of its old files unless it can write all of them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from document_cases import Editing

from gp_core.landmarks.measurements import Measurement
from gp_labeler.cli.entry import main
from gp_labeler.document.measurement_edits import AddMeasurements
from gp_labeler.document.specimen_edits import RenameSpecimen
from gp_labeler.document.specimen_file import write_specimen

OLD = b"what was there before\n"


def make_phantom(_: Path) -> list[str]:
    return ["phantom", "-o", "out/head.nrrd", "--spacing", "0.5", "--labelled"]


def export(folder: Path) -> list[str]:
    files = []
    for name in ("GP1", "GP2"):
        editing = Editing()
        editing.document.do(RenameSpecimen(name))
        editing.labels.place((1, 2, 3), side="L", code="CA")
        editing.labels.place((-1, 2, 3), side="R", code="CA")
        editing.document.do(AddMeasurements((Measurement("width", ((0, 0, 0), (1, 2, 2))),)))
        files.append(str(folder / f"{name}.gpspecimen.json"))
        write_specimen(files[-1], editing.document.state)
    return ["export", *files, "-o", "out", "--measurements", "--replace"]


COMMANDS: dict[str, tuple[Callable[[Path], list[str]], tuple[str, ...]]] = {
    "phantom": (make_phantom, ("head.nrrd", "head.truth.json", "head_L.mrk.json", "head_R.mrk.json")),
    "export": (
        export,
        tuple(f"{name}_{what}.mrk.json" for name in ("GP1", "GP2") for what in ("L", "R", "width")),
    ),
}
CASES = [("phantom", "head_R.mrk.json"), *(("export", broken) for broken in COMMANDS["export"][1])]


@pytest.mark.parametrize(("command", "broken"), CASES)
def test_old_files_are_kept_if_one_output_cannot_be_written(
    command: str,
    broken: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    make_words, files = COMMANDS[command]
    words = make_words(tmp_path)
    out = tmp_path / "out"
    out.mkdir()
    for name in files:
        (out / name).write_bytes(OLD)
    (out / broken).unlink()
    (out / broken).mkdir()
    assert main(words) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert {file.name for file in out.iterdir()} == set(files)
    assert {file.read_bytes() for file in out.iterdir() if file.is_file()} == {OLD}
    (out / broken).rmdir()
    assert main(words) == 0
    assert {file.name for file in out.iterdir()} == set(files)
    assert OLD not in {file.read_bytes() for file in out.iterdir()}
