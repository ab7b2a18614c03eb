"""A state that the compiled integrator carries forward, island by island; what a continued integration needs."""

from __future__ import annotations

import copy
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from finger_pin.core import rosenbrock as core
from finger_pin.core.binding import bound
from finger_pin.core.charts import Charts, place_all
from finger_pin.core.drives import Drives, advance_driven
from finger_pin.core.inputs import Control
from finger_pin.core.islands import Island, find_islands, select, select_control
from finger_pin.core.model import BoundModel
from finger_pin.core.tableaus import Tableau, rodas4, rodas5p
from finger_pin.core.tables import Tables, build_tables, build_work
from finger_pin.description.routing import Array
from finger_pin.laws.law import ContactLaw, Law
from finger_pin.mechanism.mechanism import Mechanism

TABLEAUS: dict[str, Callable[[], Tableau]] = {"Rodas5P": rodas5p, "Rodas4": rodas4}
_FIRST_STEP = 1e-6

_Item = TypeVar("_Item")
_Found = TypeVar("_Found")


@dataclass(frozen=True, eq=False)
class Record:
    """Room for the steps of one island, at most m.

    Attributes:
        times: Ends of the steps, shape (m,), s.
        states: States there, before the angles of free bodies begin anew, shape (m, size).
        attitudes: Quaternions after that, shape (m, f, 4).
        dense: What the steps' interpolants are made of, shape (m, rows, size).
    """

    times: Array
    states: Array
    attitudes: Array
    dense: Array

    @classmethod
    def of(cls, count: int, size: int, free: int, rows: int) -> Record:
        """Make room."""
        return cls(np.zeros(count), np.zeros((count, size)), np.zeros((count, free, 4)), np.zeros((count, rows, size)))

    def first(self, count: int) -> Record:
        """Return a copy of the first steps."""
        return Record(*(part[:count].copy() for part in vars(self).values()))


class Part:
    """One island under way.

    Attributes:
        island: What it has of the whole.
        tables: Its tables.
        control: Its inputs.
        tableau: The method.
        x: Its packed state, shape (size,); the angles of free bodies since the last step.
        attitude: Quaternions of its free bodies, shape (f, 4).
        atol: Absolute tolerances, shape (size,).
        memory: Time, step size, error history and counters.
        drives: Loops of motors in position drive, which sample on the way; None for none.
    """

    drives: Drives | None = None

    def __init__(
        self,
        island: Island,
        laws: Sequence[Law | ContactLaw],
        tables: Tables,
        control: Control,
        x: Array,
        attitude: Array,
        tableau: Tableau,
        rtol: float,
        atol: Array,
        memory: Array,
    ) -> None:
        """Bind everything; arrays are taken as they are, not copied."""
        self.island, self._laws = island, laws
        # The block holds addresses: what it was made of lives as long as it does, and is not replaced.
        self.work = build_work(tables, laws, len(control.tension))
        self.model = BoundModel(tables, control, self.work)
        self._bound = core.Integration(
            model=self.model.address,
            tableau=tableau,
            x=x,
            attitude=attitude,
            rtol=rtol,
            atol=atol,
            memory=memory,
            k=np.zeros((len(tableau.nodes), len(x))),
            start=np.zeros(len(x)),
            r=np.zeros(len(x) + 1),
            drift=np.zeros(len(x)),
            kinks=np.zeros(len(tables.state)),
        )
        self._block = bound(self._bound, core.INTEGRATION)
        place_all(tables, attitude)
        self.tables, self.control, self.tableau = tables, control, tableau
        self.x, self.attitude, self.atol, self.memory = x, attitude, atol, memory
        self._nothing = self.room(0)

    def room(self, count: int) -> Record:
        """Return room for so many steps."""
        return Record.of(count, len(self.x), len(self.attitude), len(self.tableau.dense))

    @property
    def time(self) -> float:
        """Time reached, s."""
        return float(self.memory[core.TIME])

    def advance(self, end: float, record: Record | None = None) -> tuple[int, int]:
        """Integrate to a time, or until a record is full; return the status and the number of recorded steps."""
        into = self._nothing if record is None else record
        room = (into.times, into.states, into.attitudes, into.dense)
        if self.drives is None:
            status, steps = core.advance(self._block, end, *room)
        else:
            status, steps = advance_driven(self._block, self.drives, end, *room)
        return status, steps

    def restart(self, x: Array, attitude: Array) -> None:
        """Go on from another state at the same time, with no memory of earlier steps."""
        self.x[:], self.attitude[:] = x, attitude
        self.work.paths.asleep[:] = 0
        place_all(self.tables, self.attitude)
        self.memory[[core.LAST_STEP, core.LAST_ERROR, core.CULPRIT, core.HELD_STEP]] = 0.0
        self.memory[core.STEP] = _FIRST_STEP

    def with_loads(self, loaded: bool) -> Part:
        """Return the same part that minds forces at the tips, or not."""
        bound = self._bound
        return Part(
            self.island,
            self._laws,
            self.tables._replace(loaded=loaded),
            self.control,
            bound.x,
            bound.attitude,
            bound.tableau,
            bound.rtol,
            bound.atol,
            bound.memory,
        )

    def copy(self) -> Part:
        """Return an independent part that goes on bit by bit alike."""
        bound = self._bound
        tables = self.tables._replace(tip_force=self.tables.tip_force.copy(), bodies=self.tables.bodies.copy())
        return Part(
            self.island,
            self._laws,
            tables,
            self.control._replace(tension=self.control.tension.copy()),
            bound.x.copy(),
            bound.attitude.copy(),
            bound.tableau,
            bound.rtol,
            bound.atol,
            bound.memory.copy(),
        )


