"""The list of specimens: told by their files, in the shell, and what is done with all of them."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from types import SimpleNamespace

import pytest
from panel_cases import deliver
from repeated_cases import write_repeated

from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_labeler.cli.entry import main
from gp_labeler.document.edits import AnnotatePoint, ClearPoint
from gp_labeler.document.specimen_file import read_document, read_specimen, thumbnail_in, write_specimen
from gp_labeler.document.specimen_list import list_specimens
from gp_labeler.document.volume_reference import VolumeReference
from gp_labeler.imaging.thumbnail import thumbnail
from gp_labeler.jobs.runner import QueueDispatcher
from gp_labeler.models.workspace import Workspace

CODES = ("CA", "CB", "RWA", "RWP", "OS", "LLI")
PNG = b"\x89PNG"


@pytest.fixture
def folder(tmp_path):
    folder = tmp_path / "lab"
    (folder / "study" / "deeper").mkdir(parents=True)
    write_repeated(folder / "study", 2)
    (file,) = write_repeated(folder / "study" / "deeper", 1, codes=CODES)
    state = AnnotatePoint(Side.LEFT, "CA", "guess", "fluid").apply(read_specimen(file))
    write_specimen(folder / "GP10.gpspecimen.json", renamed(state, "GP10"), thumbnail=PNG)
    file.unlink()
    (folder / "study" / "damaged.gpspecimen.json").write_text("{")
    (folder / ".hidden").mkdir()
    (folder / ".hidden" / "GP9.gpspecimen.json").write_text("{")
    return folder


def renamed(state, name):
    from gp_labeler.document.specimen_edits import RenameSpecimen

    return RenameSpecimen(name).apply(state)


def by_name(rows):
    return {row.specimen: row for row in rows}


def test_every_specimen_of_a_folder_is_told_by_its_file(folder):
    rows = by_name(list_specimens([folder]))
    assert set(rows) == {"GP0", "GP1", "GP10", "damaged"}
    assert rows["GP0"].is_finished
    assert rows["GP0"].labellings == ("AB, round 1", "AB, round 2", "CD, round 1")
    part = rows["GP10"]
    assert (part.done(Side.LEFT), part.n_notes, part.thumbnail, part.is_finished) == (7, 1, PNG, False)
    assert (part.observer, part.scan, part.scan_is_there) == ("AB", "", False)
    assert rows["damaged"].problem == "is not JSON: damaged or cut off"
    assert not rows["damaged"].is_finished
    with pytest.raises(GpError, match="does not exist"):
        list_specimens([folder / "none"])


def test_scans_that_nobody_has_begun_are_listed_by_their_names(folder, workspace, tmp_path, capsys):
    """Whatever they are kept in; but not those of a specimen, nor what only looks like a scan."""
    new = folder / "new"
    (new / "stack 12.5um").mkdir(parents=True)
    (new / "photos").mkdir()
    for n in range(20):
        (new / "stack 12.5um" / f"slice{n:04}.png").touch()
        (new / "photos" / f"{'abcdefghijklmnopqrst'[n]}.png").touch()
    for name in ("A1.nrrd", "A2.nii.gz", "A3.hdr", "A3.img", "A4.ISQ;1", "A5.seg.nrrd", "A6.vtk", ".A7.mha"):
        (new / name).touch()
    (new / "A8.tif").write_bytes(b"picture")
    (new / "A9.tif").write_bytes(bytes(1 << 22))
    state = read_specimen(folder / "GP10.gpspecimen.json")
    (folder / "GP10.mha").touch()  # beside its specimen
    (folder / "study" / "elsewhere.nrrd").touch()
    volume = VolumeReference("scan", (2, 2, 2), (1.0, 1.0, 1.0), "", str(folder / "study" / "elsewhere.nrrd"))
    write_specimen(folder / "GP11.gpspecimen.json", replace(renamed(state, "GP11"), volume=volume))
    rows = by_name(list_specimens([folder]))
    begun = {"GP0", "GP1", "GP10", "GP11", "damaged"}
    assert {name for name, row in rows.items() if row.is_begun} == begun
    assert rows.keys() - begun == {"A1", "A2", "A3", "A4", "A9", "stack 12.5um"}
    assert not rows["A1"].is_finished
    assert rows["A1"].as_dict()["begun"] is False
    assert main(["list", str(folder)]) == 0
    said = capsys.readouterr().out
    assert "11 specimens, 2 finished, 6 not begun" in said
    assert f"not begun  {new / 'A1.nrrd'}" in said
    model = workspace.specimens
    model.add(folder)
    deliver(workspace)
    model.show(kind="not begun")
    assert len(model.rows) == 6
    with pytest.raises(GpError, match="no labelled specimens are listed"):
        model.export(tmp_path / "out")
    assert model.text == "6 of 11 specimens, 2 finished, 6 not begun"


def test_only_what_has_changed_is_read_and_checked_again(folder, workspace):
    before = list_specimens([folder])
    file = folder / "GP10.gpspecimen.json"
    write_specimen(file, replace(read_specimen(file), notes="a broken bulla"))
    (folder / "GP20.gpspecimen.json").write_bytes(file.read_bytes())
    after = list_specimens([folder], known=before)
    kept = [row.path for row in after if any(row is each for each in before)]
    assert {path.name for path in kept} == {"GP0.gpspecimen.json", "GP1.gpspecimen.json"}
    assert {row.path.name: row.notes for row in after}["GP10.gpspecimen.json"] == "a broken bulla"
    assert [replace(row, stamp=(0, 0)) for row in after if row.is_begun] == [
        replace(row, stamp=(0, 0)) for row in list_specimens([folder]) if row.is_begun
    ]
    model = workspace.specimens
    model.add(folder)
    deliver(workspace)
    assert {model.n_problems(row) for row in model.every} == {None}
    workspace.atlas.load()  # later than the list, it checks what is there
    deliver(workspace)
    counted = {row.path: model.n_problems(row) for row in model.every if not row.problem}
    state = read_specimen(file)
    moved = {key: replace(mark, position=(0.0, 0.0, 0.0)) for key, mark in state.landmarks.items()}
    some = {key: moved[key] if n == 0 else mark for n, (key, mark) in enumerate(state.landmarks.items())}
    write_specimen(file, replace(state, landmarks=some))
    model.refresh()
    deliver(workspace)
    now = {row.path: model.n_problems(row) for row in model.every if not row.problem}
    assert now[file] > counted[file]
    assert {path: n for path, n in now.items() if path != file} == {
        path: n for path, n in counted.items() if path != file
    }


def test_hundreds_of_specimens_take_seconds(folder):
    content = (folder / "study" / "GP0.gpspecimen.json").read_bytes()
    many = folder / "many"
    many.mkdir()
    for n in range(200):
        (many / f"A{n}.gpspecimen.json").write_bytes(content)
    start = time.process_time()
    assert len(list_specimens([many])) == 200
    assert time.process_time() - start < 4  # some 0.4 s on a quiet machine; no scan is opened


def test_the_shell_lists_them(folder, tmp_path, capsys):
    out = tmp_path / "list.json"
    assert main(["list", str(folder), "--json", str(out)]) == 0
    said = capsys.readouterr().out
    assert "GP0      left 20/20  right 20/20" in said
    assert "4 specimens, 2 finished" in said
    assert "damaged  cannot be read: is not JSON" in said
    assert [row["specimen"] for row in json.loads(out.read_text())] == ["GP10", "damaged", "GP0", "GP1"]
    assert main(["list", str(folder), "--unfinished"]) == 0
    assert "GP0 " not in capsys.readouterr().out
    assert main(["list", str(folder / "none")]) == 2


@pytest.fixture
def workspace(tmp_path):
    workspace = Workspace(tmp_path / "state", QueueDispatcher(), author="AB")
    yield workspace
    workspace.close(discard=True)


def test_the_list_filters_finds_the_next_and_remembers_its_folders(workspace, folder, tmp_path):
    workspace.atlas.load()
    workspace.specimens.add(folder)
    deliver(workspace)
    model = workspace.specimens
    assert model.text == "4 specimens, 2 finished"
    assert {row.specimen: model.n_problems(row) for row in model.every}["GP0"] == 0
    model.show(words="gp1 fluid")
    assert model.rows == ()
    model.show(words="GP1", kind="all")
    assert [row.specimen for row in model.rows] == ["GP10", "GP1"]
    model.show(words="", kind="unfinished")
    assert [row.specimen for row in model.rows] == ["GP10", "damaged"]
    model.show(kind="repeated")
    assert len(model.rows) == 3
    assert model.next_unfinished().specimen == "GP10"
    workspace.document.open(model.next_unfinished().path)
    with pytest.raises(GpError, match="no specimen of the list is unfinished"):
        model.next_unfinished()
    again = Workspace(tmp_path / "state", QueueDispatcher())
    assert again.specimens.folders == (folder,)
    again.close()


def test_a_saved_specimen_is_read_again_and_keeps_its_thumbnail(workspace, folder):
    workspace.specimens.add(folder)
    deliver(workspace)
    file = folder / "GP10.gpspecimen.json"
    workspace.document.open(file)
    workspace.document.do(ClearPoint(Side.LEFT, "CA"))
    workspace.document.save()  # without bone there is no new picture
    deliver(workspace)
    assert thumbnail_in(read_document(file)) == PNG
    assert by_name(workspace.specimens.every)["GP10"].done(Side.LEFT) == 5  # CO has gone with CA
    workspace.document.picture = lambda: PNG + b"new"
    workspace.document.do(ClearPoint(Side.LEFT, "CB"))
    workspace.document.save()
    assert thumbnail_in(read_document(file)) == PNG + b"new"


def test_all_that_are_shown_are_exported_and_fitted(workspace, folder, tmp_path):
    workspace.specimens.add(folder)
    deliver(workspace)
    said = []
    workspace.messages.said.connect(lambda text, level: said.append((text, level)))
    workspace.specimens.show(kind="finished")
    workspace.specimens.export(tmp_path / "out")
    deliver(workspace)
    assert said[-1] == ("Exported 2 specimens, 12 files", "info")
    assert (tmp_path / "out" / "GP1_CD_r1_R.mrk.json").exists()
    workspace.specimens.fit()
    deliver(workspace)
    assert [animal.name for animal in workspace.atlas.specimens] == ["GP0", "GP1"]
    write_specimen(folder / "twin.gpspecimen.json", read_specimen(folder / "study" / "GP0.gpspecimen.json"))
    workspace.specimens.refresh()
    deliver(workspace)
    workspace.specimens.export(tmp_path / "again")
    deliver(workspace)
    assert "is called GP0, as" in said[-1][0]
    assert not (tmp_path / "again").exists()


def test_the_thumbnail_is_bone_seen_from_the_left():
    import io

    import numpy as np
    from PIL import Image

    def block(low, high):
        return (
            np.stack(np.meshgrid(*[np.arange(a, b, 0.3) for a, b in zip(low, high, strict=True)]))
            .reshape(3, -1)
            .T
        )

    body, tower = block((0, 0, 0), (10, 50, 8)), block((0, 0, 8), (10, 7, 14))  # anterior is -y
    picture = thumbnail([SimpleNamespace(points=body), SimpleNamespace(points=tower)])
    image = np.asarray(Image.open(io.BytesIO(picture)))
    assert image.shape == (96, 128, 4)
    seen = image[..., 3] > 128
    rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
    assert np.ptp(columns) > 3 * np.ptp(rows)
    top = np.flatnonzero(seen[rows[0] + 2])
    assert top.max() < 64  # anterior is on the left
    assert thumbnail([]) is None
