"""Kernels of friction in MuJoCo Warp, one thread a world and friction or row, as `kernel.py` in the plugin.

Every thread gathers what it needs and writes what is its own, so that a world alone and among others has the same
numbers to the last bit.
"""

import warp as wp

from finger_pin.exchange import mujoco_friction as table
from finger_pin.mujoco.friction_step import NUMERICAL_FLOOR
from finger_pin.mujoco.warp import functions
from finger_pin.mujoco.warp import structures as places
from finger_pin.mujoco.warp.structures import State, Table

wp.set_module_options({"enable_backward": False})

# Constants, as Warp reads them.
_PIN, _LINK, _BRANCH = (wp.constant(each) for each in (table.PIN, table.LINK, table.BRANCH))
_LEVEL, _FORCE, _LOAD, _TURN, _SIGNALS = (wp.constant(each) for each in range(table.SIGNALS + 1))
_COULOMB, _STATIC, _STIFFNESS, _VISCOUS, _STRIBECK, _FLOOR, _EXPONENT, _MICRO, _DRAG, _OFFSET, _HARDENING = (
    wp.constant(each) for each in range(places.LAW)
)
_BRISTLE, _HELD, _CONTACT, _MEMORY = (
    wp.constant(each) for each in (places.BRISTLE, places.HELD, places.CONTACT, places.MEMORY)
)
_PULL, _DAMP, _LIMIT = (wp.constant(each) for each in (places.PULL, places.DAMP, places.LIMIT))
_NEVER, _NUMERICAL = wp.constant(places.NEVER), wp.constant(NUMERICAL_FLOOR)
# As large as no friction, N.
_MOST = wp.constant(1e30)


@wp.kernel
def finish(
    t: Table,
    s: State,
    nv: int,
    timestep: wp.array[float],
    rows: wp.array[int],
    counts: wp.array[int],
    columns: wp.array[int],
    time: wp.array[float],
    qvel: wp.array2d[float],
) -> None:
    """Finish the last step where time has gone on: bristles by (9a), and loads; forget all where it has gone back."""
    w, f = wp.tid()
    s.address[w, t.row_of[t.row[f]]] = -1
    if time[w] < s.clock[w]:
        for k in range(_MEMORY):
            s.memory[w, f, k] = 0.0
        for k in range(_SIGNALS):
            s.signals[k, w, f] = 0.0
    elif time[w] > s.clock[w] and s.clock[w] > _NEVER:
        row, speed = t.row[f], float(0.0)
        if row < nv:
            speed = qvel[w, row]
        else:
            first = rows[row - nv]
            for k in range(first, first + counts[row - nv]):
                speed += s.arms[w, k] * qvel[w, columns[k]]
        level, bristle = s.signals[_LEVEL, w, f], float(s.memory[w, f, _BRISTLE])
        if t.kind[f] != _PIN and s.signals[_LOAD, w, f] == 0.0 and wp.max(level, wp.abs(bristle)) <= _NUMERICAL:
            # A tendon that is slack: its bristles stand up.
            bristle, speed = float(0.0), float(0.0)
        dt = timestep[w % timestep.shape[0]]
        stiffness = s.law[_STIFFNESS, w, f] + s.law[_HARDENING, w, f] * wp.abs(bristle)
        change, _left = functions.slide(bristle, stiffness * dt * speed * t.ratio[f], level)
        s.memory[w, f, _BRISTLE] = bristle + change
        for k in range(_HELD, _MEMORY):
            s.memory[w, f, k] = s.following[w, f, k]


@wp.kernel
def forget(s: State, mask: wp.array[bool]) -> None:
    """Put the friction of some worlds at rest."""
    w, f = wp.tid()
    if not mask[w]:
        return
    for k in range(_MEMORY):
        s.memory[w, f, k] = 0.0
    for k in range(_SIGNALS):
        s.signals[k, w, f] = 0.0
    s.clock[w] = _NEVER


@wp.func
def _write_terms(t: Table, s: State, w: int, f: int, seen: wp.vec4, most: float, turn: float, dt: float) -> None:
    """Write level, load and turn, and a friction's part of its row; seen are speed, load, normal force, bristles."""
    law = s.law
    level = functions.level_of(
        t.kind[f] == _PIN,
        law[_COULOMB, w, f],
        law[_STATIC, w, f],
        law[_STRIBECK, w, f],
        law[_EXPONENT, w, f],
        law[_FLOOR, w, f],
        law[_DRAG, w, f],
        seen[0],
        seen[2],
        turn,
    )
    stiffness = law[_STIFFNESS, w, f] + law[_HARDENING, w, f] * wp.abs(seen[3])
    pull, damp, limit = functions.exerted(
        level, stiffness, law[_VISCOUS, w, f], law[_MICRO, w, f], seen[0], seen[1], most, seen[3], dt
    )
    s.signals[_LEVEL, w, f] = level
    s.signals[_LOAD, w, f] = seen[1]
    s.signals[_TURN, w, f] = turn
    ratio = t.ratio[f]
    s.terms[w, f, _PULL] = ratio * pull
    s.terms[w, f, _DAMP] = ratio * ratio * damp
    s.terms[w, f, _LIMIT] = wp.abs(ratio) * limit


