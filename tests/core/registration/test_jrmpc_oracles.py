"""JRMPC against the answers of the authors of the study and of the algorithm, to 1e-6."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy.io import loadmat

from gp_core.landmarks.anatomy import round_window_frame
from gp_core.landmarks.features import PROBE, TRAINING
from gp_core.landmarks.sets import LandmarkSet
from gp_core.registration.jrmpc import ESTIMATION, jrmpc, jrmpc_batch
from gp_core.validation import FloatArray

DATA = Path(__file__).parents[3] / ".." / "shared" / "data"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="../shared/data is not here")

# fmt: off
ROWS = ["CB", "CC", "CL", "FPA", "FPP", "DTL", "DTM", "MN", "OI", "OS",
        "RWM", "RWA", "RWL", "RWP", "MH", "LLI", "CA", "IN", "ZL", "CO"]
# fmt: on
TOUCHED = {"CL": 0, "MN": 1, "OS": 2, "RWA": 4, "RWP": 5, "LLI": 6}
SETTINGS: dict[str, Any] = {
    "max_iterations": ESTIMATION.max_iterations,
    "gamma": ESTIMATION.gamma,
    "epsilon": ESTIMATION.epsilon,
}


class Means(NamedTuple):
    """Means of the registered training animals in the common frame."""

    co: FloatArray
    ca: FloatArray
    cb: FloatArray


def animals(side: str) -> FloatArray:
    """(11, 20, 3), each in its own CO frame."""
    file = DATA / "usevitch2021" / f"combined_coords_method2_morepts_final_co_correct_{side}_CO.mat"
    return np.ascontiguousarray(np.moveaxis(loadmat(file)[f"cc_{side}"], 2, 0))


def pick(points: FloatArray, codes: tuple[str, ...]) -> FloatArray:
    return points[[ROWS.index(code) for code in codes]]


def means(training: FloatArray, rotations: FloatArray, translations: FloatArray) -> Means:
    moved = [a @ r.T + t for a, r, t in zip(training, rotations, translations, strict=False)]
    return Means(*pick(np.mean(moved, axis=0), ("CO", "CA", "CB")))


def test_settings_are_those_of_the_study() -> None:
    config = json.loads((DATA / "oracles" / "loo_oracle.json").read_text())["config"]
    assert {name: config[name] for name in SETTINGS} == SETTINGS


@pytest.mark.parametrize("file", ["SkullA_Left_new.dat", "SkullD_Right.dat", "SkullE_Right.dat"])
def test_estimate_from_touches(file: str) -> None:
    answer = json.loads((DATA / "oracles" / "estimate_shared.json").read_text())[file]
    rows = np.loadtxt(DATA / "probe" / file)
    touches = LandmarkSet.from_mapping(
        {code: rows[i] for code, i in TOUCHED.items()}, answer["side"], frame="tracker"
    )
    T_tracker_window = round_window_frame(touches)
    probe = T_tracker_window.inverse().apply(touches.array(PROBE))
    training = animals(answer["side"])
    result = jrmpc([*(pick(a, TRAINING) for a in training), probe], **SETTINGS)
    common = means(training, result.rotations, result.translations)
    back = result.rotations[-1].T
    origin = T_tracker_window.apply([back @ (common.co - result.translations[-1])])[0]
    axis = T_tracker_window.apply_vector(back @ (common.ca - common.cb))
    np.testing.assert_allclose(origin, answer["co_mm"], atol=1e-6)
    np.testing.assert_allclose(axis / np.linalg.norm(axis), answer["modiolar_axis"], atol=1e-6)


@pytest.mark.parametrize("side", ["L", "R"])
def test_leave_one_out_in_one_batch(side: str) -> None:
    answer = json.loads((DATA / "oracles" / "loo_oracle.json").read_text())["errors"][side]
    everyone = animals(side)
    held_out, problems = [], []
    for i, animal in enumerate(everyone):
        landmarks = LandmarkSet.from_mapping(dict(zip(ROWS, animal, strict=True)), side)
        held_out.append(round_window_frame(landmarks).inverse().apply(animal))
        training = [pick(a, TRAINING) for a in np.delete(everyone, i, axis=0)]
        problems.append(np.concatenate([*training, pick(held_out[i], PROBE)]))
    sizes = [len(TRAINING)] * (len(everyone) - 1) + [len(PROBE)]
    batch = jrmpc_batch(problems, sizes, ESTIMATION)
    for i, (rotations, translations) in enumerate(zip(batch.rotations, batch.translations, strict=True)):
        common = means(np.delete(everyone, i, axis=0), rotations, translations)
        co, ca = pick(held_out[i] @ rotations[-1].T + translations[-1], ("CO", "CA"))
        assert np.linalg.norm(co - common.co) == pytest.approx(answer["e_co_mm"][i], abs=1e-6)
        assert angle_deg(ca - co, common.ca - common.co) == pytest.approx(answer["e_ma_deg"][i], abs=1e-6)


def angle_deg(a: FloatArray, b: FloatArray) -> float:
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))


def test_four_views_of_the_bunny() -> None:
    answer = loadmat(DATA / "oracles" / "jrmpc_bunny_view.mat")
    views = [np.loadtxt(DATA / "pointsets" / f"view{i}.txt") for i in (1, 2, 3, 4)]
    result = jrmpc(views, answer["Xin"].T, gamma=0.1)
    assert result.n_iterations == 100
    np.testing.assert_allclose(result.rotations, np.moveaxis(answer["Rm"], 2, 0), atol=1e-6)
    np.testing.assert_allclose(result.translations, answer["tm"].T, atol=1e-6)
    np.testing.assert_allclose(result.centres, answer["X"].T, atol=1e-6)
    np.testing.assert_allclose(result.variances, answer["S"].ravel(), atol=1e-6)
