"""Files in and out: a bound on what is read, whole files or the old ones, devices written to, inputs kept."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import gp_core
from gp_core import disk
from gp_core.atlas.sampling import draw_animal
from gp_core.cli import main
from gp_core.errors import FileFormatError, GpError
from gp_core.io import write_markups

OLD = b"what was there before\n"


@pytest.fixture
def small_disk() -> Iterator[None]:
    """Let no file grow beyond 20 kB, as where a disk is full."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, before)
    signal.signal(signal.SIGXFSZ, handler)


@pytest.fixture
def labelled(tmp_path: Path) -> Path:
    folder = tmp_path / "labelled"
    folder.mkdir()
    for seed, name in enumerate("ABCD"):
        animal = draw_animal(gp_core.Atlas.published(), rng=np.random.default_rng(seed))
        for side in "LR":
            write_markups(folder / f"{name}_{side}.mrk.json", animal.side(side), specimen=name)
    return folder


def contents(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in folder.iterdir()}


# Reading


@pytest.mark.parametrize("name", ["pipe", "/dev/zero", "/dev/urandom", "folder", "large", "none", "\udcff"])
@pytest.mark.parametrize(
    "read", [disk.read_bytes, disk.read_json, disk.check_file], ids=["bytes", "json", "check"]
)
def test_only_plain_files_of_bounded_size_are_read(name: str, read: object, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    with (tmp_path / "large").open("wb") as file:
        file.truncate(disk.MAX_BYTES + 1)
    start = time.process_time()  # not what else the machine does
    with pytest.raises(FileFormatError) as caught:
        read(tmp_path / name)  # type: ignore[operator]
    assert "\n" not in str(caught.value)
    assert time.process_time() - start < 1


@pytest.mark.parametrize("opening", ["[", '{"a":'])
def test_deep_json_is_refused_in_a_line(opening: str, tmp_path: Path) -> None:
    (tmp_path / "deep.json").write_text(opening * 1_000_000)
    with pytest.raises(FileFormatError, match=r"deep\.json: is not JSON"):
        disk.read_json(tmp_path / "deep.json")


# Writing


@pytest.mark.parametrize("content", [b"", b"new", b"x" * 100_000])
def test_a_file_is_written_whole_and_nothing_else_is_left(content: bytes, tmp_path: Path) -> None:
    file = tmp_path / ("n" * 250 + ".json")
    disk.write_bytes(file, content)
    assert contents(tmp_path) == {file.name: content}


def test_a_full_disk_keeps_the_old_file(small_disk: None, tmp_path: Path) -> None:
    file = tmp_path / "pose.json"
    file.write_bytes(OLD)
    with pytest.raises(GpError, match=r"pose\.json: cannot be written .* The file is as it was"):
        disk.write_bytes(file, b"x" * 100_000)
    assert contents(tmp_path) == {"pose.json": OLD}


@pytest.mark.parametrize("suffix", [".png", ".pdf", ".svg"])
def test_a_figure_on_a_full_disk_keeps_the_old_one(
    suffix: str, small_disk: None, labelled: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    figure = tmp_path / f"figure{suffix}"
    figure.write_bytes(OLD)
    assert main(["distances", str(labelled), "--figure", str(figure)]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert figure.read_bytes() == OLD
    assert {file.name for file in tmp_path.iterdir()} == {figure.name, "labelled"}


def test_a_write_protected_file_is_not_replaced(tmp_path: Path) -> None:
    file = tmp_path / "kept.json"
    file.write_bytes(OLD)
    file.chmod(0o444)
    if os.access(file, os.W_OK):
        pytest.skip("root may write everything")
    with pytest.raises(GpError, match="Permission denied"):
        disk.write_bytes(file, b"new")
    assert file.read_bytes() == OLD


def test_a_link_stays_a_link_and_modes_are_kept(tmp_path: Path) -> None:
    target, link = tmp_path / "target", tmp_path / "link"
    target.write_bytes(OLD)
    target.chmod(0o640)
    link.symlink_to(target)
    disk.write_bytes(link, b"new")
    assert link.is_symlink()
    assert target.read_bytes() == b"new"
    assert target.stat().st_mode & 0o777 == 0o640


@pytest.mark.parametrize("name", ["a.json", "head.nii.gz"])
def test_drafts_of_killed_programs_are_cleaned_up_and_those_of_living_ones_are_not(
    tmp_path: Path, name: str
) -> None:
    code = f"""
import sys, time
from gp_core import disk
with disk.atomic_file({str(tmp_path / name)!r}) as draft:
    draft.write_text("half")
    print("ready", flush=True)
    time.sleep(60)
"""
    writer = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE)
    assert writer.stdout is not None
    writer.stdout.readline()
    disk.write_text(tmp_path / name, "whole")
    assert len(contents(tmp_path)) == 2
    assert all(file.endswith("".join(Path(name).suffixes)) for file in contents(tmp_path))
    writer.kill()
    writer.communicate()
    disk.write_text(tmp_path / name, "whole again")
    assert contents(tmp_path) == {name: b"whole again"}


# Devices and pipes


def test_a_device_is_written_to_and_stays(capsys: pytest.CaptureFixture[str], labelled: Path) -> None:
    assert main(["check", str(labelled), "--json", "/dev/null"]) in (0, 1)
    assert not Path("/dev/null").is_file()
    capsys.readouterr()
    assert main(["check", str(labelled), "--json", "/dev/full"]) == 2
    assert "No space left" in capsys.readouterr().err


def test_a_pipe_is_written_to_and_stays(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    heard: list[bytes] = []
    reader = threading.Thread(target=lambda: heard.append(pipe.read_bytes()))
    reader.start()
    disk.write_bytes(pipe, b"x" * 300_000)
    reader.join()
    assert heard == [b"x" * 300_000]
    assert pipe.is_fifo()


def test_a_pipe_that_nobody_reads_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(disk, "PIPE_PATIENCE_S", 0.1)
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(GpError, match="nobody reads this pipe"):
        disk.write_bytes(tmp_path / "pipe", b"x")


def test_standard_output_that_is_a_file_is_not_replaced(labelled: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.txt"
    words = [sys.executable, "-m", "gp_core.cli", "distances", str(labelled), "--json", "/dev/stdout"]
    with out.open("wb") as stream:
        done = subprocess.run(words, stdout=stream, stderr=subprocess.PIPE, check=False)
    assert (done.returncode, done.stderr) == (0, b"")
    text = out.read_text()
    assert '"typical_sd_mm"' in text
    assert "Distances between features on 8 sides" in text


# Inputs


@pytest.mark.parametrize("way", ["itself", "through a link", "by a hard link", "in a linked folder"])
@pytest.mark.parametrize(
    "words", [["fit", "{in}", "-o"], ["distances", "{in}", "--csv"], ["check", "{in}", "--json"]], ids=str
)
def test_no_input_in_a_folder_is_written_over(
    words: list[str], way: str, labelled: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    animal = labelled / "B_R.mrk.json"
    output = animal
    if way == "through a link":
        output = tmp_path / "link.json"
        output.symlink_to(animal)
    elif way == "by a hard link":
        output = tmp_path / "hard.json"
        output.hardlink_to(animal)
    elif way == "in a linked folder":
        (tmp_path / "other").symlink_to(labelled)
        output = tmp_path / "other" / animal.name
    before = contents(labelled)
    assert main([word.replace("{in}", str(labelled)) for word in words] + [str(output)]) == 2
    error = capsys.readouterr().err
    assert "is an input, and" in error
    assert error.count("\n") == 1
    assert contents(labelled) == before


def test_results_may_go_beside_the_inputs_again_and_again(labelled: Path) -> None:
    for _ in range(2):
        assert main(["fit", str(labelled), "-o", str(labelled / "atlas.json")]) == 0


def test_what_is_protected_stays_so_only_while_the_command_runs(tmp_path: Path) -> None:
    file = tmp_path / "touches.csv"
    file.write_bytes(OLD)
    with disk.protected_inputs([file]), pytest.raises(GpError, match="would be overwritten"):
        disk.write_bytes(file, b"new")
    disk.write_bytes(file, b"new")
    assert file.read_bytes() == b"new"
