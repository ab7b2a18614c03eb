"""Arguments handed to compiled code once: unpacking some eighty arrays costs as much as a small step does.

Compiled code sees an array as a few machine words: its address, its sizes, its strides. `put` writes those of a whole
table of arrays into one block, from which `get` reads them back at no cost at every later call.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, get_type_hints

import numpy as np
from numba import errors, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from finger_pin.description.routing import Array

Vector = Annotated[Array, types.Array(types.float64, 1, "C")]
Matrix = Annotated[Array, types.Array(types.float64, 2, "C")]
Layers = Annotated[Array, types.Array(types.float64, 3, "C")]
Block = Annotated[NDArray[np.uint8], types.Array(types.uint8, 1, "C")]
IndexTable = Annotated[NDArray[np.int64], types.Array(types.int64, 2, "C")]
Indices = Annotated[NDArray[np.int64], types.Array(types.int64, 1, "C")]

# Typed as what it makes of a function: one that compiled code calls without the typing context.
_built_in: Callable[[Callable[..., Any]], Callable[..., Any]] = intrinsic

_SCALARS = {int: types.int64, float: types.float64, bool: types.boolean}
_WORD = 8


def kind_of(table: Any) -> Any:
    """Return numba's type of a NamedTuple whose fields are arrays of the kinds above, numbers, or such tables."""
    kinds = []
    for hint in get_type_hints(table, include_extras=True).values():
        if hasattr(hint, "_fields"):
            kinds.append(kind_of(hint))
        else:
            kinds.append(_SCALARS.get(hint) or hint.__metadata__[0])
    return types.NamedTuple(kinds, table)  # type: ignore[no-untyped-call]


def block_for(kind: Any) -> NDArray[np.uint8]:
    """Return an empty block that is large enough for what `put` writes of a value of a type."""
    return np.zeros(_WORD * _words(kind), dtype=np.uint8)


def _words(kind: Any) -> int:
    if isinstance(kind, types.Array):
        return 5 + 2 * int(kind.ndim)
    return sum(_words(part) for part in kind) if isinstance(kind, types.NamedTuple) else 1


def _pointer(context: Any, builder: Any, block: Any, value: Any, kind: Any) -> Any:
    data = context.make_array(block)(context, builder, value).data
    return builder.bitcast(data, context.get_value_type(kind).as_pointer())


@_built_in
def put(_typing: Any, block: Any, value: Any, kind: Any) -> Any:
    """Write a value into a block; whoever does must keep the value's arrays alive as long as the block.

    Raises:
        TypingError: If the value is not of the type that `get` will read: another layout would be misread.
    """
    if value != kind.instance_type:
        raise errors.TypingError(f"a value of type {value} cannot be bound as {kind.instance_type}")

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        builder.store(arguments[1], _pointer(context, builder, signature.args[0], arguments[0], value))
        return context.get_dummy_value()

    return types.void(block, value, kind), generate


@_built_in
def get(_typing: Any, block: Any, kind: Any) -> Any:
    """Read the value of a type from a block that `put` has filled."""
    target = kind.instance_type

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.load(_pointer(context, builder, signature.args[0], arguments[0], target))

    return target(block, kind), generate
