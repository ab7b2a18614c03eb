"""Adaptive integrator of one island, bound to compiled code."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from finger_pin.core.evaluation.attitude_charts import place_all
from finger_pin.core.events.step_events import activate_contacts, step_events
from finger_pin.core.jit import Block, CompiledFunction, copied, overwrite, pack
from finger_pin.core.signals.bound_models import BoundModel
from finger_pin.core.stepping.drives import ADVANCE_DRIVEN_ARGS, AdvanceDrivenArgs, Drives, advance_driven
from finger_pin.core.stepping.knots import ADVANCE_KNOTTED_ARGS, AdvanceKnottedArgs, advance_knotted
from finger_pin.core.steps import integration as core
from finger_pin.core.steps.adaptive import advance
from finger_pin.core.steps.repetition import REPEAT_STEPS_ARGS, RepeatStepsArgs, Steps, repeat_steps
from finger_pin.core.steps.tableaus import Tableau
from finger_pin.core.tables.inputs import InputTable
from finger_pin.core.tables.islands import Island
from finger_pin.core.tables.mechanism_parameters import Parameters
from finger_pin.core.tables.structure import Structure
from finger_pin.laws.law import ContactLaw, Law
from finger_pin.typing import Array

FIRST_STEP = 1e-6


@dataclass(frozen=True, eq=False)
class Record:
    """Room for the steps of one island, at most m.

    Attributes:
        times: Ends of the steps, shape (m,), s.
        states: States there, before the angles of free bodies are reset, shape (m, size).
        attitudes: Quaternions after that, shape (m, f, 4).
        dense: Coefficients of the steps' interpolants, shape (m, rows, size).
        shares: Of the lengths that were tried the shares that were taken, shape (m,).
        branches: Where the rows were between the sides of their kinks at the start of each, or, of `PackedSteps`, the
            signs of that, shape (m, K).
    """

    times: Array
    states: Array
    attitudes: Array
    dense: Array
    shares: Array
    branches: NDArray[Any]

    @classmethod
    def from_sizes(cls, count: int, size: int, free: int, rows: int, kinks: int) -> Record:
        """Return an empty record of `count` steps."""
        shapes = (), (size,), (free, 4), (rows, size), (), (kinks,)
        return cls(*(np.empty((count, *shape)) for shape in shapes))

    def first(self, count: int) -> Record:
        """Return the first steps; no copy."""
        return Record(*(part[:count] for part in vars(self).values()))

    def doubled(self) -> Record:
        """Return a copy with room for twice as many."""
        return Record(*(np.concatenate([part, np.empty_like(part)]) for part in vars(self).values()))


class StartValues(NamedTuple):
    """Parameters, inputs, state and tolerances of an island at the start, as `IslandIntegrator` has them."""

    parameters: Parameters
    control: InputTable
    x: Array
    attitude: Array
    atol: Array


class IslandIntegrator:
    """Adaptive integrator of one island.

    Attributes:
        island: Its indices in the whole.
        laws: Of its groups of rows.
        structure: Its structure.
        parameters: Its parameters.
        control: Its inputs.
        tableau: The method.
        x: Its packed state, shape (size,); the angles of free bodies since the last step.
        attitude: Quaternions of its free bodies, shape (f, 4).
        atol: Absolute tolerances, shape (size,).
        memory: Time, step size, error history and counters; views of one vector.
        drives: Loops of motors in position drive, which sample on the way; None for none.
        knots: Times at which steps end, s, positive, in order.
        steps: Steps that are taken whatever their errors; None to choose them.
    """

    drives: Drives | None = None
    knots: Array = np.zeros(0)
    steps: Steps | None = None

    def __init__(
        self,
        island: Island,
        laws: Sequence[Law | ContactLaw],
        structure: Structure,
        parameters: Parameters,
        control: InputTable,
        x: Array,
        attitude: Array,
        tableau: Tableau,
        rtol: float,
        atol: Array,
        memory: Array,
    ) -> None:
        """Bind everything; arrays are taken as they are, not copied."""
        self.island, self.laws = island, laws
        # The block holds addresses: what it was made of lives as long as it does, and is not replaced.
        self.model = BoundModel(structure, parameters, laws, control)
        self.work = self.model.model.work
        if not len(x) == len(atol) == len(self.model.model.state):
            raise RuntimeError(f"an island of {len(self.model.model.state)} numbers starts from {len(x)}")
        self._bound = core.Integration(
            model=self.model.address,
            tableau=tableau,
            x=x,
            attitude=attitude,
            rtol=rtol,
            atol=atol,
            memory=core.StepMemory.from_vector(memory),
            k=np.zeros((len(tableau.nodes), len(x))),
            start=np.zeros(len(x)),
            r=np.zeros(len(x) + 1),
            end=np.zeros(len(x)),
            live=self.work.paths.live,
            live_count=self.work.paths.live_count,
            dense=np.zeros((len(tableau.dense), len(x))),
            kinks=np.zeros(len(structure.state)),
            reevaluate=bool(parameters.has_tip_force or structure.contact_rows),
            events=step_events(structure.contact_rows > 0),
        )
        self._block = pack(self._bound, core.INTEGRATION)
        place_all(structure, parameters, attitude)
        self.structure, self.parameters, self.control, self.tableau = structure, parameters, control, tableau
        self.x, self.attitude, self.atol, self.memory = x, attitude, atol, self._bound.memory
        self._memory, self._nothing, self._record_range = memory, self.room(0), np.zeros(2, dtype=np.int64)
        # What compiled code was given last, and the blocks that hold it.
        self._placed: tuple[Record | None, Drives | None, Array, Steps | None] = (None, None, self.knots, None)
        self._blocks: list[Block] = []
        self._advance = advance

    def rebind(self, values: StartValues, time: float) -> bool:
        """Start anew with other values of the same structure, at a time, s; return False if they do not fit."""
        if not (overwrite(self.control, values.control) and self.model.rebind(values.parameters)):
            return False
        self.drives, self.knots, self.steps = None, np.zeros(0), None
        self.atol[:], self._memory[:], self._bound.kinks[:] = values.atol, 0.0, 0.0
        self.restart(values.x, values.attitude, time)
        return True

    def room(self, count: int) -> Record:
        """Return a buffer for m steps."""
        bound = self._bound
        return Record.from_sizes(count, len(self.x), len(self.attitude), len(bound.dense), len(bound.kinks))

    @property
    def rtol(self) -> float:
        """Relative tolerance."""
        return float(self._bound.rtol)

    @property
    def time(self) -> float:
        """Time reached, s."""
        return float(self.memory.time[0])

    def advance(self, end: float, record: Record | None = None, rows: slice = slice(None)) -> tuple[int, int]:
        """Integrate to a time, or until rows of a record are full; return the status and the row after the last one."""
        block, unit = self.ready(record, rows)
        return unit(block, end), int(self._record_range[0])

    def ready(self, record: Record | None = None, rows: slice = slice(None)) -> tuple[int, CompiledFunction]:
        """Return the address of the `AdvanceArgs` and the function that advances them, with a record if given."""
        target = self._nothing if record is None else record
        self._record_range[:] = rows.indices(len(target.times))[:2]
        self._place(target)
        return self._blocks[-1].address, self._advance

    def _place(self, record: Record) -> None:
        """Write the addresses of a record, drive loops, knots and given steps for compiled code."""
        before, drives, knots, steps = self._placed
        if before is record and drives is self.drives and knots is self.knots and steps is self.steps:
            return
        room = record.times, record.states, record.attitudes, record.dense, record.shares, record.branches
        args = pack(core.AdvanceArgs(self._block.address, *room, self._record_range), core.ADVANCE_ARGS)
        self._placed, self._blocks, self._advance = (record, self.drives, self.knots, self.steps), [args], advance
        if self.steps is not None:
            repetition = RepeatStepsArgs(self.steps, np.zeros(1, dtype=np.int64), args.address)
            self._blocks.append(pack(repetition, REPEAT_STEPS_ARGS))
            self._advance = repeat_steps
        if self.drives is not None:
            driven = AdvanceDrivenArgs(self.drives, args.address, self._advance.address, self._blocks[-1].address)
            self._blocks.append(pack(driven, ADVANCE_DRIVEN_ARGS))
            self._advance = advance_driven
        if len(self.knots):
            passed, inner_args = np.zeros(1, dtype=np.int64), self._blocks[-1].address
            knotted = AdvanceKnottedArgs(self.knots, passed, args.address, self._advance.address, inner_args)
            self._blocks.append(pack(knotted, ADVANCE_KNOTTED_ARGS))
            self._advance = advance_knotted

    def restart(self, x: Array, attitude: Array, time: float | None = None) -> None:
        """Continue from another state, at the same time or another one, s, with no memory of earlier steps."""
        self.correct(x, attitude)
        memory = self.memory
        for entry in (memory.rejected, memory.limiting_state, memory.held_step_size, memory.continued):
            entry[0] = 0.0
        memory.step_size[0] = FIRST_STEP
        if time is not None:
            # Steps are counted from here on, for those that creep.
            memory.time[0], memory.window_start[0], memory.window_end[0] = time, 0.0, 0.0
            if self.drives is not None:
                self.drives.sample_count[0] = math.ceil((time - self.drives.first) / self.drives.period * (1.0 - 1e-12))

    def correct(self, x: Array, attitude: Array) -> None:
        """Continue from a state near the present one, with steps as long as they are."""
        self.x[:], self.attitude[:] = x, attitude
        self.forget()
        place_all(self.structure, self.parameters, self.attitude)
        # The trend of errors is that of the motion before.
        self.memory.last_step_size[0] = self.memory.last_error[0] = 0.0

    def forget(self) -> None:
        """Activate all contact pairs."""
        if self.structure.contact_rows:
            activate_contacts(self._block.address)

    def with_loads(self, loaded: bool) -> IslandIntegrator:
        """Return the same integrator with or without forces at the tips."""
        pack = self._bound
        twin = IslandIntegrator(
            self.island,
            self.laws,
            self.structure,
            self.parameters._replace(has_tip_force=loaded),
            self.control,
            pack.x,
            pack.attitude,
            pack.tableau,
            pack.rtol,
            pack.atol,
            self._memory,
        )
        twin.drives, twin.knots, twin.steps = self.drives, self.knots, self.steps
        return twin

    @property
    def state_snapshot(self) -> tuple[Array, ...]:
        """The arrays that later steps depend on; no copies, they may be filled."""
        changing = self.control.tension, self.parameters.tip_force, self.parameters.bodies
        return self.x, self.attitude, self._memory, *changing

    def repeat(self, steps: Steps) -> None:
        """Repeat given steps from now on, regardless of errors."""
        branches = np.asarray(steps.branches, dtype=float)
        known = branches.shape[1] == len(self._bound.kinks)
        # A tuple of its own, so that the same steps are counted anew.
        self.steps = steps._replace(branches=branches if known else np.zeros((len(steps.ends), 0)))

    def copy(self) -> IslandIntegrator:
        """Return an independent integrator that continues with the same bits."""
        pack = self._bound
        return IslandIntegrator(
            self.island,
            self.laws,
            self.structure,
            copied(self.parameters),
            copied(self.control),
            pack.x.copy(),
            pack.attitude.copy(),
            pack.tableau,
            pack.rtol,
            pack.atol.copy(),
            self._memory.copy(),
        )


def failure(part: IslandIntegrator, status: int, names: list[str]) -> str:
    """Return the status of an island in words; empty if nothing failed."""
    culprit = names[int(part.memory.limiting_state[0])]
    if status == core.UNDERFLOW:
        return f"the step size fell below the resolution of time; the error is largest in {culprit}"
    if status == core.STALLED:
        return (
            f"the last {core.WINDOW} steps advanced by less than {core.LEAST_MEAN_STEP:g} s each; "
            f"the error is largest in {culprit}"
        )
    if status == core.NOT_FINITE:
        return f"the rate of {culprit} is not finite"
    if status == core.RUNAWAY:
        return f"{culprit} is beyond {core.FASTEST:g} rad/s (or m/s): the motion has left every physical range"
    return ""
