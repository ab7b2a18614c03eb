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

from finger_pin.core.jit import njit_inline, scratch
from finger_pin.exchange.mujoco_friction import (
    BRANCH,
    DRAG,
    FORCE,
    KIND,
    LENGTH,
    LEVEL,
    LOAD,
    LOADS,
    MASS,
    PIN,
    RATIO,
    SHARE,
    SIGNALS,
    STIFFNESS,
    TURN,
)
from finger_pin.mujoco.constraint_rows import row_forces, write_rows
from finger_pin.mujoco.elements import mass, pin, tendon
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
from finger_pin.mujoco.vectorised_law import (
    BEARS,
    BENDS,
    BRISTLE,
    IMAGINARY,
    LEVELS,
    MOST,
    PRESSES,
    PULLS,
    REAL,
    ROW,
    SIZE,
    SPEED,
    WIDTH,
    bent,
    exerted,
    moved_on,
)

# The floor that keeps (9a) finite where nothing is pressed, N: higher ones are friction that users have asked for.
_NUMERICAL = 1e-4
_LOW = 0xFFFFFFFF


@njit_inline
def instance_of(m: int, instance: int, at: Model, kinds: Kinds) -> tuple[int, int]:
    """Return the actuator and the tuple of an instance; -1 without them, or without friction."""
    if integer(m, at.integrator) == kinds.discrete:
        return -1, -1
    plugin, names = integers(m, at.actuator_plugin), flags(m, at.names)
    for a in range(size(m, at.nactuator)):
        if plugin[a] != instance:
            continue
        own = integer_in(m, at.name_actuatoradr, a)
        for t in range(size(m, at.ntuple)):
            other, k = integer_in(m, at.name_tupleadr, t), 0
            while names[own + k] == names[other + k] and names[own + k] != 0:
                k += 1
            if names[own + k] == names[other + k]:
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
    # Of every degree of freedom, then of every tendon: what drives it, what presses pins, and three of its row.
    room, block = zeros(scratch(width + count), width + count), numbers_at(scratch(SIZE))
    about, along, reactions = numbers_at(room), numbers_at(room + 8 * width), numbers_at(room + 8 * count)
    rows = numbers_at(zeros(scratch(3 * count), 3 * count))
    driven(m, d, at, of, kinds, along, about)
    # Tendons load pins: the table has pins last.
    while e < end:
        lanes, winds = 0, 0
        while e < end and lanes < WIDTH:
            kind, loads, row = int(values[e + KIND]), int(values[e + LOADS]), objects[e + 1]
            if kind == PIN:
                found = pin(m, d, at, of, e, x, reactions)
            elif kind == MASS:
                found = mass(m, d, at, of, kinds, e, reactions)
            else:
                held = act[x] if loads > 0 else 0.0
                if kind == BRANCH:
                    held = act[z - int(values[e + SHARE])]
                found = tendon(m, d, at, of, kinds, e, act[z], held, along, about, reactions)
            for field in range(RATIO, DRAG + 1):
                block[WIDTH * field + lanes] = values[e + field]
            block[WIDTH * SPEED + lanes], block[WIDTH * BEARS + lanes], block[WIDTH * PRESSES + lanes] = found[:3]
            block[WIDTH * MOST + lanes], block[WIDTH * BENDS + lanes] = found[3:5]
            block[WIDTH * REAL + lanes], block[WIDTH * IMAGINARY + lanes] = found[5:]
            # Half a turn is a negative number without an imaginary part.
            winds = WIDTH if found[6] != 0.0 or found[5] < 0.0 else winds
            block[WIDTH * BRISTLE + lanes] = act[z]
            block[WIDTH * ROW + lanes] = 3 * (dofs[row] if types[e + 1] == kinds.of_joint else width + row)
            # `advance` moves the bristles, with the speed that the step ends with.
            rate[z] = 0.0
            for k in range(x, x + loads):
                rate[k] = 0.0
            e, z, x, lanes = e + int(values[e + LENGTH]), z + 1, x + loads, lanes + 1
        bent(block, winds)
        exerted(block, dt)
        for i in range(lanes):
            row = int(block[WIDTH * ROW + i])
            for k in range(3):
                rows[row + k] += block[WIDTH * (PULLS + k) + i]
            states[place + LEVEL], states[place + LOAD] = block[WIDTH * LEVELS + i], block[WIDTH * BEARS + i]
            states[place + TURN] = block[WIDTH * BENDS + i]
            place += SIGNALS
    write_rows(m, d, at, of, kinds, rows, dt)


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
    forces, places, held = numbers_at(room), numbers_at(room + 8 * count), numbers_at(room + 8 * (count + width))
    held_tensions(m, d, at, of, kinds, held)
    row_forces(m, d, at, of, kinds, width, forces)
    blocks, k = (x - z + WIDTH - 1) // WIDTH, 0
    moved = numbers_at(scratch(3 * WIDTH * blocks))
    while e < end:
        kind, loads, row, bristle = int(values[e + KIND]), int(values[e + LOADS]), objects[e + 1], act[z + k]
        of_joint, level = types[e + 1] == kinds.of_joint, states[place + LEVEL]
        speed = _speed(m, d, at, of, row, of_joint) * values[e + RATIO]
        row = integer_in(m, at.jnt_dofadr, row) if of_joint else width + row
        states[place + FORCE] = forces[row] / values[e + RATIO]
        if kind != PIN and states[place + LOAD] == 0.0 and max(level, abs(bristle)) <= _NUMERICAL:
            # A tendon that is slack: its bristles stand up, so that the next step need not ask for them.
            bristle = speed = 0.0
        moved[k], moved[WIDTH * blocks + k] = bristle, level
        moved[2 * WIDTH * blocks + k] = speed * values[e + STIFFNESS] * dt
        if kind == PIN:
            places[objects[e]], pins = x, True
            act[x], act[x + 1], act[x + 2] = 0.0, 0.0, 0.0
        elif loads > 0:
            act[x] = held[objects[e]]
        e, x, place, k = e + int(values[e + LENGTH]), x + loads, place + SIGNALS, k + 1
    moved_on(moved, WIDTH * blocks)
    for i in range(k):
        act[z + i] = moved[i]
    if pins:
        contact_loads(m, d, at, of, contact, kinds, places, act)


@njit_inline
def _speed(m: int, d: int, at: Model, of: Data, element: int, is_joint: bool) -> float:
    """Return the present speed of a joint, or of a tendon's length along its present arms."""
    speeds = numbers(d, of.qvel)
    if is_joint:
        return speeds[integer_in(m, at.jnt_dofadr, element)]
    arms, columns, found = numbers(d, of.ten_J), integers(m, at.ten_J_colind), 0.0
    first = integer_in(m, at.ten_J_rowadr, element)
    for k in range(first, first + integer_in(m, at.ten_J_rownnz, element)):
        found += arms[k] * speeds[columns[k]]
    return found
