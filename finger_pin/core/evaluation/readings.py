"""Readings of states by rows, in the systems of `condensation`: the changes of these states are unknowns too."""

from __future__ import annotations

from finger_pin.core.evaluation.blocks import add_contact_gain, factorise, substitute
from finger_pin.core.jit import Vector, njit_always_inline, njit_inline
from finger_pin.core.tables.linear_systems import Linear
from finger_pin.core.tables.mechanism_parameters import Parameters
from finger_pin.core.tables.structure import Structure


@njit_inline
def add_readings(structure: Structure, parameters: Parameters, k: int, slope: float, wide: int, out: Vector) -> None:
    """Add a slope by a row's readings of states."""
    for e in range(structure.read_start[k], structure.read_start[k + 1]):
        out[wide + structure.read_place[structure.read_at[e]]] += slope * parameters.read_weight[e]


@njit_always_inline
def resolve_readings(structure: Structure, linear: Linear, b: int, width: int, wide: int) -> bool:
    """Solve for the changes of the states that rows of a block read, and put them into its gains; false if singular."""
    blocks, matrix, solved, reads = linear.blocks, linear.read_matrix, linear.read_gain, structure.read_states.size
    states, first = blocks.states[blocks.state_start[b] : blocks.state_start[b + 1]], linear.contact_state_gain.shape[0]
    # An array in place of numbers would take seconds to compile, for the text of an error that there cannot be.
    matrix[:, :] = 0.0
    for p in range(reads):
        matrix[p, p] = 1.0
    solved[:wide] = 0.0
    for s in states:
        p = structure.read_place[s]
        if p >= 0 and s < first:
            # States of contacts, which stand first, read no others.
            gain = linear.contact_state_gain[s]
            add_contact_gain(structure, blocks, structure.state_row[s], 1.0, gain, width, solved[:, p])
        elif p >= 0:
            state_gain = linear.state_gain[s - first]
            for c in range(reads):
                matrix[p, c] -= state_gain[wide + c]
            for c in range(wide):
                solved[c, p] = state_gain[c]
    if not factorise(matrix, reads, linear.read_pivots):
        return False
    for c in range(wide):
        substitute(matrix, reads, linear.read_pivots, solved[c])
    for p in range(reads):
        for s in states:
            for c in range(wide if s >= first else 0):
                linear.state_gain[s - first, c] += linear.state_gain[s - first, wide + p] * solved[c, p]
        for j in range(width):
            for c in range(wide):
                linear.force[j, c] += linear.force[j, wide + p] * solved[c, p]
    return True