@wp.func
def _drawn(
    t: Table,
    w: int,
    f: int,
    gear: wp.array2d[wp.spatial_vector],
    limited: wp.array[bool],
    limits: wp.array2d[wp.vec2],
    force: wp.array2d[float],
) -> float:
    """Return what actuators exert along a tendon, or of a link on its joint, within their limits."""
    found = float(0.0)
    for k in range(t.actuators_first[f], t.actuators_first[f + 1]):
        a = t.actuators[k]
        exerted, within = float(force[w, a]), limits[w % limits.shape[0], a]
        if limited[a]:
            exerted = wp.clamp(exerted, within[0], within[1])
        found += gear[w % gear.shape[0], a][0] * exerted
    return found


@wp.kernel
def tendons(
    t: Table,
    s: State,
    nv: int,
    timestep: wp.array[float],
    gear: wp.array2d[wp.spatial_vector],
    limited: wp.array[bool],
    limits: wp.array2d[wp.vec2],
    total_limited: wp.array[bool],
    total_limits: wp.array2d[wp.vec2],
    stiffness: wp.array2d[float],
    damping: wp.array2d[float],
    rest: wp.array2d[wp.vec2],
    rows: wp.array[int],
    counts: wp.array[int],
    qpos_of: wp.array[int],
    force: wp.array2d[float],
    length: wp.array2d[float],
    velocity: wp.array2d[float],
    qpos: wp.array2d[float],
    jacobian: wp.array2d[float],
    path_first: wp.array2d[int],
    path_count: wp.array2d[int],
    wrapped: wp.array2d[wp.vec2i],
    points: wp.array2d[wp.spatial_vector],
) -> None:
    """Write the terms of tendons' frictions, and keep the arms of their rows: (12), (14) to (16)."""
    w, i = wp.tid()
    f = t.tendons[i]
    tendon, kind, trunk = t.element[f], t.kind[f], t.trunk[f]
    puller = t.element[trunk]
    pull = _drawn(t, w, f, gear, limited, limits, force)
    bristle, held, speed = s.memory[w, f, _BRISTLE], float(s.memory[w, f, _HELD]), velocity[w, tendon]
    if kind == _LINK:
        drive = pull * wp.abs(t.share[f]) * wp.sign(t.ratio[f])
        pull = wp.where(t.share[f] > 0.0, drive, wp.min(drive, 0.0))
    elif total_limited[puller]:
        within = total_limits[w % total_limits.shape[0], puller]
        pull = wp.clamp(pull, within[0], within[1])
    pull += functions.spring(w, puller, stiffness, damping, rest, length, velocity)
    if kind == _BRANCH:
        # A part of what its tendon's friction has left.
        _lost, left = functions.delivered(
            pull, wp.abs(pull), s.memory[w, trunk, _BRISTLE], s.law[_VISCOUS, w, f], velocity[w, puller]
        )
        pull, held = wp.where(pull > 0.0, t.share[f], -t.share[f]) * left, float(0.0)
    tension = wp.abs(pull) + held
    loss, left = functions.delivered(pull, tension, bristle, s.law[_VISCOUS, w, f], speed)
    s.delivered[w, f] = left
    turn = float(s.law[_OFFSET, w, f])
    if tension + left > 0.0:
        if path_count[w, tendon] > 0:
            turn += functions.turn_of_path(w, path_first[w, tendon], path_count[w, tendon], points, wrapped)
        else:
            for k in range(t.bends_first[f], t.bends_first[f + 1]):
                turn += t.weights[k] * wp.abs(qpos[w, qpos_of[t.bends[k]]])
    # What holds the tendon back takes no more than there is.
    most = wp.where(loss > 0.0, tension + s.law[_DRAG, w, f] + s.law[_FLOOR, w, f], _MOST)
    seen = wp.vec4(speed, tension, tension + left, bristle)
    _write_terms(t, s, w, f, seen, most, turn, timestep[w % timestep.shape[0]])
    if t.row[f] >= nv:
        first = rows[t.row[f] - nv]
        for k in range(first, first + counts[t.row[f] - nv]):
            s.arms[w, k] = jacobian[w, k]


@wp.kernel
def pins(
    t: Table,
    s: State,
    timestep: wp.array[float],
    parent: wp.array[int],
    joints: wp.array[int],
    count: wp.array[int],
    body_of: wp.array[int],
    qvel: wp.array2d[float],
    anchor: wp.array2d[wp.vec3],
    frame: wp.array2d[wp.mat33],
) -> None:
    """Write the terms of joints' frictions, which tendons and contacts load: (17)."""
    w, i = wp.tid()
    f = t.pins[i]
    load = float(0.0)
    for k in range(t.loads_first[f], t.loads_first[f + 1]):
        load += s.delivered[w, t.loads[k]]
    outside = wp.vec3(s.memory[w, f, _CONTACT], s.memory[w, f, _CONTACT + 1], s.memory[w, f, _CONTACT + 2])
    if wp.length_sq(outside) > 0.0:
        way = functions.proximal(w, t.element[f], parent, joints, count, body_of, anchor, frame)
        load = wp.length(outside - load * way)
    seen = wp.vec4(qvel[w, t.row[f]], load, load, s.memory[w, f, _BRISTLE])
    _write_terms(t, s, w, f, seen, _MOST, 0.0, timestep[w % timestep.shape[0]])
