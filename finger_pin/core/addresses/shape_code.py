"""Shapes compiled: the functions of spans and gaps, called through their addresses as laws are."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from types import FunctionType
from typing import Any

from finger_pin.core.jit import Pointer, address_of, inlined

# Filled in for every shape.
_shape: Any = None


def _fill(points: Pointer, p: Pointer, out: Pointer) -> None:
    _shape(points, p, out)


@cache
def shape_address(function: Callable[..., Any]) -> int:
    """Return the address of a shape's value or slopes, compiled; it lives as long as the process."""
    world = {**globals(), "_shape": inlined(function)}
    twin = FunctionType(_fill.__code__, world, _fill.__name__)
    return address_of("void(CPointer(float64), CPointer(float64), CPointer(float64))", twin)
