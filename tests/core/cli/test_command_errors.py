"""What a user gets wrong is said in one line that blames the right file, with the remedy."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import gp_core
from gp_core.atlas.sampling import draw_animal
from gp_core.cli import main
from gp_core.io import read_points, write_csv, write_markups


@pytest.fixture
def touches(tmp_path: Path) -> Path:
    atlas = gp_core.Atlas.published()
    rows = [f"{code},{','.join(repr(float(v)) for v in atlas[code] + 40)}" for code in gp_core.PROBE]
    path = tmp_path / "touches.csv"
    path.write_text("name,x,y,z\n" + "\n".join(rows) + "\n")
    return path


def _error(words: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    assert main(words) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1, error
    return error


def _damaged(content: dict[str, Any], what: str) -> dict[str, Any]:
    mean = np.array(content["mean_mm"])
    codes = content["features"]
    if what == "line":
        return {"mean_mm": (mean * [1, 0, 0]).tolist()}
    if what == "axis":
        mean[codes.index("CA")] = mean[codes.index("CB")]
        return {"mean_mm": mean.tolist()}
    if what == "scale":
        return {"mean_mm": (mean / 1000).tolist()}
    factor = 1e200 if what == "scatter" else 1e300
    key = "scatter_mm2" if what == "scatter" else "covariance_mm2"
    return {key: (factor * np.array(content[key])).tolist()}


@pytest.mark.parametrize("what", ["line", "axis", "scale", "scatter", "covariance"])
def test_a_bad_atlas_is_blamed_itself(
    what: str, touches: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    atlas = tmp_path / "atlas.json"
    gp_core.Atlas.published().save(atlas)
    content = json.loads(atlas.read_text())
    atlas.write_text(json.dumps({**content, **_damaged(content, what)}))
    error = _error(["estimate", str(touches), "--side", "L", "--atlas", str(atlas)], capsys)
    assert error.startswith(f"gp-core: {atlas}: is a damaged atlas: ")
    assert "touches.csv" not in error
    assert "gp-core fit" in error


def test_an_atlas_without_the_touched_features_is_named(
    touches: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = gp_core.Atlas.published()
    codes = tuple(code for code in whole.codes if code in ("CA", "CB", "RWA", "RWP", "DTL"))
    covariance = whole.cross_covariance(codes, codes)
    part = gp_core.Atlas("part", codes, whole.rows(codes), covariance, covariance, 22)
    part.save(tmp_path / "part.json")
    words = ["estimate", str(touches), "--side", "L", "--atlas", str(tmp_path / "part.json")]
    error = _error(words, capsys)
    assert f"{touches} with atlas {tmp_path / 'part.json'}: a pose needs at least three" in error


def test_too_few_animals_for_an_atlas_are_named(
    touches: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "labelled"
    folder.mkdir()
    animal = draw_animal(gp_core.Atlas.published(), rng=np.random.default_rng(0))
    write_markups(folder / "A_L.mrk.json", animal.side("L"), specimen="A")
    error = _error(["estimate", str(touches), "--side", "L", "--atlas", str(folder)], capsys)
    assert f"{folder}: an atlas needs at least three labelled sides, got 1" in error


def test_a_specimen_that_lacks_a_feature_is_blamed_itself(
    touches: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rng = np.random.default_rng(0)
    for name in "ABC":
        side = draw_animal(gp_core.Atlas.published(), rng=rng).side("L")
        write_markups(
            tmp_path / f"{name}_L.mrk.json",
            side.with_point("MN" if name == "B" else "CO", None),
            specimen=name,
        )
    words = ["--atlas", *(str(tmp_path / f"{name}_L.mrk.json") for name in "ABC"), "--method", "jrmpc"]
    error = _error(["estimate", str(touches), "--side", "L", *words], capsys)
    assert error.startswith("gp-core: specimen B, landmark MN: the left side has no MN")


@pytest.mark.parametrize("option", ["--json", "--csv", "--tfm", "--landmarks"])
def test_nothing_read_is_written_over(
    option: str, touches: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = touches.read_bytes()
    same = tmp_path / "." / "sub" / ".." / touches.name
    (tmp_path / "sub").mkdir()
    error = _error(["estimate", str(touches), "--side", "L", option, str(same)], capsys)
    assert error == f"gp-core: {same}: is an input, and {option} would overwrite it. Name another file.\n"
    assert touches.read_bytes() == before


def test_two_results_do_not_go_to_one_file(
    touches: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = str(tmp_path / "pose.txt")
    error = _error(["estimate", str(touches), "--side", "L", "--csv", out, "--tfm", out], capsys)
    assert f"{out}: would be written by --tfm and --csv" in error
    assert not Path(out).exists()


def test_an_atlas_is_not_written_over_the_animals_it_is_fitted_to(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = [tmp_path / f"{name}_L.mrk.json" for name in "ABC"]
    for file in files:
        animal = draw_animal(gp_core.Atlas.published(), rng=np.random.default_rng(ord(file.name[0])))
        write_markups(file, animal.side("L"), specimen=file.name[0])
    error = _error(["fit", *map(str, files), "-o", str(files[1])], capsys)
    assert error.startswith(f"gp-core: {files[1]}: is an input, and --output would overwrite it")


def test_writing_onto_a_folder_is_said_plainly(
    touches: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in "ABC":
        animal = draw_animal(gp_core.Atlas.published(), rng=np.random.default_rng(ord(name)))
        write_markups(tmp_path / f"{name}_L.mrk.json", animal.side("L"), specimen=name)
    for folder in ("/", str(tmp_path)):
        error = _error(["fit", str(tmp_path), "-o", folder], capsys)
        assert error == f"gp-core: {folder}: is a folder, not a file. Name a file in it.\n"
        error = _error(["estimate", str(touches), "--side", "L", "--json", folder], capsys)
        assert "is a folder" in error


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("touches.csv", "name;x;y;z\nOS;1,5;2,5;3,5\nCL;1,5;2,5;3,5\n"),
        ("touches.csv", "name,x,y,z\nOS,1,5,2,5,3,5\n"),
        ("touches.csv", "OS 1,5 2,5 3,5\nCL 2,5 6,5 -3,5\n"),
        ("touches.tsv", "name\tx\ty\tz\nOS\t1,5\t2,5\t3,5\n"),
        ("touches.dat", "1,5 2,5 3,5\n" * 6),
        ("touches.dat", "1,5\t2,5\t-3,5e1\n" * 6),
    ],
)
def test_decimal_commas_are_distinguished_from_columns(
    name: str, text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / name).write_text(text)
    error = _error(["estimate", str(tmp_path / name), "--side", "L"], capsys)
    assert f"{name}" in error
    assert "decimal points, not commas." in error


def test_points_apart_by_commas_are_read_as_ever(tmp_path: Path) -> None:
    (tmp_path / "touches.dat").write_text("1,2,3\n4,5,7\n7,8,9\n1,9,2\n3,3,9\n5,1,7\n")
    assert read_points(tmp_path / "touches.dat").points[0].position is not None


def test_check_takes_the_side_of_one_odd_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    animal = draw_animal(gp_core.Atlas.published(), rng=np.random.default_rng(5))
    odd = tmp_path / "odd.csv"
    write_csv(odd, animal.side("R"))
    assert "does not say which side" in _error(["check", str(odd)], capsys)
    assert main(["check", str(odd), "--side", "R", "--json", str(tmp_path / "out.json")]) in (0, 1)
    assert capsys.readouterr().out.startswith("odd: ")
    assert list(json.loads((tmp_path / "out.json").read_text())) == ["odd"]
    assert "--side is for one file, got 2" in _error(["check", str(odd), str(odd), "--side", "R"], capsys)
    write_csv(tmp_path / "A_L.csv", animal.side("L"))
    assert "is the left side" in _error(["check", str(tmp_path / "A_L.csv"), "--side", "R"], capsys)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "gp-core: the following arguments are required: COMMAND. See gp-core --help."),
        (
            ["physical", "--touches", "t.csv", "--ct-landmarks", "m.csv"],
            "gp-core: the following arguments are required: --side. See gp-core physical --help.",
        ),
        (["estimate", "a.csv", "--side", "X"], "gp-core: argument --side: invalid choice: 'X'"),
        (
            ["check", "a.csv", "--colour\n\x1b[31m"],
            "gp-core: unrecognized arguments: --colour \\x1b[31m. See",
        ),
    ],
    ids=str,
)
def test_a_wrong_command_line_is_refused_in_one_line(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(words)
    error = capsys.readouterr().err
    assert ended.value.code == 2
    assert error.startswith(said)
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    "option",
    [["--path-rows", "3"], ["--path-axes", "z,y,x"], ["--path-units", "mm"], ["--path-out", "a.csv"]],
    ids=str,
)
def test_no_option_of_a_path_is_passed_over(
    option: list[str], touches: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    error = _error(["estimate", str(touches), "--side", "L", *option], capsys)
    assert error == f"gp-core: {option[0]} needs a path. Give --path CSV.\n"


@pytest.mark.parametrize(
    ("option", "name"),
    [("--json", "pose.tfm"), ("--tfm", "pose.json"), ("--csv", "pose.JSON"), ("--landmarks", "a.fcsv")],
)
def test_no_result_takes_the_name_of_another_kind(
    option: str, name: str, touches: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / name
    error = _error(["estimate", str(touches), "--side", "L", option, str(file)], capsys)
    assert error.startswith(f"gp-core: {file}: {option} writes a ")
    assert not file.exists()
