"""Speed, load and turn of every kind of friction, from MuJoCo's model and its state."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from finger_pin.core.jit import Pointer, inlined, njit_inline
from finger_pin.exchange.mujoco_friction import BRANCH, ELEMENT, HEAD, LINK
from finger_pin.mujoco.friction_step import delivered
from finger_pin.mujoco.layout import Data, Kinds, Model
from finger_pin.mujoco.loads import difference, spring, turn_of_path
from finger_pin.mujoco.memory import integer_in, integers, number_in, numbers

_delivered = inlined(delivered)


class LawInputs(NamedTuple):
    """Inputs of a friction's law; ``largest`` is the largest friction."""

    speed: float
    load: float
    pressing: float
    largest: float
    turn: float


@njit_inline
def tendon_inputs(
    m: int,
    d: int,
    model: Model,
    data: Data,
    kinds: Kinds,
    e: int,
    force: float,
    constraint_tension: float,
    along_tendons: Pointer,
    on_dofs: Pointer,
    reactions: Pointer,
) -> LawInputs:
    """Return speed, tension, normal force, largest friction and turn of a tendon: (14)."""
    p, objects = numbers(m, model.tuple_objprm, e), integers(m, model.tuple_objid, e)
    tendon, row = objects[0], objects[1]
    first_joint = HEAD
    pull = along_tendons[tendon] + spring(m, d, model, data, tendon)
    if int(p[ELEMENT.kind]) == BRANCH:
        # A part of what its tendon's friction has left, which ``constraint_tension`` is here.
        first_joint, trunk = HEAD + 1, objects[HEAD]
        pull = along_tendons[trunk] + spring(m, d, model, data, trunk)
        remaining = _delivered(
            pull, abs(pull), constraint_tension, p[ELEMENT.viscous], number_in(d, data.ten_velocity, trunk)
        )[1]
        pull, constraint_tension = (p[HEAD] if pull > 0.0 else -p[HEAD]) * remaining, 0.0
    if int(p[ELEMENT.kind]) == LINK:
        drive = on_dofs[integer_in(m, model.jnt_dofadr, row)] * (
            abs(p[ELEMENT.share]) if p[ELEMENT.ratio] > 0.0 else -abs(p[ELEMENT.share])
        )
        pull += drive if p[ELEMENT.share] > 0.0 else min(drive, 0.0)
    tension = abs(pull) + constraint_tension
    speed = number_in(d, data.ten_velocity, tendon)
    loss, remaining = _delivered(pull, tension, force, p[ELEMENT.viscous], speed)
    turn, pressing = 0.0, tension + remaining
    if pressing > 0.0:
        turn = _path_turn(m, d, model, data, kinds, e, tendon)
    for k in range(first_joint, int(p[ELEMENT.length])):
        reactions[integers(m, model.jnt_dofadr)[objects[k]]] += remaining
    # What holds the tendon back takes no more than there is.
    largest = tension + p[ELEMENT.drag] + p[ELEMENT.floor] if loss > 0.0 else np.inf
    return LawInputs(speed, tension, pressing, largest, p[ELEMENT.curvature_offset] + turn)


@njit_inline
def _path_turn(m: int, d: int, model: Model, data: Data, kinds: Kinds, e: int, tendon: int) -> float:
    """Return the angle by which a path turns beyond its offset, by (15) or along its points (`turn_of_path`)."""
    if tendon >= 0 and integer_in(d, data.ten_wrapnum, tendon) > 0:
        return turn_of_path(d, data, tendon)
    p, objects, turn = numbers(m, model.tuple_objprm, e), integers(m, model.tuple_objid, e), 0.0
    places, types = integers(m, model.jnt_qposadr), integers(m, model.tuple_objtype, e)
    for k in range(HEAD, int(p[ELEMENT.length])):
        if types[k] == kinds.of_joint:
            turn += p[k] * abs(numbers(d, data.qpos)[places[objects[k]]])
    return turn


@njit_inline
def mass_inputs(m: int, d: int, model: Model, data: Data, kinds: Kinds, e: int, reactions: Pointer) -> LawInputs:
    """Return speed, load, normal force, largest friction and turn of a slide that is a passive tendon's mass: (14c)."""
    p, objects = numbers(m, model.tuple_objprm, e), integers(m, model.tuple_objid, e)
    types = integers(m, model.tuple_objtype, e)
    speed, load = number_in(d, data.qvel, integer_in(m, model.jnt_dofadr, objects[0])), 0.0
    dofs, tension = integers(m, model.jnt_dofadr), 0.0
    for k in range(HEAD, int(p[ELEMENT.length])):
        if types[k] == kinds.of_tendon:
            tension = abs(spring(m, d, model, data, objects[k]))
            load += tension
        else:
            # The joints that the half just named crosses.
            reactions[dofs[objects[k]]] += tension
    turn = p[ELEMENT.curvature_offset] + _path_turn(m, d, model, data, kinds, e, -1)
    return LawInputs(speed, load, load, np.inf, turn)


@njit_inline
def pin_inputs(m: int, d: int, model: Model, data: Data, e: int, load_at: int, reactions: Pointer) -> LawInputs:
    """Return speed, load, normal force, largest friction and turn of a joint's pin: (17)."""
    joint = integer_in(m, model.tuple_objid, e)
    dof = integer_in(m, model.jnt_dofadr, joint)
    speed, load = number_in(d, data.qvel, dof), reactions[dof]
    contact = numbers(d, data.act, load_at)
    x, y, z = contact[0], contact[1], contact[2]
    if x * x + y * y + z * z > 0.0:
        ex, ey, ez = _proximal(m, d, model, data, joint)
        load = math.sqrt((x - load * ex) ** 2 + (y - load * ey) ** 2 + (z - load * ez) ** 2)
    return LawInputs(speed, load, load, np.inf, 0.0)


@njit_inline
def _proximal(m: int, d: int, model: Model, data: Data, joint: int) -> tuple[float, float, float]:
    """Return e_j: from the joint before to this one, or the x axis of its carrier."""
    parent, joints = integers(m, model.body_parentid), integers(m, model.body_jntadr)
    count = integers(m, model.body_jntnum)
    anchor, carrier = numbers(d, data.xanchor), integer_in(m, model.jnt_bodyid, joint)
    body = parent[carrier]
    while body > 0:
        if count[body] > 0:
            other = joints[body] + count[body] - 1
            x, y, z = difference(anchor, other, joint)
            distance = math.sqrt(x * x + y * y + z * z)
            if distance > 1e-6:
                return x / distance, y / distance, z / distance
        body = parent[body]
    frame = numbers(d, data.xmat, 9 * parent[carrier])
    return frame[0], frame[3], frame[6]
