"""Islands: parts of a mechanism that nothing couples, which are integrated apart.

Coordinates are coupled by inertia (one tree), by a row that acts on or measures both, by a load or an input that one
row has from another, and by a controller that reads both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from finger_pin.core.control import PLANNED, Control
from finger_pin.core.evaluation.time_functions import SignalTable
from finger_pin.core.jit import indices
from finger_pin.core.path_tables import select_paths
from finger_pin.core.tables import Tables

Indices = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Island:
    """Indices of what an island has of the whole, in the order of the whole."""

    coordinates: Indices
    rows: Indices
    states: Indices
    channels: Indices
    planned: Indices
    tips: Indices


def find_islands(tables: Tables, control: Control, touching: bool = True) -> list[Island]:
    """Return the islands of a mechanism under its inputs: of what may touch, or of what is joined without contacts."""
    count, bodies = len(tables.state), len(tables.parents)
    width = bodies + len(tables.lumps)
    planned = len(control.minimum) if control.kind == PLANNED else 0
    channels = len(control.tension)
    # Nodes: coordinates, rows, controllers; a controller stands at the index of its first planned tension.
    row_at, loop_at = width, width + count
    links: list[tuple[Indices, Indices]] = []
    moved = np.flatnonzero(tables.parents >= 0)
    links.append((moved, tables.parents[moved]))
    for start, at in ((tables.arm_start, tables.arm_at), (tables.bend_start, tables.bend_at)):
        owners = np.repeat(np.arange(count), np.diff(start))
        kept = touching | (tables.touch[owners] == 0)
        links.append((row_at + owners[kept], at[kept]))
    for start in (tables.input_start, tables.load_start):
        owners = np.repeat(np.arange(count), np.diff(start))
        links.append((row_at + owners, row_at + tables.terms[start[0] : start[-1]]))
    if planned:
        tensions, read = np.nonzero(_reads(control))
        links.append((loop_at + control.loop[tensions], read))
        loop_of = np.full(channels, -1)
        driven = control.channel >= 0
        loop_of[control.channel[driven]] = control.loop[driven]
        wired = np.flatnonzero((tables.channel >= 0) & (loop_of[tables.channel] >= 0))
        links.append((row_at + wired, loop_at + loop_of[tables.channel[wired]]))
    first, second = (np.concatenate(side) for side in zip(*links, strict=True))
    total = loop_at + (int(control.loop.max(initial=-1)) + 1 if planned else 0)
    labels = _connected(first, second, total)
    found: list[Island] = []
    unread = np.setdiff1d(np.arange(channels), tables.channel)
    for label in dict.fromkeys(labels[:width].tolist()):
        rows = np.flatnonzero(labels[row_at:loop_at] == label)
        fed = tables.channel[rows]
        states = tables.state[rows]
        found.append(
            Island(
                coordinates=np.flatnonzero(labels[:width] == label),
                rows=rows,
                states=states[states >= 0],
                # What nobody reads is the first one's.
                channels=np.union1d(fed[fed >= 0], unread if not found else []).astype(np.int64),
                planned=np.flatnonzero(labels[loop_at + control.loop] == label)
                if planned
                else np.zeros(0, dtype=np.int64),
                tips=np.flatnonzero((tables.tip_body >= 0) & (labels[tables.tip_body] == label) if bodies else []),
            )
        )
    return found


def wiring(tables: Tables, control: Control) -> bytes:
    """Return what islands and all memory follow from, besides sizes: whatever is wired alike differs in numbers."""
    wires = (control.loop, control.channel, _reads(control))
    return b"".join([indices(tables), *(each.tobytes() for each in wires)])


def _reads(control: Control) -> NDArray[np.bool_]:
    """Return which coordinates every planned tension depends on, shape (T, N)."""
    return np.asarray((control.inverse != 0.0) & ((control.gain != 0.0) | (control.damping != 0.0)))


def select(tables: Tables, island: Island) -> Tables:
    """Return the tables of an island."""
    coordinates, rows = island.coordinates, island.rows
    size = len(tables.parents)
    bodies, lumps = coordinates[coordinates < size], coordinates[coordinates >= size]
    body = _renumbered(bodies, size)
    row = _renumbered(rows, len(tables.state))
    channel = _renumbered(island.channels, int(np.concatenate([tables.channel, island.channels, [0]]).max()) + 1)
    charts = np.isin(tables.charts, bodies)
    present, groups = _groups(tables, rows)
    state = tables.state[rows]
    state[state >= 0] = np.arange(np.count_nonzero(state >= 0))
    coordinate = _renumbered(coordinates, size + len(tables.lumps))
    input_start, inputs = _entries(tables.input_start, rows)
    load_start, loads = _entries(tables.load_start, rows)
    arm_start, arms = _entries(tables.arm_start, rows)
    bend_start, bends = _entries(tables.bend_start, rows)
    terms = np.concatenate([inputs, loads])
    return tables._replace(
        parents=_mapped(body, tables.parents[bodies]),
        roots=body[tables.roots[bodies]],
        kinds=tables.kinds[bodies],
        bodies=tables.bodies[bodies],
        charts=body[tables.charts[charts]],
        chart_frames=tables.chart_frames[charts],
        guided=tables.guided[coordinates],
        lumps=tables.lumps[lumps - size],
        tip_body=_mapped(body, tables.tip_body[island.tips]),
        tip_offset=tables.tip_offset[island.tips],
        tip_force=tables.tip_force[island.tips],
        carriers=_mapped(body, tables.carriers[bodies]),
        directions=tables.directions[bodies],
        groups=groups,
        laws=tables.laws[present],
        books=tables.books[present],
        parameters=np.ascontiguousarray(tables.parameters[:, rows]),
        offset=tables.offset[rows],
        arm_start=arm_start,
        arm_at=coordinate[tables.arm_at[arms]],
        arm_row=row[tables.arm_row[arms]],
        arm=tables.arm[arms],
        measure=tables.measure[arms],
        state=state,
        state_row=row[tables.state_row[island.states]],
        touch=tables.touch[rows],
        touching=int(np.count_nonzero(tables.touch[rows])),
        channel=_mapped(channel, tables.channel[rows]),
        fed_row=row[np.intersect1d(tables.fed_row, rows)],
        input_start=input_start,
        load_start=len(inputs) + load_start,
        terms=row[tables.terms[terms]],
        weights=tables.weights[terms],
        pins=_mapped(body, tables.pins[rows]),
        carried=np.ascontiguousarray(tables.carried[np.ix_(island.tips, bodies)]),
        bend_start=bend_start,
        bend_at=coordinate[tables.bend_at[bends]],
        bend_row=row[tables.bend_row[bends]],
        bend=tables.bend[bends],
        curvature_offset=tables.curvature_offset[rows],
        paths=select_paths(tables.paths, rows, bodies, lambda old: _mapped(body, old), _entries),
    )


def _groups(tables: Tables, rows: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the groups that some rows belong to, and their entries where these rows stand one after the other."""
    counts = np.array([np.isin(rows, np.arange(*group[:2])).sum() for group in tables.groups], dtype=np.int64)
    present = np.flatnonzero(counts)
    ends = np.cumsum([0, *counts[present]])
    return present, np.column_stack([ends[:-1], ends[1:], tables.groups[present, 2:]])


