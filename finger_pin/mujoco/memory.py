"""MuJoCo's numbers as arrays, in compiled code: a struct is an address, and a field its offset."""

from __future__ import annotations

from collections.abc import MutableSequence

import numpy as np

from finger_pin.core.jit import Pointer, load, njit_inline, types, view

_load_number, _load_int, _load_word = (load(each) for each in (types.float64, types.int32, types.int64))


@njit_inline
def size(owner: int, offset: int) -> int:
    """Return a number of mjtSize, or an address."""
    return _load_word(owner + offset)


@njit_inline
def integer(owner: int, offset: int) -> int:
    """Return a number of int."""
    return np.int64(_load_int(owner + offset))  # type: ignore[return-value]


@njit_inline
def number(owner: int, offset: int) -> float:
    """Return a number of mjtNum."""
    return _load_number(owner + offset)


@njit_inline
def number_in(owner: int, offset: int, index: int) -> float:
    """Return a number of an array of mjtNum."""
    return _load_number(_load_word(owner + offset) + 8 * index)


@njit_inline
def integer_in(owner: int, offset: int, index: int) -> int:
    """Return a number of an array of int."""
    return np.int64(_load_int(_load_word(owner + offset) + 4 * index))  # type: ignore[return-value]


_view_numbers, _view_ints, _view_words, _view_flags = (
    view(each) for each in (types.float64, types.int32, types.int64, types.uint8)
)


@njit_inline
def numbers(owner: int, offset: int, first: int = 0) -> Pointer:
    """Return an array of mjtNum from one of them on."""
    return _view_numbers(size(owner, offset) + 8 * first)


@njit_inline
def integers(owner: int, offset: int, first: int = 0) -> MutableSequence[int]:
    """Return an array of int from one of them on."""
    return _view_ints(size(owner, offset) + 4 * first)


@njit_inline
def flags(owner: int, offset: int) -> MutableSequence[int]:
    """Return an array of mjtBool or char."""
    return _view_flags(size(owner, offset))


@njit_inline
def words(owner: int, offset: int) -> MutableSequence[int]:
    """Return an array of uintptr_t."""
    return _view_words(size(owner, offset))


@njit_inline
def numbers_at(address: int) -> Pointer:
    """Return an array of mjtNum that begins at an address."""
    return _view_numbers(address)


@njit_inline
def integers_at(address: int) -> MutableSequence[int]:
    """Return an array of int that begins at an address."""
    return _view_ints(address)


@njit_inline
def zeros(address: int, count: int) -> int:
    """Return the address of `scratch`, filled with zeros."""
    for k in range(count):
        numbers_at(address)[k] = 0.0
    return address
