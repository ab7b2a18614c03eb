"""Shapes compiled: the functions of spans and gaps, called through their addresses as laws are."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from types import FunctionType
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic as _numba_intrinsic

from finger_pin.core.compilation import address_of
from finger_pin.core.law_code import inlined
from finger_pin.mechanism.pieces import Shape

# Numbers that a shape gives, and their derivatives, at most.
OUT, SLOPES = 16, 80

_intrinsic: Callable[[Callable[..., Any]], Callable[..., Any]] = _numba_intrinsic

# Filled in for every shape.
_shape: Any = None


def shape_addresses(shape: Shape) -> tuple[int, int]:
    """Return where a shape's value and slopes are, compiled; they live as long as the process."""
    return _address(shape.value), _address(shape.slopes)


def _fill(y: Any, p: Any, out: Any) -> None:
    _shape(y, p, out)


@cache
def _address(function: Callable[..., Any]) -> int:
    world = {**globals(), "_shape": inlined(function)}
    twin = FunctionType(_fill.__code__, world, _fill.__name__)
    # Numba names what it keeps on disk after this.
    twin.__qualname__ = f"_fill[{function.__module__}.{function.__qualname__}]"
    pointer = types.CPointer(types.float64)  # type: ignore[no-untyped-call]
    kept = function.__module__.startswith("finger_pin.mechanism.")
    return address_of(types.void(pointer, pointer, pointer), twin, kept=kept)


@_intrinsic
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
