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

from finger_pin.core.evaluation.law_code import inlined
from finger_pin.core.jit import Pointer, njit_inline, scratch
from finger_pin.exchange.mujoco_friction import BRANCH, ELEMENT, MASS, PIN, SIGNAL, SIGNALS
from finger_pin.mujoco.constraint_rows import TERM, TERMS, row_forces, write_rows
from finger_pin.mujoco.elements import LawInputs, mass, pin, tendon
from finger_pin.mujoco.friction_step import NUMERICAL_FLOOR, exerted, level_of, slide
from finger_pin.mujoco.layout import Contact, Data, Kinds, Model
from finger_pin.mujoco.loads import contact_loads, driven, held_tensions
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

_LOW = 0xFFFFFFFF

_level, _law, _slide = map(inlined, (level_of, exerted, slide))


@njit_inline
def instance_of(m: int, instance: int, at: Model, kinds: Kinds) -> tuple[int, int]:
    """Return the indices of an instance's actuator and tuple, -1 if they are missing."""
    if integer(m, at.integrator) == kinds.discrete:
        return -1, -1
    plugin, names = integers(m, at.actuator_plugin), flags(m, at.names)
    for a in range(size(m, at.nactuator)):
        if plugin[a] != instance:
            continue
        name = integer_in(m, at.name_actuatoradr, a)
        for t in range(size(m, at.ntuple)):
            other, k = integer_in(m, at.name_tupleadr, t), 0
            while names[name + k] == names[other + k] and names[name + k] != 0:
                k += 1
            if names[name + k] == names[other + k]:
                return a, t
    return -1, -1


@njit_inline
def signals(m: int, instance: int, at: Model) -> int:
    """Return the number of signals of an instance in plugin_state; MuJoCo asks before a model has its tuples."""
    digits, k, count = flags(m, at.plugin_attr), integer_in(m, at.plugin_attradr, instance), 0
    while digits[k] != 0:
        count, k = 10 * count + digits[k] - 48, k + 1
    return SIGNALS * count


@njit_inline
def init(m: int, d: int, instance: int, at: Model, of: Data, kinds: Kinds) -> int:
    """Store the actuator and the tuple of an instance in a new mjData; -1 if friction is impossible."""
    actuator, which = instance_of(m, instance, at, kinds)
    if which < 0:
        return -1
    words(d, of.plugin_data)[instance] = actuator + (which << 32)
    return 0


@njit_inline
def copy(to: int, d: int, instance: int, of: Data) -> None:
    """Copy the notes of `init`."""
    words(to, of.plugin_data)[instance] = words(d, of.plugin_data)[instance]


@njit_inline
def reset(m: int, state: int, instance: int, at: Model) -> None:
    """Forget all signals."""
    for k in range(signals(m, instance, at)):
        numbers_at(state)[k] = 0.0


@njit_inline
def compute(m: int, d: int, instance: int, at: Model, of: Data, kinds: Kinds) -> None:
    """Write the rows of all frictions, the rates of their bristles, and their signals."""
    key, width = words(d, of.plugin_data)[instance], size(m, at.nv)
    e, end = _entries(m, at, key >> 32)
    z, x, place = _start(m, at, key, instance)
    values, objects, types = numbers(m, at.tuple_objprm), integers(m, at.tuple_objid), integers(m, at.tuple_objtype)
    dofs, states = integers(m, at.jnt_dofadr), numbers(d, of.plugin_state)
    act, rate, dt = numbers(d, of.act), numbers(d, of.act_dot), number(m, at.timestep)
    count = width + size(m, at.ntendon)
    # Of every degree of freedom, then of every tendon: what drives it, what presses pins, and the terms of its row.
    room = zeros(scratch(width + count), width + count)
    about, along, reactions = numbers_at(room), numbers_at(room + 8 * width), numbers_at(room + 8 * count)
    rows = numbers_at(zeros(scratch(TERMS * count), TERMS * count))
    driven(m, d, at, of, kinds, along, about)
    # Tendons load pins: the table has pins last.
    while e < end:
        kind, loads, row = int(values[e + ELEMENT.kind]), int(values[e + ELEMENT.loads]), objects[e + 1]
        if kind == PIN:
            inputs = pin(m, d, at, of, e, x, reactions)
        elif kind == MASS:
            inputs = mass(m, d, at, of, kinds, e, reactions)
        else:
            constraint_tension = act[x] if loads > 0 else 0.0
            if kind == BRANCH:
                constraint_tension = act[z - int(values[e + ELEMENT.share])]
            inputs = tendon(m, d, at, of, kinds, e, act[z], constraint_tension, along, about, reactions)
        row = TERMS * (dofs[row] if types[e + 1] == kinds.of_joint else width + row)
        level, pull, damp, limit = _exerted(numbers(m, at.tuple_objprm, e), kind == PIN, inputs, act[z], dt)
        rows[row + TERM.pull] += pull
        rows[row + TERM.damp] += damp
        rows[row + TERM.limit] += limit
        states[place + SIGNAL.level], states[place + SIGNAL.load], states[place + SIGNAL.turn] = (
            level,
            inputs.load,
            inputs.turn,
        )
        # `advance` moves the bristles, with the speed that the step ends with.
        rate[z] = 0.0
        for k in range(x, x + loads):
            rate[k] = 0.0
        e, z, x, place = e + int(values[e + ELEMENT.length]), z + 1, x + loads, place + SIGNALS
    write_rows(m, d, at, of, kinds, rows, dt)


