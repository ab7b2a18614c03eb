"""Law (9) in MuJoCo's solver: what the plugin's callbacks compute.

The solver's row of a friction exerts -clip(F - x + (c + b) v', +-L) with v and v' the speed before and after the step:
F is the bristles' force F^s, c = s0 dt, so that bristles which stick are stepped by Euler's implicit method, stable at
any mass, and L is the level, or what (9a) takes F to at v where that is more, and b |v|; micro-damping adds to b. x is
by how much F + c v is more than that, where bristles slide less than their own length in a step: the row then is exact
at v' = v. It is never more than 0.37 F, so that friction does not drive. In terms of MuJoCo's row R = 1 / ((c + b)
dt), aref = -v / dt - (F - x) R and frictionloss = L. After the step v' is known, and (9a) takes F^s on, exactly at
this speed and level.
"""

from __future__ import annotations

import math
from typing import Any

from finger_pin.mechanism.exchange.mujoco_friction import (
    FORCE,
    KIND,
    LENGTH,
    LEVEL,
    LINK,
    LOAD,
    LOADS,
    MASS,
    MICRO,
    PIN,
    RATIO,
    SIGNALS,
    STIFFNESS,
    TENDON,
    TURN,
    VISCOUS,
)
from finger_pin.mujoco.elements import mass, pin, tendon
from finger_pin.mujoco.loads import contact_loads, driven, held_tensions
from finger_pin.mujoco.memory import (
    compiled,
    flags,
    integer,
    integer_in,
    integers,
    number,
    number_in,
    numbers,
    numbers_at,
    scratch,
    size,
    words,
    zeros,
)

# What a row's frictionloss is at least, N: MuJoCo drops rows that have none.
_NOTHING = 1e-12
# The floor that keeps (9a) finite where nothing is pressed, N: higher ones are friction that users have asked for.
_NUMERICAL = 1e-4
_LOW = 0xFFFFFFFF


@compiled
def instance_of(m: Any, instance: Any, at: Any, kinds: Any) -> Any:
    """Return the actuator and the tuple of an instance; -1 where there are none, or friction cannot be."""
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


@compiled
def signals(m: Any, instance: Any, at: Any) -> Any:
    """Return how many numbers an instance keeps in plugin_state; MuJoCo asks before a model has its tuples."""
    digits, k, count = flags(m, at.plugin_attr), integer_in(m, at.plugin_attradr, instance), 0
    while digits[k] != 0:
        count, k = 10 * count + digits[k] - 48, k + 1
    return SIGNALS * count


@compiled
def init(m: Any, d: Any, instance: Any, at: Any, of: Any, kinds: Any) -> Any:
    """Note in a new mjData which actuator and which tuple are an instance's; -1 where it cannot be."""
    actuator, which = instance_of(m, instance, at, kinds)
    if which < 0:
        return -1
    words(d, of.plugin_data)[instance] = actuator + (which << 32)
    return 0


@compiled
def copy(to: Any, d: Any, instance: Any, of: Any) -> None:
    """Copy what `init` has noted."""
    words(to, of.plugin_data)[instance] = words(d, of.plugin_data)[instance]


@compiled
def reset(m: Any, state: Any, instance: Any, at: Any) -> None:
    """Forget all signals."""
    for k in range(signals(m, instance, at)):
        numbers_at(state)[k] = 0.0


