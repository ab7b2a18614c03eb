"""Law (9) in MuJoCo's solver: the callbacks of the plugin.

The solver's row of a friction exerts -clip(F - x + (c + b) v', +-L) with v and v' the speed before and after the step:
F is the bristles' force F^s, c = s0 dt, so that bristles which stick are stepped by Euler's implicit method, stable at
any mass, and L is the level, or what (9a) takes F to at v where that is more, and b |v|; micro-damping adds to b. x is
by how much F + c v is more than that, where bristles slide less than their own length in a step: the row then is exact
at v' = v. It is never more than 0.37 F, so that friction does not drive. In terms of MuJoCo's row R = 1 / ((c + b)
dt), aref = -v / dt - (F - x) R and frictionloss = L. After the step v' is known, and (9a) takes F^s on, exactly at
this speed and level.
"""

from __future__ import annotations

from finger_pin.core.jit import Pointer, inlined, njit_inline, scratch
from finger_pin.exchange.mujoco_friction import BRANCH, ELEMENT, MASS, PIN, SIGNAL, SIGNALS
from finger_pin.mujoco.constraint_rows import TERM, TERMS, row_forces, write_rows
from finger_pin.mujoco.elements import LawInputs, mass_inputs, pin_inputs, tendon_inputs
from finger_pin.mujoco.friction_step import NUMERICAL_FLOOR, bristle_stiffness, row_terms, slide, sliding_level
from finger_pin.mujoco.layout import Contact, Data, Kinds, Model
from finger_pin.mujoco.loads import actuator_forces, constraint_tensions, contact_loads
from finger_pin.mujoco.memory import (
    flags,
    integer,
    integer_in,
    integers,
    number,
    numbers,
    numbers_at,
    size,
    words,
    zeros,
)

_LOW_WORD = 0xFFFFFFFF

_level, _law, _slide, _stiffness = map(inlined, (sliding_level, row_terms, slide, bristle_stiffness))


@njit_inline
def instance_of(m: int, instance: int, model: Model, kinds: Kinds) -> tuple[int, int]:
    """Return the indices of an instance's actuator and tuple, -1 if they are missing."""
    if integer(m, model.integrator) == kinds.discrete:
        return -1, -1
    plugin, names = integers(m, model.actuator_plugin), flags(m, model.names)
    for a in range(size(m, model.nactuator)):
        if plugin[a] != instance:
            continue
        name = integer_in(m, model.name_actuatoradr, a)
        for t in range(size(m, model.ntuple)):
            other, k = integer_in(m, model.name_tupleadr, t), 0
            while names[name + k] == names[other + k] and names[name + k] != 0:
                k += 1
            if names[name + k] == names[other + k]:
                return a, t
    return -1, -1


@njit_inline
def signals(m: int, instance: int, model: Model) -> int:
    """Return the number of signals of an instance in plugin_state; MuJoCo asks before a model has its tuples."""
    digits, k, count = flags(m, model.plugin_attr), integer_in(m, model.plugin_attradr, instance), 0
    while digits[k] != 0:
        count, k = 10 * count + digits[k] - 48, k + 1
    return SIGNALS * count


@njit_inline
def init(m: int, d: int, instance: int, model: Model, data: Data, kinds: Kinds) -> int:
    """Store the actuator and the tuple of an instance in a new mjData; -1 if friction is impossible."""
    actuator, which = instance_of(m, instance, model, kinds)
    if which < 0:
        return -1
    words(d, data.plugin_data)[instance] = actuator + (which << 32)
    return 0


@njit_inline
def copy(target: int, d: int, instance: int, data: Data) -> None:
    """Copy the notes of `init`."""
    words(target, data.plugin_data)[instance] = words(d, data.plugin_data)[instance]


@njit_inline
def reset(m: int, state: int, instance: int, model: Model) -> None:
    """Forget all signals."""
    for k in range(signals(m, instance, model)):
        numbers_at(state)[k] = 0.0


