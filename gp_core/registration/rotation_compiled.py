"""`gp_core.registration.rotation`, compiled into whatever kernel calls it; importing this loads Numba."""

from __future__ import annotations

from gp_core.registration import rotation
from gp_core.registration.compiling import compiled_together

__all__ = ["as_matrix", "best_turn", "least_turn", "product"]

_KERNELS = compiled_together(rotation.TURNS, vars(rotation))
as_matrix = _KERNELS["as_matrix"]
best_turn = _KERNELS["best_turn"]
least_turn = _KERNELS["least_turn"]
product = _KERNELS["product"]
