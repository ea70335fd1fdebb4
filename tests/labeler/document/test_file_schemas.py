"""The JSON schemas of what the application writes: real files meet them, and what is damaged does not."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from document_cases import edits, quick
from hypothesis import given
from hypothesis import strategies as st

from gp_core.errors import GpError
from gp_labeler.autolabel.proposal import Guess, Proposal
from gp_labeler.document.specimen_file import write_specimen
from gp_labeler.document.specimen_json import document_of
from gp_labeler.document.state import SpecimenState
from gp_labeler.scripting.demo import demo_script

_SCHEMAS = Path(__file__).resolve().parents[3] / "docs" / "schemas"
_EARLIER = Path(__file__).parent / "earlier"


def _schema(kind: str) -> Any:
    return json.loads((_SCHEMAS / f"{kind}.schema.json").read_text())


_SPECIMEN = jsonschema.Draft7Validator(_schema("specimen"))
_HEADER = {"format": "gp-labeler specimen", "version": 4}


@pytest.mark.parametrize("path", sorted(_SCHEMAS.iterdir()), ids=lambda path: path.name)
def test_every_schema_is_one_and_has_its_own_id(path: Path) -> None:
    content = json.loads(path.read_text())
    jsonschema.Draft7Validator.check_schema(content)
    assert content["$id"] == f"urn:gp-labeler:schema:{path.name.removesuffix('.schema.json')}"


@quick
@given(st.lists(edits, max_size=15))
def test_whatever_is_edited_a_specimen_meets_its_schema(sequence: list[Any]) -> None:
    state = SpecimenState()
    for edit in sequence:
        try:
            state = edit.apply(state)
        except GpError:
            continue
    _SPECIMEN.validate(_HEADER | json.loads(json.dumps(document_of(state))))


@pytest.mark.parametrize("path", sorted(_EARLIER.glob("*.gpspecimen.json")), ids=lambda path: path.name)
def test_specimen_files_of_earlier_versions_meet_it_too(path: Path) -> None:
    content = json.loads(path.read_text())
    assert content["landmarks"]
    _SPECIMEN.validate(content)


def test_what_is_saved_meets_it(tmp_path: Path) -> None:
    file = tmp_path / "a.gpspecimen.json"
    write_specimen(file, SpecimenState(), thumbnail=b"png")
    _SPECIMEN.validate(json.loads(file.read_text()))


def _put(value: Any, *way: str) -> Callable[[Any], None]:
    def change(content: Any) -> None:
        for key in way[:-1]:
            content = content[key]
        content[way[-1]] = value

    return change


@pytest.mark.parametrize(
    "damage",
    [
        _put("other", "format"),
        _put("4", "version"),
        _put([1.0, 2.0], "landmarks", "L", "CA", "position"),
        _put("nearly", "landmarks", "L", "CA", "certainty"),
        _put({}, "landmarks", "left"),
        _put(0, "round"),
        _put([[1, 0, 0, 0]], "headFrame", "T_head_scan"),
        _put([{"name": "a", "points": [[0, 0, 0]]}], "measurements"),
        _put({"L": {"CA": {"position": [0, 0, 0]}}}, "touches"),
    ],
)
def test_a_damaged_specimen_does_not(damage: Callable[[Any], None]) -> None:
    mark = {"position": [1.0, 2.0, 3.0], "certainty": "fair", "provenance": {"how": "mesh"}}
    content = _HEADER | {"landmarks": {"L": {"CA": mark}}, "headFrame": {"T_head_scan": np.eye(4).tolist()}}
    _SPECIMEN.validate(content)
    damage(content)
    assert not _SPECIMEN.is_valid(content)


def test_a_proposal_meets_its_schema() -> None:
    schema = jsonschema.Draft7Validator(_schema("proposal"))
    guesses = (
        Guess("CA_L", np.zeros(3), 0.4, 0.1, 0.2, 5, True, 1.5),
        Guess("CB_L", np.ones(3), None, None, None, 1),
    )
    found = Proposal(guesses, ("CA_L", "CB_L"), ("MN_L",), ("a",), 0.2, "greedy", "the file", ("look",))
    content = {"schema": "gp-labeler proposal", "version": 1, "specimen": "a", "key": "k", **found.as_json()}
    schema.validate(content)
    del content["guesses"][0]["position"]
    assert not schema.is_valid(content)


def test_scripts_meet_their_schema() -> None:
    schema = jsonschema.Draft7Validator(_schema("script"))
    steps = [{"do": type(step).do} for step in demo_script().steps]
    schema.validate(steps)
    schema.validate({"specimens": ["a"], "step": steps})
    assert not schema.is_valid({"step": [{"path": "head.nrrd"}]})
    assert not schema.is_valid({"step": steps, "other": 1})