@compiled
def compute(m: Any, d: Any, instance: Any, at: Any, of: Any, kinds: Any) -> None:
    """Write the rows of all frictions, the rates of their bristles, and their signals."""
    key, width = words(d, of.plugin_data)[instance], size(m, at.nv)
    e, end = _entries(m, at, key >> 32)
    z, x, place = _start(m, at, key, instance)
    values, objects, types = numbers(m, at.tuple_objprm), integers(m, at.tuple_objid), integers(m, at.tuple_objtype)
    dofs, states = integers(m, at.jnt_dofadr), numbers(d, of.plugin_state)
    act, rate, dt = numbers(d, of.act), numbers(d, of.act_dot), number(m, at.timestep)
    count = width + size(m, at.ntendon)
    # Of every degree of freedom, then of every tendon: what drives it, what presses pins, and three of its row.
    room = zeros(scratch(5 * count), 5 * count)
    about, along, reactions = numbers_at(room), numbers_at(room + 8 * width), numbers_at(room + 8 * count)
    rows = numbers_at(room + 16 * count)
    driven(m, d, at, of, kinds, along, about)
    # Tendons load pins: the table has pins last.
    while e < end:
        kind, ratio, row = int(values[e + KIND]), values[e + RATIO], objects[e + 1]
        row = 3 * (dofs[row] if types[e + 1] == kinds.of_joint else width + row)
        if kind == PIN:
            found = pin(m, d, at, of, e, x, reactions)
        elif kind == MASS:
            found = mass(m, d, at, of, kinds, e, reactions)
        else:
            found = tendon(m, d, at, of, kinds, e, act[z], act[x], along, about, reactions)
        speed, level, most, load, bend = found
        states[place + LEVEL], states[place + LOAD], states[place + TURN] = level, load, bend
        # `advance` moves the bristles, with the speed that the step ends with.
        rate[z] = 0.0
        for k in range(x, x + LOADS[kind]):
            rate[k] = 0.0
        force, drag, limit = _exerted(numbers(m, at.tuple_objprm, e), act[z], speed, level, load, dt)
        rows[row] += ratio * force
        rows[row + 1] += ratio * ratio * (values[e + STIFFNESS] * dt + drag)
        rows[row + 2] += abs(ratio) * min(limit, most)
        e, z, x, place = e + int(values[e + LENGTH]), z + 1, x + LOADS[kind], place + SIGNALS
    _write(m, d, at, of, kinds, rows, dt)


@compiled
def _exerted(p: Any, force: Any, speed: Any, level: Any, load: Any, dt: Any) -> Any:
    """Return F - x, b and what micro-damping adds to it, and the most that a friction exerts."""
    stiffness, viscous, micro = p[STIFFNESS], p[VISCOUS], p[MICRO]
    if load == 0.0 and force == 0.0:
        return 0.0, viscous + micro, level + viscous * abs(speed)
    moved = stiffness * dt * speed
    decay, steady = math.exp(-abs(moved) / level), level if speed > 0.0 else -level
    later = steady + (force - steady) * decay
    # The micro-damping's sigma_1 z', as z goes at this speed; it may help the motion.
    if micro > 0.0 and speed != 0.0:
        micro *= (later - force) / moved
    excess = (force + moved - later) * decay
    limit = max(level, abs(later)) + (viscous + micro) * abs(speed)
    return force - excess + min(micro, 0.0) * speed, viscous + max(micro, 0.0), limit


@compiled
def _entries(m: Any, at: Any, which: Any) -> Any:
    """Return where the elements of a tuple begin and end."""
    first = integer_in(m, at.tuple_adr, which)
    return first, first + integer_in(m, at.tuple_size, which)


@compiled
def _start(m: Any, at: Any, key: Any, instance: Any) -> Any:
    """Return where the first friction has its bristles, its loads and its signals."""
    bristles = integer_in(m, at.actuator_actadr, key & _LOW)
    loads = bristles + signals(m, instance, at) // SIGNALS
    return bristles, loads, integer_in(m, at.plugin_stateadr, instance)


@compiled
def _slid(force: Any, speed: Any, level: Any, stiffness: Any, dt: Any) -> Any:
    """Return F^s after dt by (9a) at this speed and level, exactly."""
    steady = level if speed > 0.0 else -level
    return steady + (force - steady) * math.exp(-stiffness * abs(speed) * dt / level)


@compiled
def _write(m: Any, d: Any, at: Any, of: Any, kinds: Any, rows: Any, dt: Any) -> None:
    """Write the solver's rows: of islands their copies too, and where it is a dual one the diagonal of its matrix."""
    width, ne, nefc = size(m, at.nv), integer(d, of.ne), integer(d, of.nefc)
    kind, which = integers(d, of.efc_type), integers(d, of.efc_id)
    aref, most = numbers(d, of.efc_aref), numbers(d, of.efc_frictionloss)
    weight, resistance = numbers(d, of.efc_D), numbers(d, of.efc_R)
    islands = integer(d, of.nisland) > 0
    dual = integer(m, at.solver) == kinds.pgs or integer(m, at.noslip_iterations) > 0
    for r in range(ne, ne + integer(d, of.nf)):
        of_dof = kind[r] == kinds.friction_dof
        row = which[r] if of_dof else width + which[r]
        if rows[3 * row + 1] == 0.0:
            continue
        speed = number_in(d, of.qvel, row) if of_dof else number_in(d, of.ten_velocity, which[r])
        before, stiff = resistance[r], rows[3 * row + 1] * dt
        held = 1.0 / stiff
        aref[r] = -speed / dt - held * rows[3 * row]
        resistance[r], weight[r] = held, stiff
        most[r] = max(rows[3 * row + 2], _NOTHING)
        if islands:
            s = integer_in(d, of.map_efc2iefc, r)
            numbers(d, of.iefc_R)[s], numbers(d, of.iefc_D)[s] = held, stiff
            numbers(d, of.iefc_frictionloss)[s] = most[r]
        if dual:
            numbers(d, of.efc_AR)[_diagonal(m, d, at, of, kinds, r, nefc)] += held - before


