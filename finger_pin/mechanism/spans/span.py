"""Spans: the piece of a tendon's path between two points, and its slopes by their motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar


@dataclass(frozen=True)
class Span:
    """A piece of a path between two points that bodies carry, seen from its own frame, which a third body carries.

    Its functions take plain numbers, allocate nothing, and are run by Python and by the compiler.

    Attributes:
        name: For messages.
        parameters: Names of its numbers; ``p`` holds them in this order.
        value: (y, p, out) -> None; y are 6 numbers, the two points in the span's frame, m. Into out go the length, m,
            the angle by which the path turns along the wrap, rad, and 6 numbers pull = d length / d y.
        slopes: (y, p, out) -> None; into out go 6 numbers d turn / d y, 1/m, and 36 numbers d pull / d y, 1/m, row by
            row.
    """

    name: str
    parameters: tuple[str, ...]
    value: Callable[[Any, Any, Any], None]
    slopes: Callable[[Any, Any, Any], None]
    columns: ClassVar[int] = 1


#: Numbers of a wrap: its radius, m; the side point, m; whether there is one; whether the path passes inside.
WRAP = ("radius", "side_x", "side_y", "side_z", "has_side", "inside")
