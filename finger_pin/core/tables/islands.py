"""Islands: uncoupled parts of a mechanism, integrated separately.

Coordinates are coupled by inertia (one tree), by a row that acts on or measures both, by a load or an input that one
row has from another, and by a controller that reads both. Every row, state and tip belongs to exactly one island.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from finger_pin.core.addresses.time_functions import SignalTable
from finger_pin.core.tables.axes import Subset
from finger_pin.core.tables.inputs import PLANNED, InputTable
from finger_pin.core.tables.mechanism_parameters import Parameters
from finger_pin.core.tables.structure import Structure
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


def _read_coordinates(control: InputTable) -> NDArray[np.bool_]:
    """Return a mask of the coordinates that every planned tension depends on, shape (T, N)."""
    return np.asarray((control.inverse != 0.0) & ((control.gain != 0.0) | (control.damping != 0.0)))


def _island_key(structure: Structure, control: InputTable, *options: bool) -> tuple[object, ...]:
    """Return all that islands depend on."""
    wires = control.loop.tobytes(), control.channel.tobytes(), _read_coordinates(control).tobytes()
    return (structure, *wires, control.kind, len(control.tension), len(control.minimum), *options)


@memoised(_island_key)
def find_islands(structure: Structure, control: InputTable, touching: bool = True) -> list[Island]:
    """Return the islands of a mechanism under its inputs, coupled by possible contacts or apart from them."""
    count, bodies = len(structure.state), len(structure.parents)
    width = len(structure.prescribed)
    planned = len(control.minimum) if control.kind == PLANNED else 0
    channels = len(control.tension)
    # Nodes: coordinates, rows, controllers; a controller stands at the index of its first planned tension.
    row_at, loop_at = width, width + count
    links: list[tuple[Indices, Indices]] = []
    moved = np.flatnonzero(structure.parents >= 0)
    links.append((moved, structure.parents[moved]))
    for start, at in ((structure.arm_start, structure.arm_at), (structure.bend_start, structure.bend_at)):
        owners = np.repeat(np.arange(count), np.diff(start))
        coupling = touching | (structure.touch[owners] == 0)
        links.append((row_at + owners[coupling], at[coupling]))
    for start in (structure.input_start, structure.load_start):
        owners = np.repeat(np.arange(count), np.diff(start))
        links.append((row_at + owners, row_at + structure.terms[start[0] : start[-1]]))
    links.append((row_at + structure.read_row, row_at + structure.state_row[structure.read_at]))
    if planned:
        tensions, read = np.nonzero(_read_coordinates(control))
        links.append((loop_at + control.loop[tensions], read))
        loop_of = np.full(channels, -1)
        driven = control.channel >= 0
        loop_of[control.channel[driven]] = control.loop[driven]
        wired = np.flatnonzero((structure.channel >= 0) & (loop_of[structure.channel] >= 0))
        links.append((row_at + wired, loop_at + loop_of[structure.channel[wired]]))
    first, second = (np.concatenate(side) for side in zip(*links, strict=True))
    total = loop_at + (int(control.loop.max(initial=-1)) + 1 if planned else 0)
    labels = _connected(first, second, total)
    # What no coordinate feels, such as friction of a cord whose points all stand still, is the first one's.
    labels[~np.isin(labels, labels[:width])] = labels[0]
    islands: list[Island] = []
    unread = np.setdiff1d(np.arange(channels), structure.channel)
    for label in dict.fromkeys(labels[:width].tolist()):
        rows = np.flatnonzero(labels[row_at:loop_at] == label)
        channel = structure.channel[rows]
        states = structure.state[rows]
        islands.append(
            Island(
                coordinates=np.flatnonzero(labels[:width] == label),
                rows=rows,
                states=np.sort(states[states >= 0]),
                # What nobody reads is the first one's.
                channels=np.union1d(channel[channel >= 0], unread if not islands else []).astype(np.int64),
                planned=np.flatnonzero(labels[loop_at + control.loop] == label)
                if planned
                else np.zeros(0, dtype=np.int64),
                tips=np.flatnonzero(
                    (structure.tip_body >= 0) & (labels[structure.tip_body] == label) if bodies else []
                ),
            )
        )
    return islands


@dataclass(frozen=True, eq=False)
class Selection:
    """An island's part of the structure of a mechanism.

    Attributes:
        island: Its indices in the whole.
        subset: Its places by axis; None where it is the whole.
        structure: Its structure.
        groups: Numbers of its groups of rows among all.
        inputs: Its places by axis in the inputs; None where it is the whole.
    """

    island: Island
    subset: Subset | None
    structure: Structure
    groups: Indices
    inputs: Subset | None

    @classmethod
    def from_island(cls, structure: Structure, island: Island, control: InputTable) -> Selection:
        """Return an island's part of a structure under its inputs."""
        rows, paths, size, width = island.rows, structure.paths, len(structure.parents), len(structure.prescribed)
        bodies, lumps = island.coordinates[island.coordinates < size], island.coordinates[island.coordinates >= size]
        counts = np.diff(np.searchsorted(rows, np.append(structure.groups.first, len(structure.state))))
        present = np.flatnonzero(counts)
        ends = np.cumsum([0, *counts[present]])
        channels = 1 + max(structure.channel.max(initial=-1), island.channels.max(initial=-1))
        read = structure.read_states
        part = Subset()
        part.keep("coordinate", island.coordinates, width)
        part.keep("body", bodies, size)
        part.keep("lump", lumps - size, width - size)
        part.keep("chart", np.flatnonzero(np.isin(structure.charts, bodies)), len(structure.charts))
        part.keep("tip", island.tips, len(structure.tip_body))
        part.keep("row", rows, len(structure.state))
        part.keep("group", present, len(counts))
        part.keep("state", island.states, len(structure.state_row))
        part.keep("input row", np.flatnonzero(np.isin(structure.input_rows, rows)), len(structure.input_rows))
        part.keep("channel", island.channels, channels)
        part.keep("read state", np.flatnonzero(np.isin(read, island.states)), len(read))
        for entries in ("arm", "bend", "term", "reading"):
            part.keep_entries(structure, entries)
        part.keep("path", np.flatnonzero(np.isin(paths.rows, rows)), len(paths.rows))
        part.keep_entries(paths, "leg")
        part.keep("piece", np.unique(paths.piece[part.kept["leg"]]), len(paths.columns))
        part.keep_entries(paths, "mover")
        part.keep("pair", np.flatnonzero(np.isin(paths.pair_start[:-1], part.kept["piece"])), len(paths.pair_start) - 1)
        selected = part.select(structure)._replace(
            groups=part.select(structure.groups)._replace(first=ends[:-1], end=ends[1:]),
            contact_rows=int(np.count_nonzero(structure.touch[rows])),
            paths=part.select(paths),
        )
        inputs = Subset()
        inputs.keep("coordinate", island.coordinates, len(control.gain))
        inputs.keep("channel", island.channels, len(control.tension))
        inputs.keep("planned", island.planned, len(control.minimum))
        inputs.keep("loop", np.unique(control.loop[island.planned]), len(control.level))
        return cls(island, part, selected, present, inputs)

    def parameters(self, parameters: Parameters) -> Parameters:
        """Return the parameters of the island."""
        part = self.subset
        return parameters if part is None else part.select(parameters)._replace(paths=part.select(parameters.paths))

    def control(self, control: InputTable) -> InputTable:
        """Return the inputs of the island."""
        island = self.island
        if self.inputs is None:
            return control
        schedule = _chosen(control.schedule, island.channels)
        force = _chosen(control.force, (3 * island.tips[:, None] + np.arange(3)).ravel())
        return self.inputs.select(control)._replace(schedule=schedule, force=force)


@memoised(_island_key)
def selections(structure: Structure, control: InputTable) -> list[Selection]:
    """Return the islands of a mechanism under its inputs, with their structures."""
    islands = find_islands(structure, control)
    states = np.sort(np.concatenate([each.states for each in islands]))
    if not np.array_equal(states, np.arange(len(structure.state_row))):
        raise RuntimeError(f"islands have the states {states.tolist()} of {len(structure.state_row)}")
    if len(islands) == 1:
        return [Selection(islands[0], None, structure, np.arange(len(structure.groups.first)), None)]
    return [Selection.from_island(structure, island, control) for island in islands]


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
