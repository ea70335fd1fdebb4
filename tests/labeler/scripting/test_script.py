"""Scripts are checked as a whole, and say which step is wrong and what is allowed."""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path

import pytest

from gp_core.errors import GpError
from gp_labeler.document.edit_tables import EDITS
from gp_labeler.scripting.demo import demo_script
from gp_labeler.scripting.prompts import ScriptPrompts
from gp_labeler.scripting.script import StepError, make_script, read_script
from gp_labeler.scripting.steps import STEPS
from gp_labeler.scripting.steps.edits import EDIT_STEPS
from gp_labeler.scripting.steps.placing import Place
from gp_labeler.scripting.steps.scan import Open

TOML = """
[[step]]
do = "open"
path = "scans/{specimen}.nrrd"
spacing = [0.1, 0.1, 0.2]

[[step]]
do = "place"
feature = "CA"
side = "left"
at = [1, 2.5, -3]
"""
STEPS_OF_TOML = (
    Open(path="scans/{specimen}.nrrd", spacing=(0.1, 0.1, 0.2)),
    Place("CA", "L", at=(1.0, 2.5, -3.0)),
)


def test_toml_and_json_hold_the_same_steps(tmp_path) -> None:
    pytest.importorskip("tomllib", reason="TOML needs Python 3.11")
    toml = tmp_path / "a.toml"
    toml.write_text(TOML)
    script = read_script(toml)
    assert script.steps == STEPS_OF_TOML
    assert (script.name, script.folder) == ("a", tmp_path)
    for tables in (script.tables, {"step": script.tables}):
        file = tmp_path / "a.json"
        file.write_text(json.dumps(tables))
        assert read_script(file).steps == script.steps


def test_the_name_of_a_specimen_goes_into_its_places() -> None:
    script = make_script([{"do": "open", "path": "{specimen}/a_{specimen}.nrrd"}, {"do": "save"}])
    assert script.has_slots
    filled = script.for_specimen("GP-01")
    assert filled.steps[0] == Open(path="GP-01/a_GP-01.nrrd")
    assert not filled.has_slots


@pytest.mark.parametrize(
    ("table", "text"),
    [
        ({"do": "plaice", "feature": "CA"}, r"step 2: unknown step 'plaice' \(did you mean place\b"),
        ({"feature": "CA"}, "step 2: has no key do"),
        ("save", "step 2: must be a table"),
        ({"do": "place", "side": "L"}, "step 2: place: feature is missing"),
        ({"do": "place", "feature": "CA", "side": "L", "aat": [1, 2, 3]}, "unknown key 'aat'"),
        (
            {"do": "place", "feature": "CA", "side": "up"},
            "step 2: place: side: side must be L or R, got 'up'",
        ),
        ({"do": "place", "feature": "CA", "side": "L", "at": [1, 2]}, "at must be three numbers or text"),
        ({"do": "place", "feature": 7, "side": "L"}, "feature must be text, got 7"),
        ({"do": "undo", "times": 1.5}, "times must be a whole number"),
        ({"do": "undo", "times": True}, "times must be a whole number"),
        ({"do": "threshold", "value": float("nan")}, "value must be a number"),
        ({"do": "view", "reset": "yes"}, "reset must be true or false"),
        ({"do": "import", "files": 3}, "files must be texts"),
        ({"do": ["open"]}, "unknown step"),
        ({"do": "save", "where": 1}, "save: unknown key 'where'"),
    ],
)
def test_a_wrong_step_is_named_with_what_is_allowed(table, text) -> None:
    with pytest.raises(StepError, match=text) as caught:
        make_script([{"do": "save"}, table])
    assert caught.value.number == 2


def test_an_unknown_step_is_answered_by_the_nearest_or_else_by_all_steps() -> None:
    with pytest.raises(StepError) as near:
        make_script([{"do": "opne"}])
    with pytest.raises(StepError) as far:
        make_script([{"do": "xyzzy"}])
    assert "did you mean open" in str(near.value)
    assert "There are" not in str(near.value)
    assert "There are open, " in str(far.value)


