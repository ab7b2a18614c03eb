"""The parts that rest on numba's inside; `pyproject.toml` caps numba to the versions that this was tried with.

What it saves of the processor time of compiling the core, measured in turns on one machine, and what would replace it:

- `_Fields` and `_field` give the fields of a table to compiled code. `numba.extending.overload_attribute` with
  `numba.carray` does the same and takes a fourth more: it compiles a function for each field of each table.
- `INTERNAL` leaves out the wrappers through which Python would call a function: a twentieth. All else is the same.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, lower_getattr_generic

from finger_pin.core.jit.kinds import WORD, Kind, Numbers

#: An option of functions that nobody calls from Python.
INTERNAL = {"no_cpython_wrapper": True}
_SCALARS = {int: types.int64, float: types.float64, bool: types.boolean}
_INTEGER = ir.IntType(64)


def _array(kind: Numbers) -> Any:
    return types.Array(getattr(types, kind.dtype), kind.dimensions, "C")


@infer_getattr  # type: ignore[untyped-decorator]
class _Fields(AttributeTemplate):  # type: ignore[misc]
    key = Kind

    def generic_resolve(self, table: Any, name: str) -> Any:  # type: ignore[override]
        """Return the type of a field, None for a name that is none."""
        kind: Any = table.fields.get(name)
        return _array(kind) if isinstance(kind, Numbers) else _SCALARS.get(kind, kind)


@lower_getattr_generic(Kind)  # type: ignore[untyped-decorator]
def _field(context: Any, builder: Any, table: Kind, value: Any, name: str) -> Any:
    """Load a field, marked as constant, so that the optimiser loads it once, whatever is stored meanwhile."""
    kind, place = table.fields[name], table.places[name]

    def at(offset: int) -> Any:
        return builder.gep(value, [ir.Constant(_INTEGER, offset)])

    def load(offset: int, to: Any) -> Any:
        loaded = builder.load(builder.bitcast(at(offset), to.as_pointer()))
        loaded.set_metadata("invariant.load", builder.module.add_metadata([]))
        return loaded

    if isinstance(kind, Kind):
        return at(place)
    if not isinstance(kind, Numbers):
        return load(place, context.get_value_type(_SCALARS[kind]))
    array = context.make_array(_array(kind))(context, builder)
    count = ir.Constant(_INTEGER, 1)
    shape = strides = ir.Constant(ir.ArrayType(_INTEGER, kind.dimensions), ir.Undefined)
    for axis in reversed(range(kind.dimensions)):
        size = load(place + WORD * (1 + axis), _INTEGER)
        strides = builder.insert_value(strides, builder.mul(count, ir.Constant(_INTEGER, WORD)), axis)
        shape = builder.insert_value(shape, size, axis)
        count = builder.mul(count, size)
    array.data, array.shape, array.strides = load(place, array.data.type), shape, strides
    array.nitems, array.itemsize = count, ir.Constant(array.itemsize.type, WORD)
    # Whoever has bound the array owns it: nothing is counted.
    array.meminfo, array.parent = ir.Constant(array.meminfo.type, None), ir.Constant(array.parent.type, None)
    return array._getvalue()
