"""Islands: uncoupled parts of a mechanism, integrated separately.

Coordinates are coupled by inertia (one tree), by a row that acts on or measures both, by a load or an input that one
row has from another, and by a controller that reads both. Every row, state and tip belongs to exactly one island.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from finger_pin.core.axes import Subset
from finger_pin.core.evaluation.time_functions import SignalTable
from finger_pin.core.inputs import PLANNED, InputTable
from finger_pin.core.jit import indices
from finger_pin.core.row_tables import Groups
from finger_pin.core.tables import Tables
from finger_pin.description.caching import memoised

Indices = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Island:
    """The indices of an island in the whole mechanism, in order."""

    coordinates: Indices
    rows: Indices
    states: Indices
    channels: Indices
    planned: Indices
    tips: Indices


def _reads(control: InputTable) -> NDArray[np.bool_]:
    """Return a mask of the coordinates that every planned tension depends on, shape (T, N)."""
    return np.asarray((control.inverse != 0.0) & ((control.gain != 0.0) | (control.damping != 0.0)))


def _wires(tables: Tables, control: InputTable, *more: bool) -> tuple[object, ...]:
    """Return all that islands depend on."""
    wires = indices(tables), control.loop.tobytes(), control.channel.tobytes(), _reads(control).tobytes()
    arrays = tables.parents, tables.lumps, tables.state, control.tension, control.minimum
    return (*wires, control.kind, *map(len, arrays), *more)


@memoised(_wires)
def find_islands(tables: Tables, control: InputTable, touching: bool = True) -> list[Island]:
    """Return the islands of a mechanism under its inputs, coupled by possible contacts or apart from them."""
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
    links.append((row_at + tables.read_row, row_at + tables.state_row[tables.read_at]))
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
    # What no coordinate feels, such as friction of a cord whose points all stand still, is the first one's.
    labels[~np.isin(labels, labels[:width])] = labels[0]
    islands: list[Island] = []
    unread = np.setdiff1d(np.arange(channels), tables.channel)
    for label in dict.fromkeys(labels[:width].tolist()):
        rows = np.flatnonzero(labels[row_at:loop_at] == label)
        fed = tables.channel[rows]
        states = tables.state[rows]
        islands.append(
            Island(
                coordinates=np.flatnonzero(labels[:width] == label),
                rows=rows,
                states=np.sort(states[states >= 0]),
                # What nobody reads is the first one's.
                channels=np.union1d(fed[fed >= 0], unread if not islands else []).astype(np.int64),
                planned=np.flatnonzero(labels[loop_at + control.loop] == label)
                if planned
                else np.zeros(0, dtype=np.int64),
                tips=np.flatnonzero((tables.tip_body >= 0) & (labels[tables.tip_body] == label) if bodies else []),
            )
        )
    return islands


@dataclass(frozen=True, eq=False)
class Selection:
    """The part of tables of one wiring that an island has.

    Attributes:
        island: Its indices in the whole.
        subset: Its places by axis; None where it is the whole.
        groups: Its groups of rows, as in the tables.
        of_groups: Numbers of these groups among all.
        contact_rows: Number of rows of contacts.
    """

    island: Island
    subset: Subset | None
    groups: Groups
    of_groups: Indices
    contact_rows: int

    @classmethod
    def from_island(cls, tables: Tables, island: Island) -> Selection:
        """Return an island's part of tables."""
        rows, paths, size, width = island.rows, tables.paths, len(tables.parents), len(tables.prescribed)
        bodies, lumps = island.coordinates[island.coordinates < size], island.coordinates[island.coordinates >= size]
        counts = np.diff(np.searchsorted(rows, np.append(tables.groups.first, len(tables.state))))
        present = np.flatnonzero(counts)
        ends = np.cumsum([0, *counts[present]])
        part = Subset()
        part.keep("coordinate", island.coordinates, width)
        part.keep("body", bodies, size)
        part.keep("lump", lumps - size, width - size)
        part.keep("chart", np.flatnonzero(np.isin(tables.charts, bodies)), len(tables.charts))
        part.keep("tip", island.tips, len(tables.tip_body))
        part.keep("row", rows, len(tables.state))
        part.keep("group", present, len(counts))
        part.keep("state", island.states, len(tables.state_row))
        part.keep("input row", np.flatnonzero(np.isin(tables.input_rows, rows)), len(tables.input_rows))
        part.keep("channel", island.channels, 1 + max(tables.channel.max(initial=-1), island.channels.max(initial=-1)))
        read = tables.read_states
        part.keep("read state", np.flatnonzero(np.isin(read, island.states)), len(read))
        for entries in ("arm", "bend", "term", "reading"):
            part.keep_entries(tables, entries)
        part.keep("path", np.flatnonzero(np.isin(paths.rows, rows)), len(paths.rows))
        part.keep_entries(paths, "leg")
        part.keep("piece", np.unique(paths.piece[part.kept["leg"]]), len(paths.columns))
        part.keep_entries(paths, "mover")
        groups = part.select(tables.groups)._replace(first=ends[:-1], end=ends[1:])
        return cls(island, part, groups, present, int(np.count_nonzero(tables.touch[rows])))

    def tables(self, tables: Tables) -> Tables:
        """Return the tables of the island."""
        part = self.subset
        if part is None:
            return tables
        island_tables = part.select(tables)
        return island_tables._replace(
            groups=self.groups, contact_rows=self.contact_rows, paths=part.select(tables.paths)
        )

    def control(self, control: InputTable) -> InputTable:
        """Return the inputs of the island."""
        island = self.island
        if self.subset is None:
            return control
        part = Subset()
        part.keep("coordinate", island.coordinates, len(control.gain))
        part.keep("channel", island.channels, len(control.tension))
        part.keep("planned", island.planned, len(control.minimum))
        part.keep("loop", np.unique(control.loop[island.planned]), len(control.level))
        schedule = _chosen(control.schedule, island.channels)
        force = _chosen(control.force, (3 * island.tips[:, None] + np.arange(3)).ravel())
        return part.select(control)._replace(schedule=schedule, force=force)


@memoised(_wires)
def selections(tables: Tables, control: InputTable) -> list[Selection]:
    """Return the rows and states of every island; remembered for equal wiring."""
    islands = find_islands(tables, control)
    states = np.sort(np.concatenate([each.states for each in islands]))
    if not np.array_equal(states, np.arange(len(tables.state_row))):
        raise RuntimeError(f"islands have the states {states.tolist()} of {len(tables.state_row)}")
    if len(islands) == 1:
        return [Selection(islands[0], None, tables.groups, np.arange(len(tables.groups.first)), tables.contact_rows)]
    return [Selection.from_island(tables, island) for island in islands]


def _chosen(signal: SignalTable, functions: Indices) -> SignalTable:
    """Return some functions of a signal, which may have none."""
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
