"""The JSON schemas of docs/schemas: what is written meets them, and what is damaged does not."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import pytest

import gp_core
from gp_core.study.drawn_labels import draw_labels, draw_touches

_SCHEMAS = Path(__file__).resolve().parents[3] / "docs" / "schemas"


def _written(kind: str, folder: Path) -> Any:
    file = folder / f"{kind}.json"
    if kind == "pose":
        gp_core.estimate_pose(draw_touches(seed=1)[0], "L").save(file)
    elif kind == "reliability":
        draw_labels(folder, 2, observers=["AB", "CD"], rounds=2, label_error_mm=0.1)
        report = gp_core.reliability(gp_core.load_labellings(folder))
        return json.loads(json.dumps(report.as_dict()))
    elif kind == "atlas":
        gp_core.Atlas.published().save(file)
    else:
        file = draw_labels(folder, 1, observers=["AB"], rounds=2)[0]
    return json.loads(file.read_text())


def _schema(kind: str) -> Any:
    return json.loads((_SCHEMAS / f"{kind}.schema.json").read_text())


@pytest.mark.parametrize("kind", ["pose", "atlas", "landmarks", "reliability"])
def test_what_is_written_meets_its_schema(kind: str, tmp_path: Path) -> None:
    jsonschema.Draft7Validator.check_schema(_schema(kind))
    jsonschema.validate(_written(kind, tmp_path), _schema(kind))


def _drop(key: str) -> Callable[[Any], Any]:
    return lambda content: content.pop(key)


@pytest.mark.parametrize(
    ("kind", "damage"),
    [
        ("pose", _drop("transform")),
        ("pose", lambda content: content["modiolar_axis"].append(1.0)),
        ("pose", lambda content: content.update(side="left")),
        ("atlas", _drop("mean_mm")),
        ("atlas", lambda content: content.update(units="um")),
        ("landmarks", _drop("gpLabeler")),
        ("reliability", _drop("features")),
        ("reliability", lambda content: content["overall"]["intra"].update(mean_mm="0.1")),
        ("landmarks", lambda content: content["markups"][0].update(coordinateSystem="RAS")),
    ],
)
def test_what_is_damaged_does_not(kind: str, damage: Callable[[Any], Any], tmp_path: Path) -> None:
    content = _written(kind, tmp_path)
    damage(content)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(content, _schema(kind))
