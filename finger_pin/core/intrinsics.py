"""What numba does not know by itself: tables behind an address, and calls of functions at an address."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.imputils import lower_getattr_generic
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import intrinsic, models, register_model

from finger_pin.core.binding import Kind, Numbers

_SCALARS = {int: types.int64, float: types.float64, bool: types.boolean}
_WORD = 8


def type_of(kind: Kind) -> Any:
    """Return numba's type of the tables of a kind."""
    fields = [
        own.made if isinstance(own, Kind)
        else types.Array(getattr(types, own.dtype), own.dimensions, "C") if isinstance(own, Numbers)
        else _SCALARS[own]
        for own in kind.fields.values()
    ]  # fmt: skip
    return types.NamedTuple(fields, kind.table)


def _words(kind: Any) -> int:
    if isinstance(kind, types.Array):
        return 3 + 2 * int(kind.ndim)
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
    # The words of an array: number of items, size of an item, address, sizes, strides.
    array.meminfo = cgutils.get_null_value(array.meminfo.type)
    array.parent = cgutils.get_null_value(array.parent.type)
    array.nitems, array.itemsize = load(place, number), load(place + _WORD, number)
    array.data = load(place + 2 * _WORD, array.data.type)
    words = [load(place + (3 + word) * _WORD, number) for word in range(2 * kind.ndim)]
    array.shape = cgutils.pack_array(builder, words[: kind.ndim], number)
    array.strides = cgutils.pack_array(builder, words[kind.ndim :], number)
    return array._getvalue()


@intrinsic
def bound_at(_typing: Any, address: Any, kind: Any) -> Any:
    """Return the table at the address of a block that `bound` has filled."""
    target = Bound(kind.instance_type)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], context.get_value_type(target))

    return target(types.int64, kind), generate


@intrinsic
def call_at(_typing: Any, function: Any, address: Any, number: Any) -> Any:
    """Call the function at an address with the address of a block and a number; return an integer."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        integer = ir.IntType(64)
        kind = ir.FunctionType(integer, [integer, ir.DoubleType()])
        return builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), arguments[1:])

    return types.int64(types.int64, types.int64, types.float64), generate


@intrinsic(prefer_literal=True)
def numbers(_typing: Any, table: Any, first: Any, stride: Any, count: Any) -> Any:
    """Return a tuple of numbers of a table, ``stride`` apart; their count is a constant."""
    size = count.literal_value

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        values, place = [], arguments[1]
        for _ in range(size):
            values.append(builder.load(builder.gep(arguments[0], [place])))
            place = builder.add(place, arguments[2])
        return context.make_tuple(builder, signature.return_type, values)

    tuple_of_numbers = types.UniTuple(types.float64, size)  # type: ignore[no-untyped-call]
    return tuple_of_numbers(table, types.int64, types.int64, count), generate


@intrinsic
def put(_typing: Any, table: Any, first: Any, stride: Any, values: Any) -> Any:
    """Write a tuple of numbers into a table, ``stride`` apart."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place = arguments[1]
        for index, kind in enumerate(values):
            value = context.cast(builder, builder.extract_value(arguments[3], index), kind, types.float64)
            builder.store(value, builder.gep(arguments[0], [place]))
            place = builder.add(place, arguments[2])
        return context.get_dummy_value()

    return types.void(table, types.int64, types.int64, values), generate


def _call(context: Any, builder: Any, signature: Any, arguments: Any, tables: int) -> Any:
    """Generate the call of an address with the data of some tables, their stride, and a range of rows."""
    number, pointer = ir.IntType(64), ir.DoubleType().as_pointer()
    arrays = [
        context.make_array(kind)(context, builder, value)
        for kind, value in zip(signature.args[1 : 1 + tables], arguments[1 : 1 + tables], strict=True)
    ]
    stride = builder.extract_value(arrays[0].shape, 1)
    called = ir.FunctionType(ir.VoidType(), [pointer] * tables + [number] * 3)
    function = builder.inttoptr(arguments[0], called.as_pointer())
    builder.call(function, [*(array.data for array in arrays), stride, *arguments[1 + tables :]])
    return context.get_dummy_value()


@intrinsic
def call_value(_typing: Any, address: Any, rows: Any, parameters: Any, begin: Any, end: Any) -> Any:
    """Evaluate the law at an address for a range of rows."""
    signature = types.void(types.int64, rows, parameters, types.int64, types.int64)
    return signature, lambda context, builder, sig, args: _call(context, builder, sig, args, 2)


@intrinsic
def call_filling(_typing: Any, address: Any, rows: Any, parameters: Any, filled: Any, begin: Any, end: Any) -> Any:
    """Fill slopes, or energies and powers, by the law at an address for a range of rows."""
    signature = types.void(types.int64, rows, parameters, filled, types.int64, types.int64)
    return signature, lambda context, builder, sig, args: _call(context, builder, sig, args, 3)


@intrinsic
def call_shape(_typing: Any, address: Any, y: Any, p: Any, out: Any) -> Any:
    """Call the function of a shape at an address with three rows of numbers."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        pointer = ir.DoubleType().as_pointer()
        data = [
            context.make_array(kind)(context, builder, value).data
            for kind, value in zip(signature.args[1:], arguments[1:], strict=True)
        ]
        function = ir.FunctionType(ir.VoidType(), [pointer] * 3).as_pointer()
        builder.call(builder.inttoptr(arguments[0], function), data)
        return context.get_dummy_value()

    return types.void(types.int64, y, p, out), generate
