"""Exact derivatives of a mechanism's rate at a state, out of the linear systems that implicit methods solve."""

from __future__ import annotations

import numpy as np
import scipy.linalg

from finger_pin.core.evaluation.condensation import condense
from finger_pin.core.evaluation.dynamics import evaluate
from finger_pin.core.evaluation.linearisation import linearise
from finger_pin.core.signals.bound_models import BoundModel
from finger_pin.core.tables.inputs import held_control
from finger_pin.core.tables.linear_systems import Linear
from finger_pin.core.tables.mechanism_parameters import compile_mechanism
from finger_pin.exceptions import InputError
from finger_pin.mechanism.mechanism import Mechanism
from finger_pin.typing import Array

# g of the systems (g - J) u = r, 1/s, between slow and stiff rates: J is known to parts of 1e-16 of it.
_G = 1e4


def rate_derivatives(mechanism: Mechanism, x: Array, command: Array) -> tuple[Array, Array]:
    """Return the exact derivatives of the rate by state and inputs, shapes (n, n) and (n, u).

    At a kink, such as that of friction at rest, they are the mean of both sides.

    Args:
        mechanism: At rest as a whole, without free bodies, whose state has quaternions.
        x: Packed state, shape (n,).
        command: Inputs, shape (u,).

    Raises:
        InputError: If the derivatives are not finite at the state.
    """
    structure, parameters = compile_mechanism(mechanism)
    control = held_control(mechanism.channels, mechanism.coordinates)
    bound = BoundModel(structure, parameters, [table.law for table in mechanism.rows], control, mechanism.moved)
    bound.model.state[:], control.tension[:] = x, command
    evaluate(bound.address)
    linearise(bound.address)
    by_state, by_input = np.zeros((len(x), len(x))), np.zeros((len(x), len(command)))
    for k in range(len(command) or 1):
        # The input rises by 1 in a second: its derivative is that by time.
        control.by_time[:] = np.arange(len(command)) == k
        if not condense(bound.address, _G):
            raise InputError("state", "has a rate whose derivatives are not finite", x.tolist())
        by_state, by_time = _resolved(bound.model.linear)
        by_input[:, k : k + 1] = by_time[:, None]
    return by_state, by_input


def _resolved(linear: Linear) -> tuple[Array, Array]:
    """Return the Jacobian and the derivative by time of solutions (g - J)^-1 (r + f_t), block by block."""
    blocks, whole = linear.blocks, len(linear.mass)
    size = 2 * whole + len(blocks.loose)
    first, slips = len(linear.contact_state_gain), linear.contact_state_gain.shape[1] - 2 * whole
    jacobian, by_time = np.zeros((size, size)), np.zeros(size)
    # Of open contacts, each on its own.
    alone = 2 * whole + np.arange(len(blocks.loose))
    jacobian[alone, alone] = -blocks.loose
    for b in range(blocks.number[0]):
        begin, end = blocks.coordinate_start[b : b + 2]
        places, width = blocks.coordinates[begin:end], end - begin
        states = blocks.states[blocks.state_start[b] : blocks.state_start[b + 1]]
        at = np.concatenate([places, whole + places, 2 * whole + states])
        wide = len(at) + 1
        factors = linear.reduced[begin:end, :width].copy()
        np.fill_diagonal(factors, 1.0 / np.diag(factors))
        moving = scipy.linalg.lu_solve((factors, linear.pivots[begin:end]), linear.velocity[begin:end, :wide])
        moved = (np.eye(width, wide) + moving) / _G
        gain = np.zeros((len(states), wide))
        touching = int(np.count_nonzero(states < first))
        gain[touching:] = linear.state_gain[states[touching:] - first, :wide]
        for c, state in enumerate(states[:touching]):
            own = 2 * width + c - c % slips
            gain[c, : 2 * width] = linear.contact_state_gain[state, : 2 * width]
            gain[c, own : own + slips] = linear.contact_state_gain[state, 2 * width : 2 * width + slips]
        of_motion, gain[:, : 2 * width] = gain[:, : 2 * width].copy(), 0.0
        solution = np.concatenate([moved, moving, gain + of_motion @ np.concatenate([moved, moving])])
        inverse = np.linalg.inv(solution[:, :-1])
        jacobian[np.ix_(at, at)] = _G * np.eye(len(at)) - inverse
        by_time[at] = inverse @ solution[:, -1]
    return jacobian, by_time