@njit_inline
def compute(m: int, d: int, instance: int, model: Model, data: Data, kinds: Kinds) -> None:
    """Write the rows of all frictions, the rates of their bristles, and their signals."""
    key, width = words(d, data.plugin_data)[instance], size(m, model.nv)
    e, end = _element_range(m, model, key >> 32)
    z, x, signal = _first_addresses(m, model, key, instance)
    values, objects = numbers(m, model.tuple_objprm), integers(m, model.tuple_objid)
    types = integers(m, model.tuple_objtype)
    dofs, states = integers(m, model.jnt_dofadr), numbers(d, data.plugin_state)
    act, rate, dt = numbers(d, data.act), numbers(d, data.act_dot), number(m, model.timestep)
    count = width + size(m, model.ntendon)
    # Of every degree of freedom, then of every tendon: what drives it, what presses pins, and the terms of its row.
    memory = zeros(scratch(width + count), width + count)
    on_dofs, along_tendons = numbers_at(memory), numbers_at(memory + 8 * width)
    reactions = numbers_at(memory + 8 * count)
    rows = numbers_at(zeros(scratch(TERMS * count), TERMS * count))
    actuator_forces(m, d, model, data, kinds, along_tendons, on_dofs)
    # Tendons load pins: the table has pins last.
    while e < end:
        kind, loads, row = int(values[e + ELEMENT.kind]), int(values[e + ELEMENT.loads]), objects[e + 1]
        if kind == PIN:
            inputs = pin_inputs(m, d, model, data, e, x, reactions)
        elif kind == MASS:
            inputs = mass_inputs(m, d, model, data, kinds, e, reactions)
        else:
            constraint_tension = act[x] if loads > 0 else 0.0
            if kind == BRANCH:
                constraint_tension = act[z - int(values[e + ELEMENT.share])]
            inputs = tendon_inputs(
                m, d, model, data, kinds, e, act[z], constraint_tension, along_tendons, on_dofs, reactions
            )
        row = TERMS * (dofs[row] if types[e + 1] == kinds.of_joint else width + row)
        level, pull, damp, limit = _law_terms(numbers(m, model.tuple_objprm, e), kind == PIN, inputs, act[z], dt)
        rows[row + TERM.pull] += pull
        rows[row + TERM.damp] += damp
        rows[row + TERM.limit] += limit
        states[signal + SIGNAL.level], states[signal + SIGNAL.load], states[signal + SIGNAL.turn] = (
            level,
            inputs.load,
            inputs.turn,
        )
        # `advance` moves the bristles, with the speed that the step ends with.
        rate[z] = 0.0
        for k in range(x, x + loads):
            rate[k] = 0.0
        e, z, x, signal = e + int(values[e + ELEMENT.length]), z + 1, x + loads, signal + SIGNALS
    write_rows(m, d, model, data, kinds, rows, dt)


@njit_inline
def _bristles_at(p: Pointer, force: float, level: float, speed: float, turn: float) -> float:
    """Return the stiffness of a friction's bristles; pins have no turn."""
    return _stiffness(p[ELEMENT.stiffness], p[ELEMENT.hardening], force, level, speed, p[ELEMENT.coulomb], turn)


@njit_inline
def _law_terms(
    p: Pointer, of_pin: bool, inputs: LawInputs, force: float, dt: float
) -> tuple[float, float, float, float]:
    """Return the level by (9b), (16), and a friction's part of its row: F - x, c + b, and the most that it exerts."""
    speed, tension, pressing, largest, turn = inputs
    level = _level(
        of_pin,
        p[ELEMENT.coulomb],
        p[ELEMENT.stiction],
        p[ELEMENT.stribeck_velocity],
        p[ELEMENT.stribeck_exponent],
        p[ELEMENT.floor],
        p[ELEMENT.drag],
        speed,
        pressing,
        turn,
    )
    stiffness = _bristles_at(p, force, level, speed, turn)
    pull, damp, limit = _law(
        level, stiffness, p[ELEMENT.viscous], p[ELEMENT.micro_damping], speed, tension, largest, force, dt
    )
    return level, p[ELEMENT.ratio] * pull, p[ELEMENT.ratio] * p[ELEMENT.ratio] * damp, abs(p[ELEMENT.ratio]) * limit


