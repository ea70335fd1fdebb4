"""``-`` stands for standard input and output, for every command."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from gp_core import Atlas, read_pose
from gp_core.cli.entry import main
from gp_core.errors import FileFormatError
from gp_core.standard_streams import kind_of

TOUCHES = Path("docs/example/touches.csv")


class _Done(NamedTuple):
    returncode: int
    stdout: bytes
    stderr: bytes


Core = Callable[..., _Done]


@pytest.fixture
def core(capsysbinary: pytest.CaptureFixture[bytes], monkeypatch: pytest.MonkeyPatch) -> Core:
    def run(*words: str, given: bytes = b"") -> _Done:
        monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(given)))
        return _Done(main(words), *capsysbinary.readouterr())

    return run


def test_touches_in_a_pose_out_and_that_again_into_the_next_command(core: Core, tmp_path: Path) -> None:
    first = core("estimate", "-", "--side", "L", "--json", "-", given=TOUCHES.read_bytes())
    assert first.returncode == 0
    file = tmp_path / "pose.json"
    file.write_bytes(first.stdout)
    assert b"Cochlea from standard input, left side" in first.stderr
    second = core("estimate", "-", "--csv", "-", given=first.stdout)
    assert second.returncode == 0
    matrix = np.array([line.split(",") for line in second.stdout.decode().splitlines()], dtype=float)
    np.testing.assert_array_equal(matrix, read_pose(file).transform)


@pytest.mark.parametrize(
    ("words", "given", "said"),
    [
        (("estimate", "-", "--side", "L"), b"", "standard input: is empty"),
        (("estimate", "-", "--side", "L"), b"\x00\x01\x02", "standard input: is of an unknown kind"),
        (("estimate", "-", "--side", "L", "--atlas", "-"), b"x", "only one file can be standard input"),
        (("estimate", str(TOUCHES), "--side", "L", "--json", "-", "--tfm", "-"), b"", "standard output"),
        (("simulate", "a", "--physical", "-"), b"{}", "standard input: is not the result of a physical test"),
        (("import-mat", "a", "b", "-o", "-"), b"", "--output cannot be a stream"),
        (("estimate", "-", "--side", "L"), b"name,x,y\nCL,1,2\n", "standard input: its header must name"),
    ],
)
def test_what_cannot_be_is_said_in_one_line(
    core: Core, words: tuple[str, ...], given: bytes, said: str
) -> None:
    done = core(*words, given=given)
    assert done.returncode == 2
    assert said in done.stderr.decode()
    assert done.stderr.count(b"\n") == 1
    assert done.stdout == b""


def test_a_withheld_pose_goes_out_as_json_alone(core: Core) -> None:
    atlas = Atlas.published()
    names = {"CL": "OS", "OS": "CL"}
    rows = [
        f"{names.get(c, c)},{','.join(map(str, atlas[c]))}" for c in ("CL", "LLI", "MN", "OS", "RWA", "RWP")
    ]
    text = "\n".join(rows).encode()
    told = core("estimate", "-", "--side", "L", "--json", "-", given=text)
    assert told.returncode == 3
    content = json.loads(told.stdout)
    assert content["status"] == 3
    assert [reason["code"] for reason in content["reasons"]] == ["wrong names"]
    assert core("estimate", "-", "--side", "L", "--tfm", "-", given=text).stdout == b""


@pytest.mark.parametrize(
    ("head", "kind"),
    [
        (b"NRRD0004\n", ".nrrd"),
        (b"ObjectType = Image\nNDims = 3\n", ".mha"),
        (b"# Markups fiducial file version = 4.11\n", ".fcsv"),
        (b'{"@schema": "markups-schema-v1.0.3.json"', ".mrk.json"),
        (b'\xef\xbb\xbf{"gpAtlas": 1', ".json"),
        (b"label\tx\ty\tz\n", ".tsv"),
        ("name,x,y,z\n".encode("utf-16"), ".csv"),
        (b"1.0 2.0 3e-1\n-4 5 6\n", ".dat"),
        (b'# a script\n[[step]]\ndo = "open"\n', ".toml"),
        (b'specimens = ["a"]\n', ".toml"),
        (b"[[1, 2, 3]]", ".json"),
        (b"MATLAB 5.0 MAT-file", ".mat"),
        (b"\x00" * 128 + b"DICM", ".dcm"),
        (b"\x5c\x01\x00\x00" + b"\x00" * 340 + b"n+1\x00", ".nii"),
    ],
)
def test_the_kind_is_told_from_the_content(head: bytes, kind: str) -> None:
    assert kind_of(head) == kind


@pytest.mark.parametrize("head", [b"\x1f\x8bxxxx", b"\x00\x00", b""])
def test_what_is_of_no_kind_is_refused(head: bytes) -> None:
    with pytest.raises(FileFormatError, match="of an unknown kind"):
        kind_of(head)