@njit_inline
def _exerted(p: Pointer, of_pin: bool, inputs: LawInputs, force: float, dt: float) -> tuple[float, float, float, float]:
    """Return the level by (9b), (16), and a friction's part of its row: F - x, c + b, and the most that it exerts."""
    speed, tension, pressing, most, turn = inputs
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
    stiffness = p[ELEMENT.stiffness] + p[ELEMENT.hardening] * abs(force)
    pull, damp, limit = _law(
        level, stiffness, p[ELEMENT.viscous], p[ELEMENT.micro_damping], speed, tension, most, force, dt
    )
    return level, p[ELEMENT.ratio] * pull, p[ELEMENT.ratio] * p[ELEMENT.ratio] * damp, abs(p[ELEMENT.ratio]) * limit


@njit_inline
def _entries(m: int, at: Model, which: int) -> tuple[int, int]:
    """Return the first element of a tuple, and the one after its last."""
    first = integer_in(m, at.tuple_adr, which)
    return first, first + integer_in(m, at.tuple_size, which)


@njit_inline
def _start(m: int, at: Model, key: int, instance: int) -> tuple[int, int, int]:
    """Return the addresses of the first friction's bristles, loads and signals."""
    bristles = integer_in(m, at.actuator_actadr, key & _LOW)
    loads = bristles + signals(m, instance, at) // SIGNALS
    return bristles, loads, integer_in(m, at.plugin_stateadr, instance)


@njit_inline
def advance(m: int, d: int, instance: int, at: Model, of: Data, contact: Contact, kinds: Kinds) -> None:
    """Move bristles by (9a), and note the solver's force of each friction, and its next load."""
    key, width = words(d, of.plugin_data)[instance], size(m, at.nv)
    e, end = _entries(m, at, key >> 32)
    z, x, place = _start(m, at, key, instance)
    values, objects, types = numbers(m, at.tuple_objprm), integers(m, at.tuple_objid), integers(m, at.tuple_objtype)
    states, act = numbers(d, of.plugin_state), numbers(d, of.act)
    dt, count = number(m, at.timestep), width + size(m, at.ntendon)
    room, pins = zeros(scratch(2 * count), 2 * count), False
    forces, places, tensions = numbers_at(room), numbers_at(room + 8 * count), numbers_at(room + 8 * (count + width))
    held_tensions(m, d, at, of, kinds, tensions)
    row_forces(m, d, at, of, kinds, width, forces)
    while e < end:
        kind, loads, row, bristle = (
            int(values[e + ELEMENT.kind]),
            int(values[e + ELEMENT.loads]),
            objects[e + 1],
            act[z],
        )
        of_joint, level = types[e + 1] == kinds.of_joint, states[place + SIGNAL.level]
        speed = _speed(m, d, at, of, row, of_joint) * values[e + ELEMENT.ratio]
        row = integer_in(m, at.jnt_dofadr, row) if of_joint else width + row
        states[place + SIGNAL.force] = forces[row] / values[e + ELEMENT.ratio]
        if kind != PIN and states[place + SIGNAL.load] == 0.0 and max(level, abs(bristle)) <= NUMERICAL_FLOOR:
            # A tendon that is slack: its bristles stand up, so that the next step need not ask for them.
            bristle = speed = 0.0
        stiffness = values[e + ELEMENT.stiffness] + values[e + ELEMENT.hardening] * abs(bristle)
        act[z] = bristle + _slide(bristle, stiffness * dt * speed, level)[0]
        if kind == PIN:
            places[objects[e]], pins = x, True
            act[x], act[x + 1], act[x + 2] = 0.0, 0.0, 0.0
        elif loads > 0:
            act[x] = tensions[objects[e]]
        e, z, x, place = e + int(values[e + ELEMENT.length]), z + 1, x + loads, place + SIGNALS
    if pins:
        contact_loads(m, d, at, of, contact, kinds, places, act)


@njit_inline
def _speed(m: int, d: int, at: Model, of: Data, element: int, is_joint: bool) -> float:
    """Return the present speed of a joint, or of a tendon's length along its present arms."""
    speeds = numbers(d, of.qvel)
    if is_joint:
        return speeds[integer_in(m, at.jnt_dofadr, element)]
    arms, columns, speed = numbers(d, of.ten_J), integers(m, at.ten_J_colind), 0.0
    first = integer_in(m, at.ten_J_rowadr, element)
    for k in range(first, first + integer_in(m, at.ten_J_rownnz, element)):
        speed += arms[k] * speeds[columns[k]]
    return speed
