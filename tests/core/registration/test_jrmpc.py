"""JRMPC: the laws it obeys, agreement with plain NumPy, and bad input."""

from __future__ import annotations

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from reference_jrmpc import reference_jrmpc

from gp_core.errors import GeometryError, GpError
from gp_core.registration import jrmpc as module
from gp_core.registration.jrmpc import DEFAULTS, ESTIMATION, JrmpcResult, JrmpcSettings, jrmpc, jrmpc_batch
from gp_core.validation import FloatArray


def turn(rng: np.random.Generator, largest_angle: float = np.pi) -> FloatArray:
    """Rotation about a random axis."""
    x, y, z = (axis := rng.normal(size=3)) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = rng.uniform(0, largest_angle)
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def animals(seed: int, n_sets: int = 6, sizes: tuple[int, ...] = (16, 12, 6)) -> list[FloatArray]:
    """Noisy, gently turned copies of one shape, of which some sets lack points."""
    rng = np.random.default_rng(seed)
    shape = rng.normal(size=(max(sizes), 3)) * [4.0, 3.0, 2.0]
    return [
        (shape + 0.1 * rng.normal(size=shape.shape))[: sizes[j % len(sizes)]] @ turn(rng, 0.2).T
        + rng.normal(size=3)
        for j in range(n_sets)
    ]


def assert_same(result: Any, expected: Any, atol: float = 1e-9) -> None:
    for name in ("rotations", "translations", "centres", "variances"):
        np.testing.assert_allclose(getattr(result, name), getattr(expected, name), atol=atol, err_msg=name)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("options", [{}, {"gamma": 0.05, "epsilon": 1e-9, "max_iterations": 60}])
def test_agrees_with_plain_numpy(seed: int, options: dict[str, Any]) -> None:
    sets = animals(seed)
    result, expected = jrmpc(sets, **options), reference_jrmpc(sets, **options)
    assert_same(result, expected, atol=1e-8)
    assert result.n_iterations == len(result.objective) <= options.get("max_iterations", 100)
    np.testing.assert_allclose(result.objective, -expected.objective[: result.n_iterations], atol=1e-7)


def test_agrees_with_plain_numpy_in_pieces_on_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    sets = animals(5, n_sets=4, sizes=(150, 101, 90, 33))
    centres = 4 * np.random.default_rng(0).normal(size=(45, 3))
    expected = reference_jrmpc(sets, centres, gamma=0.1, max_iterations=25)
    whole = jrmpc(sets, centres, gamma=0.1, max_iterations=25)
    monkeypatch.setattr(module, "TABLE_SIZE", 45 * 40)
    monkeypatch.setattr(module, "THREADS_FROM_WORK", 0)
    monkeypatch.setattr(module, "n_cores", lambda: 3)
    pieces = jrmpc(sets, centres, gamma=0.1, max_iterations=25)
    assert_same(whole, expected)
    assert_same(pieces, expected)


@pytest.mark.parametrize("longest", [1, 7, 16, 40, 1000])
def test_pieces_and_blocks_cover_every_point_once(longest: int) -> None:
    starts = np.array([0, 16, 32, 35, 100], dtype=np.uint64)
    pieces, piece_sets, blocks = (rows.astype(int) for rows in module.cut_into_blocks(starts, longest))
    assert pieces[0] == blocks[0] == 0
    assert (pieces[-1], blocks[-1]) == (100, len(piece_sets))
    assert (np.diff(pieces) > 0).all()
    assert np.diff(pieces[blocks]).max() <= longest
    owners = np.repeat(piece_sets, np.diff(pieces))
    np.testing.assert_array_equal(owners, np.repeat(range(4), np.diff(starts.astype(int))))


