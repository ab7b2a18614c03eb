"""Speed, load and turn of every kind of friction, from MuJoCo's model and its state."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from finger_pin.core.evaluation.law_code import inlined
from finger_pin.core.jit import Pointer, njit_inline
from finger_pin.exchange.mujoco_friction import BRANCH, ELEMENT, HEAD, LINK
from finger_pin.mujoco.friction_step import delivered
from finger_pin.mujoco.layout import Data, Kinds, Model
from finger_pin.mujoco.loads import between, spring, turn_of_path
from finger_pin.mujoco.memory import integer_in, integers, number_in, numbers

_delivered = inlined(delivered)


class LawInputs(NamedTuple):
    """Inputs of a friction's law; ``most`` is the largest friction."""

    speed: float
    load: float
    pressing: float
    most: float
    turn: float


@njit_inline
def tendon(
    m: int,
    d: int,
    at: Model,
    of: Data,
    kinds: Kinds,
    e: int,
    force: float,
    constraint_tension: float,
    along: Pointer,
    about: Pointer,
    reactions: Pointer,
) -> LawInputs:
    """Return speed, tension, normal force, largest friction and turn of a tendon: (14)."""
    p, objects = numbers(m, at.tuple_objprm, e), integers(m, at.tuple_objid, e)
    tendon, row = objects[0], objects[1]
    first = HEAD
    pull = along[tendon] + spring(m, d, at, of, tendon)
    if int(p[ELEMENT.kind]) == BRANCH:
        # A part of what its tendon's friction has left, which ``constraint_tension`` is here.
        first, trunk = HEAD + 1, objects[HEAD]
        pull = along[trunk] + spring(m, d, at, of, trunk)
        left = _delivered(
            pull, abs(pull), constraint_tension, p[ELEMENT.viscous], number_in(d, of.ten_velocity, trunk)
        )[1]
        pull, constraint_tension = (p[HEAD] if pull > 0.0 else -p[HEAD]) * left, 0.0
    if int(p[ELEMENT.kind]) == LINK:
        drive = about[integer_in(m, at.jnt_dofadr, row)] * (
            abs(p[ELEMENT.share]) if p[ELEMENT.ratio] > 0.0 else -abs(p[ELEMENT.share])
        )
        pull += drive if p[ELEMENT.share] > 0.0 else min(drive, 0.0)
    tension = abs(pull) + constraint_tension
    speed = number_in(d, of.ten_velocity, tendon)
    loss, left = _delivered(pull, tension, force, p[ELEMENT.viscous], speed)
    bend, pressing = 0.0, tension + left
    if pressing > 0.0:
        bend = _turn(m, d, at, of, kinds, e, tendon)
    for k in range(first, int(p[ELEMENT.length])):
        reactions[integers(m, at.jnt_dofadr)[objects[k]]] += left
    # What holds the tendon back takes no more than there is.
    most = tension + p[ELEMENT.drag] + p[ELEMENT.floor] if loss > 0.0 else np.inf
    return LawInputs(speed, tension, pressing, most, p[ELEMENT.curvature_offset] + bend)


@njit_inline
def _turn(m: int, d: int, at: Model, of: Data, kinds: Kinds, e: int, tendon: int) -> float:
    """Return the angle by which a path turns beyond its offset, by (15) or along its points (`turn_of_path`)."""
    if tendon >= 0 and integer_in(d, of.ten_wrapnum, tendon) > 0:
        return turn_of_path(d, of, tendon)
    p, objects, turn = numbers(m, at.tuple_objprm, e), integers(m, at.tuple_objid, e), 0.0
    places, types = integers(m, at.jnt_qposadr), integers(m, at.tuple_objtype, e)
    for k in range(HEAD, int(p[ELEMENT.length])):
        if types[k] == kinds.of_joint:
            turn += p[k] * abs(numbers(d, of.qpos)[places[objects[k]]])
    return turn


@njit_inline
def mass(m: int, d: int, at: Model, of: Data, kinds: Kinds, e: int, reactions: Pointer) -> LawInputs:
    """Return speed, load, normal force, largest friction and turn of a slide that is a passive tendon's mass: (14c)."""
    p, objects, types = (
        numbers(m, at.tuple_objprm, e),
        integers(m, at.tuple_objid, e),
        integers(m, at.tuple_objtype, e),
    )
    speed, load = number_in(d, of.qvel, integer_in(m, at.jnt_dofadr, objects[0])), 0.0
    dofs, tension = integers(m, at.jnt_dofadr), 0.0
    for k in range(HEAD, int(p[ELEMENT.length])):
        if types[k] == kinds.of_tendon:
            tension = abs(spring(m, d, at, of, objects[k]))
            load += tension
        else:
            # The joints that the half just named crosses.
            reactions[dofs[objects[k]]] += tension
    bend = p[ELEMENT.curvature_offset] + _turn(m, d, at, of, kinds, e, -1)
    return LawInputs(speed, load, load, np.inf, bend)


@njit_inline
def pin(m: int, d: int, at: Model, of: Data, e: int, load_at: int, reactions: Pointer) -> LawInputs:
    """Return speed, load, normal force, largest friction and turn of a joint's pin: (17)."""
    joint = integer_in(m, at.tuple_objid, e)
    dof = integer_in(m, at.jnt_dofadr, joint)
    speed, load = number_in(d, of.qvel, dof), reactions[dof]
    outside = numbers(d, of.act, load_at)
    x, y, z = outside[0], outside[1], outside[2]
    if x * x + y * y + z * z > 0.0:
        ex, ey, ez = _proximal(m, d, at, of, joint)
        load = math.sqrt((x - load * ex) ** 2 + (y - load * ey) ** 2 + (z - load * ez) ** 2)
    return LawInputs(speed, load, load, np.inf, 0.0)


@njit_inline
def _proximal(m: int, d: int, at: Model, of: Data, joint: int) -> tuple[float, float, float]:
    """Return e_j: from the joint before to this one, or the x axis of its carrier."""
    parent, joints, count = integers(m, at.body_parentid), integers(m, at.body_jntadr), integers(m, at.body_jntnum)
    anchor, carrier = numbers(d, of.xanchor), integer_in(m, at.jnt_bodyid, joint)
    body = parent[carrier]
    while body > 0:
        if count[body] > 0:
            other = joints[body] + count[body] - 1
            x, y, z = between(anchor, other, joint)
            away = math.sqrt(x * x + y * y + z * z)
            if away > 1e-6:
                return x / away, y / away, z / away
        body = parent[body]
    frame = numbers(d, of.xmat, 9 * parent[carrier])
    return frame[0], frame[3], frame[6]
