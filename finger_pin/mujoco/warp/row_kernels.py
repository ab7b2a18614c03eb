"""Kernels of the solver's rows of friction: limits that are written, and forces that are read."""

import mujoco
import warp as wp

from finger_pin.exchange.mujoco_friction import PIN
from finger_pin.mujoco.warp import kernel_functions
from finger_pin.mujoco.warp.structures import MEMORY, SIGNAL, TERM, ForceInputs, RowInputs, State, Table

wp.set_module_options({"enable_backward": False})

_PIN = wp.constant(PIN)
_types = mujoco.mjtConstraint
_FRICTION_DOF, _FRICTION_TENDON = (
    wp.constant(int(each)) for each in (_types.mjCNSTR_FRICTION_DOF, _types.mjCNSTR_FRICTION_TENDON)
)
_EQUALITY, _LIMIT_TENDON = (wp.constant(int(each)) for each in (_types.mjCNSTR_EQUALITY, _types.mjCNSTR_LIMIT_TENDON))
_ELLIPTIC, _LEAST_CONTACT = (
    wp.constant(int(each)) for each in (_types.mjCNSTR_CONTACT_ELLIPTIC, _types.mjCNSTR_CONTACT_FRICTIONLESS)
)
_EQ_TENDON = wp.constant(int(mujoco.mjtEq.mjEQ_TENDON))


@wp.kernel
def write_rows(t: Table, s: State, x: RowInputs) -> None:
    """Write the solver's rows, which may be in another order at every step."""
    w, i = wp.tid()
    r = x.ne[w] + i
    if i >= x.nf[w] or r >= x.njmax:
        return
    element, speed = int(x.id[w, r]), float(0.0)
    if x.type[w, r] == _FRICTION_DOF:
        speed = x.qvel[w, element]
    elif x.type[w, r] == _FRICTION_TENDON:
        speed = x.ten_velocity[w, element]
        element += x.nv
    else:
        return
    row = t.row_of[element]
    if row < 0:
        return
    pull, damp, limit = float(0.0), float(0.0), float(0.0)
    for k in range(t.sharing_first[row], t.sharing_first[row + 1]):
        f = t.sharing[k]
        pull += s.terms[w, f, TERM.pull]
        damp += s.terms[w, f, TERM.damp]
        limit += s.terms[w, f, TERM.limit]
    dt = x.timestep[w % x.timestep.shape[0]]
    s.address[w, row] = r
    x.D[w, r] = damp * dt
    x.aref[w, r] = -speed / dt - pull / (damp * dt)
    x.frictionloss[w, r] = limit


@wp.func
def _limits_and_equalities(w: int, tendon: int, end: int, x: ForceInputs) -> float:
    """Return the forces of limits and equalities along a tendon, N."""
    tension = float(0.0)
    for r in range(end):
        i = x.id[w, r]
        if x.type[w, r] == _LIMIT_TENDON and i == tendon:
            tension += wp.abs(x.force[w, r])
        elif x.type[w, r] == _EQUALITY and x.eq_type[i] == _EQ_TENDON:
            if x.eq_obj1id[i] == tendon or x.eq_obj2id[i] == tendon:
                tension += wp.abs(x.force[w, r])
    return tension


@wp.kernel
def record(t: Table, s: State, x: ForceInputs) -> None:
    """Record the solver's force of each friction, and the next step's loads: limits, equalities and contacts."""
    w, f = wp.tid()
    row = s.address[w, t.row_of[t.row[f]]]
    s.signals[SIGNAL.force, w, f] = 0.0
    if row >= 0:
        s.signals[SIGNAL.force, w, f] = -x.force[w, row] / t.ratio[f]
    end = wp.min(x.nefc[w], x.njmax)
    if t.constrained[f] > 0:
        tendon = t.element[f]
        s.following[w, f, MEMORY.constraint_tension] = _limits_and_equalities(w, tendon, end, x)
    if t.kind[f] != _PIN:
        return
    contact_load = wp.vec3(0.0, 0.0, 0.0)
    for r in range(end):
        c = x.id[w, r]
        if x.type[w, r] >= _LEAST_CONTACT and x.efc_address[c, 0] == r:
            side, last = float(0.0), int(x.dim[c])
            if x.type[w, r] != _ELLIPTIC and x.dim[c] > 1:
                last = 2 * (x.dim[c] - 1)
            # A contact on both sides of the joint does not load its pin; one without all of its rows exerts nothing.
            for k in range(2):
                if x.geom[c][k] >= 0 and x.body_isdofancestor[x.geom_bodyid[x.geom[c][k]], t.row[f]] != 0:
                    side += 2.0 * float(k) - 1.0
            if side != 0.0 and x.efc_address[c, last - 1] >= 0:
                elliptic = x.type[w, r] == _ELLIPTIC
                contact_load += side * kernel_functions.contact_force(w, r, elliptic, x)
    for k in range(3):
        s.following[w, f, MEMORY.contact_x + k] = contact_load[k]
