"""What other programs run of ours: the logic of the Slicer module, on plain data."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import gp_core
from gp_core.study.drawn_labels import draw_touches

_MODULE = Path(__file__).resolve().parents[1] / "integrations" / "slicer" / "GuineaPigCochlea"


@pytest.fixture
def logic(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The logic of the module, found as Slicer finds it."""
    monkeypatch.syspath_prepend(_MODULE)
    import GuineaPigCochleaLogic

    return GuineaPigCochleaLogic


def _points(landmarks: gp_core.LandmarkSet, codes: tuple[str, ...]) -> dict[str, list[float]]:
    return {code: landmarks[code].tolist() for code in codes}


def test_the_estimate_is_ours_in_slicers_axes(logic: ModuleType) -> None:
    touches, truth = draw_touches(seed=3)
    found = logic.estimate(_points(touches, touches.placed), "L")
    pose = gp_core.estimate_pose(touches, "L")
    np.testing.assert_allclose(found["points"]["CO"], pose.origin)
    assert np.linalg.norm(pose.origin - truth["CO"]) < pose.radius_95
    lps_to_ras = np.diag([-1.0, -1.0, 1.0, 1.0])
    matrix = np.array(found["transform_ras"])
    np.testing.assert_allclose(matrix[:3, 3], (lps_to_ras @ [*pose.origin, 1.0])[:3])
    assert np.linalg.det(matrix[:3, :3]) == pytest.approx(1.0)
    assert "95 % within" in found["text"]


def test_a_pose_that_must_not_be_used_is_not_given(logic: ModuleType) -> None:
    touches, _ = draw_touches(seed=3)
    mirrored = {code: [-x, y, z] for code, (x, y, z) in _points(touches, touches.placed).items()}
    with pytest.raises(gp_core.GpError, match="look like those of the right ear"):
        logic.estimate(mirrored, "L")


def test_expected_features_hold_the_truth(logic: ModuleType) -> None:
    _, truth = draw_touches(seed=4)
    given = _points(truth, ("CA", "RWP", "OS", "MN", "CL"))
    found = logic.expected_features(given, "L")
    assert set(found) == set(gp_core.CODES) - set(given)
    within = [
        np.linalg.norm(truth[code] - each["position"]) < each["radius_95"] for code, each in found.items()
    ]
    assert np.mean(within) > 0.8


def test_labels_that_may_be_wrong_are_named(logic: ModuleType) -> None:
    _, truth = draw_touches(seed=4)
    points = _points(truth, tuple(code for code in gp_core.CODES if code != "CO"))
    assert logic.check_labels(points, "L") == []
    points["CA"], points["OS"] = points["OS"], points["CA"]
    assert any("CA" in line and "OS" in line for line in logic.check_labels(points, "L"))


def test_the_part_for_slicer_can_be_read_without_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(_MODULE)
    import GuineaPigCochlea

    assert GuineaPigCochlea.slicer is None
    sys.modules.pop("GuineaPigCochlea")
