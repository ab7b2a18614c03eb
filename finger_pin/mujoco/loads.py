"""Loads of frictions in MuJoCo: actuators and springs of this step, the solver's forces of the last."""

from __future__ import annotations

import math

from finger_pin.core.jit import Pointer, njit_inline
from finger_pin.mujoco.layout import Contact, Data, Kinds, Model
from finger_pin.mujoco.memory import (
    flags,
    integer,
    integer_in,
    integers,
    integers_at,
    number_in,
    numbers,
    numbers_at,
    size,
)


@njit_inline
def actuator_forces(
    m: int, d: int, model: Model, data: Data, kinds: Kinds, along_tendons: Pointer, on_dofs: Pointer
) -> None:
    """Add the actuators' forces along tendons, N, and on degrees of freedom, N m or N, within their limits.

    MuJoCo clamps forces after plugins have been asked, so that they are clamped here.
    """
    kind, target = integers(m, model.actuator_trntype), integers(m, model.actuator_trnid)
    gear = numbers(m, model.actuator_gear)
    limited, limits = flags(m, model.actuator_forcelimited), numbers(m, model.actuator_forcerange)
    force, output = numbers(d, data.actuator_force), integers(m, model.actuator_outadr)
    dof = integers(m, model.jnt_dofadr)
    for i in range(size(m, model.nactuator)):
        exerted = force[output[i]]
        if limited[i]:
            exerted = min(max(exerted, limits[2 * i]), limits[2 * i + 1])
        if kind[i] == kinds.tendon:
            along_tendons[target[2 * i]] += gear[6 * i] * exerted
        elif kind[i] == kinds.joint or kind[i] == kinds.jointinparent:
            on_dofs[dof[target[2 * i]]] += gear[6 * i] * exerted
    limited, limits = flags(m, model.tendon_actfrclimited), numbers(m, model.tendon_actfrcrange)
    for i in range(size(m, model.ntendon)):
        if limited[i]:
            along_tendons[i] = min(max(along_tendons[i], limits[2 * i]), limits[2 * i + 1])


@njit_inline
def spring(m: int, d: int, model: Model, data: Data, tendon: int) -> float:
    """Return the force of a tendon's own spring and damper along it, N, negative in tension."""
    stiffness, damping = number_in(m, model.tendon_stiffness, tendon), number_in(m, model.tendon_damping, tendon)
    damped = -damping * number_in(d, data.ten_velocity, tendon) if damping != 0.0 else 0.0
    if stiffness == 0.0:
        return damped
    length, rest = number_in(d, data.ten_length, tendon), numbers(m, model.tendon_lengthspring)
    return damped + stiffness * (max(rest[2 * tendon] - length, 0.0) + min(rest[2 * tendon + 1] - length, 0.0))


@njit_inline
def difference(points: Pointer, first: int, second: int) -> tuple[float, float, float]:
    """Return the vector from one point of MuJoCo's to another, m."""
    return (
        points[3 * second] - points[3 * first],
        points[3 * second + 1] - points[3 * first + 1],
        points[3 * second + 2] - points[3 * first + 2],
    )


@njit_inline
def turn_of_path(d: int, data: Data, tendon: int) -> float:
    """Return the angle by which a spatial tendon's path turns up to its first pulley, rad.

    Each branch behind that is a tendon of its own. Of a wrap both tangent points are in the path. The chord between
    them makes half the arc's angle with either tangent.
    """
    first, count = integer_in(d, data.ten_wrapadr, tendon), integer_in(d, data.ten_wrapnum, tendon)
    point, of_wrap, turn = numbers(d, data.wrap_xpos), integers(d, data.wrap_obj), 0.0
    x0, y0, z0 = 0.0, 0.0, 0.0
    for k in range(first + 1, first + count):
        if of_wrap[k] == -2 or of_wrap[k - 1] == -2:
            break
        x, y, z = difference(point, k - 1, k)
        if x * x + y * y + z * z < 1e-24:
            continue
        cx, cy, cz = y * z0 - z * y0, z * x0 - x * z0, x * y0 - y * x0
        # Nothing comes before the first length: with a product of -0.0 it would turn by pi.
        if x0 * x0 + y0 * y0 + z0 * z0 > 0.0:
            turn += math.atan2(math.sqrt(cx * cx + cy * cy + cz * cz), x * x0 + y * y0 + z * z0)
        x0, y0, z0 = x, y, z
    return turn


@njit_inline
def constraint_tensions(m: int, d: int, model: Model, data: Data, kinds: Kinds, tensions: Pointer) -> None:
    """Add the forces of limits and equalities along tendons, N, by the solver's last forces."""
    kind, which, force = integers(d, data.efc_type), integers(d, data.efc_id), numbers(d, data.efc_force)
    couples, first, second = integers(m, model.eq_type), integers(m, model.eq_obj1id), integers(m, model.eq_obj2id)
    for r in range(integer(d, data.nefc)):
        if kind[r] == kinds.limit_tendon:
            tensions[which[r]] += abs(force[r])
        elif kind[r] == kinds.equality and couples[which[r]] == kinds.eq_tendon:
            tensions[first[which[r]]] += abs(force[r])
            if second[which[r]] >= 0:
                tensions[second[which[r]]] += abs(force[r])


@njit_inline
def contact_loads(
    m: int, d: int, model: Model, data: Data, contact: Contact, kinds: Kinds, place: Pointer, act: Pointer
) -> None:
    """Add the contact forces on bodies beyond joints, world frame, N: ``place`` is the index in act, or 0."""
    first = size(d, data.contact)
    parent, carrier = integers(m, model.body_parentid), integers(m, model.geom_bodyid)
    joints, count = integers(m, model.body_jntadr), integers(m, model.body_jntnum)
    for c in range(integer(d, data.ncon)):
        address = first + c * contact.size
        row, geoms = integers_at(address + contact.efc_address)[0], integers_at(address + contact.geom)
        if row < 0:
            continue
        x, y, z = _contact_force(d, data, contact, kinds, address, row)
        for side in range(2):
            sign, body = 2.0 * side - 1.0, carrier[geoms[side]] if geoms[side] >= 0 else 0
            while body > 0:
                for j in range(joints[body], joints[body] + count[body]):
                    index = int(place[j])
                    if index > 0:
                        act[index] += sign * x
                        act[index + 1] += sign * y
                        act[index + 2] += sign * z
                body = parent[body]


@njit_inline
def _contact_force(
    d: int, data: Data, contact: Contact, kinds: Kinds, address: int, row: int
) -> tuple[float, float, float]:
    """Return the force of a contact on its second geom, world frame, N."""
    exerted, frame = numbers(d, data.efc_force), numbers_at(address + contact.frame)
    dim, kind = integers_at(address + contact.dim)[0], integer_in(d, data.efc_type, row)
    normal, across, along = exerted[row], 0.0, 0.0
    if kind == kinds.elliptic:
        across, along = exerted[row + 1], exerted[row + 2] if dim > 2 else 0.0
    elif kind == kinds.pyramidal:
        friction = numbers_at(address + contact.friction)
        for k in range(1, 2 * (dim - 1)):
            normal += exerted[row + k]
        across = friction[0] * (exerted[row] - exerted[row + 1])
        along = friction[1] * (exerted[row + 2] - exerted[row + 3]) if dim > 2 else 0.0
    return (
        normal * frame[0] + across * frame[3] + along * frame[6],
        normal * frame[1] + across * frame[4] + along * frame[7],
        normal * frame[2] + across * frame[5] + along * frame[8],
    )
