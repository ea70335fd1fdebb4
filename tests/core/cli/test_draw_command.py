"""``gp-core draw``: what it draws can be read, errs as asked, and is the same for the same seed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import gp_core
from gp_core.cli import main
from gp_core.study.drawn_labels import draw_labels, draw_touches


def test_both_sides_of_each_animal_are_written_and_hang_together(tmp_path: Path) -> None:
    assert main(["draw", "-n", "3", "-o", str(tmp_path / "a")]) == 0
    animals = gp_core.load_specimens(tmp_path / "a")
    assert [animal.name for animal in animals] == ["drawn01", "drawn02", "drawn03"]
    for animal in animals:
        left, right = animal.sides.values()
        assert set(left.placed) == set(gp_core.CODES)
        np.testing.assert_array_equal(left["IN"], right["IN"])
        assert (left["OS"] - right["OS"])[0] > 10.0  # LPS: left is +x


def test_the_seed_decides(tmp_path: Path) -> None:
    for folder, seed in (("a", 1), ("b", 1), ("c", 2)):
        draw_labels(tmp_path / folder, 1, seed=seed)
    content = [(tmp_path / f / "drawn01_L.mrk.json").read_text() for f in "abc"]
    assert content[0] == content[1] != content[2]


def test_observers_err_by_what_was_asked(tmp_path: Path) -> None:
    draw_labels(tmp_path, 6, observers=("AB", "CD"), rounds=2, label_error_mm=0.1)
    report = gp_core.reliability(gp_core.load_labellings(tmp_path))
    assert report.overall.inter.sd_mm == pytest.approx(0.1, rel=0.15)
    assert report.overall.intra.sd_mm == pytest.approx(0.1, rel=0.15)


def test_touches_are_of_the_animal_that_is_printed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "touches.csv"
    assert main(["draw", "--csv", str(file), "--seed", "5", "--touch-error", "0"]) == 0
    touches, truth = draw_touches(seed=5, touch_error_mm=0.0)
    read = gp_core.read_touches(file, "L")
    for code in touches.placed:
        np.testing.assert_allclose(read[code], truth[code], atol=1e-3)
    assert f"{truth['CO'][0]:.3f}" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "there is nothing to write"),
        (["-o", "labelled", "-n", "0"], "at least one animal"),
        (["-o", "labelled", "--label-error", "-1"], "no negative number"),
        (["--csv", "touches.json"], "--csv writes a .csv file"),
        (["-o", "here", "-n", "1"], "already exists"),
    ],
)
def test_what_cannot_be_is_one_line(
    words: list[str],
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    draw_labels("here", 1)
    assert main(["draw", *words]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
