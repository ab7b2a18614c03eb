"""Shapes compiled: the functions of spans and gaps, called through their addresses as laws are."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from types import FunctionType
from typing import Any

from finger_pin.core.evaluation.law_code import inlined
from finger_pin.core.jit import Pointer, address_of
from finger_pin.mechanism.path_elements import PathShape

# Numbers that a shape gives, and their derivatives, at most.
OUT, SLOPES = 16, 80

# Filled in for every shape.
_shape: Any = None


def shape_addresses(shape: PathShape) -> tuple[int, int]:
    """Return the addresses of a shape's value and slopes, compiled; they live as long as the process."""
    return _address(shape.value), _address(shape.slopes)


def _fill(y: Pointer, p: Pointer, out: Pointer) -> None:
    _shape(y, p, out)


@cache
def _address(function: Callable[..., Any]) -> int:
    world = {**globals(), "_shape": inlined(function)}
    twin = FunctionType(_fill.__code__, world, _fill.__name__)
    return address_of("void(CPointer(float64), CPointer(float64), CPointer(float64))", twin)
