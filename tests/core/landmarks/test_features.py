from __future__ import annotations

from pathlib import Path

import pytest

from gp_core.errors import FeatureError
from gp_core.landmarks.features import (
    CODES,
    EXTERNAL,
    FEATURES,
    PROBE,
    TRAINING,
    Side,
    check_codes,
    feature,
    index_of,
)


def test_the_table_is_the_papers() -> None:
    assert len(FEATURES) == 20
    assert list(CODES) == sorted(CODES)
    assert set(EXTERNAL) == {"CL", "IN", "LLI", "MN", "OI", "OS", "RWA", "RWL", "RWM", "RWP", "ZL"}
    assert [f.code for f in FEATURES if f.computed] == ["CO"]
    assert [f.code for f in FEATURES if f.shared] == ["IN"]
    assert set(CODES) - set(TRAINING) == {"CC", "FPP", "RWM", "DTL"}
    assert set(PROBE) == {"CL", "MN", "OS", "RWA", "RWP", "LLI"}
    assert feature("MN").view == "coronal"
    assert feature("CL").view == "axial"
    assert feature("RWA").view == feature("RWP").view == "3D"


def test_every_feature_is_explained() -> None:
    for row in FEATURES:
        assert row.name
        assert row.definition.endswith(".")
        assert row.where.endswith(".")
        assert row.view in ("3D", "axial", "sagittal", "coronal")


def test_codes_are_found_in_any_case_and_strangers_named_with_near_matches() -> None:
    assert index_of(" rwa ") == CODES.index("RWA")
    with pytest.raises(FeatureError, match=r"unknown feature 'RWX' \(did you mean RW"):
        feature("RWX")


def test_subsets_are_checked() -> None:
    assert check_codes(["os", "CL"], "probe") == ("OS", "CL")
    with pytest.raises(FeatureError, match="names CL twice"):
        check_codes(["CL", "CL"], "probe")
    with pytest.raises(FeatureError, match="must not contain CA"):
        check_codes(["CA"], "probe", allowed=EXTERNAL)
    with pytest.raises(FeatureError, match="at least 3 features, got 1"):
        check_codes(["CL"], "probe", at_least=3)


@pytest.mark.parametrize("word", ["L", "l", "left", "LEFT", Side.LEFT])
def test_sides_are_read_as_people_write_them(word: str) -> None:
    assert Side.parse(word) is Side.LEFT
    assert Side.parse(word).other is Side.RIGHT


def test_other_sides_are_refused() -> None:
    with pytest.raises(FeatureError, match="must be L or R, got 'up'"):
        Side.parse("up")


def test_the_documented_table_is_this_one() -> None:
    text = (Path(__file__).resolve().parents[3] / "docs" / "landmarks.md").read_text(encoding="utf-8")
    for row in FEATURES:
        assert f"| {row.code} | {row.name} | {row.definition} | {row.where} | {row.view} |" in text
