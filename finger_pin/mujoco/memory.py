"""MuJoCo's numbers as arrays, in compiled code: a struct is an address, and a field its offset."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from numba.extending import intrinsic

_array: Any = numba.carray  # type: ignore[attr-defined]
_intrinsic: Any = intrinsic
#: Compiles a function of numbers and addresses into what calls it, where offsets are constants: else all of them would
#: be passed at every call. What it divides by zero is infinite, as in NumPy.
compiled: Any = numba.njit(error_model="numpy", forceinline=True)


@_intrinsic
def _pointer(typing_context: Any, address: Any) -> Any:
    """Return an address as a pointer."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], context.get_value_type(numba.types.voidptr))

    return numba.types.voidptr(address), generate


def _loader(kind: Any) -> Any:
    """Return a function that reads one number at an address: arrays cost more than what is done with their numbers."""

    @_intrinsic
    def load(typing_context: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.load(builder.inttoptr(arguments[0], context.get_value_type(kind).as_pointer()))

        return kind(address), generate

    return load


_load_number, _load_int, _load_word = (
    _loader(each) for each in (numba.types.float64, numba.types.int32, numba.types.int64)
)
_load_flag = _loader(numba.types.uint8)


@compiled
def size(owner: Any, offset: Any) -> Any:
    """Return a number of mjtSize, or an address."""
    return _load_word(owner + offset)


@compiled
def integer(owner: Any, offset: Any) -> Any:
    """Return a number of int."""
    return np.int64(_load_int(owner + offset))


@compiled
def number(owner: Any, offset: Any) -> Any:
    """Return a number of mjtNum."""
    return _load_number(owner + offset)


@compiled
def number_in(owner: Any, offset: Any, index: Any) -> Any:
    """Return a number of an array of mjtNum."""
    return _load_number(_load_word(owner + offset) + 8 * index)


@compiled
def integer_in(owner: Any, offset: Any, index: Any) -> Any:
    """Return a number of an array of int."""
    return np.int64(_load_int(_load_word(owner + offset) + 4 * index))


@compiled
def flag_in(owner: Any, offset: Any, index: Any) -> Any:
    """Return a number of an array of mjtBool or char."""
    return _load_flag(_load_word(owner + offset) + index)


# Arrays are read as far as an index of MuJoCo's leads, so that their lengths are not asked for.
_ANY = 1 << 40


@compiled
def numbers(owner: Any, offset: Any, first: Any = 0) -> Any:
    """Return an array of mjtNum from one of them on."""
    return _array(_pointer(size(owner, offset) + 8 * first), _ANY, np.float64)


@compiled
def integers(owner: Any, offset: Any, first: Any = 0) -> Any:
    """Return an array of int from one of them on."""
    return _array(_pointer(size(owner, offset) + 4 * first), _ANY, np.int32)


@compiled
def flags(owner: Any, offset: Any) -> Any:
    """Return an array of mjtBool or char."""
    return _array(_pointer(size(owner, offset)), _ANY, np.uint8)


@compiled
def words(owner: Any, offset: Any) -> Any:
    """Return an array of uintptr_t."""
    return _array(_pointer(size(owner, offset)), _ANY, np.int64)


@compiled
def numbers_at(address: Any) -> Any:
    """Return an array of mjtNum that begins at an address."""
    return _array(_pointer(address), _ANY, np.float64)


@compiled
def borrowed(array: Any, first: Any = 0) -> Any:
    """Return an array's numbers from one on, for its owner to use while it holds it: holders are not counted.

    Counting them, atomically at every call and slice, costs more than most of what is done with the numbers.
    """
    return numbers_at(array.ctypes.data + 8 * first)


@compiled
def integers_at(address: Any) -> Any:
    """Return an array of int that begins at an address."""
    return _array(_pointer(address), _ANY, np.int32)
