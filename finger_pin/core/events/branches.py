"""Rows frozen on one branch of their law during a step, so that its rates are smooth.

Those that bend with the sign of their speed are frozen here too; where they turn round, `reversals` says.
"""

from __future__ import annotations

import numpy as np

from finger_pin.core.addresses.law_code import ROW
from finger_pin.core.collision.broad_phase import record_start_gaps
from finger_pin.core.jit import CompiledFunction, Matrix, Vector, call_at, copy, njit_always_inline, njit_inline, unpack
from finger_pin.core.steps.error_norm import step_error
from finger_pin.core.steps.integration import INTEGRATION, Integration
from finger_pin.core.steps.interpolation import cut_to_share, interpolate_share
from finger_pin.core.steps.tableaus import Tableau
from finger_pin.core.tables.buffers import Work
from finger_pin.core.tables.model import MODEL, Model
from finger_pin.core.tables.structure import Structure

# Derivations and origins: core/stepping/NOTES.md.
# Safety factor of the maximum step after an event, 1: a rejected step costs as much as the two in which it grows back.
_EVENT_STEP_SAFETY = 0.25
# Floor of the relative cost of an event, 1, so that nothing is divided by zero.
_MIN_EVENT_COST = 1e-300
# Greatest distance of a step's end behind the kink, in parts of the way to the kink.
_MAX_OVERSHOOT = 0.02
# Branch error at that end that is aimed at, in tolerances: half of what would be rejected.
_TARGET_BRANCH_ERROR = 0.5
# Ends that are tried, 1; without one the step is repeated shorter.
_MAX_END_TRIALS = 6


@CompiledFunction
def release(address: int, _time: float) -> int:
    """Let the branches of all rows follow the motion, or freeze them on the kinks of a repeated `Integration`."""
    integration = unpack(address, INTEGRATION)
    model = unpack(integration.model, MODEL)
    structure, rows, frozen = model.structure, model.work.rows, integration.memory.frozen[0] > 0.0
    for g in range(structure.groups.first.size):
        if structure.groups.kink[g] >= 0:
            for k in range(structure.groups.first[g], structure.groups.end[g]):
                rows[ROW.side, k] = np.sign(integration.kinks[k]) if frozen else 0.0
    return 1


@CompiledFunction
def freeze(address: int, _time: float) -> int:
    """Freeze all rows on the present branches of their laws, unless others are given, and record gaps."""
    integration = unpack(address, INTEGRATION)
    model = unpack(integration.model, MODEL)
    structure, parameters, rows, kinks = model.structure, model.parameters, model.work.rows, integration.kinks
    if integration.memory.frozen[0] == 0.0:
        for g in range(structure.groups.first.size):
            column = structure.groups.kink[g]
            if column >= 0:
                for k in range(structure.groups.first[g], structure.groups.end[g]):
                    kinks[k] = rows[column, k]
                    rows[ROW.side, k] = np.sign(kinks[k])
    integration.memory.counted[0] = integration.x.size
    if structure.contact_rows:
        paths = model.work.paths
        # Else a tolerance would mean less, the more bodies might touch.
        open_contacts = structure.contact_rows // structure.contact_arms - paths.closed_count[0]
        integration.memory.counted[0] -= open_contacts * (structure.contact_arms - 1)
        record_start_gaps(parameters, paths)
    return 1


@njit_inline
def _leaving_share(rows: Matrix, kinks: Vector, column: int, begin: int, end: int) -> float:
    """Return the earliest share of a step at which one of some rows leaves its branch, infinity for none."""
    share = np.inf
    for k in range(begin, end):
        nearer = kinks[k] - rows[column, k]
        if kinks[k] * nearer > 0.0:
            share = min(share, kinks[k] / nearer)
    return share


@njit_inline
def leaving_share(structure: Structure, work: Work, kinks: Vector) -> float:
    """Return the earliest share of a step at which a frozen row leaves its branch, above 1 if none has.

    It is taken to go on at its mean rate. Contacts that are culled stay on theirs.
    """
    share, pieces = np.inf, work.paths
    for g in range(structure.groups.first.size):
        column, begin, end = structure.groups.kink[g], structure.groups.first[g], structure.groups.end[g]
        if column <= ROW.speed:
            continue
        if begin >= structure.contact_rows:
            share = min(share, _leaving_share(work.rows, kinks, column, begin, end))
            continue
        for index in range(pieces.active_pair_count[0]):
            k = structure.paths.row[pieces.active_pairs[index]]
            if begin <= k < end:
                share = min(share, _leaving_share(work.rows, kinks, column, k, k + structure.contact_arms))
    return share


@CompiledFunction
def left(address: int, _time: float) -> int:
    """Return 1 if a frozen row of an `Integration`'s model has left its branch, else 0."""
    integration = unpack(address, INTEGRATION)
    model = unpack(integration.model, MODEL)
    return 1 if left_share(model.structure, model.work, integration.kinks) < 1.0 else 0


