"""Arguments handed to compiled code once: unpacking some eighty arrays costs as much as a small step does.

`bound` writes a table of arrays into one block of machine words, from which `bound_at` reads at no cost at every later
call. To compiled code a table is a pointer, whose attributes are its fields: passing a pointer instead of some hundred
numbers is what compiling quickly depends on.
"""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from finger_pin.core.jit.functions import Unit
from finger_pin.core.jit.kinds import Kind, Numbers

_DTYPES = {name: np.dtype(name) for name in ("float64", "int64")}
# Callers see another signature than numba's.
_generated: Any = intrinsic


def bound(table: Any, kind: Kind) -> NDArray[np.uint8]:
    """Return a block that holds a table for `bound_at`; its arrays must be kept alive as long as the block.

    Raises:
        TypeError: If the table is not of the kind that `bound_at` will read: another layout would be misread.
    """
    words: list[int] = []
    _write(table, kind, words)
    return np.array(words, dtype=np.int64).view(np.uint8)


def call(unit: Unit, table: Any, kind: Kind) -> int:
    """Call a unit with a table."""
    block = bound(table, kind)
    return unit(block.ctypes.data)


def _address(array: Any) -> int:
    """Return the address of an array's numbers."""
    if array.size and array.flags.writeable:
        # Sooner than NumPy says it itself.
        return ctypes.addressof(ctypes.c_char.from_buffer(array))
    return int(array.ctypes.data)


def _write(table: Any, kind: Kind, words: list[int]) -> None:
    for value, own in zip(table, kind.fields.values(), strict=True):
        if isinstance(own, Numbers):
            fitting = isinstance(value, np.ndarray) and value.ndim == own.dimensions and value.flags.c_contiguous
            if not fitting or value.dtype != _DTYPES[own.dtype]:
                raise TypeError(f"{value!r} cannot be bound as {own}")
            words.append(_address(value))
            words.extend(value.shape)
        elif isinstance(own, Kind):
            _write(value, own, words)
        elif isinstance(value, bool | int) and own in (int, bool):
            words.append(int(value))
        elif isinstance(value, float) and own is float:
            words.append(int(np.float64(value).view(np.int64)))
        else:
            raise TypeError(f"{value!r} cannot be bound as {own}")


@_generated
def bound_at(_typing: Any, address: Any, kind: Any) -> Any:
    """Return the table at the address of a block that `bound` has filled."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))

    return kind.instance_type(types.int64, kind), generate
