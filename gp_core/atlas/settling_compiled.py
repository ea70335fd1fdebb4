"""`gp_core.atlas.settling`, compiled; importing this takes half a second, some seconds once a machine."""

from __future__ import annotations

from gp_core.atlas import settling
from gp_core.registration.compiling import compiled_together
from gp_core.registration.turning_compiled import as_matrix, best_turn

__all__ = ["best_exchange", "settle"]

_BUFFERS = ", ".join(["float64[::1]"] * 8)
_SIGNATURES = {
    "settle": f"UniTuple(float64, 3)({_BUFFERS}, float64, int64)",
    "best_exchange": f"UniTuple(float64, 3)({_BUFFERS}, float64, int64, float64)",
}

_NAMES = {**vars(settling), "as_matrix": as_matrix, "best_turn": best_turn}
_KERNELS = compiled_together(settling.KERNELS, _NAMES, _SIGNATURES)
settle = _KERNELS["settle"]
best_exchange = _KERNELS["best_exchange"]
