"""The solver's rows of friction: limits that are written, and forces that are read."""

from __future__ import annotations

from typing import NamedTuple

from finger_pin.core.jit import Pointer, njit_inline
from finger_pin.mujoco.layout import Data, Kinds, Model
from finger_pin.mujoco.memory import integer, integer_in, integers, number_in, numbers, size


class RowTerms(NamedTuple):
    """Places of the terms of a row of friction: F - x, c + b, and the most that it exerts."""

    pull: int
    damp: int
    limit: int


TERMS = len(RowTerms._fields)
TERM = RowTerms(*range(TERMS))
# What a row's frictionloss is at least, N: MuJoCo drops rows that have none.
_NOTHING = 1e-12


@njit_inline
def write_rows(m: int, d: int, at: Model, of: Data, kinds: Kinds, rows: Pointer, dt: float) -> None:
    """Write the solver's rows: of islands their copies too, of a dual one the diagonal of its matrix."""
    width, ne, nefc = size(m, at.nv), integer(d, of.ne), integer(d, of.nefc)
    kind, which = integers(d, of.efc_type), integers(d, of.efc_id)
    aref, most = numbers(d, of.efc_aref), numbers(d, of.efc_frictionloss)
    weight, resistance = numbers(d, of.efc_D), numbers(d, of.efc_R)
    islands = integer(d, of.nisland) > 0
    dual = integer(m, at.solver) == kinds.pgs or integer(m, at.noslip_iterations) > 0
    for r in range(ne, ne + integer(d, of.nf)):
        of_dof = kind[r] == kinds.friction_dof
        row = which[r] if of_dof else width + which[r]
        terms = TERMS * row
        if rows[terms + TERM.damp] == 0.0:
            continue
        speed = number_in(d, of.qvel, row) if of_dof else number_in(d, of.ten_velocity, which[r])
        before, stiff = resistance[r], rows[terms + TERM.damp] * dt
        compliance = 1.0 / stiff
        aref[r] = -speed / dt - compliance * rows[terms + TERM.pull]
        resistance[r], weight[r] = compliance, stiff
        most[r] = max(rows[terms + TERM.limit], _NOTHING)
        if islands:
            s = integer_in(d, of.map_efc2iefc, r)
            numbers(d, of.iefc_R)[s], numbers(d, of.iefc_D)[s] = compliance, stiff
            numbers(d, of.iefc_frictionloss)[s] = most[r]
        if dual:
            numbers(d, of.efc_AR)[_diagonal(m, d, at, of, kinds, r, nefc)] += compliance - before


@njit_inline
def _diagonal(m: int, d: int, at: Model, of: Data, kinds: Kinds, r: int, nefc: int) -> int:
    """Return the address of a diagonal entry of the dual solver's matrix, in its dense or its sparse form."""
    how = integer(m, at.jacobian)
    # As mj_isSparse: automatic is sparse from 60 degrees of freedom on.
    if how == kinds.dense or (how != kinds.sparse and size(m, at.nv) < 60):
        return r * (nefc + 1)
    k = integer_in(d, of.efc_AR_rowadr, r)
    while integer_in(d, of.efc_AR_colind, k) != r:
        k += 1
    return k


@njit_inline
def row_forces(m: int, d: int, at: Model, of: Data, kinds: Kinds, width: int, forces: Pointer) -> None:
    """Record the forces of the solver's rows of friction, by degree of freedom and tendon."""
    ne = integer(d, of.ne)
    for r in range(ne, ne + integer(d, of.nf)):
        row = integer_in(d, of.efc_id, r)
        row += 0 if integer_in(d, of.efc_type, r) == kinds.friction_dof else width
        forces[row] = -numbers(d, of.efc_force)[r]
