"""The commands of the study: what they write, print and refuse."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from study_cases import cohort

from gp_core.cli import main
from gp_core.io import landmark_file_name, write_markups
from gp_core.landmarks.sets import LandmarkSet


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Landmark files of four drawn animals."""
    where = tmp_path_factory.mktemp("cohort")
    for animal in cohort(4):
        for side, landmarks in animal.sides.items():
            write_markups(where / landmark_file_name(animal.name, side), landmarks, specimen=animal.name)
    return str(where)


def test_distances(folder: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = [tmp_path / name for name in ("d.json", "d.csv", "d.png")]
    options = ["--json", str(files[0]), "--csv", str(files[1]), "--figure", str(files[2])]
    assert main(["distances", folder, *options]) == 0
    assert "on 8 sides" in capsys.readouterr().out
    assert len(json.loads(files[0].read_text())["pairs"]) == 190
    assert files[1].read_text().startswith("feature_a,feature_b,mean_mm,sd_mm")
    assert files[2].read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("method", ["jrmpc", "robust"])
def test_leave_one_out(method: str, folder: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    report, figure = tmp_path / "loo.json", tmp_path / "loo.svg"
    options = ["--method", method, "--json", str(report), "--figure", str(figure)]
    assert main(["leave-one-out", folder, *options]) == 0
    content = json.loads(report.read_text())
    assert len(content["rows"]) == 8
    out = capsys.readouterr().out
    assert f"{content['summary']['e_t']:.2f}" in out
    assert "D04" in out
    assert "<svg" in figure.read_text()


def test_features_and_settings_reach_the_study(folder: str, tmp_path: Path) -> None:
    report = tmp_path / "loo.json"
    options = ["--training", "all", "--probe", "CL,MN", "OS", "--method", "jrmpc"]
    numbers = ["--settings", "defaults", "--gamma", "0.2", "--max-iterations", "5"]
    assert main(["leave-one-out", folder, *options, *numbers, "--json", str(report)]) == 0
    settings = json.loads(report.read_text())["settings"]
    assert len(settings["training"]) == 20
    assert settings["probe"] == ["CL", "MN", "OS"]
    assert settings["max_iterations"] == 5
    assert settings["gamma"] == 0.2
    assert settings["epsilon"] == 1e-6
    assert main(["leave-one-out", folder, "--probe", "all", "--json", str(report)]) == 0
    assert len(json.loads(report.read_text())["settings"]["probe"]) == 10


def test_search(folder: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    report, figure, checkpoint = (str(tmp_path / name) for name in ("s.json", "s.png", "c.json"))
    features = ["--training", "CA,CB,CL,LLI,MN,OS,RWA", "--fewest-training", "6", "--max-iterations", "10"]
    files = ["--json", report, "--figure", figure, "--checkpoint", checkpoint]
    assert main(["search", folder, "--workers", "1", *features, *files]) == 0
    first = capsys.readouterr().out
    assert "Best:" in first
    content = json.loads(Path(report).read_text())
    assert [step["n"] for step in content["training"]] == [7, 6]
    assert content["settings"]["max_iterations"] == 10
    assert Path(figure).read_bytes().startswith(b"\x89PNG")
    assert main(["search", folder, "--workers", "1", *features, "--checkpoint", checkpoint]) == 0
    assert capsys.readouterr().out.splitlines()[1:] == first.splitlines()[1:]


def test_nested_search(folder: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    report, figure = tmp_path / "n.json", tmp_path / "n.png"
    features = ["--training", "CA,CB,CL,LLI,MN,OS", "--fewest-training", "6", "--max-iterations", "10"]
    files = ["--json", str(report), "--figure", str(figure)]
    assert main(["search", folder, "--nested", "--workers", "1", *features, *files]) == 0
    content = json.loads(report.read_text())
    assert [fold["held_out"] for fold in content["folds"]] == ["D01", "D02", "D03", "D04"]
    out = capsys.readouterr().out
    assert "chosen without the animal" in out
    assert f"{content['summary']['e_t']:.2f}" in out
    assert figure.read_bytes().startswith(b"\x89PNG")


def test_simulate_with_physical_results(
    folder: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    skull = tmp_path / "skull.json"
    row = {"registration": "icp", "method": "jrmpc", "e_co_mm": 0.65, "e_ma_deg": 9.3}
    skull.write_text(json.dumps({"rows": [row]}))
    report, figure = tmp_path / "sim.json", tmp_path / "sim.pdf"
    options = ["--n", "20", "--seed", "3", "--noise", "0.1", "--physical", str(skull)]
    assert main(["simulate", folder, *options, "--json", str(report), "--figure", str(figure)]) == 0
    content = json.loads(report.read_text())
    assert content["seed"] == 3
    assert content["settings"]["noise_mm"] == 0.1
    assert f"{content['groups']['pooled']['e_co_mm']['mean']:.3f}" in capsys.readouterr().out
    assert figure.read_bytes().startswith(b"%PDF")
    skull.write_text("[]")
    assert main(["simulate", folder, *options]) == 2
    assert "is not the result of a physical test" in capsys.readouterr().err


def test_compare(folder: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = [str(tmp_path / name) for name in ("c.json", "c.csv", "c.png")]
    options = ["--repeats", "1", "--workers", "1"]
    outputs = ["--json", files[0], "--csv", files[1], "--figure", files[2]]
    assert main(["compare", folder, *options, *outputs]) == 0
    assert len(json.loads(Path(files[0]).read_text())["rows"]) == 36
    assert len(Path(files[1]).read_text().splitlines()) == 37
    assert Path(files[2]).read_bytes().startswith(b"\x89PNG")
    assert "4 labelled animals, each touched 1 times" in capsys.readouterr().out


def test_physical(folder: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    animal = cohort(1, seed=9)[0].side("R")
    skull = {f"S{i}": 12.0 * np.array([np.cos(i), np.sin(2 * i), np.cos(5 * i)]) for i in range(1, 9)}
    ct = LandmarkSet(animal.points, animal.side, "scan", extra=skull)
    write_markups(tmp_path / "ct_R.mrk.json", ct, specimen="ct")
    rows = [animal[code] for code in ("CL", "MN", "OS", "RWA", "RWP", "LLI")] + list(skull.values())
    touches = tmp_path / "touches.dat"
    touches.write_text("\n".join("\t".join(repr(float(x)) for x in row) for row in rows) + "\n")
    report = tmp_path / "physical.json"
    files = ["--touches", str(touches), "--ct-landmarks", str(tmp_path / "ct_R.mrk.json")]
    figure = tmp_path / "skull.png"
    words = ["--atlas", folder, "--json", str(report), "--figure", str(figure), "--n", "10"]
    assert main(["physical", *files, "--side", "R", *words]) == 0
    assert figure.read_bytes().startswith(b"\x89PNG")
    content = json.loads(report.read_text())
    assert [r["way"] for r in content["registrations"]] == ["names", "icp"]
    assert content["registrations"][0]["fre_mm"] < 1e-6
    assert len(content["rows"]) == 4
    assert "icp" in capsys.readouterr().out
    assert main(["physical", *files, "--side", "L"]) == 2
    assert "ct_R.mrk.json" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--probe", "CL", "MN", "OX"], "unknown feature 'OX'"),
        (["--gamma", "-1", "--method", "jrmpc"], "gamma must be a number"),
        (["--figure", "loo.bmp"], "Use .png, .pdf or .svg"),
    ],
)
def test_bad_options_are_one_line(
    folder: str, options: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["leave-one-out", folder, *options]) == 2
    captured = capsys.readouterr().err
    assert message in captured
    assert captured.count("\n") == 1
