"""What a map over a period works with, and evaluations with one number changed."""

from __future__ import annotations

from typing import NamedTuple

from finger_pin.core.addresses.law_code import ROW
from finger_pin.core.evaluation.dynamics import evaluate_rows
from finger_pin.core.jit import (
    IndexTable,
    Indices,
    Layers,
    Matrix,
    StructType,
    Vector,
    call_at,
    copy,
    copy_matrix,
    njit_inline,
    unpack,
)
from finger_pin.core.signals.state_batches import exert_alone
from finger_pin.core.tables.mechanism_parameters import Parameters
from finger_pin.core.tables.model import MODEL, Model


class PeriodArgs(NamedTuple):
    """Arguments of `advance_period` for n states, u inputs, t tips and p parameters; m = u + 3 t + p.

    Attributes:
        advance: Address of the function that advances an integration.
        args: Address of its `AdvanceArgs`, with room for one step.
        exact: Whether J and b of a step's middle and end act as well.
        plain: Address of a `Model` of the same inputs and forces, for evaluations alone.
        varied: Addresses of such models with one parameter changed each, shape (p,).
        derivatives: Filled: of the state at the end by that at the start and what is held, shape (n, n + m).
        held: Memory, b, shape (n, m).
        inverse: Memory, W, shape (n, n).
        terms: Memory for D_(k-1) and D_k, shape (2 n, n + m).
        weights: Memory, c_k from c_0 = 1 on, shape (6,).
        right: Memory, shape (n + 1,).
        start, state: Memory, the state at a step's start and where derivatives are asked for, shape (n,).
        gradient: Memory, of a kink by the state and what is held, shape (n + m,).
        steps: By how much each number of the state, and of what is held, is changed for differences, shape (n + m,).
        row_ranges: Group, first row and last + 1 of rows that a number of what is held changes, shape (r, 3).
        range_start: The first of these of each number, shape (m + 1,); none of one that changes more than rows.
        plain_rows: Memory, the table of rows with nothing changed, shape (columns, K).
        weights_of_rows: Weights of forces and inputs of the rows in the signals that are watched, shape (2, K, k).
        watched: Filled by `fill_watched`: these signals at the state, shape (k,).
        slopes: Filled by it: their derivatives by the state and what is held, shape (k, n + m).
        bristles: Places of bristles in the state, their rows, and columns of the rows' levels, shape (b, 3).
        levels: Filled by `limit_bristles`: their levels, infinite for all other numbers of the state, shape (n,).
    """

    advance: int
    args: int
    exact: bool
    plain: int
    varied: Indices
    derivatives: Matrix
    held: Matrix
    inverse: Matrix
    terms: Matrix
    weights: Vector
    right: Vector
    start: Vector
    state: Vector
    gradient: Vector
    steps: Vector
    row_ranges: IndexTable
    range_start: Indices
    plain_rows: Matrix
    weights_of_rows: Layers
    watched: Vector
    slopes: Matrix
    bristles: IndexTable
    levels: Vector


PERIOD_ARGS = StructType(PeriodArgs)


@njit_inline
def evaluate_plain(address: int, state: Vector, rates: bool) -> None:
    """Evaluate a model at a state, or its rows alone, which takes less."""
    model = unpack(address, MODEL)
    copy(state, model.state)
    if rates:
        call_at(model.evaluate, address, 0.0)
    else:
        copy(model.control.tension, model.work.command)
        exert_alone(model, address, 0.0)


@njit_inline
def evaluate_changed(period: PeriodArgs, state: Vector, column: int, rates: bool) -> int:
    """Evaluate with one number of the state, or of what is held, changed; return the address of the model that has."""
    plain, step = unpack(period.plain, MODEL), period.steps[column]
    inputs, forces = plain.control.tension, plain.parameters.tip_force
    for numbers in (state, inputs, forces.reshape(-1)):
        if column < numbers.size:
            value = numbers[column]
            numbers[column] = value + step
            evaluate_plain(period.plain, state, rates)
            numbers[column] = value
            return period.plain
        column -= numbers.size
    address = period.varied[column]
    evaluate_plain(address, state, rates)
    return address


@njit_inline
def is_of_rows(period: PeriodArgs, held: int) -> bool:
    """Return whether a number of what is held acts by some rows alone."""
    return period.range_start[held + 1] > period.range_start[held]


@njit_inline
def keep_rows(period: PeriodArgs, plain: Model) -> None:
    """Keep the table of rows after an evaluation with nothing changed."""
    copy_matrix(plain.work.rows, period.plain_rows)


@njit_inline
def held_parameters(period: PeriodArgs, plain: Model, held: int) -> Parameters:
    """Return the parameters with a number of what is held changed, the same for an input or a force."""
    first = plain.work.command.size + plain.parameters.tip_force.size
    return unpack(period.varied[held - first] if held >= first else period.plain, MODEL).parameters


@njit_inline
def change_rows(period: PeriodArgs, plain: Model, held: int) -> None:
    """Evaluate the rows that a number of what is held changes, after `keep_rows`, where it changes nothing else."""
    structure, work, command, before = plain.structure, plain.work, plain.work.command, plain.parameters
    rows, numbers, x, width = work.rows, held_parameters(period, plain, held), plain.state, work.torque.size
    value = command[held] if held < command.size else 0.0
    if held < command.size:
        command[held] = value + period.steps[x.size + held]
    for r in range(period.range_start[held], period.range_start[held + 1]):
        begin, end = period.row_ranges[r, 1], period.row_ranges[r, 2]
        for k in range(begin, end):
            for e in range(structure.arm_start[k], structure.arm_start[k + 1]):
                at = structure.arm_at[e]
                rows[ROW.length, k] += (numbers.measure[e] - before.measure[e]) * x[at]
                rows[ROW.speed, k] += (numbers.arm[e] - before.arm[e]) * x[width + at]
            rows[ROW.command, k] = command[structure.channel[k]] if structure.channel[k] >= 0 else 0.0
        evaluate_rows(structure, numbers, work, period.row_ranges[r, 0], begin, end)
    if held < command.size:
        command[held] = value


@njit_inline
def restore_rows(period: PeriodArgs, plain: Model, held: int) -> None:
    """Undo `change_rows`."""
    rows = plain.work.rows
    for r in range(period.range_start[held], period.range_start[held + 1]):
        for c in range(rows.shape[0]):
            for k in range(period.row_ranges[r, 1], period.row_ranges[r, 2]):
                rows[c, k] = period.plain_rows[c, k]
