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

from finger_pin.core.evaluation.condensation import solve
from finger_pin.core.jit import bound_at, call_at, compiled, compiled_within, copy_matrix
from finger_pin.core.model import MODEL
from finger_pin.core.stepping.events import rate_at

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


@compiled_within
def node(col: Any, model: Any, a: int, time: float, h: float) -> Any:
    """Fill E and the resolvent at a node that is evaluated; false if it is singular."""
    count, size = col.derivative.shape
    for k in range(count):
        if col.changed[k] != 0:
            rate_at(col.changed[k], time, col.state)
            other = bound_at(col.changed[k], MODEL)
            for c in range(size):
                col.given[a, k, c] = (other.rate[c] - model.rate[c]) / col.changes[k]
    call_at(model.linearise, col.model, time)
    if call_at(model.condense, col.model, 1.0 / (h * col.sweep[a, a])) == 0:
        return False
    resolvent = col.resolvents[a]
    if model.linear.blocks.touches.size == 0:
        for i in range(size):
            for c in range(size):
                resolvent[c, i] = model.linear.solution[i, c]
        return True
    for c in range(size + 1):
        col.right[c] = 0.0
    for c in range(size):
        col.right[c] = 1.0
        solve(model.linear, col.right, resolvent[c])
        col.right[c] = 0.0
    return True


@compiled_within
def sweep(col: Any, h: float) -> Any:
    """Improve S and its rates at all nodes in turn; return the correction of S at the last one."""
    count, size = col.derivative.shape
    nodes, known, source, off = col.nodes.size, col.known, col.source, 0.0
    for a in range(nodes):
        for k in range(count):
            row, first = known[a, k], col.derivative[k]
            for c in range(size):
                row[c] = first[c]
            for b in range(1, nodes):
                weight, rate = h * (col.matrix[a, b] - col.sweep[a, b]), col.rates[b, k]
                for c in range(size):
                    row[c] += weight * rate[c]
    for a in range(nodes):
        g, resolvent = 1.0 / (h * col.sweep[a, a]), col.resolvents[a]
        for k in range(count):
            row, given, found, rate = known[a, k], col.given[a, k], col.found[k], col.rates[a, k]
            for b in range(a):
                weight, earlier = h * col.sweep[a, b], col.rates[b, k]
                for c in range(size):
                    row[c] += weight * earlier[c]
            for c in range(size):
                source[c], found[c] = g * row[c] + given[c], 0.0
            # Two columns at a time, so that what is found is read and written half as often.
            for j in range(0, size - 1, 2):
                one, two, first, second = source[j], source[j + 1], resolvent[j], resolvent[j + 1]
                for c in range(size):
                    found[c] += one * first[c] + two * second[c]
            if size % 2 == 1:
                for c in range(size):
                    found[c] += source[size - 1] * resolvent[size - 1, c]
            for c in range(size):
                rate[c] = g * (found[c] - row[c])
        if a == nodes - 1:
            off = distance(col, col.found, col.nodal[a])
        copy_matrix(col.found, col.nodal[a])
    return off


@compiled
def distance(col: Any, one: Any, other: Any) -> Any:
    """Return the distance of S from another one, for the worst number: rms over states, each of its largest so far."""
    count, size = one.shape
    most = 0.0
    for k in range(count):
        total, most_felt, largest = 0.0, 0.0, col.largest[k]
        for c in range(size):
            most_felt = max(most_felt, largest[c] / col.scale[c], abs(one[k, c]) / col.scale[c])
        for c in range(size):
            felt = max(largest[c], abs(one[k, c]), _UNFELT * most_felt * col.scale[c], 1e-300)
            total += ((one[k, c] - other[k, c]) / felt) ** 2
        most = max(most, total)
    return np.sqrt(most / size)


@compiled_within
def relax(col: Any, h: float) -> None:
    """Solve for S at the nodes, from its rate at the begin and that rate's own."""
    for a in range(col.nodes.size):
        ahead, rates = col.nodes[a] * h, col.rates[a]
        for k in range(rates.shape[0]):
            for c in range(rates.shape[1]):
                rates[k, c] = col.rate[k, c] + ahead * col.bend[k, c]
    for _ in range(_MOST):
        if sweep(col, h) <= _CLOSE * col.allowed:
            break


@compiled_within
def curvature(col: Any) -> Any:
    """Return the distance of S at the begin from the polynomial through the nodes alone."""
    for k in range(col.found.shape[0]):
        for c in range(col.found.shape[1]):
            value = 0.0
            for a in range(col.nodes.size):
                value += col.back[a] * col.nodal[a, k, c]
            col.found[k, c] = value
    return distance(col, col.derivative, col.found)
