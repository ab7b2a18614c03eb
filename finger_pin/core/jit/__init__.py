"""Compiled code: the only place that knows the compiler, which is numba.

`functions` compiles, `tables` hands over arguments of the `struct_types` there are, `calls` calls what lies at an
address and reads memory, and `digests` tells which code on disk still holds. The rest of the package sees the names
below.
"""

from numba import types

from finger_pin.core.jit.calls import (
    add_at,
    call_at,
    call_filling,
    call_shape,
    call_value,
    copy,
    copy_matrix,
    load,
    look_at,
    numbers,
    power_over,
    put,
    put_at,
    scratch,
    two_to_the,
    view,
)
from finger_pin.core.jit.functions import Unit, address_of, cache_place, compiled, compiled_loosely, compiled_within
from finger_pin.core.jit.struct_types import IndexTable, Indices, Kind, Layers, Matrix, Vector, bound_at
from finger_pin.core.jit.tables import (
    Block,
    alike,
    bound,
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
    "load",
    "look_at",
    "numbered",
    "numbers",
    "power_over",
    "put",
    "put_at",
    "refill",
    "refuse_copy",
    "scratch",
    "taken",
    "two_to_the",
    "types",
    "view",
]
