"""The schematic of the ear: the right way round, and all of it inside its frame."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from gp_core.landmarks.features import CODES, Side
from gp_labeler.views.schematic import FAR, Schematic, ground_of, ground_schematic

LEFT, RIGHT = Side.LEFT, Side.RIGHT
_ROOT = Path(__file__).resolve().parents[3]


def schematic_of(code: str, side: Side) -> Schematic:
    return ground_schematic(ground_of(code), side)


@pytest.mark.parametrize("code", CODES)
def test_the_feature_lies_inside_the_frame_of_its_own_picture(code):
    for side in Side:
        picture = schematic_of(code, side)
        low, high = picture.box_around(code)
        assert (picture.points[code] >= low).all()
        assert (picture.points[code] <= high).all()
        assert bool(picture.head) == (code in FAR)


@pytest.mark.parametrize("code", CODES)
def test_left_and_right_ears_mirror_each_other(code):
    left, right = schematic_of(code, LEFT), schematic_of(code, RIGHT)
    for name in CODES:
        np.testing.assert_allclose(left.points[name] * [-1, 1], right.points[name], atol=1e-9)


def test_outwards_is_to_the_patients_side_on_coronal_and_axial_pictures():
    for code in ("CA", "FPA"):
        picture = schematic_of(code, LEFT)
        assert picture.letters[:2] == "RL"
        assert picture.points["OS"][0] > picture.points["CO"][0]
        picture = schematic_of(code, RIGHT)
        assert picture.points["OS"][0] < picture.points["CO"][0]


def test_the_nose_points_where_the_letter_says():
    for side, ahead in ((LEFT, -1), (RIGHT, 1)):
        picture = schematic_of("IN", side)
        assert np.sign(picture.points["IN"][0] - picture.points["CO"][0]) == ahead
        assert picture.letters.index("A") == (0 if ahead < 0 else 1)
        low, high = picture.head[0][:, 0].min(), picture.head[0][:, 0].max()
        assert abs(picture.points["IN"][0]) <= max(abs(low), abs(high))


def test_up_is_superior_from_the_side_and_anterior_from_below():
    assert schematic_of("OS", LEFT).points["OS"][1] > schematic_of("OS", LEFT).points["OI"][1]
    axial = schematic_of("FPA", LEFT)
    assert axial.points["FPA"][1] > axial.points["FPP"][1]
    assert axial.letters[3] == "A"


def test_the_files_are_what_the_tool_draws_from_the_atlas(tmp_path):
    command = [sys.executable, "tools/feature-pictures", "--write", "--folder", str(tmp_path)]
    subprocess.run(command, cwd=_ROOT, check=True, capture_output=True)
    shipped = sorted((_ROOT / "resources" / "pictures").glob("*.svg"))
    assert [file.name for file in shipped] == sorted(file.name for file in tmp_path.iterdir())
    for file in shipped:
        now, then = (f.read_text(encoding="utf-8") for f in (tmp_path / file.name, file))
        numbers = r"-?\d+\.?\d*"
        assert re.sub(numbers, "", now) == re.sub(numbers, "", then), (
            f"{file}: tools/feature-pictures --write"
        )
        values = [np.array(re.findall(numbers, text), float) for text in (now, then)]
        np.testing.assert_allclose(*values, atol=0.011)