@compiled
def _diagonal(m: Any, d: Any, at: Any, of: Any, kinds: Any, r: Any, nefc: Any) -> Any:
    """Return where the diagonal of the dual solver's matrix is, in its dense or its sparse form."""
    how = integer(m, at.jacobian)
    # As mj_isSparse: automatic is sparse from 60 degrees of freedom on.
    if how == kinds.dense or (how != kinds.sparse and size(m, at.nv) < 60):
        return r * (nefc + 1)
    k = integer_in(d, of.efc_AR_rowadr, r)
    while integer_in(d, of.efc_AR_colind, k) != r:
        k += 1
    return k


@compiled
def advance(m: Any, d: Any, instance: Any, at: Any, of: Any, contact: Any, kinds: Any) -> None:
    """Move bristles by (9a), and note what the solver has found: the force of each friction, what will load it next."""
    key, width = words(d, of.plugin_data)[instance], size(m, at.nv)
    e, end = _entries(m, at, key >> 32)
    z, x, place = _start(m, at, key, instance)
    values, objects, types = numbers(m, at.tuple_objprm), integers(m, at.tuple_objid), integers(m, at.tuple_objtype)
    states, act = numbers(d, of.plugin_state), numbers(d, of.act)
    dt, count = number(m, at.timestep), width + size(m, at.ntendon)
    room, pins = zeros(scratch(2 * count), 2 * count), False
    forces, places, held = numbers_at(room), numbers_at(room + 8 * count), numbers_at(room + 8 * (count + width))
    held_tensions(m, d, at, of, kinds, held)
    _row_forces(m, d, at, of, kinds, width, forces)
    while e < end:
        kind, row = int(values[e + KIND]), objects[e + 1]
        row = integer_in(m, at.jnt_dofadr, row) if types[e + 1] == kinds.of_joint else width + row
        states[place + FORCE] = forces[row] / values[e + RATIO]
        if kind != PIN and states[place + LOAD] == 0.0 and max(states[place + LEVEL], abs(act[z])) <= _NUMERICAL:
            # A tendon that is slack: its bristles stand up, so that the next step need not ask for them.
            act[z] = 0.0
        else:
            speed = _speed(m, d, at, of, objects[e + 1], types[e + 1] == kinds.of_joint) * values[e + RATIO]
            act[z] = _slid(act[z], speed, states[place + LEVEL], values[e + STIFFNESS], dt)
        if kind == TENDON or kind == LINK:
            act[x] = held[objects[e]]
        elif kind == PIN:
            places[objects[e]], pins = x, True
            act[x], act[x + 1], act[x + 2] = 0.0, 0.0, 0.0
        e, z, x, place = e + int(values[e + LENGTH]), z + 1, x + LOADS[kind], place + SIGNALS
    if pins:
        contact_loads(m, d, at, of, contact, kinds, places, act)


@compiled
def _speed(m: Any, d: Any, at: Any, of: Any, element: Any, is_joint: Any) -> Any:
    """Return the present speed of a joint, or of a tendon's length along its present arms."""
    speeds = numbers(d, of.qvel)
    if is_joint:
        return speeds[integer_in(m, at.jnt_dofadr, element)]
    arms, columns, found = numbers(d, of.ten_J), integers(m, at.ten_J_colind), 0.0
    first = integer_in(m, at.ten_J_rowadr, element)
    for k in range(first, first + integer_in(m, at.ten_J_rownnz, element)):
        found += arms[k] * speeds[columns[k]]
    return found


@compiled
def _row_forces(m: Any, d: Any, at: Any, of: Any, kinds: Any, width: Any, found: Any) -> None:
    """Note what the solver's rows of friction take, by degree of freedom and tendon."""
    ne = integer(d, of.ne)
    for r in range(ne, ne + integer(d, of.nf)):
        row = integer_in(d, of.efc_id, r)
        row += 0 if integer_in(d, of.efc_type, r) == kinds.friction_dof else width
        found[row] = -numbers(d, of.efc_force)[r]
