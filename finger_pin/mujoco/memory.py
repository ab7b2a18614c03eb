"""MuJoCo's numbers as arrays, in compiled code: a struct is an address, and a field its offset."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from numba.extending import intrinsic

_intrinsic: Any = intrinsic
_types: Any = numba.types
#: Compiles a function of numbers and addresses into what calls it, where offsets are constants: else all of them would
#: be passed at every call. What it divides by zero is infinite, as in NumPy.
compiled: Any = numba.njit(error_model="numpy", forceinline=True)


def _viewer(kind: Any) -> Any:
    """Return a function of an address that gives the numbers there, by index.

    An array of numba's would ask of each index whether it is negative.
    """

    @_intrinsic
    def view(typing_context: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.inttoptr(arguments[0], context.get_data_type(kind).as_pointer())

        return _types.CPointer(kind)(address), generate

    return view


def _loader(kind: Any) -> Any:
    """Return a function that reads one number at an address: arrays cost more than the use of their numbers."""

    @_intrinsic
    def load(typing_context: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.load(builder.inttoptr(arguments[0], context.get_value_type(kind).as_pointer()))

        return kind(address), generate

    return load


@_intrinsic
def scratch(typing_context: Any, count: Any) -> Any:
    """Return the address of room for numbers on the callback's stack: an array of NumPy's would be allocated anew."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kind = context.get_value_type(_types.float64)
        return builder.ptrtoint(builder.alloca(kind, size=arguments[0]), context.get_value_type(_types.intp))

    return _types.intp(_types.intp), generate


@_intrinsic
def two_to_the(typing_context: Any, rounded: Any) -> Any:
    """Return 2^n of a number with the integer n in its last bits, as bits of its exponent."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        word = context.get_value_type(_types.int64)
        exponent = builder.shl(builder.bitcast(arguments[0], word), word(52))
        return builder.bitcast(builder.add(exponent, word(1023 << 52)), context.get_value_type(_types.float64))

    return _types.float64(_types.float64), generate


@_intrinsic
def power_over(typing_context: Any, value: Any) -> Any:
    """Return the power of two from 1 / x to 2 / x, by the bits of a positive number's exponent."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        word = context.get_value_type(_types.int64)
        exponent = builder.and_(builder.bitcast(arguments[0], word), word(2047 << 52))
        return builder.bitcast(builder.sub(word(2046 << 52), exponent), context.get_value_type(_types.float64))

    return _types.float64(_types.float64), generate


_load_number, _load_int, _load_word = (_loader(each) for each in (_types.float64, _types.int32, _types.int64))


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


_view_numbers, _view_ints, _view_words, _view_flags = (
    _viewer(each) for each in (_types.float64, _types.int32, _types.int64, _types.uint8)
)


@compiled
def numbers(owner: Any, offset: Any, first: Any = 0) -> Any:
    """Return an array of mjtNum from one of them on."""
    return _view_numbers(size(owner, offset) + 8 * first)


@compiled
def integers(owner: Any, offset: Any, first: Any = 0) -> Any:
    """Return an array of int from one of them on."""
    return _view_ints(size(owner, offset) + 4 * first)


@compiled
def flags(owner: Any, offset: Any) -> Any:
    """Return an array of mjtBool or char."""
    return _view_flags(size(owner, offset))


@compiled
def words(owner: Any, offset: Any) -> Any:
    """Return an array of uintptr_t."""
    return _view_words(size(owner, offset))


@compiled
def numbers_at(address: Any) -> Any:
    """Return an array of mjtNum that begins at an address."""
    return _view_numbers(address)


@compiled
def integers_at(address: Any) -> Any:
    """Return an array of int that begins at an address."""
    return _view_ints(address)


@compiled
def zeros(room: Any, count: Any) -> Any:
    """Return the address of `scratch`, filled with zeros."""
    for k in range(count):
        numbers_at(room)[k] = 0.0
    return room
