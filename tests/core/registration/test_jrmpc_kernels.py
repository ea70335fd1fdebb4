"""The compiled mathematics of JRMPC: its exponential and its best rotation."""

from __future__ import annotations

import numpy as np
import pytest

from gp_core.registration.jrmpc_kernels import exp_negative
from gp_core.registration.rotation_compiled import as_matrix, minimal_rotation
from gp_core.validation import FloatArray


def test_exponential_is_good_to_two_units_in_the_last_place() -> None:
    u = -np.concatenate([np.linspace(0, 708, 4001), np.geomspace(1e-300, 1, 400), [0.0]])
    exact = np.exp(u)
    off = np.abs(np.array([exp_negative(v) for v in u]) - exact) / np.spacing(exact)
    assert off.max() <= 2


def test_exponential_falls_to_zero_cleanly() -> None:
    assert [exp_negative(u) for u in (-708.1, -745.0, -1e300, -np.inf)] == [0.0] * 4


def rotation_of(h: FloatArray) -> FloatArray:
    return np.reshape(as_matrix(minimal_rotation(tuple(h.ravel().tolist()))), (3, 3))


def random_orthogonal(rng: np.random.Generator) -> FloatArray:
    return np.linalg.qr(rng.normal(size=(3, 3)))[0]


def test_the_rotation_is_that_of_the_singular_value_decomposition() -> None:
    """Nearly singular, mirrored, tiny and huge matrices too; the error grows as the rotation gets open."""
    rng = np.random.default_rng(0)
    for _ in range(3000):
        scale = 10.0 ** rng.integers(-30, 30)
        h = random_orthogonal(rng) @ np.diag(scale * 10.0 ** rng.uniform(-6, 0, 3)) @ random_orthogonal(rng)
        u, s, vt = np.linalg.svd(h)
        sign = np.sign(np.linalg.det(u @ vt))
        off = np.abs(rotation_of(h) - u @ np.diag([1, 1, sign]) @ vt).max()
        assert off * (s[1] + sign * s[2]) / s[0] < 5e-14


@pytest.mark.parametrize("h", [np.zeros((3, 3)), np.diag([1.0, 0, 0]), np.diag([1.0, 1.0, -1.0])])
def test_an_under_determined_rotation_is_the_minimal_one(h: FloatArray) -> None:
    np.testing.assert_allclose(rotation_of(h), np.eye(3), atol=1e-12)


def test_opposite_of_the_identity_is_still_a_rotation() -> None:
    rotation = rotation_of(np.diag([-1.0, -1.0, 1.0]))
    np.testing.assert_allclose(rotation, np.diag([-1.0, -1.0, 1.0]), atol=1e-12)
