"""What notebooks show of a pose, an atlas and an animal."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest

import gp_core
from gp_core.study.drawn_labels import draw_touches


def _shown() -> dict[str, object]:
    touches, truth = draw_touches(seed=3)
    named = gp_core.Specimen("<GP & 1>", {truth.side: truth})
    return {
        "pose": gp_core.estimate_pose(touches, "L"),
        "atlas": gp_core.Atlas.published(),
        "specimen": named,
    }


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("pose", ["left side, method robust", "origin CO", "95 % within", "side clear, names clear"]),
        ("atlas", ["22 sides", "RWP", "SD mm"]),
        ("specimen", ["<GP & 1>", "20 placed", "left"]),
    ],
)
def test_a_table_that_is_sound_and_says_what_it_is(kind: str, words: list[str]) -> None:
    html = _shown()[kind]._repr_html_()  # type: ignore[attr-defined]
    text = " ".join(ElementTree.fromstring(html).itertext())  # raises where it is not escaped
    for word in words:
        assert word in text
