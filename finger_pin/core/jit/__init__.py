"""Compiled code: the only place that knows the compiler, numba.

`functions` compiles, `tables` hands over arguments of the `struct_types` there are, `calls` calls what lies at an
address and reads memory, and `digests` tells which code on disk still holds. The rest of the package sees the names
below.
"""

from numba import types

from finger_pin.core.jit.calls import (
    call_at,
    call_filling,
    call_shape,
    call_value,
    copy,
    copy_matrix,
    load,
    numbers,
    put,
    scratch,
    sum_products,
    view,
)
from finger_pin.core.jit.functions import (
    CompiledFunction,
    address_of,
    cache_place,
    inlined,
    njit_always_inline,
    njit_inline,
    njit_reassociate,
)
from finger_pin.core.jit.struct_packing import Block, call, copied, empty_table, overwrite, pack, refuse_copy
from finger_pin.core.jit.struct_types import IndexTable, Indices, Layers, Matrix, StructType, Vector, unpack
from finger_pin.typing import Pointer

__all__ = [
    "Block",
    "CompiledFunction",
    "IndexTable",
    "Indices",
    "Layers",
    "Matrix",
    "Pointer",
    "StructType",
    "Vector",
    "address_of",
    "cache_place",
    "call",
    "call_at",
    "call_filling",
    "call_shape",
    "call_value",
    "copied",
    "copy",
    "copy_matrix",
    "empty_table",
    "inlined",
    "load",
    "njit_always_inline",
    "njit_inline",
    "njit_reassociate",
    "numbers",
    "overwrite",
    "pack",
    "put",
    "refuse_copy",
    "scratch",
    "sum_products",
    "types",
    "unpack",
    "view",
]
