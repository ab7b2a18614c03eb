"""Compiled code: the only place that knows the compiler, which is numba.

`functions` compiles, `tables` hands over arguments of the `kinds` there are, `calls` calls what lies at an address, and
`dependencies` tells which code on disk still holds. What rests on numba's inside is in `numba_internals`. The rest of
the core sees the names below.
"""

from finger_pin.core.jit.calls import (
    add_at,
    call_at,
    call_filling,
    call_shape,
    call_value,
    copy,
    copy_matrix,
    look_at,
    numbers,
    put,
    put_at,
)
from finger_pin.core.jit.functions import Unit, address_of, cache_place, compiled, compiled_loosely, compiled_within
from finger_pin.core.jit.kinds import IndexTable, Indices, Kind, Layers, Matrix, Vector
from finger_pin.core.jit.tables import (
    Block,
    alike,
    bound,
    bound_at,
    call,
    copied,
    fits,
    indices,
    numbered,
    refill,
    refuse_copy,
    taken,
)

__all__ = [
    "Block",
    "IndexTable",
    "Indices",
    "Kind",
    "Layers",
    "Matrix",
    "Unit",
    "Vector",
    "add_at",
    "address_of",
    "alike",
    "bound",
    "bound_at",
    "cache_place",
    "call",
    "call_at",
    "call_filling",
    "call_shape",
    "call_value",
    "compiled",
    "compiled_loosely",
    "compiled_within",
    "copied",
    "copy",
    "copy_matrix",
    "fits",
    "indices",
    "look_at",
    "numbered",
    "numbers",
    "put",
    "put_at",
    "refill",
    "refuse_copy",
    "taken",
]
