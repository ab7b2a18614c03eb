"""Struct types of tables: records of machine words with the fields of a NamedTuple.

To compiled code a table is a pointer, whose attributes are its fields: passing a pointer instead of some hundred
numbers is what compiling quickly depends on. `numba.extending.overload_attribute` would do as well, but compiles a
function for each field of each table, by which the core takes half as long again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Annotated, Any, Generic, NamedTuple, Protocol, TypeVar, get_type_hints

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic, lower_getattr_generic, models, register_model
from numpy.typing import NDArray

from finger_pin.typing import Array

#: Bytes of a machine word.
WORD = 8


class Numbers(NamedTuple):
    """An array's numbers and dimensions; it is contiguous."""

    dtype: str
    dimensions: int


Vector = Annotated[Array, Numbers("float64", 1)]
Matrix = Annotated[Array, Numbers("float64", 2)]
Layers = Annotated[Array, Numbers("float64", 3)]
IndexTable = Annotated[NDArray[np.int64], Numbers("int64", 2)]
Indices = Annotated[NDArray[np.int64], Numbers("int64", 1)]

_Table = TypeVar("_Table", bound=tuple[Any, ...])

_SCALARS = {int: types.int64, float: types.float64, bool: types.boolean}
# Callers see another signature than numba's.
_generated: Any = intrinsic


class StructType(types.Record, Generic[_Table]):  # type: ignore[misc]
    """The type of a table: a NamedTuple whose fields are arrays of the types above, numbers, or such tables.

    Attributes:
        kinds: By name, the types of fields: of numbers ``int``, ``float`` or ``bool``.
    """

    def __init__(self, table: type[_Table]) -> None:
        """Read the annotations. An array takes the words of its address and of its sizes, every number one word."""
        self.kinds: dict[str, Any] = {}
        fields: list[Any] = []
        words = 0
        for name, hint in get_type_hints(table, include_extras=True).items():
            kind = StructType(hint) if hasattr(hint, "_fields") else hint
            if not (kind in _SCALARS or isinstance(kind, StructType)):
                kind = hint.__metadata__[0]
            self.kinds[name] = kind
            fields.append(
                (name, {"type": kind if isinstance(kind, StructType) else types.int64, "offset": WORD * words})
            )
            words += kind.size // WORD if isinstance(kind, StructType) else 1 + getattr(kind, "dimensions", 0)
        super().__init__(fields, size=WORD * words, aligned=True)
        # Tables of the same layout stay apart.
        self.name = f"{table.__module__}.{table.__qualname__}"

    def typeof(self, key: str) -> types.Type:
        """Return the type that compiled code sees in a field."""
        kind = self.kinds[key]
        if isinstance(kind, Numbers):
            return types.Array(getattr(types, kind.dtype), kind.dimensions, "C")
        return _SCALARS.get(kind, kind)

    def can_convert_to(self, typingctx: Any, other: types.Type) -> None:
        """Convert to no other table, though its first fields may be the same."""


register_model(StructType)(models.OpaqueModel)


@lower_getattr_generic(StructType)  # type: ignore[untyped-decorator]
def _field(context: Any, builder: ir.IRBuilder, table: StructType[Any], value: ir.Value, name: str) -> ir.Value:
    """Load a field marked as constant, so that the optimiser loads it once."""
    kind, place, numba_type = table.kinds[name], table.offset(name), table.typeof(name)
    integer = context.get_value_type(types.int64)

    def at(offset: int) -> ir.Value:
        return builder.gep(value, [integer(offset)])

    def load(offset: int, to: ir.Type) -> ir.Value:
        loaded = builder.load(builder.bitcast(at(offset), to.as_pointer()))
        loaded.set_metadata("invariant.load", builder.module.add_metadata([]))
        return loaded

    if isinstance(kind, StructType):
        return at(place)
    if not isinstance(kind, Numbers):
        return load(place, context.get_value_type(numba_type))
    array = context.make_array(numba_type)(context, builder)
    count, shape, strides = integer(1), array.shape, array.strides
    for axis in reversed(range(kind.dimensions)):
        size = load(place + WORD * (1 + axis), integer)
        strides = builder.insert_value(strides, builder.mul(count, integer(WORD)), axis)
        shape = builder.insert_value(shape, size, axis)
        count = builder.mul(count, size)
    array.data, array.shape, array.strides = load(place, array.data.type), shape, strides
    array.nitems, array.itemsize = count, array.itemsize.type(WORD)
    # Whoever has bound the array owns it: nothing is counted.
    array.meminfo, array.parent = array.meminfo.type(None), array.parent.type(None)
    return array._getvalue()


class _Unpack(Protocol):
    def __call__(self, address: int, kind: StructType[_Table], /) -> _Table: ...


@_generated
def _unpack(_typing: Any, address: types.Type, kind: Any) -> tuple[Any, Callable[..., ir.Value]]:
    def generate(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Sequence[ir.Value]) -> ir.Value:
        return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))

    return kind.instance_type(types.int64, kind), generate


#: Return the table at the address of a block that `pack` has filled.
unpack: _Unpack = _unpack
