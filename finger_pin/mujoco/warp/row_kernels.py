"""Kernels of the solver's rows of friction: limits that are written, and forces that are read."""

import mujoco
import warp as wp

from finger_pin.exchange import mujoco_friction as table
from finger_pin.mujoco.warp import functions
from finger_pin.mujoco.warp import structures as places
from finger_pin.mujoco.warp.structures import State, Table

wp.set_module_options({"enable_backward": False})

_PIN, _FORCE = wp.constant(table.PIN), wp.constant(table.FORCE)
_HELD, _CONTACT = wp.constant(places.HELD), wp.constant(places.CONTACT)
_PULL, _DAMP, _LIMIT = (wp.constant(each) for each in (places.PULL, places.DAMP, places.LIMIT))
_types = mujoco.mjtConstraint
_FRICTION_DOF, _FRICTION_TENDON = (
    wp.constant(int(each)) for each in (_types.mjCNSTR_FRICTION_DOF, _types.mjCNSTR_FRICTION_TENDON)
)
_EQUALITY, _LIMIT_TENDON = (wp.constant(int(each)) for each in (_types.mjCNSTR_EQUALITY, _types.mjCNSTR_LIMIT_TENDON))
_ELLIPTIC, _LEAST_CONTACT = (
    wp.constant(int(each)) for each in (_types.mjCNSTR_CONTACT_ELLIPTIC, _types.mjCNSTR_CONTACT_FRICTIONLESS)
)
_Vector5 = wp.types.vector(length=5, dtype=float)
_EQ_TENDON = wp.constant(int(mujoco.mjtEq.mjEQ_TENDON))


@wp.kernel
def write_rows(
    t: Table,
    s: State,
    nv: int,
    timestep: wp.array[float],
    qvel: wp.array2d[float],
    ten_velocity: wp.array2d[float],
    ne: wp.array[int],
    nf: wp.array[int],
    njmax: int,
    kind: wp.array2d[int],
    which: wp.array2d[int],
    weight: wp.array2d[float],
    reference: wp.array2d[float],
    most: wp.array2d[float],
) -> None:
    """Write the solver's rows, which may be in another order at every step."""
    w, i = wp.tid()
    r = ne[w] + i
    if i >= nf[w] or r >= njmax:
        return
    place, speed = int(which[w, r]), float(0.0)
    if kind[w, r] == _FRICTION_DOF:
        speed = qvel[w, place]
    elif kind[w, r] == _FRICTION_TENDON:
        speed = ten_velocity[w, place]
        place += nv
    else:
        return
    row = t.row_of[place]
    if row < 0:
        return
    pull, damp, limit = float(0.0), float(0.0), float(0.0)
    for k in range(t.sharing_first[row], t.sharing_first[row + 1]):
        f = t.sharing[k]
        pull += s.terms[w, f, _PULL]
        damp += s.terms[w, f, _DAMP]
        limit += s.terms[w, f, _LIMIT]
    dt = timestep[w % timestep.shape[0]]
    s.address[w, row] = r
    weight[w, r] = damp * dt
    reference[w, r] = -speed / dt - pull / (damp * dt)
    most[w, r] = limit


@wp.func
def _limits_and_equalities(
    w: int,
    tendon: int,
    end: int,
    kind: wp.array2d[int],
    which: wp.array2d[int],
    force: wp.array2d[float],
    eq_type: wp.array[int],
    eq_first: wp.array[int],
    eq_second: wp.array[int],
) -> float:
    """Return the forces of limits and equalities along a tendon, N."""
    found = float(0.0)
    for r in range(end):
        i = which[w, r]
        if kind[w, r] == _LIMIT_TENDON and i == tendon:
            found += wp.abs(force[w, r])
        elif kind[w, r] == _EQUALITY and eq_type[i] == _EQ_TENDON:
            if eq_first[i] == tendon or eq_second[i] == tendon:
                found += wp.abs(force[w, r])
    return found


@wp.kernel
def record(
    t: Table,
    s: State,
    nefc: wp.array[int],
    njmax: int,
    kind: wp.array2d[int],
    which: wp.array2d[int],
    force: wp.array2d[float],
    eq_type: wp.array[int],
    eq_first: wp.array[int],
    eq_second: wp.array[int],
    body_of: wp.array[int],
    moved: wp.array2d[int],
    dim: wp.array[int],
    geoms: wp.array[wp.vec2i],
    frame: wp.array[wp.mat33],
    friction: wp.array[_Vector5],
    address: wp.array2d[int],
) -> None:
    """Record the solver's force of each friction, and what its forces load next: limits, equalities and contacts."""
    w, f = wp.tid()
    row = s.address[w, t.row_of[t.row[f]]]
    s.signals[_FORCE, w, f] = 0.0
    if row >= 0:
        s.signals[_FORCE, w, f] = -force[w, row] / t.ratio[f]
    end = wp.min(nefc[w], njmax)
    if t.held[f] > 0:
        tendon = t.element[f]
        s.following[w, f, _HELD] = _limits_and_equalities(
            w, tendon, end, kind, which, force, eq_type, eq_first, eq_second
        )
    if t.kind[f] != _PIN:
        return
    found = wp.vec3(0.0, 0.0, 0.0)
    for r in range(end):
        c = which[w, r]
        if kind[w, r] >= _LEAST_CONTACT and address[c, 0] == r:
            side, last = float(0.0), int(dim[c])
            if kind[w, r] != _ELLIPTIC and dim[c] > 1:
                last = 2 * (dim[c] - 1)
            # A contact on both sides of the joint does not load its pin; one without all of its rows exerts nothing.
            for k in range(2):
                if geoms[c][k] >= 0 and moved[body_of[geoms[c][k]], t.row[f]] != 0:
                    side += 2.0 * float(k) - 1.0
            if side != 0.0 and address[c, last - 1] >= 0:
                elliptic = kind[w, r] == _ELLIPTIC
                found += side * functions.contact_force(
                    w, r, elliptic, dim[c], frame[c], friction[c][0], friction[c][1], force
                )
    for k in range(3):
        s.following[w, f, _CONTACT + k] = found[k]
