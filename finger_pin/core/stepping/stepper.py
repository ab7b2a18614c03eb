"""Integrator of a mechanism, one island at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from finger_pin.core.collision.broad_phase import activate_all
from finger_pin.core.evaluation.attitude_charts import Charts
from finger_pin.core.inputs import HELD, InputTable
from finger_pin.core.jit import alike, copied, fits, numbered, taken
from finger_pin.core.stepping import rosenbrock as core
from finger_pin.core.stepping.drives import Drives
from finger_pin.core.stepping.island_stepper import FIRST_STEP, IslandIntegrator, failure
from finger_pin.core.stepping.islands import Island, find_islands, groups_of, select, select_control, wiring
from finger_pin.core.stepping.repetition import Steps
from finger_pin.core.stepping.tableaus import Tableau, rodas4, rodas5p
from finger_pin.core.tables import Tables, build_tables
from finger_pin.core.threads import in_threads
from finger_pin.description.caching import memoised
from finger_pin.mechanism.mechanism import Mechanism
from finger_pin.typing import Array

#: Snapshot of every island: tip-force flag, drive loops, knots, state arrays.
Snapshot = list[tuple[bool, Drives | None, Array, tuple[Array, ...]]]

TABLEAUS: dict[str, Callable[[], Tableau]] = {"Rodas5P": rodas5p, "Rodas4": rodas4}

# Of mechanisms that are wired alike.

# As often the error that is carried along counts.
_TWICE = 2.0


class Stepper:
    """Integrator of a mechanism, one island at a time.

    Attributes:
        mechanism: The mechanism.
        parts: Its islands.
        estimate_error: Whether its error is estimated.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        control: InputTable,
        x: Array,
        tableau: Tableau,
        rtol: float,
        atol: Array,
        force: Array | None = None,
        time: float = 0.0,
        *,
        estimate_error: bool = True,
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
            estimate_error: Whether `estimated_error` will be asked for, which takes a tenth of the time.
        """
        self.estimate_error = estimate_error
        tables, laws = build_tables(mechanism), [table.law for table in mechanism.rows]
        self._charts, self._width, self._wiring = Charts.of(mechanism), mechanism.coordinates, wiring(tables, control)
        self._islands = _islands(self._wiring, tables, control)
        self._free = [np.isin(tables.charts, island.coordinates) for island in self._islands]
        self._made_of, self._tables = (mechanism, control, x, tableau, rtol, atol, force, time), self._selected(tables)
        self._whole, self._inputs = tables, self._selected_inputs(control)
        self.mechanism, self.parts = mechanism, list[IslandIntegrator]()
        for island, (own, inputs, start, attitude, tolerances) in zip(self._islands, self._begun(), strict=True):
            memory = np.zeros(len(core.StepMemory._fields))
            named = core.StepMemory.from_vector(memory)
            named.time[0], named.step_size[0] = time, FIRST_STEP
            followed = laws if len(self._islands) == 1 else [laws[g] for g in groups_of(tables, island)]
            given = copied(own), copied(inputs), start, attitude, tableau, float(rtol), tolerances, memory
            self.parts.append(IslandIntegrator(island, followed, *given, estimate_error))

    def renew(
        self,
        mechanism: Mechanism,
        control: InputTable,
        x: Array,
        tableau: Tableau,
        rtol: float,
        atol: Array,
        force: Array | None = None,
    ) -> bool:
        """Reset to new parameters and a new initial state; return False, unchanged, if the structure differs."""
        whole, (_, inputs, _, method, tolerance, *_) = self._whole, self._made_of
        tables = build_tables(mechanism)
        if method is not tableau or tolerance != rtol or not (fits(whole, tables) and fits(inputs, control)):
            return False
        driven_alike = alike(inputs, control, numbers=True)
        if not (driven_alike and alike(whole, tables)) and wiring(tables, control) != self._wiring:
            return False
        self._made_of = (mechanism, control, x, tableau, rtol, atol, force, 0.0)
        if mechanism is not self.mechanism:
            pairs = zip(self._tables, self._numbered, strict=True)
            self._tables = [tables] if len(self._islands) == 1 else [taken(*each, tables, whole) for each in pairs]
            self.mechanism, self._whole = mechanism, tables
        if not driven_alike:
            self._inputs = self._selected_inputs(control)
        for index, each in enumerate(self._begun()):
            if each[0].loaded != self.parts[index].tables.loaded:
                self.parts[index] = self.parts[index].with_loads(each[0].loaded)
            self.parts[index].renew(*each)
        return True

    def _selected(self, tables: Tables) -> list[Tables]:
        """Return the tables of every island."""
        return [tables] if len(self._islands) == 1 else [select(tables, island) for island in self._islands]

    def _selected_inputs(self, control: InputTable) -> list[InputTable]:
        """Return the inputs of every island."""
        alone = len(self._islands) == 1
        return [control] if alone else [select_control(control, island) for island in self._islands]

    @cached_property
    def _numbered(self) -> list[Tables]:
        """The places of the numbers of every island's tables in those of the whole."""
        return self._selected(numbered(build_tables(self.mechanism)))

    def _begun(self) -> Iterator[tuple[Tables, InputTable, Array, Array, Array]]:
        """Yield the tables, inputs, state, quaternions and absolute tolerances of each island at the start."""
        mechanism, _, x, _, _, atol, force, _ = self._made_of
        forces = np.zeros((len(mechanism.body.tips), 3))
        forces[:] = 0.0 if force is None else force
        start, attitude = self._charts.to_core(np.asarray(x, dtype=float))
        tolerances = np.asarray(atol, dtype=float)[self._charts.packed_places(np.arange(self._charts.size))]
        whole = len(self._islands) == 1
        for tables, inputs, island, free in zip(self._tables, self._inputs, self._islands, self._free, strict=True):
            pushed = forces if whole else forces[island.tips]
            # An island that nothing pushes computes as it does alone.
            loaded = bool(len(inputs.force.harmonics) or np.any(pushed))
            own, at = tables._replace(tip_force=pushed, loaded=loaded), self._places(island)
            yield own, inputs, start[at], attitude[free], tolerances[at]

    def _places(self, island: Island) -> NDArray[np.int64]:
        """Return the places of an island's numbers in the state of the whole."""
        return np.concatenate([island.coordinates, self._width + island.coordinates, 2 * self._width + island.states])

    def places(self, island: Island) -> NDArray[np.int64]:
        """Return the places of an island's numbers in a packed state."""
        return self._charts.packed_places(self._places(island))

    @property
    def driven(self) -> bool:
        """Whether loops of motors run."""
        return any(part.drives is not None for part in self.parts)

    @property
    def repeats(self) -> bool:
        """Whether it takes given steps."""
        return any(part.steps is not None for part in self.parts)

    @property
    def held(self) -> bool:
        """Whether inputs are held."""
        return any(part.control.kind == HELD for part in self.parts)

    @property
    def estimated_error(self) -> float:
        """Estimate of the error of the joints' angles so far, root mean square over joints and time, rad.

        It is that of free objects, of their turns and places, rad and m, where that is larger. The local errors are
        carried along the linearised flow, and count twice: at kinks they are known to a factor only. It is seldom
        below a third of the error, and sometimes far above it; NaN if nobody wants to know.
        """
        if not self.estimate_error:
            return np.nan
        joints = [(len(part.joints), part.memory.joint_error[0]) for part in self.parts]
        objects = [(len(part.objects), part.memory.object_error[0]) for part in self.parts]
        means = [
            sum(n * global_error for n, global_error in each) / max(sum(n for n, _ in each), 1)
            for each in (joints, objects)
        ]
        return _TWICE * float(np.sqrt(max(means) / self.time)) if self.time > 0.0 else 0.0

    @property
    def time(self) -> float:
        """Time that all have reached, s."""
        return min([part.time for part in self.parts])

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

    def restart(self, x: Array, time: float | None = None) -> None:
        """Continue from another state, at the same time or another one, s, with no memory of earlier steps."""
        start, attitude = self._charts.to_core(np.asarray(x, dtype=float))
        for part, free in zip(self.parts, self._free, strict=True):
            part.restart(start[self._places(part.island)], attitude[free], time)

    def drive(self, drives: Drives) -> None:
        """Run loops of motors from now on, each in the island of its rotor; memory is shared."""
        for part in self.parts:
            motors = np.flatnonzero(np.isin(drives.places, part.island.coordinates))
            if len(motors):
                part.drives = drives._replace(
                    motors=motors,
                    places=np.searchsorted(part.island.coordinates, drives.places),
                    channels=np.searchsorted(part.island.channels, drives.channels),
                    taken=np.zeros(1, dtype=np.int64),
                )

    def end_steps_at(self, knots: Array) -> None:
        """End steps at these times from now on, s, positive, in order: inputs bend or jump there."""
        for part in self.parts:
            part.knots = np.array(knots, dtype=float)

    def repeat(self, steps: Sequence[Steps]) -> None:
        """Repeat given steps from now on in each island, regardless of errors."""
        if len(steps) != len(self.parts):
            # Parameters that join what moved apart, or part it, leave the steps of all to each.
            steps = [Steps.whole(np.unique(np.concatenate([each.ends for each in steps])))] * len(self.parts)
        for part, own in zip(self.parts, steps, strict=True):
            part.repeat(own)

    def hold(self, inputs: Array) -> None:
        """Hold inputs from now on, shape (channels,); but voltages are those of loops that run."""
        for part in self.parts:
            held, running = inputs[part.island.channels], part.drives
            if running is not None:
                driven = running.channels[running.motors]
                held[driven] = part.control.tension[driven]
            part.control.tension[:] = held

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
        """Return an independent stepper that continues with the same bits."""
        twin = object.__new__(Stepper)
        twin.__dict__ |= self.__dict__
        twin.parts = [part.copy() for part in self.parts]
        return twin

    def __reduce__(self) -> tuple[Any, ...]:
        """Return constructor and arguments for `copy.deepcopy` and pickles: a copy binds islands of its own."""
        return partial(Stepper, estimate_error=self.estimate_error), self._made_of, self.state_snapshot

    def __setstate__(self, state: Snapshot) -> None:
        """Continue from the snapshot of a stepper with the same arguments."""
        self.restore(state)

    @property
    def state_snapshot(self) -> Snapshot:
        """Snapshot of all that later steps depend on; a copy."""
        return [
            (part.tables.loaded, part.drives, part.knots, tuple(each.copy() for each in part.state_snapshot))
            for part in self.parts
        ]

    def restore(self, snapshot: Snapshot) -> None:
        """Continue from a snapshot of this stepper or of one with the same arguments."""
        for index, (loaded, drives, knots, arrays) in enumerate(snapshot):
            if loaded != self.parts[index].tables.loaded:
                self.parts[index] = self.parts[index].with_loads(loaded)
            part = self.parts[index]
            part.drives, part.knots = drives, knots
            activate_all(part.tables, part.work.paths)
            for own, other in zip(part.state_snapshot, arrays, strict=True):
                own[...] = other

    def failure(self, status: int, names: tuple[str, ...]) -> str:
        """Return a status in words, with a name for every number of the state; empty if nothing failed."""
        part = min(self.parts, key=lambda each: each.time)
        return failure(part, status, [names[at] for at in self.places(part.island)])


def _wires(wires: bytes, tables: Tables, control: InputTable) -> tuple[object, ...]:
    arrays = tables.parents, tables.lumps, tables.state, control.tension, control.minimum
    return (wires, control.kind, *map(len, arrays))


@memoised(_wires)
def _islands(wires: bytes, tables: Tables, control: InputTable) -> list[Island]:
    """Return the islands of a mechanism under its inputs, searched once for each wiring."""
    return find_islands(tables, control)
