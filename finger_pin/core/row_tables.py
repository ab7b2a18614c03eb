"""Rows of a mechanism as plain arrays: states, wiring, arms and energies."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from finger_pin.core.axes import along
from finger_pin.core.evaluation.law_code import addresses, kink_column
from finger_pin.core.jit import Indices
from finger_pin.laws.contact_law import CONTACT
from finger_pin.mechanism.mechanism import Mechanism
from finger_pin.mechanism.rows import Rows


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
    """Return the fields of `Tables` that say how rows are wired.

    Args:
        mechanism: Of K rows and N coordinates.
        routed: Where paths through space give arms to rows, shape (K, N).
    """
    count = len(routed)
    return {
        "energies": _energies(mechanism),
        **_of_states(mechanism, count),
        **_of_readings(mechanism),
        **_of_wiring(mechanism),
        **_of_arms(mechanism, routed),
    }


def _of_states(mechanism: Mechanism, count: int) -> dict[str, Any]:
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


def _of_readings(mechanism: Mechanism) -> dict[str, Any]:
    """Return the states that rows read."""
    starts, at, weights = [0], [np.zeros(0, dtype=np.int64)], [np.zeros(0)]
    states = {table.group: part for table, part in zip(mechanism.rows, mechanism.states, strict=True)}
    for table in mechanism.rows:
        for k in range(table.count):
            for group, matrix in table.readings.items():
                read = np.flatnonzero(matrix[k])
                at.append(states[group].start + read)
                weights.append(matrix[k, read])
            starts.append(sum(map(len, at)))
    read_at = np.concatenate(at)
    read_states, place = np.unique(read_at), np.full(mechanism.state_count, -1, dtype=np.int64)
    place[read_states] = np.arange(len(read_states))
    return {
        "read_start": np.array(starts, dtype=np.int64),
        "read_at": read_at,
        "read_row": np.repeat(np.arange(len(starts) - 1), np.diff(starts)),
        "read_weight": np.concatenate(weights),
        "read_states": read_states,
        "read_place": place,
    }


def _of_wiring(mechanism: Mechanism) -> dict[str, Any]:
    """Return the wiring of rows: inputs and loads by earlier ones, from outside, and as pins."""
    rows, ends = mechanism.rows, np.cumsum([0, *(table.count for table in mechanism.rows)])
    first_row = {table.group: int(begin) for table, begin in zip(rows, ends[:-1], strict=True)}
    first_body = [*(int(joint.idx_v) for joint in mechanism.body.model.joints[1:]), -1]
    terms: list[int] = []
    weights: list[float] = []
    starts: list[list[int]] = []
    for wiring in ("inputs", "loads"):
        starts.append([len(terms)])
        for table in rows:
            weighted = getattr(table, wiring)
            if not weighted:
                starts[-1] += [len(terms)] * table.count
                continue
            for k in range(table.count):
                for group, matrix in weighted.items():
                    sources = np.flatnonzero(matrix[k])
                    terms.extend(first_row[group] + sources)
                    weights.extend(matrix[k, sources])
                starts[-1].append(len(terms))
    channel = np.concatenate([np.zeros(0), *(table.channels for table in rows)]).astype(np.int64)
    return {
        "groups": _groups(rows, ends),
        "channel": channel,
        "input_rows": np.flatnonzero((channel >= 0) | (np.diff(starts[0]) > 0)),
        "input_start": np.array(starts[0], dtype=np.int64),
        "load_start": np.array(starts[1], dtype=np.int64),
        "terms": np.array(terms, dtype=np.int64),
        "weights": np.array(weights, dtype=float),
        "joint_pin": np.array([first_body[pin] for table in rows for pin in table.pins], dtype=np.int64),
    }


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


def _of_arms(mechanism: Mechanism, routed: NDArray[np.bool_]) -> dict[str, Any]:
    """Return the entries of arms, measures and bends that are not zero, or depend on paths."""
    rows, none = mechanism.rows, np.zeros((0, mechanism.coordinates))
    arm, measure, bends = (
        np.concatenate([none, *(getattr(table, name) for table in rows)]) for name in ("arm", "measure", "bends")
    )
    arm_start, arm_row, arm_at = _sparse((arm != 0.0) | (measure != 0.0) | routed)
    bend_start, bend_row, bend_at = _sparse((bends != 0.0) | routed)
    return {
        "offset": np.concatenate([np.zeros(0), *(table.offset for table in rows)]),
        "arm_start": arm_start,
        "arm_at": arm_at,
        "arm_row": arm_row,
        "arm": arm[arm_row, arm_at],
        "measure": measure[arm_row, arm_at],
        "bend_start": bend_start,
        "bend_at": bend_at,
        "bend_row": bend_row,
        "bend": bends[bend_row, bend_at],
        "curvature_offset": np.concatenate([np.zeros(0), *(table.curvature_offset for table in rows)]),
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
