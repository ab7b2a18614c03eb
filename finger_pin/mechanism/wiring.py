"""Wiring: which rows read the forces and states of which, and which drives pull which tendons."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from graphlib import CycleError, TopologicalSorter

import numpy as np

from finger_pin.exceptions import InputError
from finger_pin.mechanism.rows import Rows
from finger_pin.typing import Array


def sort_tables(tables: Sequence[Rows]) -> tuple[Rows, ...]:
    """Return tables sorted so that every force is evaluated before it is read, stable otherwise."""
    counts = {table.group: table.count for table in tables}
    if len(counts) < len(tables):
        names = [table.group for table in tables]
        raise InputError("rows", "two tables have this name; choose another", max(names, key=names.count))
    stateful = {table.group: table.count for table in tables if table.states == table.count}
    for table in tables:
        _check_wiring(table, counts, stateful)
    readers = {table.group: {*table.inputs, *table.loads} for table in tables}
    try:
        TopologicalSorter(readers).prepare()
    except CycleError as error:
        # In the circle each one is read by the next.
        circle = " reads ".join(reversed(error.args[1]))
        raise InputError("rows", f"no force may depend on itself: {circle}") from None
    left, ordered = list(tables), dict[str, Rows]()
    while left:
        table = next(table for table in left if readers[table.group] <= ordered.keys())
        left.remove(table)
        ordered[table.group] = table
    return tuple(ordered.values())


def replace_tables(tables: Sequence[Rows], replacements: Mapping[str, Callable[[Rows], Rows]]) -> list[Rows]:
    """Return tables with some in place of those of their groups."""
    names = [table.group for table in tables]
    for name in replacements:
        if name not in names:
            raise InputError("tables", f"no such table of rows; there are {', '.join(names)}", name)
    placed = [replacements[table.group](table) if table.group in replacements else table for table in tables]
    for new, old in zip(placed, tables, strict=True):
        if (new.group, new.names, new.states) != (old.group, old.names, old.states):
            raise InputError(f"tables.{old.group}", f"must have the group, names and states of {old.group}")
        for kind in ("parameters", "signals"):
            first = getattr(old.law, kind)
            if getattr(new.law, kind)[: len(first)] != first:
                raise InputError(f"tables.{old.group}.law.{kind}", f"must begin with {', '.join(first)}")
    return placed


def _check_wiring(table: Rows, every: Mapping[str, int], stateful: Mapping[str, int]) -> None:
    """Refuse a table that reads unknown forces or states, or with weights of the wrong shape.

    Args:
        table: The table.
        every: Counts of the rows of all tables, by name.
        stateful: Those of tables with a state in each row.
    """
    for wiring, counts in (("inputs", every), ("loads", every), ("readings", stateful)):
        for group, weights in getattr(table, wiring).items():
            entry, of_states = f"rows.{table.group}.{wiring}", " with a state in each row" * (wiring == "readings")
            if group not in counts:
                raise InputError(entry, f"no such table{of_states}; there are {', '.join(counts) or 'none'}", group)
            if np.shape(weights) != (table.count, counts[group]):
                allowed = f"must have shape {(table.count, counts[group])}, not {np.shape(weights)}"
                raise InputError(f"{entry}.{group}", allowed)


def drive_matrices(tables: Sequence[Rows], tendons: Sequence[str]) -> dict[str, Array]:
    """Return the weights with which the rows of drives pull t tendons, by table, shape (t, k)."""
    for table in tables:
        for name in table.pulls:
            if name not in tendons:
                allowed = f"no such tendon with a source of its own; there are {', '.join(tendons)}"
                raise InputError(f"rows.{table.group}.pulls", allowed, name)
    return {
        table.group: np.array([np.equal(name, table.pulls) for name in tendons], dtype=float).reshape(-1, table.count)
        for table in tables
        if table.pulls
    }
