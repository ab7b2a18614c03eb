"""Arguments handed to compiled code once: unpacking some eighty arrays costs as much as a small step does.

`pack` writes a table of arrays into one `Block` of machine words, from which `unpack` reads at no cost at every
later call.
"""

from __future__ import annotations

import ctypes
from typing import Any, NoReturn, TypeVar

import numpy as np

from finger_pin.core.jit.functions import CompiledFunction
from finger_pin.core.jit.struct_types import Numbers, StructType

_Table = TypeVar("_Table", bound=tuple[Any, ...])
_DTYPES = {name: np.dtype(name) for name in ("float64", "int64")}


def refuse_copy(holder: object) -> NoReturn:
    """Refuse to copy or pickle an object that holds addresses, as its method ``__reduce__``.

    A copy would lead compiled code to the memory of the original, which may be gone, or in another process. Owners that
    can be copied have a ``__reduce__`` that builds another from what they were built from; all others refuse with this.

    Raises:
        TypeError: Always.
    """
    raise TypeError(f"{type(holder).__name__} holds addresses: its owner is copied, and builds another")


class Block:
    """A table for `unpack`, kept alive with its arrays.

    Attributes:
        address: Where compiled code finds it.
    """

    __slots__ = ("_table", "_words", "address")

    def __init__(self, table: tuple[Any, ...], words: list[int]) -> None:
        """Keep a table and its machine words."""
        self._table, self._words = table, np.array(words, dtype=np.int64)
        self.address = int(self._words.ctypes.data)

    __reduce__ = refuse_copy


def pack(table: _Table, kind: StructType[_Table]) -> Block:
    """Return a block that holds a table for `unpack`.

    Raises:
        TypeError: If the table is not of the kind that `unpack` will read: another layout would be misread.
    """
    words: list[int] = []
    _write(table, kind, words)
    return Block(table, words)


def call(unit: CompiledFunction, table: _Table, kind: StructType[_Table]) -> int:
    """Call a unit with a table."""
    block = pack(table, kind)
    return unit(block.address)


def copied(table: _Table) -> _Table:
    """Return a table with arrays of its own."""
    return type(table)(*map(_copied, table))


def indices(table: tuple[Any, ...]) -> bytes:
    """Return all arrays of integers of a table, one after the other."""
    found = []
    for value in table:
        if isinstance(value, tuple):
            found.append(indices(value))
        elif isinstance(value, np.ndarray) and value.dtype == np.int64:
            found.append(value.tobytes())
    return b"".join(found)


def alike(table: tuple[Any, ...], other: tuple[Any, ...], *, numbers: bool = False) -> bool:
    """Return whether two tables that fit have the same integers, and numbers too if those are asked for."""
    for own, new in zip(table, other, strict=True):
        if own is new:
            continue
        if isinstance(own, tuple):
            if not alike(own, new, numbers=numbers):
                return False
        elif isinstance(own, np.ndarray):
            if (numbers or own.dtype == np.int64) and not np.array_equal(own, new):
                return False
        elif numbers and own != new:
            return False
    return True


def fits(table: tuple[Any, ...], other: tuple[Any, ...]) -> bool:
    """Return whether the numbers of another table have room in the arrays of one, and all else is the same."""
    for own, new in zip(table, other, strict=True):
        if own is new:
            continue
        if isinstance(own, np.ndarray):
            if own.shape != new.shape:
                return False
        elif not (fits(own, new) if isinstance(own, tuple) else own == new):
            return False
    return True


def refill(table: tuple[Any, ...], other: tuple[Any, ...], before: tuple[Any, ...] | None = None) -> None:
    """Copy the numbers of another table, which `fits`, into the arrays of one: a block that holds it holds them.

    Args:
        table: It is filled.
        other: Whose numbers it is given.
        before: What it was filled from before, if nothing has changed them since: what both share stays.
    """
    for own, new, old in zip(table, other, before or (None,) * len(table), strict=True):
        if own is new or new is old:
            continue
        if isinstance(own, np.ndarray):
            own[...] = new
        elif isinstance(own, tuple):
            refill(own, new, old)


def numbered(table: _Table) -> _Table:
    """Return a table that has in the place of every number its index in the array."""
    numbers = [
        np.arange(each.size, dtype=float).reshape(each.shape) if _is_of_numbers(each) else each for each in table
    ]
    return type(table)(*(numbered(each) if isinstance(each, tuple) else each for each in numbers))


def taken(like: _Table, places: _Table, table: tuple[Any, ...], before: tuple[Any, ...]) -> _Table:
    """Return a table with the numbers that stand at some places, as `numbered` has them, in another.

    Args:
        like: Such a table, of the same places in ``before``: what both have in common stays.
        places: The places.
        table: The other one.
        before: The one before.
    """
    found = []
    for own, at, new, old in zip(like, places, table, before, strict=True):
        if new is old:
            found.append(own)
        elif isinstance(own, tuple):
            found.append(taken(own, at, new, old))
        else:
            found.append(new.ravel()[at.astype(np.int64)] if _is_of_numbers(own) else own)
    return type(like)(*found)


def _is_of_numbers(value: object) -> bool:
    return isinstance(value, np.ndarray) and value.dtype == float


def _copied(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.copy()
    return copied(value) if isinstance(value, tuple) else value


def _address(array: Any) -> int:
    """Return the address of an array's numbers."""
    if not array.size:
        # Nobody looks there.
        return 0
    if array.flags.writeable:
        # Sooner than NumPy says it itself.
        return ctypes.addressof(ctypes.c_char.from_buffer(array))
    return int(array.ctypes.data)


def _write(table: tuple[Any, ...], kind: StructType[Any], words: list[int]) -> None:
    for value, own in zip(table, kind.kinds.values(), strict=True):
        if isinstance(own, Numbers):
            fitting = isinstance(value, np.ndarray) and value.ndim == own.dimensions and value.flags.c_contiguous
            if not fitting or value.dtype != _DTYPES[own.dtype]:
                raise TypeError(f"{value!r} cannot be packed as {own}")
            words += (_address(value), *value.shape)
        elif isinstance(own, StructType):
            _write(value, own, words)
        elif isinstance(value, bool | int) and own in (int, bool):
            words.append(int(value))
        elif isinstance(value, float) and own is float:
            words.append(int(np.float64(value).view(np.int64)))
        else:
            raise TypeError(f"{value!r} cannot be packed as {own}")
