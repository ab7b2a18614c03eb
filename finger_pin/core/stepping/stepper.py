"""Integrator of a mechanism, one island at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from finger_pin.core.evaluation.attitude_charts import Charts
from finger_pin.core.jit import copied
from finger_pin.core.signals.compiled_finger import CompiledFinger
from finger_pin.core.stepping.drives import Drives
from finger_pin.core.stepping.island_stepper import FIRST_STEP, IslandIntegrator, StartValues, failure
from finger_pin.core.steps import integration as core
from finger_pin.core.steps.repetition import Steps
from finger_pin.core.steps.tableaus import Tableau, rodas4, rodas5p
from finger_pin.core.tables.inputs import HELD, InputTable
from finger_pin.core.tables.islands import Island, selections
from finger_pin.core.tables.mechanism_parameters import Parameters, compile_mechanism
from finger_pin.core.tables.structure import Structure
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.mechanism import Mechanism
from finger_pin.threads import in_threads
from finger_pin.typing import Array

#: Snapshot of every island: tip-force flag, drive loops, knots, state arrays.
Snapshot = list[tuple[bool, Drives | None, Array, tuple[Array, ...]]]
TABLEAUS: dict[str, Callable[[], Tableau]] = {"Rodas5P": rodas5p, "Rodas4": rodas4}


class StepperArgs(NamedTuple):
    """Arguments of `Stepper`."""

    mechanism: Mechanism
    control: InputTable
    x: Array
    tableau: Tableau
    rtol: float
    atol: Array
    force: Array | None = None
    time: float = 0.0


class Stepper:
    """Integrator of a mechanism, one island at a time.

    Attributes:
        mechanism: The mechanism.
        parts: Its islands.
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
        compiled: tuple[Structure, Parameters] | None = None,
    ) -> None:
        """Start from a state.

        Args:
            mechanism: The mechanism; arrays of its parameters are copied.
            control: Its inputs.
            x: Packed state, shape (mechanism.size,).
            tableau: The method.
            rtol: Relative tolerance.
            atol: Absolute tolerances, shape (mechanism.size,); of a quaternion the first counts.
            force: At the tips, shape (3,) or (t, 3), N, base frame.
            time: When, s.
            compiled: What `compile_mechanism` has made of the mechanism, if it is there.
        """
        structure, parameters = compiled or compile_mechanism(mechanism)
        laws = [table.law for table in mechanism.rows]
        self._charts, self._width = Charts.from_mechanism(mechanism), mechanism.coordinates
        self._structure, self._selected = structure, selections(structure, control)
        self._free = [np.isin(structure.charts, selection.island.coordinates) for selection in self._selected]
        self._made_of = StepperArgs(mechanism, control, x, tableau, rtol, atol, force, time)
        self.mechanism, self.parts = mechanism, list[IslandIntegrator]()
        for selection, values in zip(self._selected, self._values_at_start(parameters), strict=True):
            memory = np.zeros(len(core.StepMemory._fields))
            named = core.StepMemory.from_vector(memory)
            named.time[0], named.step_size[0] = time, FIRST_STEP
            numbers, inputs, start, attitude, tolerances = copied(values)
            start_arguments = inputs, start, attitude, tableau, float(rtol), tolerances, memory
            followed = [laws[group] for group in selection.groups]
            self.parts.append(
                IslandIntegrator(selection.island, followed, selection.structure, numbers, *start_arguments)
            )

    def rebind(self, args: StepperArgs, compiled: tuple[Structure, Parameters] | None = None) -> bool:
        """Start anew, bit for bit as a new stepper of these; return False, and be of no use, if more differs."""
        structure, parameters = compiled or compile_mechanism(args.mechanism)
        same = structure is self._structure and selections(structure, args.control) is self._selected
        if not same or args.tableau is not self._made_of.tableau or args.rtol != self._made_of.rtol:
            return False
        self.mechanism, self._made_of = args.mechanism, args
        values = self._values_at_start(parameters)
        return all(part.rebind(each, args.time) for part, each in zip(self.parts, values, strict=True))

    def _values_at_start(self, parameters: Parameters) -> Iterator[StartValues]:
        """Yield the values of each island, not copied."""
        args = self._made_of
        forces = np.zeros((len(args.mechanism.body.tips), 3))
        forces[:] = 0.0 if args.force is None else args.force
        start, attitude = self._charts.to_core(np.asarray(args.x, dtype=float))
        tolerances = np.asarray(args.atol, dtype=float)[self._charts.packed_places(np.arange(self._charts.size))]
        for selection, free in zip(self._selected, self._free, strict=True):
            inputs, pushed = selection.control(args.control), forces[selection.island.tips]
            at = self._places(selection.island)
            # An island that nothing pushes computes as it does alone.
            loaded = bool(len(inputs.force.harmonics) or np.any(pushed))
            numbers = selection.parameters(parameters)._replace(tip_force=pushed, has_tip_force=loaded)
            yield StartValues(numbers, inputs, start[at], attitude[free], tolerances[at])

    @classmethod
    def from_finger(
        cls,
        finger: Finger,
        control: InputTable,
        x: Array,
        force: Array | None = None,
        *,
        method: str,
        rtol: float,
        atol_scale: float,
        reused: Stepper | None = None,
        evaluator: object = None,
    ) -> Stepper:
        """Return the stepper of a finger under inputs, from a packed state on.

        Args:
            finger: The finger.
            control: Its inputs.
            x: Packed state, shape (size,).
            force: At the tips, shape (3,) or (t, 3), N, base frame.
            method: One of `TABLEAUS`.
            rtol: Relative tolerance.
            atol_scale: Absolute tolerance over the scale of each kind of state.
            reused: A stepper that is not needed any more: it is returned, if its finger differs in numbers only.
            evaluator: If it is one of the same mechanism, its structure and parameters are taken.
        """
        tableau, atol = TABLEAUS[method](), atol_scale * finger.layout.scales()
        args = StepperArgs(finger.mechanism, control, x, tableau, rtol, atol, force)
        compiled = None
        if isinstance(evaluator, CompiledFinger) and evaluator.finger is finger:
            compiled = evaluator.mechanism.structure, evaluator.mechanism.parameters
        return reused if reused is not None and reused.rebind(args, compiled) else cls(*args, compiled)

    def _places(self, island: Island) -> NDArray[np.int64]:
        """Return places in the whole state."""
        return np.concatenate([island.coordinates, self._width + island.coordinates, 2 * self._width + island.states])

    def places(self, island: Island) -> NDArray[np.int64]:
        """Return the places of an island's numbers in a packed state."""
        return self._charts.packed_places(self._places(island))

    @property
    def driven(self) -> bool:
        """Return whether any island has running motor loops."""
        return any(part.drives is not None for part in self.parts)

    @property
    def holds_inputs(self) -> bool:
        """Return whether any island has constant inputs."""
        return any(part.control.kind == HELD for part in self.parts)

    @property
    def time(self) -> float:
        """Time that all islands have reached, s."""
        return min([part.time for part in self.parts])

    @property
    def x(self) -> Array:
        """The packed state, shape (mechanism.size,); a copy."""
        if len(self.parts) == 1 and not len(self.parts[0].attitude):
            return self.parts[0].x.copy()
        return self.to_packed([part.x for part in self.parts], [part.attitude for part in self.parts])

    def to_packed(self, states: list[Array], attitudes: list[Array]) -> Array:
        """Return packed states of the whole from those of the islands, shapes (..., size) and (..., f, 4)."""
        lead = states[0].shape[:-1]
        whole = np.zeros((*lead, 2 * self._width + self.mechanism.state_count))
        attitude = np.zeros((*lead, len(self._free[0]), 4))
        for part, state, quaternions, free in zip(self.parts, states, attitudes, self._free, strict=True):
            whole[..., self._places(part.island)] = state
            attitude[..., free, :] = quaternions
        return self._charts.to_packed(whole, attitude)

    def restart(self, x: Array, time: float | None = None) -> None:
        """Continue from another state, at the same time or another one, s, with no memory of earlier steps."""
        for part, numbers, attitude in self._divided(x):
            part.restart(numbers, attitude, time)

    def correct(self, x: Array) -> None:
        """Continue from a state near the present one, with steps as long as they are."""
        for part, numbers, attitude in self._divided(x):
            part.correct(numbers, attitude)

    def _divided(self, x: Array) -> Iterator[tuple[IslandIntegrator, Array, Array]]:
        """Yield islands with their numbers of a packed state, and quaternions."""
        start, attitude = self._charts.to_core(np.asarray(x, dtype=float))
        for part, free in zip(self.parts, self._free, strict=True):
            yield part, start[self._places(part.island)], attitude[free]

    def drive(self, drives: Drives) -> None:
        """Run loops of motors from now on, each in the island of its rotor; memory is shared."""
        for part in self.parts:
            motors = np.flatnonzero(np.isin(drives.places, part.island.coordinates))
            if len(motors):
                part.drives = drives._replace(
                    motors=motors,
                    places=np.searchsorted(part.island.coordinates, drives.places),
                    channels=np.searchsorted(part.island.channels, drives.channels),
                    sample_count=drives.sample_count.copy(),
                )
                if drives.sample_count[0]:
                    latest = min(drives.sample_count[0], len(drives.voltages)) - 1
                    part.control.tension[part.drives.channels[motors]] = drives.voltages[latest, motors]

    def end_steps_at(self, knots: Array) -> None:
        """End steps at these times from now on, s, positive, in order: inputs bend or jump there."""
        for part in self.parts:
            part.knots = np.array(knots, dtype=float)

    def repeat(self, steps: Sequence[Steps]) -> None:
        """Repeat given steps from now on in each island, regardless of errors."""
        if len(steps) != len(self.parts):
            # Parameters that join what moved apart, or part it, leave the steps of all to each.
            steps = [Steps.from_ends(np.unique(np.concatenate([each.ends for each in steps])))] * len(self.parts)
        for part, island_steps in zip(self.parts, steps, strict=True):
            part.repeat(island_steps)

    def hold(self, inputs: Array) -> None:
        """Hold inputs from now on, shape (channels,); but voltages are those of loops that run."""
        for part in self.parts:
            island_inputs, running = inputs[part.island.channels], part.drives
            if running is not None:
                driven = running.channels[running.motors]
                island_inputs[driven] = part.control.tension[driven]
            part.control.tension[:] = island_inputs

    def load(self, force: Array) -> None:
        """Set the forces at the tips, shape (3,) or (t, 3), N, base frame."""
        forces = np.broadcast_to(force, (len(self.mechanism.body.tips), 3))
        for index, part in enumerate(self.parts):
            part.parameters.tip_force[:] = forces[part.island.tips]
            if np.any(part.parameters.tip_force) and not part.parameters.has_tip_force:
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
        return Stepper, self._made_of, self.state_snapshot

    def __setstate__(self, state: Snapshot) -> None:
        """Continue from the snapshot of a stepper with the same arguments."""
        self.restore(state)

    @property
    def state_snapshot(self) -> Snapshot:
        """Snapshot of all that later steps depend on; a copy."""
        return [
            (part.parameters.has_tip_force, part.drives, part.knots, tuple(each.copy() for each in part.state_snapshot))
            for part in self.parts
        ]

    def restore(self, snapshot: Snapshot) -> None:
        """Continue from a snapshot of this stepper or of one with the same arguments."""
        for index, (loaded, drives, knots, arrays) in enumerate(snapshot):
            if loaded != self.parts[index].parameters.has_tip_force:
                self.parts[index] = self.parts[index].with_loads(loaded)
            part = self.parts[index]
            part.drives, part.knots = drives, knots
            part.forget()
            for array, saved in zip(part.state_snapshot, arrays, strict=True):
                array[...] = saved

    def failure(self, status: int, names: tuple[str, ...]) -> str:
        """Return a status in words, with a name for every number of the state; empty if nothing failed."""
        part = min(self.parts, key=lambda island: island.time)
        return failure(part, status, [names[at] for at in self.places(part.island)])
