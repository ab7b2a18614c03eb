"""Doors into the compiled core, whose inner functions have no Python face of their own."""

from typing import NamedTuple

from finger_pin.core.evaluation.condensation import solve
from finger_pin.core.evaluation.rigid_body import factorise_mass, inverse_dynamics, mass_matrix, move, solve_mass
from finger_pin.core.evaluation.rigid_body_derivatives import inverse_dynamics_derivatives
from finger_pin.core.jit import Kind, Matrix, Unit, Vector, bound_at, call, call_at
from finger_pin.core.model import MODEL
from finger_pin.core.stepping import error_norm
from finger_pin.core.tables import Tables
from finger_pin.core.work import Work


class Rigid(NamedTuple):
    tables: Tables
    q: Vector
    v: Vector
    a: Vector
    torque: Vector
    work: Work
    bias: Vector
    needed: Vector
    acceleration: Vector


RIGID = Kind(Rigid)


@Unit
def _rigid(address, _number):
    rigid = bound_at(address, RIGID)
    q, v, a, work, tables = rigid.q, rigid.v, rigid.a, rigid.work, rigid.tables
    move(tables, q, v, work)
    mass_matrix(tables, work)
    factorise_mass(tables, q.size, work)
    inverse_dynamics(tables, v, a, work, rigid.bias, False)
    for j in range(q.size):
        rigid.acceleration[j] = rigid.torque[j] - rigid.bias[j]
    solve_mass(tables, q.size, work, rigid.acceleration)
    inverse_dynamics(tables, v, a, work, rigid.needed, True)
    inverse_dynamics_derivatives(tables, v, work)
    return 1


def rigid(*arguments):
    """Fill C v + G, the torque that a needs and its derivatives, and the acceleration that a torque gives."""
    call(_rigid, Rigid(*arguments), RIGID)


class Errors(NamedTuple):
    x: Vector
    difference: Vector
    rtol: float
    atol: Vector


ERRORS = Kind(Errors)


@Unit
def _blamed(address, _number):
    errors = bound_at(address, ERRORS)
    return error_norm.worst(errors.x, errors.difference, errors.rtol, errors.atol)


def worst(*arguments):
    """Return the index of the state that a failure is blamed on."""
    return call(_blamed, Errors(*arguments), ERRORS)


class Condensed(NamedTuple):
    model: int
    time: float
    x: Vector
    g: float
    rate: Vector
    r: Vector
    columns: Matrix


CONDENSED = Kind(Condensed)


@Unit
def _condensed(address, _number):
    condensed = bound_at(address, CONDENSED)
    model, x, r = bound_at(condensed.model, MODEL), condensed.x, condensed.r
    for c in range(x.size):
        model.state[c] = x[c]
    call_at(model.evaluate, condensed.model, condensed.time)
    for c in range(x.size):
        condensed.rate[c] = model.rate[c]
    call_at(model.linearise, condensed.model, condensed.time)
    solved = call_at(model.condense, condensed.model, condensed.g)
    for c in range(r.size):
        r[c] = 1.0
        solve(model.linear, r, condensed.columns[c])
        r[c] = 0.0
    return solved


def condensed(*arguments):
    """Fill the state rate, and the solutions of (g - J) u = r for unit vectors r; return false if there are none."""
    return call(_condensed, Condensed(*arguments), CONDENSED) == 1
