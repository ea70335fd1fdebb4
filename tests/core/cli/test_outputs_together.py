"""A command with several outputs replaces none of its old files unless it can write all of them."""

from __future__ import annotations

import argparse
import resource
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import gp_core
from gp_core.atlas.sampling import draw_animal
from gp_core.cli import main, make_parser
from gp_core.cli.options import WRITTEN
from gp_core.errors import GpError
from gp_core.io import write_markups
from gp_core.study import figures

OLD = b"what was there before\n"
FEW = "--repeats 1 --animals 4 --max-iterations 2 --workers 1"
COMMANDS = {
    "estimate": "touches.csv --side L --path path.csv --path-units mm --path-side L --accept-warnings",
    "register": "touches.csv labelled/A_L.mrk.json --side L",
    "physical": "--touches touches.csv --ct-landmarks ct.csv --side L --n 3",
    "fit": "labelled",
    "reliability": "again",
    "distances": "labelled",
    "leave-one-out": "labelled --method robust",
    "search": "labelled --method robust --training CA CB RWA RWP CL MN OS LLI --workers 1",
    "simulate": "labelled --method robust --n 3",
    "compare": FEW,
    "draw": "-n 2",
}
"""The quickest words of every command that may write several files."""

ENDINGS = {"json": ".json", "tfm": ".tfm", "csv": ".csv", "landmarks": ".mrk.json", "path_out": ".txt"}
FOLDERS = {"draw"}


def outputs_of(command: str) -> dict[str, str]:
    """Return the options of a command that name written files, without the checkpoint, a file of its own."""
    actions = subparsers()[command]._actions
    found = [each for each in actions if each.dest in WRITTEN and each.dest != "checkpoint"]
    return {each.dest: each.option_strings[-1] for each in found}


def subparsers() -> Mapping[str, argparse.ArgumentParser]:
    actions = make_parser()._actions
    return next(each.choices for each in actions if isinstance(each, argparse._SubParsersAction))


CASES = [(command, option) for command in COMMANDS for option in outputs_of(command)]


@pytest.fixture
def quick_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Write a figure without rendering it."""
    monkeypatch.setattr(Figure, "savefig", lambda _, file, **options: file.write(b"a figure"))


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for place in ("labelled", "again"):
        (tmp_path / place).mkdir()
    for seed, name in enumerate("ABCD"):
        animal = draw_animal(gp_core.Atlas.published(), rng=np.random.default_rng(seed))
        for side in "LR":
            write_markups(f"labelled/{name}_{side}.mrk.json", animal.side(side), specimen=name)
            for observer in ("AB", "CD"):
                file = f"again/{name}_{observer}_r1_{side}.mrk.json"
                write_markups(file, animal.side(side), specimen=name)
    animal = gp_core.read_landmarks("labelled/A_L.mrk.json")
    rows = {code: f"{code},{','.join(map(str, animal[code]))}\n" for code in animal.placed if code != "CO"}
    skull = "S1,20,5,5\nS2,-5,25,4\nS3,6,-4,22\n"
    Path("touches.csv").write_text("".join(rows[code] for code in gp_core.PROBE) + skull)
    Path("ct.csv").write_text("".join(rows.values()) + skull)
    angle = np.linspace(0.5, 6, 20)
    wound = np.column_stack([angle / 6, np.cos(angle), -np.sin(angle)])
    np.savetxt("path.csv", wound, delimiter=",")
    return tmp_path


def words_of(command: str) -> tuple[list[str], dict[str, Path]]:
    outputs = {
        name: Path("out") / (name if is_folder(command, name) else f"{name}{ending_of(command, name)}")
        for name in outputs_of(command)
    }
    words = [word for name, option in outputs_of(command).items() for word in (option, str(outputs[name]))]
    return [command, *COMMANDS[command].split(), *words], outputs


def ending_of(command: str, name: str) -> str:
    return ENDINGS.get(name, ".png" if name == "figure" else ".json")


def is_folder(command: str, name: str) -> bool:
    return name == "output" and command in FOLDERS


def everything_in(folder: Path) -> dict[str, bytes]:
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


def test_every_command_with_several_outputs_is_tried_here() -> None:
    several = {command for command in subparsers() if len(outputs_of(command)) > 1}
    assert several == set(COMMANDS)


@pytest.mark.parametrize("command", COMMANDS)
def test_all_outputs_are_written_where_they_can_be(
    command: str, quick_figures: None, capsys: pytest.CaptureFixture[str]
) -> None:
    words, outputs = words_of(command)
    Path("out").mkdir()
    assert main(words) in (0, 1), capsys.readouterr().err
    assert all(path.exists() for path in outputs.values())


@pytest.mark.parametrize(("command", "broken"), CASES)
def test_old_files_are_kept_if_one_output_cannot_be_written(
    command: str, broken: str, quick_figures: None, capsys: pytest.CaptureFixture[str]
) -> None:
    words, outputs = words_of(command)
    for name, path in outputs.items():
        in_its_place = path / "drawn02_R.mrk.json" if is_folder(command, name) else path
        in_its_place.parent.mkdir(parents=True, exist_ok=True)
        if name == broken:
            in_its_place.mkdir()
        else:
            in_its_place.write_bytes(OLD)
    before = everything_in(Path("out"))
    assert main([*words, *(["--replace"] if command in FOLDERS else [])]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert everything_in(Path("out")) == before


def test_a_figure_that_cannot_be_drawn_leaves_the_numbers_as_they_were(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: object) -> None:
        raise GpError("cannot be drawn")

    monkeypatch.setattr(figures, "distance_matrix", fail)
    Path("a.json").write_bytes(OLD)
    before = everything_in(Path())
    assert main(["distances", "labelled", "--json", "a.json", "--figure", "b.png"]) == 2
    assert everything_in(Path()) == before


def test_more_files_than_a_program_may_open_are_written_together() -> None:
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (200, before[1]))
    try:
        assert main(["draw", "-n", "110", "-o", "out"]) == 0
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)
    assert len(everything_in(Path("out"))) == 220
    assert not list(Path("out").glob(".*"))
