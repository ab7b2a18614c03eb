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
# Least frictionloss of a row, N: MuJoCo drops rows that have none.
_LEAST_LIMIT = 1e-12


@njit_inline
def write_rows(m: int, d: int, model: Model, data: Data, kinds: Kinds, rows: Pointer, dt: float) -> None:
    """Write the solver's rows: of islands their copies too, of a dual one the diagonal of its matrix."""
    width, ne, nefc = size(m, model.nv), integer(d, data.ne), integer(d, data.nefc)
    kind, which = integers(d, data.efc_type), integers(d, data.efc_id)
    aref, limits = numbers(d, data.efc_aref), numbers(d, data.efc_frictionloss)
    weight, resistance = numbers(d, data.efc_D), numbers(d, data.efc_R)
    islands = integer(d, data.nisland) > 0
    dual = integer(m, model.solver) == kinds.pgs or integer(m, model.noslip_iterations) > 0
    for r in range(ne, ne + integer(d, data.nf)):
        of_dof = kind[r] == kinds.friction_dof
        row = which[r] if of_dof else width + which[r]
        terms = TERMS * row
        if rows[terms + TERM.damp] == 0.0:
            continue
        speed = number_in(d, data.qvel, row) if of_dof else number_in(d, data.ten_velocity, which[r])
        old_resistance, row_weight = resistance[r], rows[terms + TERM.damp] * dt
        compliance = 1.0 / row_weight
        aref[r] = -speed / dt - compliance * rows[terms + TERM.pull]
        resistance[r], weight[r] = compliance, row_weight
        limits[r] = max(rows[terms + TERM.limit], _LEAST_LIMIT)
        if islands:
            s = integer_in(d, data.map_efc2iefc, r)
            numbers(d, data.iefc_R)[s], numbers(d, data.iefc_D)[s] = compliance, row_weight
            numbers(d, data.iefc_frictionloss)[s] = limits[r]
        if dual:
            numbers(d, data.efc_AR)[_diagonal(m, d, model, data, kinds, r, nefc)] += compliance - old_resistance


@njit_inline
def _diagonal(m: int, d: int, model: Model, data: Data, kinds: Kinds, r: int, nefc: int) -> int:
    """Return the address of a diagonal entry of the dual solver's matrix, in its dense or its sparse form."""
    storage = integer(m, model.jacobian)
    # As mj_isSparse: automatic is sparse from 60 degrees of freedom on.
    if storage == kinds.dense or (storage != kinds.sparse and size(m, model.nv) < 60):
        return r * (nefc + 1)
    k = integer_in(d, data.efc_AR_rowadr, r)
    while integer_in(d, data.efc_AR_colind, k) != r:
        k += 1
    return k


@njit_inline
def row_forces(m: int, d: int, model: Model, data: Data, kinds: Kinds, width: int, forces: Pointer) -> None:
    """Record the forces of the solver's rows of friction, by degree of freedom and tendon."""
    ne = integer(d, data.ne)
    for r in range(ne, ne + integer(d, data.nf)):
        row = integer_in(d, data.efc_id, r)
        row += 0 if integer_in(d, data.efc_type, r) == kinds.friction_dof else width
        forces[row] = -numbers(d, data.efc_force)[r]
