"""Kernels of friction in MuJoCo Warp, one thread a world and friction or row, as `kernel.py` in the plugin.

Every thread gathers what it needs and writes what is its own, so that a world alone and among others has the same
numbers to the last bit.
"""

import warp as wp

from finger_pin.exchange import mujoco_friction as table
from finger_pin.mujoco.friction_step import NUMERICAL_FLOOR
from finger_pin.mujoco.warp import kernel_functions
from finger_pin.mujoco.warp.structures import (
    LAW,
    MEMORIES,
    MEMORY,
    NEVER,
    SIGNAL,
    TERM,
    PinInputs,
    State,
    Table,
    TendonInputs,
)

wp.set_module_options({"enable_backward": False})

# Constants, as Warp reads them.
_PIN, _LINK, _BRANCH = (wp.constant(each) for each in (table.PIN, table.LINK, table.BRANCH))
_SIGNALS, _MEMORIES = wp.constant(table.SIGNALS), wp.constant(MEMORIES)
_NEVER, _NUMERICAL = wp.constant(NEVER), wp.constant(NUMERICAL_FLOOR)
# Limit of an unlimited friction, N.
_UNLIMITED = wp.constant(1e30)


@wp.func
def _stiffness(s: State, w: int, f: int, bristle: float, level: float, speed: float, turn: float) -> float:
    """Return the stiffness of a friction's bristles; pins have no turn."""
    law = s.law
    return kernel_functions.bristle_stiffness(
        law[LAW.stiffness, w, f], law[LAW.hardening, w, f], bristle, level, speed, law[LAW.coulomb, w, f], turn
    )


@wp.kernel
def finish_step(t: Table, s: State, x: TendonInputs) -> None:
    """Finish the last step where time has gone on: bristles by (9a), and loads; forget all where it has gone back."""
    w, f = wp.tid()
    s.address[w, t.row_of[t.row[f]]] = -1
    if x.time[w] < s.clock[w]:
        for k in range(_MEMORIES):
            s.memory[w, f, k] = 0.0
        for k in range(_SIGNALS):
            s.signals[k, w, f] = 0.0
    elif x.time[w] > s.clock[w] and s.clock[w] > _NEVER:
        row, speed = t.row[f], float(0.0)
        if row < x.nv:
            speed = x.qvel[w, row]
        else:
            first = x.ten_J_rowadr[row - x.nv]
            for k in range(first, first + x.ten_J_rownnz[row - x.nv]):
                speed += s.arms[w, k] * x.qvel[w, x.ten_J_colind[k]]
        level, bristle = s.signals[SIGNAL.level, w, f], float(s.memory[w, f, MEMORY.bristle])
        if t.kind[f] != _PIN and s.signals[SIGNAL.load, w, f] == 0.0 and wp.max(level, wp.abs(bristle)) <= _NUMERICAL:
            # A tendon that is slack: its bristles stand up.
            bristle, speed = float(0.0), float(0.0)
        dt = x.timestep[w % x.timestep.shape[0]]
        speed *= t.ratio[f]
        stiffness = _stiffness(s, w, f, bristle, level, speed, s.signals[SIGNAL.turn, w, f])
        change, _left = kernel_functions.slide(bristle, stiffness * dt * speed, level)
        s.memory[w, f, MEMORY.bristle] = bristle + change
        for k in range(MEMORY.constraint_tension, _MEMORIES):
            s.memory[w, f, k] = s.following[w, f, k]


@wp.kernel
def reset_worlds(s: State, mask: wp.array[bool]) -> None:
    """Put the friction of some worlds at rest."""
    w, f = wp.tid()
    if not mask[w]:
        return
    for k in range(_MEMORIES):
        s.memory[w, f, k] = 0.0
    for k in range(_SIGNALS):
        s.signals[k, w, f] = 0.0
    s.clock[w] = _NEVER


@wp.func
def _write_terms(t: Table, s: State, w: int, f: int, inputs: wp.vec4, largest: float, turn: float, dt: float) -> None:
    """Write level, load and turn, and a friction's part of its row; inputs are speed, load, normal force, bristles."""
    law = s.law
    level = kernel_functions.sliding_level(
        t.kind[f] == _PIN,
        law[LAW.coulomb, w, f],
        law[LAW.stiction, w, f],
        law[LAW.stribeck_velocity, w, f],
        law[LAW.stribeck_exponent, w, f],
        law[LAW.floor, w, f],
        law[LAW.drag, w, f],
        inputs[0],
        inputs[2],
        turn,
    )
    stiffness = _stiffness(s, w, f, inputs[3], level, inputs[0], turn)
    pull, damp, limit = kernel_functions.row_terms(
        level,
        stiffness,
        law[LAW.viscous, w, f],
        law[LAW.micro_damping, w, f],
        inputs[0],
        inputs[1],
        largest,
        inputs[3],
        dt,
    )
    s.signals[SIGNAL.level, w, f] = level
    s.signals[SIGNAL.load, w, f] = inputs[1]
    s.signals[SIGNAL.turn, w, f] = turn
    ratio = t.ratio[f]
    s.terms[w, f, TERM.pull] = ratio * pull
    s.terms[w, f, TERM.damp] = ratio * ratio * damp
    s.terms[w, f, TERM.limit] = wp.abs(ratio) * limit


