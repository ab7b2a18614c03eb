"""A Radau IIA method for a linear equation, by sweeps over its nodes, compiled.

The method couples all nodes (Hairer and Wanner, Solving Ordinary Differential Equations II, 1996, IV.5). Sweeps take
one after the other instead, each implicit in itself alone (spectral deferred corrections); with a triangular factor of
the method's matrix in place of it they converge whatever the stiffness (Weiser, "Faster SDC convergence on
non-equidistant grids by DIRK sweeps", BIT Numerical Mathematics 55, 2015).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.polynomial import Legendre

from finger_pin.core.evaluation.blocks import extent
from finger_pin.core.evaluation.rigid_body import solve_mass
from finger_pin.core.jit import call_at, copy, njit_always_inline, njit_inline, njit_reassociate, unpack
from finger_pin.core.model import MODEL
from finger_pin.core.stepping.events import rate_at

#: Numbers that are added at once: of so many, or of a multiple, arrays are quickest.
LANES = 4
_COUNT = 4
#: Nodes c, of a step: zeros of P_s - P_(s-1) on it.
NODES = np.sort(np.real((Legendre.basis(_COUNT, [0.0, 1.0]) - Legendre.basis(_COUNT - 1, [0.0, 1.0])).roots()))
_POWERS = np.arange(1, _COUNT + 1)
#: What integrates the polynomial through values at the nodes up to each, of the step.
MATRIX = (NODES[:, None] ** _POWERS / _POWERS) @ np.linalg.inv(np.vander(NODES, increasing=True))
#: What continues it to the begin.
BACK = np.linalg.inv(np.vander(NODES, increasing=True))[0]
#: What gives its slope at the end, by the share.
SLOPE = np.arange(_COUNT) @ np.linalg.inv(np.vander(NODES, increasing=True))


def _lower(matrix: Any) -> Any:
    """Return U^T of the factors L U of the transpose, without exchanges."""
    upper = matrix.T.copy()
    for c in range(len(upper)):
        upper[c + 1 :] -= np.outer(upper[c + 1 :, c] / upper[c, c], upper[c])
    return np.tril(upper.T)


#: The matrix that sweeps take for it.
SWEEP = _lower(MATRIX)
# What a state feels of a number at the least, of what the state that feels most does, each in its tolerances.
_UNFELT = 1e-4
# When sweeps end: changes of the last node, of what is allowed, as the rest adds up over intervals; or after so many.
_CLOSE, _MOST = 0.02, 12


@njit_always_inline
def node(col: Any, model: Any, a: int, time: float, h: float) -> Any:
    """Fill E and the resolvent at a node that is evaluated; false if it is singular."""
    size, wide = col.state.size, col.scale.size
    for k in range(col.changes.size):
        if col.changed[k] != 0 and not col.within[k]:
            rate_at(col.changed[k], time, col.state)
            other = unpack(col.changed[k], MODEL)
            for c in range(size):
                col.given[a, k * wide + c] = (other.rate[c] - model.rate[c]) / col.changes[k]
    call_at(model.linearise, col.model, time)
    if call_at(model.condense, col.model, 1.0 / (h * col.sweep[a, a])) == 0:
        return False
    _transpose(col, model.linear, col.resolvents[a])
    copy(model.rate, col.part)
    copy(model.work.torque, col.torque)
    for k in range(col.changes.size):
        if col.within[k]:
            _differ(col, model, k, time, col.given[a])
    return True


@njit_always_inline
def _differ(col: Any, model: Any, k: int, time: float, given: Any) -> None:
    """Fill E of a number that changes laws alone, after the evaluation without: bodies and inputs are as they were."""
    tables, work, change, first = model.tables, model.work, col.changes[k], k * col.scale.size
    size, width, moved = tables.parents.size, work.torque.size, work.acceleration
    call_at(model.exert, col.changed[k], time)
    for j in range(width):
        moved[j] = (work.torque[j] - col.torque[j]) / change
    solve_mass(tables, size, work, moved)
    for j in range(width):
        given[first + width + j] = moved[j] if j < size else moved[j] / tables.lumps[j - size]
        if tables.guided[j] >= 0:
            given[first + width + j] = 0.0
    for c in range(2 * width, model.rate.size):
        given[first + c] = (model.rate[c] - col.part[c]) / change


@njit_always_inline
def _transpose(col: Any, linear: Any, resolvent: Any) -> None:
    """Fill the resolvent of a condensed system, transposed."""
    blocks, solution, order, whole = linear.blocks, linear.solution, col.order, linear.mass.shape[0]
    if blocks.touches.size == 0:
        for i in range(order.size):
            for c in range(order.size):
                resolvent[c, i] = solution[i, c]
        return
    for i in range(order.size):
        for c in range(order.size):
            resolvent[c, i] = 0.0
    for index in range(blocks.awake_count[0]):
        i = 2 * whole + blocks.awake[index]
        resolvent[i, i] = linear.loose[blocks.awake[index]]
    for b in range(blocks.number[0]):
        width, wide = extent(blocks, b)
        for c in range(width):
            order[c] = blocks.coordinates[blocks.coordinate_start[b] + c]
            order[width + c] = whole + order[c]
        for c in range(wide - 1 - 2 * width):
            order[2 * width + c] = 2 * whole + blocks.states[blocks.state_start[b] + c]
        for i in range(wide - 1):
            for c in range(wide - 1):
                resolvent[order[c], order[i]] = solution[order[i], c]


@njit_inline
def add(weight: float, source: Any, out: Any) -> None:
    """Add a multiple of numbers, whose count is one of `LANES`, to others."""
    for i in range(out.size // LANES * LANES):
        out[i] += weight * source[i]


@njit_inline
def _product(source: Any, matrix: Any, out: Any) -> None:
    """Fill rows of numbers, one after the other, with other such rows times a matrix, all as wide as `LANES` lets."""
    wide, rows = matrix.shape[0] // LANES * LANES, out.size // matrix.shape[0]
    # Two rows and four columns at a time, so that the matrix and what is found are read and written less often.
    for k in range(0, rows - 1, 2):
        s, t = source[k * wide :], source[(k + 1) * wide :]
        one, two = out[k * wide :], out[(k + 1) * wide :]
        for c in range(wide):
            one[c], two[c] = 0.0, 0.0
        for j in range(0, wide, LANES):
            m0, m1, m2, m3 = matrix[j], matrix[j + 1], matrix[j + 2], matrix[j + 3]
            s0, s1, s2, s3, t0, t1, t2, t3 = s[j], s[j + 1], s[j + 2], s[j + 3], t[j], t[j + 1], t[j + 2], t[j + 3]
            for c in range(wide):
                one[c] += s0 * m0[c] + s1 * m1[c] + s2 * m2[c] + s3 * m3[c]
                two[c] += t0 * m0[c] + t1 * m1[c] + t2 * m2[c] + t3 * m3[c]
    if rows % 2 == 1:
        s, one = source[(rows - 1) * wide :], out[(rows - 1) * wide :]
        for c in range(wide):
            one[c] = 0.0
        for j in range(0, wide, LANES):
            m0, m1, m2, m3 = matrix[j], matrix[j + 1], matrix[j + 2], matrix[j + 3]
            s0, s1, s2, s3 = s[j], s[j + 1], s[j + 2], s[j + 3]
            for c in range(wide):
                one[c] += s0 * m0[c] + s1 * m1[c] + s2 * m2[c] + s3 * m3[c]


@njit_always_inline
def sweep(col: Any, h: float) -> None:
    """Improve S and its rates at all nodes in turn; S at the last one is ``found``."""
    nodes, known, rates, source = col.nodes.size, col.known, col.rates, col.source
    size = source.size // LANES * LANES
    for a in range(nodes):
        copy(col.derivative, known[a])
        for b in range(1, nodes):
            add(h * (col.matrix[a, b] - col.sweep[a, b]), rates[b], known[a])
    for a in range(nodes):
        g, row, given, rate = 1.0 / (h * col.sweep[a, a]), known[a], col.given[a], rates[a]
        for b in range(a):
            add(h * col.sweep[a, b], rates[b], row)
        for i in range(size):
            source[i] = g * row[i] + given[i]
        found = col.found if a == nodes - 1 else col.nodal[a]
        _product(source, col.resolvents[a], found)
        for i in range(size):
            rate[i] = g * (found[i] - row[i])


@njit_inline
def _weigh(col: Any, now: Any) -> None:
    """Fill the weights of states: one over the largest of each so far and now."""
    wide = col.scale.size
    for k in range(col.changes.size):
        most_felt, at = 0.0, k * wide
        for c in range(wide):
            most_felt = max(most_felt, max(col.largest[at + c], abs(now[at + c])) / col.scale[c])
        for c in range(wide):
            least = max(_UNFELT * most_felt * col.scale[c], 1e-300)
            col.weight[at + c] = 1.0 / max(col.largest[at + c], abs(now[at + c]), least)


@njit_reassociate
def _distance(col: Any, one: Any, other: Any) -> Any:
    """Return the distance of S from another one, for the worst number: rms over states, each of its largest so far."""
    wide, most = col.scale.size // LANES * LANES, 0.0
    for k in range(col.changes.size):
        total = 0.0
        for i in range(k * wide, (k + 1) * wide):
            off = (one[i] - other[i]) * col.weight[i]
            total += off * off
        most = max(most, total)
    return np.sqrt(most / col.state.size)


@njit_always_inline
def relax(col: Any, h: float) -> None:
    """Solve for S at the nodes, from its rate at the begin and that rate's own."""
    for a in range(col.nodes.size):
        copy(col.rate, col.rates[a])
        add(col.nodes[a] * h, col.bend, col.rates[a])
    end = col.nodal[col.nodes.size - 1]
    for trial in range(_MOST):
        sweep(col, h)
        if trial == 0:
            _weigh(col, col.found)
        off = _distance(col, col.found, end)
        copy(col.found, end)
        if off <= _CLOSE * col.allowed:
            break


@njit_always_inline
def curvature(col: Any) -> Any:
    """Return the distance of S at the begin from the polynomial through the nodes alone."""
    col.found[:] = 0.0
    for a in range(col.nodes.size):
        add(col.back[a], col.nodal[a], col.found)
    _weigh(col, col.derivative)
    return _distance(col, col.derivative, col.found)
