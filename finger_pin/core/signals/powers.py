"""Powers along the steps of an island, compiled: the account needs no accelerations, and nothing else of a state."""

from __future__ import annotations

from typing import NamedTuple

from finger_pin.core.collision.broad_phase import activate_all_pairs, activate_since, cull_distant
from finger_pin.core.evaluation.attitude_charts import place_bodies
from finger_pin.core.evaluation.input_values import inputs
from finger_pin.core.jit import (
    CompiledFunction,
    Indices,
    Matrix,
    StructType,
    Vector,
    call_at,
    njit_always_inline,
    njit_inline,
    unpack,
)
from finger_pin.core.signals.state_batches import exert_alone, fill_base_power, fill_energy_terms
from finger_pin.core.steps.interpolation import Interpolation, interpolate_within, step_at
from finger_pin.core.tables.buffers import Work
from finger_pin.core.tables.mechanism_parameters import Parameters
from finger_pin.core.tables.model import MODEL
from finger_pin.core.tables.structure import Structure


class Powers(NamedTuple):
    """The steps of an island, and their powers to be filled at the k times of their `Interpolation`.

    Attributes:
        model: Address of a bound `Model` with the island's inputs.
        steps: The steps, of which there must be one, with room for one state.
        columns: Of the state's numbers those that the steps have, the others are zero, shape (size of the steps,).
        energy_terms: Scratch, energies and powers of the rows, shape (energies,).
        powers: Filled with the powers, and that of the forces at the tips, shape (k, powers + 1).
    """

    model: int
    steps: Interpolation
    columns: Indices
    energy_terms: Vector
    powers: Matrix


POWERS = StructType(Powers)


@njit_inline
def _attitude(steps: Interpolation, step: int) -> Matrix:
    """Return the reference quaternions of a step, from which angles are measured."""
    return steps.attitude if step == 0 else steps.attitudes[step - 1]


@njit_always_inline
def _fill_powers(
    structure: Structure, parameters: Parameters, work: Work, state: Vector, energy_terms: Vector, out: Vector
) -> None:
    """Fill the powers of the rows and of the forces at the tips."""
    count, width = out.size - 1, work.torque.size
    for i in range(count):
        out[i] = energy_terms[energy_terms.size - count + i]
    out[count] = 0.0
    if parameters.has_tip_force:
        for j in range(structure.parents.size):
            out[count] += work.external[j] * state[width + j]


@CompiledFunction
def power_many(address: int, _time: float) -> int:
    """Fill the `Powers` at an address."""
    powers = unpack(address, POWERS)
    steps, model = powers.steps, unpack(powers.model, MODEL)
    structure, parameters, work, state = model.structure, model.parameters, model.work, model.state
    width, step, last = work.torque.size, -1, -1
    moving = model.base_power != 0 or work.guide.size > 0
    activate_all_pairs(structure, work)
    for c in range(state.size):
        state[c] = 0.0
    for k in range(steps.times.size):
        time, last = steps.times[k], step
        step = step_at(steps, time, step)
        interpolate_within(steps, step, time, steps.interpolated[0])
        for c in range(powers.columns.size):
            state[powers.columns[c]] = steps.interpolated[0, c]
        if step != last:
            place_bodies(structure, parameters, _attitude(steps, step))
        if moving:
            call_at(model.evaluate, powers.model, time)
        else:
            # Contacts far apart are culled from state to state; what is left in ``rate`` is the state before.
            if structure.contact_rows > 0 and k > 0:
                before, now = _attitude(steps, last), _attitude(steps, step)
                activate_since(structure, parameters, work, before, now, model.rate, state)
            inputs(model.control, time, state[:width], state[width : 2 * width], work.command)
            exert_alone(model, powers.model, time)
        fill_energy_terms(structure, parameters, work, powers.energy_terms)
        if moving:
            fill_base_power(model, powers.model, True, powers.energy_terms)
        elif structure.contact_rows > 0:
            cull_distant(structure, parameters, work, state, model.rate)
        _fill_powers(structure, parameters, work, state, powers.energy_terms, powers.powers[k])
    return 1
