"""Vectors of eight numbers in Numba: one number of each of eight problems, which are computed side by side.

LLVM turns arithmetic on its vector types into the vector instructions of whatever processor it compiles for
(AVX-512, AVX2, NEON). Numba has no such type; this module adds one, with what the kernels of JRMPC need.
Numbers mix with vectors. Imported on first use only, since Numba takes half a second to start.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Sequence
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.datamodel import models
from numba.extending import intrinsic, overload, register_model

from gp_core.registration.compiling import compiled

__all__ = [
    "LANES",
    "above",
    "all_above",
    "choose",
    "exponential",
    "lanes_of",
    "larger",
    "magnitude",
    "not_at_most",
    "put",
    "square_root",
    "take",
]

LANES = 8
"""Numbers in a vector: as many as AVX-512 computes at once."""

_VECTOR = ir.VectorType(ir.DoubleType(), LANES)
_LONGS = ir.VectorType(ir.IntType(64), LANES)
_BITS = ir.VectorType(ir.IntType(1), LANES)
_FUSED = ("contract", "nsz")  # a product and a sum in one instruction; nothing is reordered

_LOG2_E = 1.4426950408889634
_LN2_HIGH, _LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
_ROUND = 6755399441055744.0  # 1.5 * 2**52: adding it rounds to an integer held in the low bits
_LOWEST = -708.0


class _Vector(types.Type):
    def __init__(self) -> None:
        super().__init__(name=f"float64x{LANES}")


class _Mask(types.Type):
    def __init__(self) -> None:
        super().__init__(name=f"boolx{LANES}")


_vector, _mask = _Vector(), _Mask()


@register_model(_Vector)
class _VectorModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _VECTOR)  # type: ignore[no-untyped-call]


@register_model(_Mask)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _BITS)  # type: ignore[no-untyped-call]


def _spread(builder: Any, value: Any) -> Any:
    """Return a vector: the value itself, or a number in all lanes."""
    if value.type == _VECTOR:
        return value
    nothing = ir.Constant(_VECTOR, ir.Undefined)
    first = builder.insert_element(nothing, value, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(
        first, nothing, ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    )


def _operation(result: Any, n: int, make: Callable[[Any, Sequence[Any]], Any]) -> Any:
    """Return a function of n vectors or numbers, for compiled code: the instructions that `make` builds."""

    def typed(arguments: Sequence[Any]) -> Any:
        wanted = [a if a in (_vector, _mask) else types.float64 for a in arguments]

        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            return make(builder, [v if v.type == _BITS else _spread(builder, v) for v in values])

        return result(*wanted), generate

    if n == 1:
        return intrinsic(lambda typing, a: typed((a,)))
    if n == 2:
        return intrinsic(lambda typing, a, b: typed((a, b)))
    return intrinsic(lambda typing, a, b, c: typed((a, b, c)))


def _function(name: str) -> Callable[[Any, Sequence[Any]], Any]:
    """Return what calls one of LLVM's own functions of one vector."""

    def make(builder: Any, values: Sequence[Any]) -> Any:
        kind = ir.FunctionType(_VECTOR, [_VECTOR])
        get: Any = cgutils.get_or_insert_function  # without types
        function = get(builder.module, kind, f"llvm.{name}.v{LANES}f64")
        return builder.call(function, values)

    return make


def _compared(ordered: bool) -> Callable[[Any, Sequence[Any]], Any]:
    def make(builder: Any, values: Sequence[Any]) -> Any:
        return (builder.fcmp_ordered if ordered else builder.fcmp_unordered)(">", *values)

    return make


def _largest(builder: Any, values: Sequence[Any]) -> Any:
    return builder.select(builder.fcmp_ordered(">", *values), *values)


def _every(builder: Any, values: Sequence[Any]) -> Any:
    bits = builder.bitcast(builder.fcmp_ordered(">", *values), ir.IntType(LANES))
    return builder.icmp_unsigned("==", bits, ir.Constant(ir.IntType(LANES), (1 << LANES) - 1))