@njit_inline
def left_share(structure: Structure, work: Work, kinks: Vector) -> float:
    """Return the least share of the step after which a frozen row has left its branch, 1 if none has."""
    return min(1.0, leaving_share(structure, work, kinks))


@njit_inline
def switch_left_branches(structure: Structure, rows: Matrix, kinks: Vector) -> None:
    """Switch the branch of the frozen rows that have left theirs."""
    for g in range(structure.groups.first.size):
        column = structure.groups.kink[g]
        if column > ROW.speed:
            for k in range(structure.groups.first[g], structure.groups.end[g]):
                if kinks[k] * rows[column, k] < 0.0:
                    rows[ROW.side, k] = -rows[ROW.side, k]


@njit_inline
def branch_error(integration: Integration, model: Model, time: float, h: float) -> float:
    """Return the error of rows frozen on a branch already left, in tolerances."""
    structure, rows, kinks, size = model.structure, model.work.rows, integration.kinks, integration.x.size
    r = integration.r
    call_at(model.evaluate, integration.model, time)
    switch_left_branches(structure, rows, kinks)
    for c in range(size):
        r[c] = model.rate[c]
    call_at(model.evaluate, integration.model, time)
    switch_left_branches(structure, rows, kinks)
    for c in range(size):
        r[c] = h * (model.rate[c] - r[c])
    return step_error(integration, model.state, r)


@njit_always_inline
def max_step_after_event(h: float, share: float, cost: float, rtol: float, tableau: Tableau) -> float:
    """Return the maximum step size after a branch change, s.

    Stiff methods damp what they are too long for, and both of a pair alike: of a vibration of y radians in a step the
    difference is at most radian y^order, and falls again as 1 / y. An impact would be swallowed. So the step has a
    share of those radians by which the difference is the tolerance; one of more would be rejected if the difference
    told. The jump of the rates, `cost` over the step, has grown over its last 1 - share. Growing on, it adds
    cost (t / h)^2 / (2 (1 - share)) tolerances; an impact, which turns a speed back, y^2 / 2 of that speed, and so at
    most y^2 / (2 rtol) tolerances. Of a slower one the difference tells, but for speeds of a few tolerances.
    """
    radians = _EVENT_STEP_SAFETY * (rtol / tableau.radian) ** (1.0 / tableau.order)
    return h * radians * np.sqrt((1.0 - share) / max(rtol * cost, _MIN_EVENT_COST))


@njit_always_inline
def midpoint_violation(integration: Integration, model: Model, time: float, h: float) -> float:
    """Return the share of a step after which a row has left its branch at too great an error, else 1.

    A row that is back at the end would not be seen there.
    """
    x, state, end = integration.x, model.state, integration.end
    copy(state, end)
    interpolate_share(x, end, integration.dense, 0.5, state)
    call_at(model.evaluate, integration.model, time + 0.5 * h)
    share = left_share(model.structure, model.work, integration.kinks)
    if share < 1.0 and branch_error(integration, model, time + 0.5 * h, h) <= 1.0:
        share = 1.0
    copy(end, state)
    call_at(model.evaluate, integration.model, time + h)
    return share if share == 1.0 else 0.5 * share


@njit_always_inline
def locate_event(
    integration: Integration, model: Model, time: float, h: float, share: float, cost: float
) -> tuple[float, float, float, int]:
    """End a step a little behind the first branch change, at the interpolant's state.

    Args:
        integration: The integration; its states are those of the step's start.
        model: The model; its state is that of the step's end.
        time: Of the start, s.
        h: Length of the step that was tried, s.
        share: Of it after which a row leaves its side, if it does so at a constant rate.
        cost: At the end, as from `branch_error`.

    Returns:
        The share that is taken, 1 if no end was found; the share of that after which the row has left its side; the
        cost; and the number of evaluations.
    """
    x, state, end, count = integration.x, model.state, integration.end, 0
    copy(state, end)
    low, behind = 0.0, min(_MAX_OVERSHOOT * share, _TARGET_BRANCH_ERROR * (1.0 - share) / cost)
    at = share + behind
    for _ in range(_MAX_END_TRIALS):
        interpolate_share(x, end, integration.dense, at, state)
        call_at(model.evaluate, integration.model, time + at * h)
        count += 1
        share = leaving_share(model.structure, model.work, integration.kinks)
        if share < 1.0:
            count += 2
            cost = branch_error(integration, model, time + at * h, at * h)
            if cost <= 1.0:
                copy(end, state)
                cut_to_share(integration, state, at)
                return at, share, cost, count
            behind = min(behind, _TARGET_BRANCH_ERROR * (1.0 - share) * at / cost)
        else:
            low = at
        at = min(max(low, share * at) + behind, 1.0)
    copy(end, state)
    call_at(model.evaluate, integration.model, time + h)
    return 1.0, share, cost, count + 1
