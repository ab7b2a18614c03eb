"""Shapes compiled: the functions of spans and gaps, called through their addresses as laws are."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from types import FunctionType
from typing import Any, NamedTuple

from finger_pin.core.jit import Pointer, address_of, inlined

# Numbers that a shape gives, and their derivatives, at most.
OUT, SLOPES = 16, 80


class SpanColumns(NamedTuple):
    """First columns of a span's numbers: length, turn, and the directions of the forces on both bodies."""

    length: int
    turn: int
    first_force: int
    second_force: int


class GapColumns(NamedTuple):
    """First columns of a gap's numbers: the gap, which stands where a span's length does, normal, point, tangents."""

    gap: int
    normal: int
    point: int
    tangents: int


SPAN_OUT, GAP_OUT = SpanColumns(0, 1, 2, 5), GapColumns(0, 1, 4, 7)

# Filled in for every shape.
_shape: Any = None


def _fill(y: Pointer, p: Pointer, out: Pointer) -> None:
    _shape(y, p, out)


@cache
def shape_address(function: Callable[..., Any]) -> int:
    """Return the address of a shape's value or slopes, compiled; it lives as long as the process."""
    world = {**globals(), "_shape": inlined(function)}
    twin = FunctionType(_fill.__code__, world, _fill.__name__)
    return address_of("void(CPointer(float64), CPointer(float64), CPointer(float64))", twin)
