"""`gp_core.atlas.settling`, compiled; importing this takes half a second, some seconds once a machine."""

from __future__ import annotations

from types import FunctionType
from typing import Any

from gp_core.atlas import settling, turning
from gp_core.registration.compiling import compiled

__all__ = ["best_exchange", "settle"]

_BUFFERS = ", ".join(["float64[::1]"] * 8)
_SIGNATURES = {
    "settle": f"UniTuple(float64, 3)({_BUFFERS}, float64, int64)",
    "best_exchange": f"UniTuple(float64, 3)({_BUFFERS}, float64, int64, float64)",
}


def _compile() -> dict[str, Any]:
    """Compile the kernels such that they call each other compiled; return them by name."""
    names = {**vars(turning), **vars(settling)}
    for kernel in settling.KERNELS:
        copy = FunctionType(kernel.__code__, names, kernel.__name__)
        copy.__module__ = settling.__name__
        signature = _SIGNATURES.get(kernel.__name__)
        names[kernel.__name__] = (compiled(signature, cache=True) if signature else compiled())(copy)
    return names


_KERNELS = _compile()
settle = _KERNELS["settle"]
best_exchange = _KERNELS["best_exchange"]