@pytest.mark.parametrize(
    ("name", "text", "problem"),
    [
        ("a.json", "{", "is not JSON"),
        ("a.json", "[" * 100_000, "is not JSON"),
        ("a.json", '{"steps": []}', "holds no steps"),
        ("a.json", "3", "holds no steps"),
        ("a.json", '{"step": [], "name": "x"}', "unknown key 'name'"),
        ("a.json", '{"step": [], "specimens": [1]}', "specimens must be a list of texts"),
        ("a.toml", "[[step", "is not TOML"),
    ],
)
def test_a_file_that_is_no_script_is_named(tmp_path, name, text, problem) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(GpError, match=problem) as caught:
        read_script(tmp_path / name)
    assert name in str(caught.value)


@pytest.mark.parametrize("table", [{"text_size": 18}, {"theme": "blue"}, {"greys": "x"}, {"glyphs": "x"}])
def test_a_view_that_there_is_not_is_refused_before_the_script_runs(table) -> None:
    with pytest.raises(StepError, match=f"{next(iter(table))} must be one of"):
        make_script([{"do": "view", **table}])


def test_a_script_that_cannot_be_read_is_named(tmp_path) -> None:
    with pytest.raises(GpError, match="does not exist"):
        read_script(tmp_path / "none.toml")
    (tmp_path / "a.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(GpError, match="not a text file"):
        read_script(tmp_path / "a.toml")


def test_the_demo_labels_everything_and_uses_every_kind_of_file() -> None:
    does = [step.do for step in demo_script().steps]
    again = does.index("label_again")  # some of them once more, blind
    assert 0 < does[again:].count("place") < 10
    assert does[:again].count("place") + does.count("confirm") == 37  # 19 on the left, 18 right: IN is shared
    assert does.count("confirm") == 16  # suggested once three are placed, then judged one by one
    assert {"export", "check", "save", "estimate", "overlay", "screenshot"} <= set(does)
    assert {"measure", "export_measurements", "distances"} <= set(does)


def test_the_manual_has_every_step_and_key() -> None:
    lines = (Path(__file__).resolve().parents[3] / "docs" / "offscreen.md").read_text().splitlines()
    rows = {line.split("`")[1]: line.split(" | ")[1] for line in lines if line.startswith("| `")}
    assert rows.keys() == STEPS.keys() | EDIT_STEPS.keys()
    for do, kind in {**STEPS, **EDITS}.items():
        assert [field.name for field in fields(kind) if f"`{field.name}`" not in rows[do]] == [], do


@pytest.mark.parametrize("kind", STEPS.values(), ids=list(STEPS))
def test_every_step_explains_its_keys(kind) -> None:
    manual = kind.__doc__ or ""
    assert "Parameters" in manual
    assert all(field.name in manual for field in fields(kind))


def test_a_table_of_texts_is_read(tmp_path):
    file = tmp_path / "s.toml"
    file.write_text('[[step]]\ndo = "import"\nfiles = ["a.csv"]\nnames = { "Apex of cochlea" = "CA" }\n')
    (step,) = read_script(file).steps
    assert step.names == {"Apex of cochlea": "CA"}


@pytest.mark.parametrize(
    ("earlier", "now"),
    [
        ("Import nevertheless", "Import anyway"),
        ("Left is as the file says", "Left is correct"),
        ("Use it nevertheless", "Use it anyway"),
    ],
)
def test_answers_of_earlier_versions_are_understood(earlier: str, now: str) -> None:
    prompts = ScriptPrompts()
    prompts.prepare(answers=[earlier])
    assert prompts.choose("", "?", ("Cancel", now)) == now
    assert prompts.choose("", "?", ("Cancel",)) == ""
