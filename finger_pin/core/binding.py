"""Arguments handed to compiled code once: unpacking some eighty arrays costs as much as a small step does.

Compiled code sees an array as a few machine words: its address, its sizes, its strides. `bound` writes those of a whole
table of arrays into one block, from which `bound_at` reads them back at no cost at every later call.
"""

from __future__ import annotations

import ctypes
from importlib import import_module
from typing import Annotated, Any, NamedTuple, get_type_hints

import numpy as np
from numpy.typing import NDArray

from finger_pin.core.compilation import Later, Unit, intrinsic
from finger_pin.description.routing import Array


class Numbers(NamedTuple):
    """An array's numbers and dimensions; it is contiguous."""

    dtype: str
    dimensions: int


_DTYPES = {name: np.dtype(name) for name in ("float64", "int64")}
Vector = Annotated[Array, Numbers("float64", 1)]
Matrix = Annotated[Array, Numbers("float64", 2)]
Layers = Annotated[Array, Numbers("float64", 3)]
IndexTable = Annotated[NDArray[np.int64], Numbers("int64", 2)]
Indices = Annotated[NDArray[np.int64], Numbers("int64", 1)]

#: Read by compiled code: the table at the address of a block that `bound` has filled.
bound_at = intrinsic("bound_at")
#: Called by compiled code: the function at an address with the address of a block and a number; an integer.
call_at = intrinsic("call_at")


class Kind(Later):
    """The kind of a table: a NamedTuple whose fields are arrays of the kinds above, numbers, or such tables.

    Attributes:
        table: The class.
        fields: By name, the kinds: of numbers ``int``, ``float`` or ``bool``.
    """

    def __init__(self, table: Any) -> None:
        """Read the annotations."""
        super().__init__(lambda: import_module("finger_pin.core.intrinsics").type_of(self))
        self.table = table
        self.fields: dict[str, Any] = {}
        for name, hint in get_type_hints(table, include_extras=True).items():
            own = Kind(hint) if hasattr(hint, "_fields") else hint
            self.fields[name] = own if own in (int, float, bool) or isinstance(own, Kind) else hint.__metadata__[0]


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


def _address(array: NDArray[Any]) -> int:
    """Return where the numbers of an array lie."""
    if array.size and array.flags.writeable:
        # Sooner than NumPy says it itself.
        return ctypes.addressof(ctypes.c_char.from_buffer(array.data))
    return int(array.ctypes.data)


def _write(value: Any, kind: Any, words: list[int]) -> None:
    if isinstance(kind, Kind):
        for part, own in zip(value, kind.fields.values(), strict=True):
            _write(part, own, words)
    elif isinstance(kind, Numbers):
        fitting = isinstance(value, np.ndarray) and value.ndim == kind.dimensions and value.flags.c_contiguous
        if not fitting or value.dtype != _DTYPES[kind.dtype]:
            raise TypeError(f"{value!r} cannot be bound as {kind}")
        # The words of an array: number of items, size of an item, address, sizes, strides.
        words += (value.size, value.itemsize, _address(value), *value.shape, *value.strides)
    elif isinstance(value, bool | int) and kind in (int, bool):
        words.append(int(value))
    elif isinstance(value, float) and kind is float:
        words.append(int(np.float64(value).view(np.int64)))
    else:
        raise TypeError(f"{value!r} cannot be bound as {kind}")
