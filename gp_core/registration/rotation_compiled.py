"""`gp_core.registration.rotation`, compiled into every kernel that calls it; importing it loads Numba."""

from __future__ import annotations

from gp_core.registration import rotation
from gp_core.registration.compiling import compiled_together

__all__ = ["as_matrix", "minimal_rotation", "optimal_rotation", "product"]

_KERNELS = compiled_together(rotation.ROTATIONS, vars(rotation))
as_matrix = _KERNELS["as_matrix"]
optimal_rotation = _KERNELS["optimal_rotation"]
minimal_rotation = _KERNELS["minimal_rotation"]
product = _KERNELS["product"]