def test_batch_gives_the_single_answers() -> None:
    problems = [animals(seed) for seed in range(5)]
    sizes = [len(points) for points in problems[0]]
    for settings in (DEFAULTS, ESTIMATION):
        batch = jrmpc_batch([np.concatenate(sets) for sets in problems], sizes, settings)
        for b, sets in enumerate(problems):
            single = jrmpc(
                sets,
                max_iterations=settings.max_iterations,
                gamma=settings.gamma,
                epsilon=settings.epsilon,
            )
            assert_same(batch_row(batch, b), single, atol=1e-8)
            assert batch.converged[b] == single.converged


def batch_row(batch: Any, b: int) -> JrmpcResult:
    return JrmpcResult(
        batch.rotations[b], batch.translations[b], batch.centres[b], batch.variances[b], np.empty(0), 0, False
    )


def test_batches_on_threads_do_not_disturb_each_other() -> None:
    sets = [np.concatenate(animals(seed)) for seed in range(8)]
    sizes = [len(points) for points in animals(0)]
    alone = jrmpc_batch(sets, sizes)
    with ThreadPoolExecutor(4) as pool:
        rows = list(pool.map(lambda points: jrmpc_batch([points], sizes), sets))
    for b, row in enumerate(rows):
        np.testing.assert_array_equal(row.rotations[0], alone.rotations[b])


def test_empty_batch_is_empty() -> None:
    assert jrmpc_batch(np.empty((0, 9, 3)), [5, 4]).rotations.shape == (0, 2, 3, 3)


def test_stopping_at_rest_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    sets = animals(1)
    early = jrmpc(sets, max_iterations=400)
    assert early.n_iterations < 400
    assert early.converged
    monkeypatch.setattr(module, "STATIONARY", -1.0)
    full = jrmpc(sets, max_iterations=400)
    assert full.n_iterations == 400
    assert_same(early, full)


def test_too_few_iterations_are_reported() -> None:
    assert not jrmpc(animals(1), max_iterations=3).converged


@pytest.mark.parametrize("seed", range(3))
def test_common_motion_moves_the_answer_only(seed: int) -> None:
    # By quarter turns: the first variances come from a box along the axes, which a slanted turn changes.
    rotation, shift = np.array([[0, -1, 0], [0, 0, 1], [-1, 0, 0.0]]), np.array([100.0, -50.0, 20.0])
    sets = animals(seed)
    still = jrmpc(sets)
    moved = jrmpc([points @ rotation.T + shift for points in sets])
    np.testing.assert_allclose(moved.rotations, rotation @ still.rotations @ rotation.T, atol=1e-7)
    np.testing.assert_allclose(moved.centres, still.centres @ rotation.T + shift, atol=1e-7)
    np.testing.assert_allclose(moved.variances, still.variances, atol=1e-7)


def test_shift_of_one_set_changes_its_translation_only() -> None:
    # Given centres: were they the centroids, the shift would move one of them.
    sets = animals(2)
    centres = np.array([points.mean(axis=0) for points in sets])
    still = jrmpc(sets, centres)
    shifted = jrmpc([sets[0] + [30.0, -20.0, 10.0], *sets[1:]], centres)
    np.testing.assert_allclose(shifted.rotations, still.rotations, atol=1e-9)
    np.testing.assert_allclose(shifted.centres, still.centres, atol=1e-9)
    np.testing.assert_allclose(shifted.translations[1:], still.translations[1:], atol=1e-9)


def test_rotation_of_one_set_is_undone() -> None:
    rng = np.random.default_rng(3)
    shape = rng.normal(size=(30, 3)) * [4.0, 3.0, 2.0]
    centres = shape + 0.2 * rng.normal(size=shape.shape)
    rotation = turn(rng, 0.15)
    still, turned = jrmpc([shape, shape], centres), jrmpc([shape @ rotation.T, shape], centres)
    np.testing.assert_allclose(
        turned.rotations[1].T @ turned.rotations[0] @ rotation,
        still.rotations[1].T @ still.rotations[0],
        atol=1e-6,
    )


