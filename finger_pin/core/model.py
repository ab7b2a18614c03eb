"""A mechanism with its inputs and its memory, bound once, and the three functions that step it.

Each function is compiled once, as a unit that is called through its address: what is linked into a caller would be
optimised again there.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numba import types

from finger_pin.core import condensation, dynamics, linearisation
from finger_pin.core.binding import Vector, block_for, bound_at, kind_of, put
from finger_pin.core.compilation import address_of, entry
from finger_pin.core.inputs import Control
from finger_pin.core.linearisation import Linear, build_linear
from finger_pin.core.tables import Tables, Work


class Model(NamedTuple):
    """Everything that an evaluation and its linearisation work on.

    Attributes:
        tables: The mechanism.
        control: Its inputs.
        work: Memory of an evaluation.
        linear: Memory of a linearisation.
        state: Where it is evaluated, shape (size,).
        rate: What comes out, shape (size,).
        evaluate: Address of the function that fills ``rate``, at a time.
        linearise: Address of the function that fills all partial derivatives after it, at a time.
        condense: Address of the function that fills the solution of (g - J) u = r for a g; 0 where it is singular.
    """

    tables: Tables
    control: Control
    work: Work
    linear: Linear
    state: Vector
    rate: Vector
    evaluate: int
    linearise: int
    condense: int


MODEL = kind_of(Model)


class BoundModel:
    """A model, and where it lies.

    Attributes:
        model: Its arrays, which live as long as this.
        address: Of what `bound_at` reads.
    """

    def __init__(self, tables: Tables, control: Control, work: Work) -> None:
        """Bind; arrays are taken as they are, not copied."""
        size = 2 * len(work.torque) + int(tables.state.max(initial=-1)) + 1
        self.model = Model(tables, control, work, build_linear(tables), np.zeros(size), np.zeros(size), *_units())
        self._block = block_for(MODEL)
        bind(self.model, self._block)
        self.address = int(self._block.ctypes.data)


@entry
def bind(model: Any, block: Any) -> None:
    """Write into a block, made by `block_for(MODEL)`, where all of a model lies."""
    put(block, model, MODEL)


@cache
def _units() -> tuple[int, int, int]:
    kind = types.int64(types.int64, types.float64)
    evaluate, linearise, condense = (address_of(kind, each, kept=True) for each in (_evaluate, _linearise, _condense))
    return evaluate, linearise, condense


def _evaluate(address: int, time: float) -> int:
    model = bound_at(address, MODEL)
    dynamics.evaluate(model.tables, model.control, time, model.state, model.work, model.rate)
    return 1


def _linearise(address: int, time: float) -> int:
    model = bound_at(address, MODEL)
    linearisation.linearise(model.tables, model.control, time, model.state, model.work, model.linear)
    return 1


def _condense(address: int, g: float) -> int:
    model = bound_at(address, MODEL)
    return 1 if condensation.condense(model.tables, model.control, g, model.work, model.linear) else 0
