"""Files of touches in which a feature was touched several times."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gp_core import read_landmarks, read_touches
from gp_core.cli.entry import main
from gp_core.errors import FeatureError, FileFormatError

HEAD = "name,x,y,z\n"
OTHERS = "CL,1,2,-3\nOS,4,1,2\nRWA,0,3,1\n"
MN = ((10, 0, 1), (10.3, 0, 1), (10, 0.3, 1))


def _write(folder: Path, text: str, name: str = "touches.csv") -> Path:
    file = folder / name
    file.write_text(text, encoding="utf-8")
    return file


def _rows(labels: tuple[str, ...]) -> str:
    return "".join(f"{name},{x},{y},{z}\n" for name, (x, y, z) in zip(labels, MN, strict=True))


FCSV = "# Markups fiducial file version = 4.11\n# CoordinateSystem = LPS\n" + "".join(
    f"{i},{x},{y},{z},0,0,0,1,1,1,0,MN,,\n" for i, (x, y, z) in enumerate(MN)
)
MARKUPS = (
    '{"markups": [{"type": "Fiducial", "coordinateSystem": "LPS", "controlPoints": ['
    + ", ".join(f'{{"label": "MN#{i + 1}", "position": {list(p)}}}' for i, p in enumerate(MN))
    + "]}]}"
)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.csv", HEAD + OTHERS + _rows(("MN", "mn", "MN"))),
        ("b.csv", HEAD + _rows(("MN#1", "MN #2", "mn#3")) + OTHERS),
        ("c.csv", _rows(("MN_L", "left MN", "MN_L#3")) + OTHERS.replace(",", "_L,", 1)),
        (
            "d.csv",
            "label,trial,x,y,z\n" + "".join(f"MN,{i + 1},{x},{y},{z}\n" for i, (x, y, z) in enumerate(MN)),
        ),
        ("e.fcsv", FCSV),
        ("f.mrk.json", MARKUPS),
    ],
)
def test_every_kind_of_file_may_hold_several_touches(tmp_path: Path, name: str, text: str) -> None:
    touches = read_touches(_write(tmp_path, text, name), "L")
    repeated = touches.repeats["MN"]
    np.testing.assert_array_equal(repeated.points, MN)
    np.testing.assert_allclose(touches["MN"], np.mean(MN, axis=0), atol=1e-12)
    assert touches.repeats.keys() == {"MN"}


def test_what_was_not_seen_is_no_touch(tmp_path: Path) -> None:
    text = HEAD + OTHERS + "MN,0,0,0\nMN,10,0,1\nOI,0,0,0\nOI,-1000,-1000,-1000\nS1,1,1,1\nS1,1,1,1.2\n"
    touches = read_touches(_write(tmp_path, text), "L")
    assert touches["MN"].tolist() == [10, 0, 1]
    assert "OI" in touches.unseen
    assert touches.extra["S1"].tolist() == [1, 1, 1.1]
    assert touches.repeats.keys() == {"S1"}


def test_what_was_not_seen_is_no_touch_in_a_file_of_ras(tmp_path: Path) -> None:
    text = HEAD.replace("x,y,z", "r,a,s") + OTHERS + "MN,-10,0,1\nOI,-1000,-1000,-1000\n"
    touches = read_touches(_write(tmp_path, text), "L")
    assert touches["MN"].tolist() == [10, 0, 1]
    assert "OI" in touches.unseen


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (HEAD + OTHERS + "MN,1,1,1\nMN,1,1,1\n", "MN.*copy"),
        (HEAD + OTHERS + "MN#2,1,1,1\nMN#2,1,1,2\n", "MN.*touch 2 twice"),
        ("name,trial,x,y,z\nMN,1.5,1,1,1\n", "MN.*whole number from 1"),
        ("name,trial,x,y,z\nMN,0,1,1,1\n", "MN.*whole number from 1"),
        (HEAD + OTHERS + "XX#1,1,1,1\n", "XX"),
    ],
)
def test_copies_and_wrong_numbers_are_refused(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises((FeatureError, FileFormatError), match=words):
        read_touches(_write(tmp_path, text), "L")


def test_numbered_touches_may_lie_at_one_place(tmp_path: Path) -> None:
    touches = read_touches(_write(tmp_path, HEAD + OTHERS + "MN#1,9,0,0\nMN#2,9,0,0\n"), "L")
    assert touches.repeats["MN"].spread_mm == 0


def test_labels_of_a_scan_still_name_each_point_once(tmp_path: Path) -> None:
    for text in (HEAD + OTHERS + "MN,1,1,1\nMN,2,1,1\n", HEAD + OTHERS + "MN#1,1,1,1\n"):
        with pytest.raises(FeatureError, match="MN"):
            read_landmarks(_write(tmp_path, text), side="L")


def test_the_command_tells_of_repeats_and_names_an_outlier(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = Path("docs/example/touches.csv").read_text(encoding="utf-8").splitlines()
    name, *xyz = next(line for line in lines if line.startswith("MN")).split(",")
    x, y, z = map(float, xyz)
    more = [f"{name}#{i},{x + dx},{y},{z}" for i, dx in ((2, 0.1), (3, 4.06))]
    file = _write(tmp_path, "\n".join([*lines, *more]) + "\n")
    assert main(["estimate", str(file), "--side", "L"]) in (0, 3)
    told = capsys.readouterr().out
    assert "mean of 2 of 3 touches, spread 0.05 mm" in told
    assert "touch 3 of 3 of MN lies 4.0 mm from the others" in told
