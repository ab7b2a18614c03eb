"""Arguments handed to compiled code once: unpacking some eighty arrays costs as much as a small step does.

Compiled code sees an array as a few machine words: its address, its sizes, its strides. `bound` writes those of a whole
table of arrays into one block, from which `get` reads them back at no cost at every later call.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, get_type_hints

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.imputils import lower_getattr_generic
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import intrinsic, models, register_model
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


def bound(table: Any, kind: Any) -> NDArray[np.uint8]:
    """Return a block that holds a table for `get`; its arrays must be kept alive as long as the block.

    Raises:
        TypeError: If the table is not of the type that `get` will read: another layout would be misread.
    """
    words: list[int] = []
    _write(table, kind, words)
    return np.array(words, dtype=np.int64).view(np.uint8)


def _write(value: Any, kind: Any, words: list[int]) -> None:
    if isinstance(kind, types.NamedTuple):
        for part, own in zip(value, kind, strict=True):
            _write(part, own, words)
    elif isinstance(kind, types.Array):
        fitting = isinstance(value, np.ndarray) and value.ndim == kind.ndim and value.flags.c_contiguous
        if not fitting or value.dtype != np.dtype(str(kind.dtype)):
            raise TypeError(f"{value!r} cannot be bound as {kind}")
        # The words of an array: owner, parent, number of items, size of an item, address, sizes, strides.
        words += (0, 0, value.size, value.itemsize, value.ctypes.data, *value.shape, *value.strides)
    elif isinstance(value, bool | int) and kind in (types.int64, types.boolean):
        words.append(int(value))
    elif isinstance(value, float) and kind == types.float64:
        words.append(int(np.float64(value).view(np.int64)))
    else:
        raise TypeError(f"{value!r} cannot be bound as {kind}")


def _words(kind: Any) -> int:
    if isinstance(kind, types.Array):
        return 5 + 2 * int(kind.ndim)
    return sum(_words(part) for part in kind) if isinstance(kind, types.NamedTuple) else 1


class Bound(types.Type):
    """Where a table that `bound` has written lies: a pointer whose attributes are the fields of the table.

    Passing a pointer instead of some hundred numbers is what compiling quickly depends on.
    """

    def __init__(self, kind: Any) -> None:
        """Point to a table of a type."""
        self.kind = kind
        super().__init__(name=f"Bound[{kind.instance_class.__name__}]")  # type: ignore[no-untyped-call]


@register_model(Bound)
class _BoundModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, ir.IntType(8).as_pointer())  # type: ignore[no-untyped-call]


@infer_getattr
class _BoundFields(AttributeTemplate):
    key = Bound

    def generic_resolve(self, bound: Any, name: str) -> Any:  # type: ignore[override]
        if name not in bound.kind.fields:
            return None
        kind = bound.kind[bound.kind.fields.index(name)]
        return Bound(kind) if isinstance(kind, types.NamedTuple) else kind


@lower_getattr_generic(Bound)
def _field(context: Any, builder: Any, bound: Any, value: Any, name: str) -> Any:
    """Load a field; that it never changes lets the optimiser load it once, whatever is stored meanwhile."""
    index = bound.kind.fields.index(name)
    kind, place = bound.kind[index], _WORD * sum(map(_words, bound.kind.types[:index]))

    def at(offset: int) -> Any:
        return builder.gep(value, [ir.Constant(ir.IntType(64), offset)])

    def load(offset: int, to: Any) -> Any:
        loaded = builder.load(builder.bitcast(at(offset), to.as_pointer()))
        loaded.set_metadata("invariant.load", builder.module.add_metadata([]))
        return loaded

    if isinstance(kind, types.NamedTuple):
        return at(place)
    if not isinstance(kind, types.Array):
        return load(place, context.get_value_type(kind))
    array, number = context.make_array(kind)(context, builder), ir.IntType(64)
    # The words of an array: owner, parent, number of items, size of an item, address, sizes, strides.
    array.meminfo = cgutils.get_null_value(array.meminfo.type)
    array.parent = cgutils.get_null_value(array.parent.type)
    array.nitems, array.itemsize = load(place + 2 * _WORD, number), load(place + 3 * _WORD, number)
    array.data = load(place + 4 * _WORD, array.data.type)
    words = [load(place + (5 + word) * _WORD, number) for word in range(2 * kind.ndim)]
    array.shape = cgutils.pack_array(builder, words[: kind.ndim], number)
    array.strides = cgutils.pack_array(builder, words[kind.ndim :], number)
    return array._getvalue()


@_built_in
def get(_typing: Any, block: Any, kind: Any) -> Any:
    """Return the table in a block that `bound` has filled; its attributes are read where they are used."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return context.make_array(signature.args[0])(context, builder, arguments[0]).data

    return Bound(kind.instance_type)(block, kind), generate


@_built_in
def bound_at(_typing: Any, address: Any, kind: Any) -> Any:
    """Return the table at the address of a block that `bound` has filled."""
    target = Bound(kind.instance_type)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], context.get_value_type(target))

    return target(types.int64, kind), generate


@_built_in
def call_at(_typing: Any, function: Any, address: Any, number: Any) -> Any:
    """Call the function at an address with the address of a block and a number; return an integer."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        integer = ir.IntType(64)
        kind = ir.FunctionType(integer, [integer, ir.DoubleType()])
        return builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), arguments[1:])

    return types.int64(types.int64, types.int64, types.float64), generate
