"""`student_t_fit`, compiled; importing it takes half a second, and some seconds once on each machine."""

from __future__ import annotations

from gp_core.registration import student_t_fit
from gp_core.registration.compiling import compiled_together
from gp_core.registration.rotation_compiled import as_matrix, optimal_rotation

__all__ = ["best_exchange", "fit_student_t"]

_BUFFERS = ", ".join(["float64[::1]"] * 9)
_SIGNATURES = {
    "fit_student_t": f"UniTuple(float64, 3)({_BUFFERS}, float64, int64)",
    "best_exchange": f"UniTuple(float64, 3)({_BUFFERS}, float64, int64, float64)",
}

_NAMES = {**vars(student_t_fit), "as_matrix": as_matrix, "optimal_rotation": optimal_rotation}
_KERNELS = compiled_together(student_t_fit.KERNELS, _NAMES, _SIGNATURES)
fit_student_t = _KERNELS["fit_student_t"]
best_exchange = _KERNELS["best_exchange"]