class Stepper:
    """A mechanism under way.

    Attributes:
        mechanism: The mechanism.
        parts: Its islands.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        control: Control,
        x: Array,
        tableau: Tableau,
        rtol: float,
        atol: Array,
        force: Array | None = None,
        time: float = 0.0,
    ) -> None:
        """Start from a state.

        Args:
            mechanism: The mechanism.
            control: Its inputs.
            x: Packed state, shape (mechanism.size,).
            tableau: The method.
            rtol: Relative tolerance.
            atol: Absolute tolerances, shape (mechanism.size,); of a quaternion the first counts.
            force: At the tips, shape (3,) or (t, 3), N, base frame.
            time: When, s.
        """
        self.mechanism, self._charts = mechanism, Charts.of(mechanism)
        tables = build_tables(mechanism)
        tables.tip_force[:] = 0.0 if force is None else force
        tolerances = np.asarray(atol, dtype=float)[self._charts.packed_places(np.arange(self._charts.size))]
        start, attitude = self._charts.to_core(np.asarray(x, dtype=float))
        laws = [table.law for table in mechanism.rows]
        self._width = mechanism.coordinates
        islands = find_islands(tables, control)
        self.parts: list[Part] = []
        for island in islands:
            whole = len(islands) == 1
            own = tables if whole else select(tables, island)
            inputs = control if whole else select_control(control, island)
            # An island that nothing pushes computes as it does alone.
            own = own._replace(loaded=bool(len(inputs.force.harmonics) or np.any(own.tip_force)))
            memory = np.zeros(core.MEMORY_SIZE)
            memory[[core.TIME, core.STEP]] = time, _FIRST_STEP
            at = self._places(island)
            free = np.isin(tables.charts, island.coordinates)
            self.parts.append(
                Part(
                    island,
                    laws if whole else [laws[g] for g in _groups_of(tables, island)],
                    own,
                    inputs,
                    start[at].copy(),
                    attitude[free].copy(),
                    tableau,
                    float(rtol),
                    tolerances[at].copy(),
                    memory,
                )
            )
        self._free = [np.isin(tables.charts, island.coordinates) for island in islands]

    def _places(self, island: Island) -> NDArray[np.int64]:
        """Return where the numbers of an island stand in the state of the whole."""
        return np.concatenate([island.coordinates, self._width + island.coordinates, 2 * self._width + island.states])

    def places(self, island: Island) -> NDArray[np.int64]:
        """Return where the numbers of an island stand in a packed state."""
        return self._charts.packed_places(self._places(island))

    @property
    def driven(self) -> bool:
        """Whether loops of motors run."""
        return any(part.drives is not None for part in self.parts)

    @property
    def estimated_error(self) -> float:
        """Estimate of the error of the joints' angles so far, root mean square over joints and time, rad.

        The local errors are carried along the linearised flow. It is seldom below a third of the error, and
        often far above it.
        """
        sizes = [len(part.tables.parents) for part in self.parts]
        total = sum(size * part.memory[core.DRIFT] for size, part in zip(sizes, self.parts, strict=True))
        return float(np.sqrt(total / (max(sum(sizes), 1) * self.time))) if self.time > 0.0 else 0.0

    @property
    def time(self) -> float:
        """Time that all have reached, s."""
        return min(part.time for part in self.parts)

    @property
    def x(self) -> Array:
        """The packed state, shape (mechanism.size,); a copy."""
        if len(self.parts) == 1 and not len(self.parts[0].attitude):
            return self.parts[0].x.copy()
        return self.joined([part.x for part in self.parts], [part.attitude for part in self.parts])

    def joined(self, states: list[Array], attitudes: list[Array]) -> Array:
        """Return packed states of the whole from those of the islands, shapes (..., size) and (..., f, 4)."""
        lead = states[0].shape[:-1]
        whole = np.zeros((*lead, 2 * self._width + self.mechanism.state_count))
        attitude = np.zeros((*lead, len(self._free[0]), 4))
        for part, state, own, free in zip(self.parts, states, attitudes, self._free, strict=True):
            whole[..., self._places(part.island)] = state
            attitude[..., free, :] = own
        return self._charts.to_packed(whole, attitude)

    def restart(self, x: Array) -> None:
        """Go on from another state at the same time, with no memory of earlier steps."""
        start, attitude = self._charts.to_core(np.asarray(x, dtype=float))
        for part, free in zip(self.parts, self._free, strict=True):
            part.restart(start[self._places(part.island)], attitude[free])

    def drive(self, drives: Drives) -> None:
        """Let loops of motors run from now on, in every island those of its rotors; what they do they share."""
        for part in self.parts:
            motors = np.flatnonzero(np.isin(drives.places, part.island.coordinates))
            if len(motors):
                part.drives = drives._replace(
                    motors=motors,
                    places=np.searchsorted(part.island.coordinates, drives.places),
                    channels=np.searchsorted(part.island.channels, drives.channels),
                    taken=np.zeros(1, dtype=np.int64),
                )

    def hold(self, inputs: Array) -> None:
        """Hold inputs from now on, shape (channels,); but voltages are those of loops that run."""
        for part in self.parts:
            running = part.drives
            driven = np.zeros(0, dtype=np.int64) if running is None else running.channels[running.motors]
            voltages = part.control.tension[driven]
            part.control.tension[:] = inputs[part.island.channels]
            part.control.tension[driven] = voltages

    def load(self, force: Array) -> None:
        """Set the forces at the tips, shape (3,) or (t, 3), N, base frame."""
        forces = np.broadcast_to(force, (len(self.mechanism.body.tips), 3))
        for index, part in enumerate(self.parts):
            part.tables.tip_force[:] = forces[part.island.tips]
            if np.any(part.tables.tip_force) and not part.tables.loaded:
                self.parts[index] = part.with_loads(True)

    def advance(self, end: float) -> int:
        """Integrate to a time; return the status of the first island that failed, else DONE."""
        if len(self.parts) == 1:
            return self.parts[0].advance(end)[0]
        return max(in_threads(lambda part: part.advance(end)[0], self.parts))

    def copy(self) -> Stepper:
        """Return an independent stepper that goes on bit by bit alike."""
        twin = copy.copy(self)
        twin.parts = [part.copy() for part in self.parts]
        return twin

    def failure(self, status: int, names: tuple[str, ...]) -> str:
        """Say what a status means, with a name for every number of the state; empty if nothing failed."""
        part = min(self.parts, key=lambda each: each.time)
        return failure(part, status, [names[at] for at in self.places(part.island)])


def failure(part: Part, status: int, names: list[str]) -> str:
    """Say what the status of an island means; empty if nothing failed."""
    culprit = names[max(int(part.memory[core.CULPRIT]), 0)]
    if status == core.UNDERFLOW:
        return f"the step size fell below the resolution of time; the error is largest in {culprit}"
    if status == core.CREEPING:
        return (
            f"the last {core.WINDOW} steps advanced by less than {core.LEAST_MEAN_STEP:g} s each; "
            f"the error is largest in {culprit}"
        )
    if status == core.NOT_FINITE:
        return f"the rate of {culprit} is not finite"
    if status == core.RUNAWAY:
        return f"{culprit} is beyond {core.FASTEST:g} rad/s (or m/s): the motion has left every physical range"
    return ""


def in_threads(task: Callable[[_Item], _Found], items: Sequence[_Item]) -> list[_Found]:
    """Do a task that holds no lock of Python for all items side by side; return what it returns in their order."""
    workers = min(len(items), len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 2)
    if workers < 2:
        return [task(item) for item in items]
    with ThreadPoolExecutor(workers) as pool:
        return list(pool.map(task, items))


def _groups_of(tables: Tables, island: Island) -> list[int]:
    return [
        g for g, (begin, end) in enumerate(tables.groups[:, :2]) if np.any((island.rows >= begin) & (island.rows < end))
    ]