def select_control(control: Control, island: Island) -> Control:
    """Return the inputs of an island."""
    coordinates, planned, channels = island.coordinates, island.planned, island.channels
    loops = np.unique(control.loop[planned])
    channel = _renumbered(channels, len(control.tension))
    return control._replace(
        tension=control.tension[channels],
        gain=control.gain[coordinates],
        minimum=control.minimum[planned],
        inverse=np.ascontiguousarray(control.inverse[np.ix_(planned, coordinates)]),
        internal=control.internal[planned],
        loop=np.searchsorted(loops, control.loop[planned]),
        channel=_mapped(channel, control.channel[planned]),
        coupling=np.ascontiguousarray(control.coupling[coordinates]),
        offset=control.offset[coordinates],
        schedule=_chosen(control.schedule, channels),
        force=_chosen(control.force, (3 * island.tips[:, None] + np.arange(3)).ravel()),
        damping=control.damping[coordinates],
        desired=np.zeros(len(coordinates)),
        rate=np.zeros(len(coordinates)),
        acceleration=np.zeros(len(coordinates)),
        planned=np.zeros(len(planned)),
        active=np.zeros(len(loops), dtype=np.int64),
        level=np.zeros(len(loops)),
        base=np.zeros(len(control.base)),
        slope=np.zeros(len(control.slope)),
        by_position=np.zeros((len(channels), len(coordinates))),
        by_velocity=np.zeros((len(channels), len(coordinates))),
        by_time=np.zeros(len(channels)),
    )


def _chosen(signal: SignalTable, functions: Indices) -> SignalTable:
    """Return some functions of a signal; none of none."""
    if not len(signal.harmonics):
        return signal
    coefficients = np.ascontiguousarray(signal.coefficients[:, :, functions])
    return SignalTable(signal.harmonics[functions], signal.knots, coefficients)


def _connected(first: Indices, second: Indices, count: int) -> Indices:
    """Return for each of some nodes the least one that links lead to."""
    labels = np.arange(count)
    while True:
        before = labels.copy()
        least = np.minimum(labels[first], labels[second])
        np.minimum.at(labels, first, least)
        np.minimum.at(labels, second, least)
        labels = labels[labels]
        if np.array_equal(labels, before):
            return labels


def _entries(start: Indices, rows: Indices) -> tuple[Indices, Indices]:
    """Return the starts of some rows' entries among themselves, and the entries' places."""
    kept = np.concatenate([np.zeros(0, dtype=np.int64), *(np.arange(start[k], start[k + 1]) for k in rows)])
    return np.append(0, np.cumsum(np.diff(start)[rows])), kept


def _renumbered(kept: Indices, size: int) -> Indices:
    """Return the new index of every old one, -1 where it is not kept."""
    new = np.full(size, -1, dtype=np.int64)
    new[kept] = np.arange(len(kept))
    return new


def _mapped(new: Indices, old: Indices) -> Indices:
    """Return new indices, with -1 as it was."""
    return np.where(old >= 0, new[old], -1) if len(new) else np.full(len(old), -1, dtype=np.int64)