def _times_power(builder: Any, values: Sequence[Any]) -> Any:
    """Multiply by 2 to the integer in the low bits of the second vector: add it to the exponents."""
    value, power = (builder.bitcast(v, _LONGS) for v in values)
    shifted = builder.shl(power, ir.Constant(_LONGS, [52] * LANES))
    return builder.bitcast(builder.add(value, shifted), _VECTOR)


lanes_of = _operation(_vector, 1, lambda builder, values: values[0])
"""A number in all lanes."""

square_root = _operation(_vector, 1, _function("sqrt"))
magnitude = _operation(_vector, 1, _function("fabs"))
larger = _operation(_vector, 2, _largest)
"""The larger one in each lane; the second where one is NaN."""

above = _operation(_mask, 2, _compared(ordered=True))
"""A mask: in which lanes the first is larger."""

not_at_most = _operation(_mask, 2, _compared(ordered=False))
"""The same, and true for NaN."""

all_above = _operation(types.boolean, 2, _every)
"""Whether the first is larger in every lane."""

choose = _operation(_vector, 3, lambda builder, values: builder.select(*values))
"""The second where the mask holds, else the third."""

_scaled = _operation(_vector, 2, _times_power)
_minus = _operation(_vector, 1, lambda builder, values: builder.fneg(values[0]))


def _arithmetic(name: str) -> Any:
    return _operation(_vector, 2, lambda builder, values: getattr(builder, name)(*values, flags=_FUSED))


def _define(function: Any, compute: Any) -> None:
    """Let an operator work on vectors."""

    @overload(function, strict=False)
    def typed(a: Any, b: Any) -> Any:
        return (lambda a, b: compute(a, b)) if _vector in (a, b) else None


for _operator, _name in (
    (operator.add, "fadd"),
    (operator.sub, "fsub"),
    (operator.mul, "fmul"),
    (operator.truediv, "fdiv"),
):
    _define(_operator, _arithmetic(_name))


@overload(operator.neg, strict=False)
def _negated(a: Any) -> Any:
    return (lambda a: _minus(a)) if a is _vector else None


@overload(math.sqrt, strict=False)
def _rooted(a: Any) -> Any:
    return (lambda a: square_root(a)) if a is _vector else None


def _pointer(context: Any, builder: Any, kind: Any, array: Any, index: Any) -> Any:
    data = context.make_array(kind)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [index]), _VECTOR.as_pointer())


def _taking(typing: Any, array: Any, index: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.load(_pointer(context, builder, signature.args[0], *values), align=8)

    return _vector(array, types.intp), generate


def _putting(typing: Any, array: Any, index: Any, value: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        place = _pointer(context, builder, signature.args[0], *values[:2])
        builder.store(_spread(builder, values[2]), place, align=8)
        return context.get_dummy_value()

    return types.void(array, types.intp, value), generate


take: Any = intrinsic(_taking)
"""``take(array, index)``: the vector of a flat contiguous array that begins there."""

put: Any = intrinsic(_putting)
"""``put(array, index, vector)``: write it there."""


@compiled()
def exponential(u: Any) -> Any:
    """Compute exp(u) in each lane, as `gp_core.registration.jrmpc_kernels.exp_negative` does.

    Parameters
    ----------
    u : vector
        Not positive.

    Returns
    -------
    vector
        exp(u); 0 below -708.
    """
    held = larger(u, _LOWEST)
    shifted = held * _LOG2_E + _ROUND
    n = shifted - _ROUND
    r = (held - n * _LN2_HIGH) - n * _LN2_LOW
    p = r * 2.5110037605963777712e-8 + 2.7632639639041029749e-7
    p = p * r + 2.7557240918578969823e-6
    p = p * r + 2.4801485482328492419e-5
    p = p * r + 1.9841269890047113707e-4
    p = p * r + 1.3888888952314774652e-3
    p = p * r + 8.3333333333196006109e-3
    p = p * r + 4.1666666666488095495e-2
    p = p * r + 1.6666666666666680806e-1
    p = p * r + 5.0000000000000183855e-1
    p = (p * r * r + r) + 1.0
    return choose(above(_LOWEST, u), 0.0, _scaled(p, shifted))
