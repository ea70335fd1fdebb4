"""``-`` for the files of ``gp-labeler``: what `gp_core.standard_streams` does for each of its commands."""

from __future__ import annotations

import io
import json
from pathlib import Path

import pytest

from gp_labeler.cli.entry import main

STEP = b'[[step]]\ndo = "fly"\n'


@pytest.mark.parametrize(
    ("words", "given", "status", "said"),
    [
        ("-", b"x", 2, "the window opens files by name"),
        ("--offscreen - --output out", b"", 2, "standard input: is empty"),
        ("--offscreen - --output out", STEP, 1, "standard input: step 1: unknown step"),
        ("--offscreen - --output out", b'{"step": 3}', 2, "standard input: holds no steps"),
        ("list -", b"", 2, "standard input: is empty"),
        ("contact-sheet - -o -", b"{}", 2, "standard input.json: is not a specimen file"),
        ("check-library - --json -", b"{}", 2, "standard input: is not a markups file"),
        ("propose - --like labelled -o -", b"x", 2, "--output cannot be a stream"),
        ("propose - --like - -o out", b"x", 2, "only one file can be standard input"),
        ("export - -o out", b"{}", 2, "standard input: is not a specimen file"),
    ],
)
def test_what_cannot_be_is_said_in_one_line(
    words: str,
    given: bytes,
    status: int,
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(given)))
    assert main(words.split()) == status
    done = capsys.readouterr()
    assert said in done.err
    assert done.out == ""


def test_a_list_goes_out_as_json_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["list", ".", "--json", "-"]) == 0
    done = capsys.readouterr()
    assert json.loads(done.out) == []
    assert "0 specimens" in done.err
    assert list(tmp_path.iterdir()) == []


def test_text_for_people_names_the_stream_and_no_file_of_ours(
    tmp_path: Path, capsysbinary: pytest.CaptureFixture[bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["phantom", "--spacing", "0.5", "-o", "-"]) == 0
    scan, told = capsysbinary.readouterr()
    assert told.decode() == "standard output: 103 x 148 x 90 voxels, plain\n"
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(scan)))
    assert main(["mesh", "-", "-o", "-"]) == 0
    mesh, told = capsysbinary.readouterr()
    assert mesh.startswith(b"ply")
    assert told.decode().startswith("standard output: ")
    assert list(tmp_path.iterdir()) == []
