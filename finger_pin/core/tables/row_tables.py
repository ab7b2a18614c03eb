"""Rows of a mechanism as plain arrays: states, wiring, arms and energies."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from finger_pin.core.addresses.law_code import addresses, kink_column
from finger_pin.core.jit import Indices
from finger_pin.core.tables.axes import along
from finger_pin.laws.contact_law import CONTACT
from finger_pin.mechanism.mechanism import Mechanism
from finger_pin.mechanism.rows import Rows
from finger_pin.typing import Array


class Groups(NamedTuple):
    """G groups of rows, one for each table of the mechanism.

    Attributes:
        first: First row, shape (G,).
        end: Last row + 1, shape (G,).
        fed: 1 for rows with inputs from earlier rows, shape (G,).
        pressed: 1 for rows with loads, shape (G,).
        kink: Column of `ROW` by whose sign their law bends, -1 for none, shape (G,).
        value, slopes, account: Addresses of their law, shape (G,).
    """

    first: Annotated[Indices, along("group")]
    end: Annotated[Indices, along("group")]
    fed: Annotated[Indices, along("group")]
    pressed: Annotated[Indices, along("group")]
    kink: Annotated[Indices, along("group")]
    value: Annotated[Indices, along("group")]
    slopes: Annotated[Indices, along("group")]
    account: Annotated[Indices, along("group")]


def row_arrays(mechanism: Mechanism, routed: NDArray[np.bool_]) -> dict[str, Any]:
    """Return the fields of `Structure` that say how rows are wired.

    Args:
        mechanism: Of K rows and N coordinates.
        routed: Where paths through space give arms to rows, shape (K, N).
    """
    count = len(routed)
    return {
        "energies": _energies(mechanism),
        **_state_arrays(mechanism, count),
        **_reading_arrays(mechanism),
        **_wiring_arrays(mechanism),
        **_arm_arrays(mechanism, routed),
    }


def _state_arrays(mechanism: Mechanism, count: int) -> dict[str, Any]:
    """Return the states and contacts among the rows."""
    rows = mechanism.rows
    ends = np.cumsum([0, *(table.count for table in rows)])
    state, touch = np.full(count, -1, dtype=np.int64), np.zeros(count, dtype=np.int64)
    for table, places, begin, end in zip(rows, mechanism.states, ends[:-1], ends[1:], strict=True):
        stateful = np.arange(begin, end)
        if table.law.arms > 1:
            touch[begin:end] = 2
            touch[begin : end : table.law.arms] = 1
            stateful = stateful[touch[begin:end] == 2]
        if table.states:
            state[stateful] = np.arange(places.start, places.stop)
    return {
        "state": state,
        "state_row": np.flatnonzero(state >= 0)[np.argsort(state[state >= 0])],
        "touch": touch,
        "contact_rows": int(np.count_nonzero(touch)),
        "contact_arms": max([CONTACT.arms, *(table.law.arms for table in rows)]),
    }


def _reading_arrays(mechanism: Mechanism) -> dict[str, Any]:
    """Return the states that rows read."""
    first = {table.group: part.start for table, part in zip(mechanism.rows, mechanism.states, strict=True)}
    read_start, read_at = _sources(mechanism.rows, "readings", first)
    read_states, place = np.unique(read_at), np.full(mechanism.state_count, -1, dtype=np.int64)
    place[read_states] = np.arange(len(read_states))
    return {
        "read_start": read_start,
        "read_at": read_at,
        "read_row": np.repeat(np.arange(len(read_start) - 1), np.diff(read_start)),
        "read_states": read_states,
        "read_place": place,
    }


def _wiring_arrays(mechanism: Mechanism) -> dict[str, Any]:
    """Return the wiring of rows: inputs and loads by earlier ones, from outside, and as pins."""
    rows, ends = mechanism.rows, np.cumsum([0, *(table.count for table in mechanism.rows)])
    first = {table.group: int(begin) for table, begin in zip(rows, ends[:-1], strict=True)}
    first_body = [*(int(joint.idx_v) for joint in mechanism.body.model.joints[1:]), -1]
    (input_start, inputs), (load_start, loads) = (_sources(rows, wiring, first) for wiring in ("inputs", "loads"))
    channel = np.concatenate([np.zeros(0), *(table.channels for table in rows)]).astype(np.int64)
    return {
        "groups": _groups(rows, ends),
        "channel": channel,
        "input_rows": np.flatnonzero((channel >= 0) | (np.diff(input_start) > 0)),
        "input_start": input_start,
        "load_start": len(inputs) + load_start,
        "terms": np.concatenate([inputs, loads]),
        "joint_pin": np.array([first_body[pin] for table in rows for pin in table.pins], dtype=np.int64),
    }


def _weights(table: Rows, wiring: str) -> Array:
    """Return the weights of all that a table reads by some wiring, side by side, shape (k, sources)."""
    return np.hstack([np.zeros((table.count, 0)), *getattr(table, wiring).values()])


def _sources(
    rows: Sequence[Rows], wiring: str, first: Mapping[str, int]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the first term of each row's sum and the sources of all terms, from the first one of each group."""
    counts, at = [np.zeros(1, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    for table in rows:
        entries, columns = np.nonzero(_weights(table, wiring))
        places = [first[group] + np.arange(matrix.shape[1]) for group, matrix in getattr(table, wiring).items()]
        counts.append(np.bincount(entries, minlength=table.count))
        at.append(np.concatenate([at[0], *places])[columns])
    return np.cumsum(np.concatenate(counts)), np.concatenate(at)


def term_weights(rows: Sequence[Rows], wiring: str) -> Array:
    """Return the weights of the terms of all rows by some wiring, in the order of the terms of `Structure`."""
    weights = [_weights(table, wiring) for table in rows if getattr(table, wiring)]
    return np.concatenate([np.zeros(0), *(matrix[matrix != 0.0] for matrix in weights)])


def stacked(mechanism: Mechanism, name: str) -> Array:
    """Return a matrix of all rows by coordinates, shape (K, N): ``arm``, ``measure`` or ``bends``."""
    return np.concatenate([np.zeros((0, mechanism.coordinates)), *(getattr(table, name) for table in mechanism.rows)])


def _groups(rows: Sequence[Rows], ends: NDArray[np.int64]) -> Groups:
    """Return the groups of tables of rows, of which each ends where the next begins."""
    laws = [addresses(table.law) for table in rows]
    return Groups(
        first=ends[:-1],
        end=ends[1:],
        fed=_integers(bool(table.inputs) for table in rows),
        pressed=_integers(bool(table.loads) or np.any(table.pins >= 0) for table in rows),
        kink=_integers(kink_column(table.law) for table in rows),
        value=_integers(law.value for law in laws),
        slopes=_integers(law.slopes for law in laws),
        account=_integers(law.account for law in laws),
    )


def _integers(values: Iterable[Any]) -> NDArray[np.int64]:
    return np.fromiter(values, dtype=np.int64)


def _arm_arrays(mechanism: Mechanism, routed: NDArray[np.bool_]) -> dict[str, Any]:
    """Return the places of arms, measures and bends that are not zero, or depend on paths."""
    arm, measure, bends = (stacked(mechanism, name) for name in ("arm", "measure", "bends"))
    arm_start, arm_row, arm_at = _sparse((arm != 0.0) | (measure != 0.0) | routed)
    bend_start, bend_row, bend_at = _sparse((bends != 0.0) | routed)
    return {
        "arm_start": arm_start,
        "arm_at": arm_at,
        "arm_row": arm_row,
        "bend_start": bend_start,
        "bend_at": bend_at,
        "bend_row": bend_row,
    }


def _energies(mechanism: Mechanism) -> NDArray[np.int64]:
    stored, powers = ([each.name for each in one] for one in (mechanism.energies.stored, mechanism.energies.powers))
    wide = 1 + max((len(table.powers) for table in mechanism.rows), default=0)
    energies = np.full((len(mechanism.rows), wide), -1, dtype=np.int64)
    for row, table in zip(energies, mechanism.rows, strict=True):
        row[0] = stored.index(table.stored.name)
        row[1 : 1 + len(table.powers)] = [len(stored) + powers.index(each.name) for each in table.powers]
    return energies


def _sparse(wanted: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return the first entry of each row among those wanted, and the entries' rows and columns."""
    rows, columns = np.nonzero(wanted)
    return np.append(0, np.cumsum(wanted.sum(axis=1))), np.ascontiguousarray(rows), np.ascontiguousarray(columns)