@njit_inline
def _element_range(m: int, model: Model, which: int) -> tuple[int, int]:
    """Return the first element of a tuple, and the one after its last."""
    first = integer_in(m, model.tuple_adr, which)
    return first, first + integer_in(m, model.tuple_size, which)


@njit_inline
def _first_addresses(m: int, model: Model, key: int, instance: int) -> tuple[int, int, int]:
    """Return the addresses of the first friction's bristles, loads and signals."""
    bristles = integer_in(m, model.actuator_actadr, key & _LOW_WORD)
    loads = bristles + signals(m, instance, model) // SIGNALS
    return bristles, loads, integer_in(m, model.plugin_stateadr, instance)


@njit_inline
def advance(m: int, d: int, instance: int, model: Model, data: Data, contact: Contact, kinds: Kinds) -> None:
    """Move bristles by (9a), and note the solver's force of each friction, and its next load."""
    key, width = words(d, data.plugin_data)[instance], size(m, model.nv)
    e, end = _element_range(m, model, key >> 32)
    z, x, signal = _first_addresses(m, model, key, instance)
    values, objects = numbers(m, model.tuple_objprm), integers(m, model.tuple_objid)
    types = integers(m, model.tuple_objtype)
    states, act = numbers(d, data.plugin_state), numbers(d, data.act)
    dt, count = number(m, model.timestep), width + size(m, model.ntendon)
    memory, pins = zeros(scratch(2 * count), 2 * count), False
    forces, load_indices = numbers_at(memory), numbers_at(memory + 8 * count)
    tensions = numbers_at(memory + 8 * (count + width))
    constraint_tensions(m, d, model, data, kinds, tensions)
    row_forces(m, d, model, data, kinds, width, forces)
    while e < end:
        kind, loads, row = int(values[e + ELEMENT.kind]), int(values[e + ELEMENT.loads]), objects[e + 1]
        bristle = act[z]
        of_joint, level = types[e + 1] == kinds.of_joint, states[signal + SIGNAL.level]
        speed = _speed(m, d, model, data, row, of_joint) * values[e + ELEMENT.ratio]
        row = integer_in(m, model.jnt_dofadr, row) if of_joint else width + row
        states[signal + SIGNAL.force] = forces[row] / values[e + ELEMENT.ratio]
        if kind != PIN and states[signal + SIGNAL.load] == 0.0 and max(level, abs(bristle)) <= NUMERICAL_FLOOR:
            # A tendon that is slack: its bristles stand up, so that the next step need not ask for them.
            bristle = speed = 0.0
        turn = states[signal + SIGNAL.turn]
        stiffness = _bristles_at(numbers(m, model.tuple_objprm, e), bristle, level, speed, turn)
        act[z] = bristle + _slide(bristle, stiffness * dt * speed, level)[0]
        if kind == PIN:
            load_indices[objects[e]], pins = x, True
            act[x], act[x + 1], act[x + 2] = 0.0, 0.0, 0.0
        elif loads > 0:
            act[x] = tensions[objects[e]]
        e, z, x, signal = e + int(values[e + ELEMENT.length]), z + 1, x + loads, signal + SIGNALS
    if pins:
        contact_loads(m, d, model, data, contact, kinds, load_indices, act)


@njit_inline
def _speed(m: int, d: int, model: Model, data: Data, element: int, is_joint: bool) -> float:
    """Return the present speed of a joint, or of a tendon's length along its present arms."""
    speeds = numbers(d, data.qvel)
    if is_joint:
        return speeds[integer_in(m, model.jnt_dofadr, element)]
    arms, columns, speed = numbers(d, data.ten_J), integers(m, model.ten_J_colind), 0.0
    first = integer_in(m, model.ten_J_rowadr, element)
    for k in range(first, first + integer_in(m, model.ten_J_rownnz, element)):
        speed += arms[k] * speeds[columns[k]]
    return speed
