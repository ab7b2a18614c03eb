"""A mechanism with its inputs and its memory, bound once, and the functions that step it.

Each function is compiled once, as a unit that is called through its address: what is linked into a caller would be
optimised again there.
"""

from __future__ import annotations

from typing import NamedTuple, NoReturn

import numpy as np

from finger_pin.core.buffers import Work, take_numbers
from finger_pin.core.control import Control
from finger_pin.core.evaluation import blocks, condensation, contacts, dynamics, linearisation, path_derivatives, paths
from finger_pin.core.evaluation.inputs import move_base
from finger_pin.core.evaluation.linearisation import Linear, build_linear
from finger_pin.core.evaluation.rigid_body import base_power, bias_rate, move
from finger_pin.core.jit import Kind, Unit, Vector, bound, bound_at, refill
from finger_pin.core.tables import Tables


class Model(NamedTuple):
    """The tables, inputs and memory of an evaluation and its linearisation.

    Attributes:
        tables: The mechanism.
        control: Its inputs.
        work: Memory of an evaluation.
        linear: Memory of a linearisation.
        state: State of the evaluation, shape (size,).
        rate: Its rate, shape (size,).
        evaluate: Address of the function that fills ``rate``, at a time.
        exert: Address of what it calls for the rows.
        linearise: Address of the function that fills all partial derivatives after it, at a time.
        condense: Address of the function that fills the solution of (g - J) u = r for a g; 0 where it is singular.
        measure: Address of what `exert` calls for paths through space and contacts; 0 without, as for the next four.
        turn: Address of what `linearise` calls for them.
        touch: Address of what `condense` calls for contacts.
        press: Address of what it calls for the pin of a row that their forces may pass.
        look: Address of what places the bodies and measures a piece; 0 if it is out of reach.
        carry: Address of what `evaluate` calls for a base that moves; 0 at rest, as for the next two.
        sway: Address of what `linearise` calls for it.
        power: Address of what fills the power that it supplies.
    """

    tables: Tables
    control: Control
    work: Work
    linear: Linear
    state: Vector
    rate: Vector
    evaluate: int
    exert: int
    linearise: int
    condense: int
    measure: int
    turn: int
    touch: int
    press: int
    look: int
    carry: int
    sway: int
    power: int


MODEL = Kind(Model)


class BoundModel:
    """A model and its address.

    Attributes:
        model: Its arrays, which live as long as this.
        address: Of what `bound_at` reads.
    """

    def __init__(self, tables: Tables, control: Control, work: Work, moved: bool = False) -> None:
        """Bind; arrays are taken as they are, not copied. The base may be ``moved`` by others than its control."""
        size = 2 * len(work.torque) + int(tables.state.max(initial=-1)) + 1
        moved = moved or len(control.palm.harmonics) > 0
        through_space = len(tables.paths.columns) > 0
        units = [unit.address for unit in (_evaluate, _exert, _linearise, _condense)]
        # Compiled only for mechanisms that need them: paths through space or contacts, and a base that moves.
        units += [unit.address if through_space else 0 for unit in (_measure, _turn, _touch, _press, _look)]
        units += [unit.address if moved else 0 for unit in (_carry, _sway, _power)]
        self.model = Model(tables, control, work, build_linear(tables, control), np.zeros(size), np.zeros(size), *units)
        self._block = bound(self.model, MODEL)
        # Of tables what changes in place is copied wherever it is handed over.
        self._filled: Tables | None = None
        self.address = int(self._block.ctypes.data)

    def renew(self, tables: Tables, control: Control) -> None:
        """Take the numbers of other tables and another control, which fit, into the arrays that are bound."""
        own = self.model
        refill(own.tables, tables, self._filled)
        refill(own.control, control)
        self._filled = tables
        take_numbers(own.work, tables)
        linearisation.take_numbers(own.linear, tables)

    def __reduce__(self) -> NoReturn:
        """Refuse to be copied or pickled: a copy's address would be that of this one.

        Raises:
            TypeError: Always.
        """
        raise TypeError("a bound model holds addresses: what owns it is copied, and binds another")


@Unit
def _evaluate(address: int, time: float) -> int:
    model = bound_at(address, MODEL)
    dynamics.evaluate(model, address, time)
    return 1


@Unit
def _exert(address: int, time: float) -> int:
    model = bound_at(address, MODEL)
    dynamics.exert(model, address, time)
    return 1


@Unit
def _linearise(address: int, time: float) -> int:
    model = bound_at(address, MODEL)
    linearisation.linearise(model, address, time)
    return 1


@Unit
def _condense(address: int, g: float) -> int:
    model = bound_at(address, MODEL)
    return 1 if condensation.condense(model, address, g) else 0


@Unit
def _measure(address: int, _time: float) -> int:
    model = bound_at(address, MODEL)
    tables, work, width = model.tables, model.work, model.work.torque.size
    paths.measure_paths(tables, work)
    if tables.touching:
        contacts.exert_contacts(tables, model.state[width : 2 * width], model.state[2 * width :], work)
    return 1


@Unit
def _turn(address: int, _time: float) -> int:
    model = bound_at(address, MODEL)
    tables, work, width = model.tables, model.work, model.work.torque.size
    path_derivatives.linearise_paths(tables, model.state[width : 2 * width], work, model.linear)
    if tables.touching:
        blocks.partition(tables, work, model.linear.blocks, model.linear.gain)
    return 1


@Unit
def _touch(address: int, g: float) -> int:
    model = bound_at(address, MODEL)
    contacts.block_contact_gains(model.tables, g, model.work, model.linear)
    return 1


@Unit
def _press(address: int, row: float) -> int:
    model = bound_at(address, MODEL)
    contacts.add_pushes(model.tables, model.work, int(row), model.linear)
    return 1


@Unit
def _look(address: int, piece: float) -> int:
    model = bound_at(address, MODEL)
    tables, work, width = model.tables, model.work, model.work.torque.size
    move(tables, model.state[:width], model.state[width : 2 * width], work)
    return 1 if paths.look(tables.paths, int(piece), work) else 0


@Unit
def _carry(address: int, time: float) -> int:
    model = bound_at(address, MODEL)
    move_base(model.control, time, model.tables, model.work)
    return 1


@Unit
def _sway(address: int, _time: float) -> int:
    model = bound_at(address, MODEL)
    width = model.work.torque.size
    bias_rate(model.tables, model.state[width : 2 * width], model.work, model.linear.bias_rate)
    return 1


@Unit
def _power(address: int, _time: float) -> int:
    model = bound_at(address, MODEL)
    width = model.work.torque.size
    model.work.base_power[0] = base_power(model.tables, model.state[width : 2 * width], model.work)
    return 1
