"""A mechanism with its inputs and its memory, bound once: what compiled code calls with one address.

Each of these is compiled as a unit of its own: the time that compilation takes grows faster than the size of what is
inlined into one function.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from finger_pin.core import condensation, dynamics, linearisation
from finger_pin.core.binding import get, kind_of, put
from finger_pin.core.compilation import compiled_apart, entry
from finger_pin.core.inputs import Control
from finger_pin.core.linearisation import Linear
from finger_pin.core.tables import Tables, Work


class Model(NamedTuple):
    """Everything that an evaluation and its linearisation work on."""

    tables: Tables
    control: Control
    work: Work
    linear: Linear


MODEL = kind_of(Model)


@entry
def bind(model: Any, block: Any) -> None:
    """Write into a block, made by `block_for(MODEL)`, where all of a model lies."""
    put(block, model, MODEL)


@compiled_apart
def evaluate(block: Any, time: float, x: Any, rate: Any) -> None:
    """Fill the rate of the packed state; see `dynamics`."""
    model = get(block, MODEL)
    dynamics.evaluate(model.tables, model.control, time, x, model.work, rate)


@compiled_apart
def linearise(block: Any, time: float, x: Any) -> None:
    """Fill all partial derivatives after `evaluate`; see `linearisation`."""
    model = get(block, MODEL)
    linearisation.linearise(model.tables, model.control, time, x, model.work, model.linear)


@compiled_apart
def condense(block: Any, g: float) -> bool:
    """Fill the solution of (g - J) u = r after `linearise`; see `condensation`."""
    model = get(block, MODEL)
    return bool(condensation.condense(model.tables, model.control, g, model.work, model.linear))
