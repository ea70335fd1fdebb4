"""No name steers the terminal, no cell is a formula, and one point has one name."""

from __future__ import annotations

import dataclasses
import os
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest

from gp_core.cli import main
from gp_core.errors import FeatureError, GeometryError, GpError
from gp_core.io import read_landmarks, read_points, read_touches, write_csv
from gp_core.landmarks.features import Side
from gp_core.landmarks.sets import LandmarkSet
from gp_core.terminal import printable

CODES = ["\x1b[31m", "\x1b]0;title\x07", "\x9b31m", "\x07", "\x08\x08", "\rall is well", "\u202e", "\x7f"]


def is_control(c: str) -> bool:
    return (c < " " and c not in "\n\t") or "\x7f" <= c <= "\x9f" or c == "\u202e"


@pytest.mark.parametrize("code", CODES, ids=ascii)
def test_control_characters_are_shown(code: str) -> None:
    for text in (printable(f"a{code}b"), str(GpError("bad", file=f"a{code}b", landmark=code))):
        assert not any(is_control(c) for c in text), ascii(text)


def test_plain_text_stays_as_it_is() -> None:
    text = "GP-014 „Größe“ µm 模 1 °\n\tend"
    assert printable(text) == text


@pytest.mark.parametrize("code", CODES, ids=ascii)
@pytest.mark.parametrize("where", ["file name", "label", "argument", "animal"])
def test_no_command_passes_a_code_on(
    code: str, where: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / ("x.csv" if where != "file name" else f"x{code}.csv")
    label = f"OS{code}" if where == "label" else "OS"
    if where == "animal":
        file = tmp_path / f"x{code}_L.csv"
    file.write_text(f'name,x,y,z\n"{label}",1,2,3\nMN,4,5,9\nRWA,7,8,1\n', encoding="utf-8")
    side = f"L{code}" if where == "argument" else "L"
    words = ["check", str(file)] if where == "animal" else ["estimate", str(file), "--side", side]
    with suppress(SystemExit):  # of argparse
        main(words)
    said = capsys.readouterr()
    text = said.out + said.err
    assert text
    assert not any(is_control(c) for c in text), ascii(text)


def test_a_name_that_is_not_utf8_goes_through_every_output(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / os.fsdecode(b"sch\xe4del")
    folder.mkdir()
    touches = folder / os.fsdecode(b"touch\xff_L.csv")
    example = Path(__file__).parents[2] / "docs" / "example" / "touches.csv"
    touches.write_bytes(example.read_bytes())
    words = ["estimate", str(touches), "--side", "L"]
    for option, name in (("--json", b"p\xff.json"), ("--tfm", b"p\xff.tfm"), ("--csv", b"p\xff.csv")):
        words += [option, str(folder / os.fsdecode(name))]
    assert main(words) == 0
    assert "touch\\xff_L.csv" in capsys.readouterr().out
    assert len(list(folder.iterdir())) == 4


@pytest.mark.parametrize("label", ["=1+1", "+A1", "-2+3", "@SUM(A1)", "\t=1", "'=1", "plain", "'quoted"])
def test_no_cell_of_a_table_is_a_formula(label: str, tmp_path: Path) -> None:
    points = LandmarkSet.from_mapping({"CA": (1, 2, 3)}, Side.LEFT)
    points = dataclasses.replace(points, extra=MappingProxyType({label: np.array([4.0, -5.0, 6.0])}))
    write_csv(tmp_path / "a_L.csv", points)
    for line in (tmp_path / "a_L.csv").read_text().splitlines():
        for cell in line.split(","):
            assert cell[:1] not in ("=", "+", "@", "\t"), cell
            assert cell[:1] != "-" or float(cell) < 0, cell
    assert label.strip() in read_points(tmp_path / "a_L.csv").labels


@pytest.mark.parametrize(
    "names", [("S2", "s2"), ("Bolt", "bolt"), ("S2", " s2 "), ("OS", "os"), ("a b", "A  B")]
)
@pytest.mark.parametrize("suffix", [".csv", ".fcsv"])
def test_two_names_of_one_point_are_that_point_twice(
    names: tuple[str, str], suffix: str, tmp_path: Path
) -> None:
    file = tmp_path / f"a_L{suffix}"
    one, other = names
    if suffix == ".csv":
        file.write_text(f'name,x,y,z\n{one},1,2,3\n"{other}",4,5,6\nMN,7,8,1\n')
    else:
        rows = [(one, "1,2,3"), (other, "4,5,6"), ("MN", "7,8,1")]
        lines = [f"{i},{xyz},0,0,0,1,1,1,0,{name},," for i, (name, xyz) in enumerate(rows)]
        file.write_text(
            "# Markups fiducial file version = 4.11\n# CoordinateSystem = LPS\n" + "\n".join(lines)
        )
    touches = read_touches(file, "L", unknown="extra")
    points = [*touches.placed, *touches.extra]
    assert len(points) == 2
    (repeated,) = touches.repeats.values()
    assert len(repeated.points) == 2
    with pytest.raises(FeatureError, match="is in the file twice"):
        read_landmarks(file, side="L", unknown="extra")


@pytest.mark.parametrize("shift", [0.0, 1e-7, 5e-4])
@pytest.mark.parametrize("others", [{}, {"RWA": (0, 2, 3), "RWP": (0, 4, 3)}])
def test_an_axis_of_one_point_is_refused(
    shift: float, others: dict[str, tuple[float, float, float]], tmp_path: Path
) -> None:
    points = LandmarkSet.from_mapping(
        {"CA": (1, 2, 3), "CB": (1 + shift, 2, 3), "OS": (9, 9, 9), **others}, Side.LEFT
    )
    write_csv(tmp_path / "a_L.csv", points)
    with pytest.raises(GeometryError, match=r"a_L\.csv, landmark CA: CA and CB are at the same place"):
        read_landmarks(tmp_path / "a_L.csv")


@pytest.mark.parametrize("suffix", [".csv", ".mrk.json", ".fcsv", ".dat"])
def test_a_million_points_are_refused_quickly(suffix: str, tmp_path: Path) -> None:
    file = tmp_path / f"a_L{suffix}"
    file.write_text("OS,1,2,3\n" * 1_000_000)
    with pytest.raises(GpError, match=r"more than 10000|is not JSON"):
        read_landmarks(file)