@wp.func
def _actuator_force(t: Table, w: int, f: int, x: TendonInputs) -> float:
    """Return what actuators exert along a tendon, or of a link on its joint, within their limits."""
    force = float(0.0)
    for k in range(t.actuators_first[f], t.actuators_first[f + 1]):
        a = t.actuators[k]
        exerted, limits = float(x.actuator_force[w, a]), x.actuator_forcerange[w % x.actuator_forcerange.shape[0], a]
        if x.actuator_forcelimited[a]:
            exerted = wp.clamp(exerted, limits[0], limits[1])
        force += x.actuator_gear[w % x.actuator_gear.shape[0], a][0] * exerted
    return force


@wp.kernel
def tendons(t: Table, s: State, x: TendonInputs) -> None:
    """Write the terms of tendons' frictions, and keep the arms of their rows: (12), (14) to (16)."""
    w, i = wp.tid()
    f = t.tendons[i]
    tendon, kind, trunk = t.element[f], t.kind[f], t.trunk[f]
    puller = t.element[trunk]
    pull = _actuator_force(t, w, f, x)
    bristle, speed = s.memory[w, f, MEMORY.bristle], x.ten_velocity[w, tendon]
    constraint_tension = float(s.memory[w, f, MEMORY.constraint_tension])
    if kind == _LINK:
        drive = pull * wp.abs(t.share[f]) * wp.sign(t.ratio[f])
        pull = wp.where(t.share[f] > 0.0, drive, wp.min(drive, 0.0))
    elif x.tendon_actfrclimited[puller]:
        limits = x.tendon_actfrcrange[w % x.tendon_actfrcrange.shape[0], puller]
        pull = wp.clamp(pull, limits[0], limits[1])
    pull += kernel_functions.spring(w, puller, x)
    if kind == _BRANCH:
        # A part of what its tendon's friction has left.
        _lost, remaining = kernel_functions.delivered(
            pull, wp.abs(pull), s.memory[w, trunk, MEMORY.bristle], s.law[LAW.viscous, w, f], x.ten_velocity[w, puller]
        )
        pull, constraint_tension = wp.where(pull > 0.0, t.share[f], -t.share[f]) * remaining, float(0.0)
    tension = wp.abs(pull) + constraint_tension
    loss, remaining = kernel_functions.delivered(pull, tension, bristle, s.law[LAW.viscous, w, f], speed)
    s.delivered[w, f] = remaining
    turn = float(s.law[LAW.curvature_offset, w, f])
    if tension + remaining > 0.0:
        if x.ten_wrapnum[w, tendon] > 0:
            turn += kernel_functions.turn_of_path(w, tendon, x)
        else:
            for k in range(t.bends_first[f], t.bends_first[f + 1]):
                turn += t.weights[k] * wp.abs(x.qpos[w, x.jnt_qposadr[t.bends[k]]])
    # What holds the tendon back takes no more than there is.
    largest = wp.where(loss > 0.0, tension + s.law[LAW.drag, w, f] + s.law[LAW.floor, w, f], _UNLIMITED)
    inputs = wp.vec4(speed, tension, tension + remaining, bristle)
    _write_terms(t, s, w, f, inputs, largest, turn, x.timestep[w % x.timestep.shape[0]])
    if t.row[f] >= x.nv:
        first = x.ten_J_rowadr[t.row[f] - x.nv]
        for k in range(first, first + x.ten_J_rownnz[t.row[f] - x.nv]):
            s.arms[w, k] = x.ten_J[w, k]


@wp.kernel
def pins(t: Table, s: State, x: PinInputs) -> None:
    """Write the terms of joints' frictions, which tendons and contacts load: (17)."""
    w, i = wp.tid()
    f = t.pins[i]
    load = float(0.0)
    for k in range(t.loads_first[f], t.loads_first[f + 1]):
        load += s.delivered[w, t.loads[k]]
    contact = wp.vec3(
        s.memory[w, f, MEMORY.contact_x], s.memory[w, f, MEMORY.contact_y], s.memory[w, f, MEMORY.contact_z]
    )
    if wp.length_sq(contact) > 0.0:
        axis = kernel_functions.proximal(w, t.element[f], x)
        load = wp.length(contact - load * axis)
    inputs = wp.vec4(x.qvel[w, t.row[f]], load, load, s.memory[w, f, MEMORY.bristle])
    _write_terms(t, s, w, f, inputs, _UNLIMITED, 0.0, x.timestep[w % x.timestep.shape[0]])
