"""Arguments handed to compiled code once: unpacking some eighty arrays costs as much as a small step does.

`pack` writes a table of arrays into one `Block` of machine words, from which `unpack` reads at no cost at every
later call.
"""

from __future__ import annotations

import ctypes
from typing import Any, NoReturn, TypeVar, get_type_hints

import numpy as np

from finger_pin.core.jit.functions import CompiledFunction
from finger_pin.core.jit.struct_types import Numbers, StructType

_Table = TypeVar("_Table", bound=tuple[Any, ...])
_DTYPES = {name: np.dtype(name) for name in ("float64", "int64")}


def refuse_copy(holder: object) -> NoReturn:
    """Refuse to copy or pickle an object that holds addresses.

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
    """Return a table with copied arrays."""
    return type(table)(*map(_copied, table))


def overwrite(table: tuple[Any, ...], others: tuple[Any, ...]) -> bool:
    """Fill a table's arrays with those of another; return False, unchanged, if these have other sizes or numbers."""
    pairs = list(zip(_entries(table), _entries(others), strict=True))
    for entry, other in pairs:
        if entry.shape != other.shape if isinstance(entry, np.ndarray) else entry != other:
            return False
    for entry, other in pairs:
        if isinstance(entry, np.ndarray):
            entry[...] = other
    return True


def _entries(table: tuple[Any, ...]) -> list[Any]:
    entries: list[Any] = []
    for entry in table:
        if isinstance(entry, tuple):
            entries += _entries(entry)
        else:
            entries.append(entry)
    return entries


def empty_table(table: type[_Table]) -> _Table:
    """Return a table whose arrays are empty, and whose numbers are zero."""
    fields = []
    for hint in get_type_hints(table, include_extras=True).values():
        kind = getattr(hint, "__metadata__", (hint,))[0]
        shape = (0,) * getattr(kind, "dimensions", 0)
        fields.append(
            empty_table(hint) if hasattr(hint, "_fields") else np.zeros(shape, kind.dtype) if shape else kind()
        )
    return table(*fields)


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
    for value, field_kind in zip(table, kind.kinds.values(), strict=True):
        if isinstance(field_kind, Numbers):
            fitting = isinstance(value, np.ndarray) and value.ndim == field_kind.dimensions and value.flags.c_contiguous
            if not fitting or value.dtype != _DTYPES[field_kind.dtype]:
                raise TypeError(f"{value!r} cannot be packed as {field_kind}")
            words += (_address(value), *value.shape)
        elif isinstance(field_kind, StructType):
            _write(value, field_kind, words)
        elif isinstance(value, bool | int) and field_kind in (int, bool):
            words.append(int(value))
        elif isinstance(value, float) and field_kind is float:
            words.append(int(np.float64(value).view(np.int64)))
        else:
            raise TypeError(f"{value!r} cannot be packed as {field_kind}")
