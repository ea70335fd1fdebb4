from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import gp_core
from gp_core.atlas.sampling import draw_animal
from gp_core.cli import main
from gp_core.io import write_csv

pytestmark = pytest.mark.machine

_KEYS = {
    "method",
    "side",
    "atlas",
    "cochlea_origin_mm",
    "modiolar_axis",
    "transform",
    "covariance",
    "radius_95_mm",
    "cone_95_deg",
    "residuals_mm",
    "suspect",
    "warnings",
}


def _touches(folder: Path, scale: float = 1.0) -> Path:
    atlas = gp_core.Atlas.published()
    rows = [f"{code},{','.join(repr(float(v * scale)) for v in atlas[code] + 40)}" for code in gp_core.PROBE]
    path = folder / "touches.csv"
    path.write_text("name,x,y,z\n" + "\n".join(rows) + "\n")
    return path


def _import_real(shared_data: Path, folder: Path) -> None:
    (left,) = (shared_data / "usevitch2021").glob("*_L_CO.mat")
    (right,) = (shared_data / "usevitch2021").glob("*_R_CO.mat")
    assert main(["import-mat", str(left), str(right), "-o", str(folder)]) == 0


def test_estimate_writes_all_it_knows(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, tfm = tmp_path / "pose.json", tmp_path / "pose.tfm"
    touches = _touches(tmp_path)
    assert main(["estimate", str(touches), "--side", "L", "--json", str(out), "--tfm", str(tfm)]) == 0
    pose = json.loads(out.read_text())
    assert set(pose) >= _KEYS
    np.testing.assert_allclose(pose["cochlea_origin_mm"], [40, 40, 40], atol=1e-6)
    assert np.shape(pose["transform"]) == (4, 4)
    assert np.shape(pose["covariance"]) == (6, 6)
    assert tfm.read_text().startswith("#Insight Transform File V1.0")
    text = capsys.readouterr().out
    assert "origin CO" in text
    assert "95 % within" in text


def test_estimate_says_what_names_and_paths_tell(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    touches = _touches(tmp_path)
    assert main(["estimate", str(touches), "--side", "L"]) == 0
    text = capsys.readouterr().out
    assert "indicates the" not in text
    assert "round window" not in text, "nothing was written"
    touches = touches.rename(tmp_path / "Skull_Right_new.csv")
    angles = -np.linspace(0, 8, 20)
    rows = [*zip(angles / -8, 2 * np.cos(angles), 2 * np.sin(angles), strict=True), (0, 0, 0), (0, 0, 2)]
    path = tmp_path / "path.csv"
    path.write_text("".join(f"{x},{y},{z}\n" for x, y, z in rows))
    about = ["--path", str(path), "--path-units", "mm", "--path-side", "L", "--path-out"]
    words = ["estimate", str(touches), "--side", "L", *about, str(tmp_path / "out.csv")]
    assert main(words) == 3
    assert "as the name Skull_Right_new.csv indicates the right side" in capsys.readouterr().out
    words.append("--accept-warnings")
    assert main(words) == 0
    text = capsys.readouterr().out
    assert "! no path can reach CO, which is row 21 of this one: try --path-rows 20" in text
    assert "the y axis of the written pose points to the touched round window" in text
    assert main([*words, "--path-rows", "20", "--round-window", "expected"]) == 0
    text = capsys.readouterr().out
    assert "CO itself" not in text
    assert "the expected round window" in text


def test_command_and_python_give_the_same_numbers(tmp_path: Path) -> None:
    touches, out = _touches(tmp_path), tmp_path / "pose.json"
    main(["estimate", str(touches), "--side", "R", "--json", str(out)])
    pose = gp_core.estimate_pose(gp_core.read_touches(touches, "R"), "R")
    told = json.loads(out.read_text())
    assert {key: told[key] for key in pose.as_dict()} == json.loads(json.dumps(pose.as_dict()))


def test_the_authors_sample_works_with_nothing_else(
    shared_data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sample = shared_data / "usevitch2021" / "sample_data_file.dat"
    assert main(["estimate", str(sample), "--side", "R"]) == 0
    assert "RWP" in capsys.readouterr().out


def test_real_sets_go_the_whole_way(shared_data: Path, tmp_path: Path) -> None:
    labelled, atlas = tmp_path / "labelled", tmp_path / "atlas.json"
    _import_real(shared_data, labelled)
    assert len(list(labelled.iterdir())) == 22
    assert main(["fit", str(labelled), "-o", str(atlas)]) == 0
    assert main(["check", str(labelled), "--json", str(tmp_path / "check.json")]) == 0
    sample = shared_data / "usevitch2021" / "sample_data_file.dat"
    oracle = json.loads((shared_data / "oracles" / "estimate_shared.json").read_text())["SkullE_Right.dat"]
    for words in (["--atlas", str(atlas)], ["--atlas", str(labelled), "--method", "jrmpc"]):
        out = tmp_path / "pose.json"
        assert main(["estimate", str(sample), "--side", "R", *words, "--json", str(out)]) == 0
        away = np.subtract(json.loads(out.read_text())["cochlea_origin_mm"], oracle["co_mm"])
        assert np.linalg.norm(away) < (1e-6 if "jrmpc" in words else 1.0)


def test_check_finds_what_is_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    atlas = gp_core.Atlas.published()
    points = {code: atlas[code] for code in atlas.codes}
    points["FPA"], points["LLI"] = points["LLI"], points["FPA"]
    write_csv(tmp_path / "GP01_L.csv", gp_core.LandmarkSet.from_mapping(points, "L"))
    assert main(["check", str(tmp_path / "GP01_L.csv")]) == 1
    assert "FPA and LLI look exchanged" in capsys.readouterr().out


def test_fit_leaves_out_what_check_rejects(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rng = np.random.default_rng(3)
    for name in ("GP1", "GP2", "GP3", "GP4"):
        for side in draw_animal(gp_core.Atlas.published(), rng=rng, name=name).sides.values():
            if (name, side.side.value) == ("GP2", "L"):
                side = side.with_point("CA", side["CB"]).with_point("CB", side["CA"])
            gp_core.write_markups(tmp_path / f"{name}_{side.side.value}.mrk.json", side, specimen=name)
    atlases = [tmp_path / "a.json", tmp_path / "kept.json"]
    capsys.readouterr()
    assert main(["fit", str(tmp_path), "-o", str(atlases[0]), "--json", str(tmp_path / "fit.json")]) == 0
    told = capsys.readouterr().out
    assert "! left  CA CB    CA and CB look exchanged. Exchange the names of CA and CB." in told
    assert "--keep-doubtful" in told
    (left_out,) = json.loads((tmp_path / "fit.json").read_text())["left_out"]
    assert (left_out["kind"], left_out["landmarks"], left_out["side"]) == ("exchanged", ["CA", "CB"], "L")
    (tmp_path / "fit.json").unlink()
    assert main(["fit", str(tmp_path), "-o", str(atlases[1]), "--keep-doubtful"]) == 0
    without, kept = (gp_core.Atlas.load(path) for path in atlases)
    assert kept.variances(["CA"])[0] > 10 * without.variances(["CA"])[0]


def test_bad_input_is_one_line_and_status_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bad = {
        "empty.csv": b"",
        "binary.dat": bytes(range(256)),
        "truncated.mrk.json": b'{"markups": [{"controlPoints": [{"label": "OS"',
        "columns.csv": b"name,x,y,z\nOS,1,2\nCL,1,2,3\n",
        "nan.csv": b"name,x,y,z\nOS,1,2,nan\nCL,4,5,6\nMN,1,5,3\n",
        "same.csv": b"name,x,y,z\nOS,1,2,3\nCL,1,2,3\nMN,1,2,3\n",
        "double.csv": b"name,x,y,z\nOS,1,2,3\nOS,4,2,3\nMN,1,7,3\n",
        "stranger.csv": b"name,x,y,z\nOSX,1,2,3\nCL,4,2,3\nMN,1,7,3\n",
    }
    for name, content in bad.items():
        (tmp_path / name).write_bytes(content)
        assert main(["estimate", str(tmp_path / name), "--side", "L"]) == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1, error
        assert name in error
        assert "Traceback" not in error


def test_metres_are_named_with_the_remedy(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for scale, words in (
        (0.001, "multiply them by 1000"),
        (0.1, "multiply them by 10"),
        (10, "divide them by 10"),
    ):
        assert main(["estimate", str(_touches(tmp_path, scale)), "--side", "L"]) == 2
        error = capsys.readouterr().err
        assert words in error
        assert "touches.csv" in error


@pytest.mark.parametrize(
    "words",
    [
        ["fit", "none", "-o", "x.json"],
        ["check", "none"],
        ["estimate", "none.dat", "--side", "L"],
        ["import-mat", "none.mat", "none.mat", "-o", "x"],
    ],
)
def test_absent_files_are_named(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words) == 2
    assert "none" in capsys.readouterr().err


def test_an_unwritable_result_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "no" / "such" / "pose.json"
    assert main(["estimate", str(_touches(tmp_path)), "--side", "L", "--json", str(out)]) == 2
    assert "pose.json" in capsys.readouterr().err


@settings(
    max_examples=60,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(
    content=st.one_of(
        st.binary(max_size=200),
        st.lists(
            st.tuples(
                st.sampled_from([*gp_core.CODES, "XX", ""]),
                *[st.floats(width=32, allow_nan=True) for _ in range(3)],
            ),
            max_size=12,
        ).map(lambda rows: "\n".join(",".join(str(v) for v in row) for row in rows).encode()),
    ),
    suffix=st.sampled_from([".csv", ".dat", ".mrk.json", ".fcsv", ".txt"]),
)
def test_no_touch_file_makes_a_traceback(content: bytes, suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"fuzz{suffix}"
    path.write_bytes(content)
    assert main(["estimate", str(path), "--side", "L"]) in (0, 2)


def test_every_command_explains_itself_with_an_example(capsys: pytest.CaptureFixture[str]) -> None:
    for command in ("estimate", "fit", "import-mat", "check"):
        with pytest.raises(SystemExit):
            main([command, "--help"])
        assert f"example:\n  gp-core {command}" in capsys.readouterr().out


def test_it_runs_from_the_shell(tmp_path: Path) -> None:
    words = [sys.executable, "-m", "gp_core.cli", "estimate", str(_touches(tmp_path)), "--side", "L"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""


def test_a_reader_that_has_read_enough_is_no_error(tmp_path: Path) -> None:
    words = [sys.executable, "-m", "gp_core.cli", "estimate", str(_touches(tmp_path)), "--side", "L"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == ""
    assert process.returncode == 141
