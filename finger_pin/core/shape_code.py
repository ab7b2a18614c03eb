"""Shapes compiled: the functions of spans and gaps, called through their addresses as laws are."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from types import FunctionType
from typing import Any

from finger_pin.core.compilation import address_of, intrinsic
from finger_pin.core.law_code import inlined
from finger_pin.mechanism.pieces import Shape

# Numbers that a shape gives, and their derivatives, at most.
OUT, SLOPES = 16, 80

#: Called by compiled code: the function of a shape at an address with three rows of numbers.
call_shape = intrinsic("call_shape")

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
    # What is kept on disk is named after this.
    twin.__qualname__ = f"_fill[{function.__module__}.{function.__qualname__}]"
    kept = function.__module__.startswith("finger_pin.mechanism.")
    return address_of("void(CPointer(float64), CPointer(float64), CPointer(float64))", twin, kept=kept)