@pytest.mark.parametrize("seed", range(3))
def test_order_of_sets_and_points_does_not_matter(seed: int) -> None:
    rng = np.random.default_rng(seed)
    sets = animals(seed)
    order = rng.permutation(len(sets))
    result = jrmpc(sets)
    shuffled = jrmpc([rng.permutation(sets[j]) for j in order])
    np.testing.assert_allclose(shuffled.rotations, result.rotations[order], atol=1e-7)
    np.testing.assert_allclose(shuffled.translations, result.translations[order], atol=1e-7)
    np.testing.assert_allclose(shuffled.centres, result.centres[order], atol=1e-7)


@pytest.mark.parametrize("seed", range(5))
def test_objective_never_rises_with_epsilon_zero(seed: int) -> None:
    rng = np.random.default_rng(seed)
    sets = [5 * rng.normal(size=(25, 3)) for _ in range(4)]
    objective = jrmpc(sets, 5 * rng.normal(size=(8, 3)), epsilon=0.0, max_iterations=60).objective
    assert (np.diff(objective) <= 1e-9 * np.abs(objective[:-1])).all()
    assert objective[-1] < objective[0]


@pytest.mark.parametrize("seed", range(3))
def test_known_poses_are_found_among_outliers(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shape = rng.uniform(-1, 1, size=(60, 3)) * [5.0, 4.0, 3.0]
    rotations = [turn(rng, 0.3) for _ in range(4)]
    sets = [
        np.vstack([shape + 0.01 * rng.normal(size=shape.shape), rng.uniform(-5, 5, size=(12, 3))]) @ r
        for r in rotations
    ]
    result = jrmpc(sets, shape + 0.3 * rng.normal(size=shape.shape), gamma=0.2)
    moved = result.moved([points[:60] for points in sets])
    assert np.abs(moved - np.mean(moved, axis=0)).max() < 0.06
    relative = [found @ known.T for found, known in zip(result.rotations, rotations, strict=True)]
    np.testing.assert_allclose(relative, np.broadcast_to(relative[0], (4, 3, 3)), atol=0.01)


def degenerate_sets() -> dict[str, list[FloatArray]]:
    rng = np.random.default_rng(0)
    cloud = rng.normal(size=(10, 3))
    line = np.outer(np.arange(6.0), [1.0, 2.0, 3.0])
    return {
        "mirror images": [cloud, cloud * [-1, 1, 1], cloud * [1, -1, 1]],
        "planar": [cloud * [1, 1, 0], cloud[:5] * [1, 1, 0]],
        "lines": [line, line[:4], line[::-1]],
        "the same set": [cloud, cloud, cloud],
        "one set": [cloud],
        "one point thrice": [np.ones((3, 3)), cloud],
        "far away": [cloud + 1e6, cloud - 1e6],
        "tiny": [1e-6 * cloud, 1e-6 * cloud[::-1] + 1e-7],
    }


@pytest.mark.parametrize("name", degenerate_sets())
@pytest.mark.parametrize("epsilon", [0.0, 1e-6])
def test_poses_are_proper_rotations_whatever_comes(name: str, epsilon: float) -> None:
    result = jrmpc(degenerate_sets()[name], epsilon=epsilon)
    for rotation in result.rotations:
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(rotation) == pytest.approx(1.0)
    assert all(np.isfinite(field).all() for field in (result.translations, result.centres, result.variances))
    assert (result.variances > 0).all()


def test_centre_out_of_reach_stays() -> None:
    sets = animals(4)
    centres = np.vstack([np.array([points.mean(axis=0) for points in sets]), [[1e5, 0, 0]]])
    # The far centre widens the first variances so much that it takes a while to fall behind.
    result = jrmpc(sets, centres, max_iterations=300)
    assert np.isfinite(result.centres).all()


def test_input_is_left_alone() -> None:
    sets = animals(0)
    centres = np.array([points.mean(axis=0) for points in sets])
    packed = np.concatenate(sets)[None]
    before = [points.copy() for points in (*sets, centres, packed)]
    jrmpc(sets, centres)
    jrmpc_batch(packed, [len(points) for points in sets])
    for now, then in zip((*sets, centres, packed), before, strict=True):
        np.testing.assert_array_equal(now, then)


def test_moved_applies_the_poses() -> None:
    sets = animals(0)
    result = jrmpc(sets)
    moved = result.moved(sets)
    np.testing.assert_allclose(moved[2], (result.rotations[2] @ sets[2].T).T + result.translations[2])
    with pytest.raises(GpError, match="must hold 6 sets, got 5"):
        result.moved(sets[:5])


CLOUD = np.random.default_rng(9).normal(size=(5, 3))


@pytest.mark.parametrize(
    ("sets", "options", "words"),
    [
        ([], {}, "at least one point set"),
        ([CLOUD, np.empty((0, 3))], {}, "set 1 has 0"),
        ([CLOUD, CLOUD[:2]], {}, "set 1 has 2"),
        ([CLOUD, np.full((4, 3), np.nan)], {}, "set 1 must be finite"),
        ([CLOUD, CLOUD[:, :2]], {}, r"set 1 must have the shape \(N, 3\)"),
        ([CLOUD, "abc"], {}, "set 1 must be numbers"),
        ([np.ones((4, 3)), np.ones((4, 3))], {}, "no usable extent"),
        ([1e200 * CLOUD], {}, "no usable extent"),
        ([CLOUD], {"centres": np.empty((0, 3))}, "centres must hold at least one"),
        ([CLOUD], {"centres": [[0, 0, np.inf]]}, "centres must be finite"),
        ([CLOUD], {"max_iterations": 0}, "max_iterations must be a whole number"),
        ([CLOUD], {"max_iterations": 2.5}, "max_iterations"),
        ([CLOUD], {"max_iterations": True}, "max_iterations"),
        ([CLOUD], {"gamma": 0.0}, "gamma must be"),
        ([CLOUD], {"gamma": -1.0}, "gamma must be"),
        ([CLOUD], {"gamma": "x"}, "gamma must be"),
        ([CLOUD], {"epsilon": -1e-9}, "epsilon must be"),
        ([CLOUD], {"epsilon": np.nan}, "epsilon must be"),
    ],
)
def test_bad_input_is_named(sets: Any, options: dict[str, Any], words: str) -> None:
    with pytest.raises(GpError, match=words):
        jrmpc(sets, **options)


@pytest.mark.parametrize(
    ("problems", "sizes", "words"),
    [
        (np.zeros((2, 9, 3)), [5, 5], r"shape \(B, 10, 3\)"),
        (np.zeros((9, 3)), [5, 4], r"shape \(B, 9, 3\)"),
        (np.full((1, 9, 3), np.inf), [5, 4], "problem 0 is not"),
        ([["a"]], [5, 4], "numbers"),
        (np.zeros((1, 9, 3)), [5, 4], "no usable extent"),
        (np.zeros((1, 5, 3)), [], "at least one"),
        (np.zeros((1, 5, 3)), [2.5, 2.5], "whole numbers"),
        (np.zeros((1, 5, 3)), [3, 2], "set 1 has 2"),
    ],
)
def test_bad_batch_is_named(problems: Any, sizes: Any, words: str) -> None:
    with pytest.raises(GpError, match=words):
        jrmpc_batch(problems, sizes)


def test_too_small_set_is_an_error_of_geometry() -> None:
    with pytest.raises(GeometryError):
        jrmpc([CLOUD, CLOUD[:2]])


def test_settings_of_the_study_and_of_the_algorithm() -> None:
    estimation, defaults = JrmpcSettings(60, 0.05, 1e-9), JrmpcSettings(100, None, 1e-6)
    assert (estimation, defaults) == (ESTIMATION, DEFAULTS)


def test_import_leaves_numba_out() -> None:
    code = "import sys, gp_core.registration.jrmpc; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
