"""A finger over periods with inputs and forces held: its state after each, and the derivatives of that."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from finger_pin.core.addresses.law_code import ROW
from finger_pin.core.jit import copied, pack
from finger_pin.core.signals.bound_models import BoundModel
from finger_pin.core.signals.compiled_finger import CompiledMechanism
from finger_pin.core.stepping.island_stepper import IslandIntegrator, failure
from finger_pin.core.stepping.period_derivatives import advance_period, fill_watched, limit_bristles
from finger_pin.core.stepping.period_evaluations import PERIOD_ARGS, PeriodArgs
from finger_pin.core.stepping.stepper import TABLEAUS
from finger_pin.core.steps import integration as core
from finger_pin.core.tables.inputs import held_control
from finger_pin.core.tables.islands import Island
from finger_pin.core.tables.mechanism_parameters import Parameters, compile_mechanism
from finger_pin.core.tables.structure import Structure
from finger_pin.exceptions import InputError
from finger_pin.laws.motor import MOTOR
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.rows import Rows
from finger_pin.typing import Array

# Changes for differences: of the scale of a state, of an input in N or V, of a winch's in m, of a force in N.
_STATE_CHANGE, _INPUT_CHANGE, _WINDING_CHANGE, _FORCE_CHANGE = 1e-6, 1e-6, 1e-9, 1e-4
# Numbers of motors whose currents are given: what was measured has flowed, whatever the supply.
_UNLIMITED, _UNHEEDED = dict.fromkeys(("voltage", "current_limit"), np.inf), ("dry", "by_torque", "by_load", "viscous")
_CURRENT_DRIVE = {"by_current": 1.0, **_UNLIMITED, **dict.fromkeys(_UNHEEDED, 0.0)}
_GAIN = MOTOR.parameters.index("gain")


class PeriodMap:
    """The map over periods of a finger with held inputs and forces, from a state on, with its derivatives.

        periods = PeriodMap(Finger("ub_stand_in"), x)
        periods.inputs[:] = tensions
        periods.advance(1e-3)

    Attributes:
        finger: The finger.
        x: Packed state, shape (n,); it may be changed in place to one near it, which forgets no step.
        inputs: Held inputs, shape (u,), N, or of motors V in position drive or A; to be changed in place.
        forces: At the tips, shape (t, 3), N, base frame; to be changed in place.
        derivatives: Of the last period: of the state at its end by that at its start, inputs, forces and parameters,
            shape (n, n + m) with m = u + 3 t + p.
        address: Of what compiled code hands to the next two by `call_at`.
        advance_address: Of the function that advances to a time and fills derivatives; it returns 0 when it is done.
        limit_address: Of the function that limits bristles.
    """

    def __init__(
        self,
        finger: Finger,
        x: Array,
        varied: Sequence[tuple[Finger, float]] = (),
        *,
        currents: bool = False,
        exact: bool = False,
        method: str = "Rodas4",
        rtol: float = 1e-4,
        atol_scale: float = 1e-4,
    ) -> None:
        """Start from a state at time zero.

        Args:
            finger: At rest as a whole, without free bodies.
            x: Packed state, shape (n,).
            varied: The finger with one parameter changed, and by how much, for each of p parameters.
            currents: Whether inputs of motors are the currents that flow, A, in place of commands of their drives.
            exact: Whether derivatives heed what changes within a step, at four times the cost.
            method: A compiled method.
            rtol: Relative tolerance.
            atol_scale: Absolute tolerance over the scale of each kind of state.

        Raises:
            InputError: If the base moves, a body is free, or a finger has another structure.
        """
        self.finger, mechanism = finger, finger.mechanism
        structure, parameters = compile_mechanism(mechanism)
        self._structure = structure
        if mechanism.moved or len(structure.charts):
            raise InputError("finger", "must be at rest as a whole, without free bodies", finger.description.name)
        control = held_control(mechanism.channels, mechanism.coordinates)
        laws, forces = [table.law for table in mechanism.rows], np.zeros((len(structure.tip_body), 3))
        counts = mechanism.coordinates, len(structure.state), len(structure.state_row), mechanism.channels
        whole = Island(*(np.arange(count) for count in (*counts, 0, len(forces))))
        tableau, memory = TABLEAUS[method](), np.zeros(len(core.StepMemory._fields))
        # All models read the same inputs and forces.
        loaded = bool(len(forces))
        all_parameters = [self._fed(parameters, currents)._replace(tip_force=forces, has_tip_force=loaded)]
        settings = np.zeros((0, 4)), tableau, float(rtol), atol_scale * finger.layout.scales(), memory
        start = np.array(x, dtype=float)
        self._integrator = IslandIntegrator(whole, laws, structure, all_parameters[0], control, start, *settings)
        self.x, self.inputs, self.forces = start, control.tension, forces
        for other, _ in varied:
            same, parameters = compile_mechanism(other.mechanism)
            if same is not structure:
                raise InputError("varied", "must be the same finger with another number", other.description.name)
            all_parameters.append(self._fed(parameters, currents)._replace(tip_force=forces, has_tip_force=loaded))
        self._models = [BoundModel(structure, each, laws, control, linearised=False) for each in all_parameters]
        self._evaluator, self._record = CompiledMechanism(mechanism), self._integrator.room(1)
        args, unit = self._integrator.ready(self._record)
        changes = [*self._input_changes(), *np.full(forces.size, _FORCE_CHANGE), *(change for _, change in varied)]
        self._args = self._arguments(unit.address, args, exact, np.array(changes))
        self.derivatives = self._args.derivatives
        self._bind()
        self.advance_address, self.limit_address = advance_period.address, limit_bristles.address
        self.restart(start)

    def _arguments(self, advance: int, args: int, exact: bool, changes: Array) -> PeriodArgs:
        """Return the arguments of compiled code, with changes of what is held for differences, shape (m,)."""
        size, held = len(self.x), len(changes)
        ranges, starts = self._row_ranges()
        return PeriodArgs(
            advance=advance,
            args=args,
            exact=exact,
            plain=self._models[0].address,
            varied=np.array([each.address for each in self._models[1:]], dtype=np.int64),
            derivatives=np.zeros((size, size + held)),
            held=np.zeros((size, held)),
            inverse=np.zeros((size, size)),
            terms=np.zeros((2 * size, size + held)),
            weights=np.zeros(6),
            right=np.zeros(size + 1),
            start=np.zeros(size),
            state=np.zeros(size),
            gradient=np.zeros(size + held),
            steps=np.concatenate([_STATE_CHANGE * self.finger.layout.scales(), changes]),
            row_ranges=ranges,
            range_start=starts,
            plain_rows=np.zeros_like(self._models[0].model.work.rows),
            weights_of_rows=np.zeros((2, len(self._structure.state), 0)),
            watched=np.zeros(0),
            slopes=np.zeros((0, size + held)),
            bristles=self._bristles(),
            levels=np.full(size, np.inf),
        )

    def _row_ranges(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return ranges of rows that numbers of what is held change, if nothing else, and the first of each."""
        structure, ranges, starts = self._structure, list[tuple[int, int, int]](), [0]
        plain, *others = [each.model.parameters for each in self._models]
        changed = [structure.channel == channel for channel in range(len(self.inputs))]
        changed += [np.zeros(len(structure.state), dtype=bool)] * self.forces.size
        changed += [_changed_rows(structure, plain, other) for other in others]
        for rows in changed:
            if not rows[: structure.contact_rows].any():
                ranges += _dependent_ranges(structure, rows)
            starts.append(len(ranges))
        return np.array(ranges, dtype=np.int64).reshape(-1, 3), np.array(starts, dtype=np.int64)

    def _input_changes(self) -> Array:
        """Return by how much inputs are changed for differences, shape (u,)."""
        changes = np.full(len(self.inputs), _INPUT_CHANGE)
        changes[np.flatnonzero(self.finger.routing.winched)] = _WINDING_CHANGE
        return changes

    def _rows(self) -> Iterator[tuple[Rows, NDArray[np.int64]]]:
        """Yield the tables of the mechanism, each with the places of its rows among all."""
        groups = self._structure.groups
        for table, begin, end in zip(self.finger.mechanism.rows, groups.first, groups.end, strict=True):
            yield table, np.arange(begin, end)

    def _fed(self, parameters: Parameters, currents: bool) -> Parameters:
        """Return a copy of parameters, with motors that take currents as they are."""
        numbers = copied(parameters)
        for table, rows in self._rows():
            if currents and table.group == "motors":
                for name, value in _CURRENT_DRIVE.items():
                    numbers.laws[MOTOR.parameters.index(name), rows] = value
                numbers.laws[_GAIN, rows] = numbers.laws[MOTOR.parameters.index("torque_constant"), rows]
        return numbers

    def _bristles(self) -> NDArray[np.int64]:
        """Return places of bristles in the state, their rows, and columns of the rows' levels, shape (b, 3)."""
        entries = []
        for table, rows in self._rows():
            # A law of friction without bristles has a level and no state.
            if "level" in table.law.signals and table.law.arms == 1 and table.law.scale is not None:
                column = ROW.signals + table.law.signals.index("level")
                places = 2 * self.finger.mechanism.coordinates + self._structure.state[rows]
                entries += [(place, row, column) for place, row in zip(places, rows, strict=True)]
        return np.array(entries, dtype=np.int64).reshape(-1, 3)

    @property
    def time(self) -> float:
        """Time reached, s."""
        return self._integrator.time

    @property
    def steps(self) -> int:
        """Number of steps that were tried so far."""
        return int(self._integrator.memory.accepted_steps[0] + self._integrator.memory.rejected_steps[0])

    def restart(self, x: Array, time: float | None = None) -> None:
        """Continue from another state, at the same time or another one, s, with no memory of earlier steps."""
        self._integrator.restart(np.array(x), np.zeros((0, 4)), time)

    @property
    def state_snapshot(self) -> tuple[Array, ...]:
        """The arrays that later periods depend on; no copies, they may be filled."""
        return self._integrator.state_snapshot

    def advance(self, end: float) -> str:
        """Advance to a time, s, and fill the derivatives; return in words what failed, or nothing."""
        return self.failure(advance_period(self.address, end))

    def failure(self, status: int) -> str:
        """Return a status of `advance_period` in words; empty if nothing failed."""
        return failure(self._integrator, status, list(self.finger.layout.names)) if status else ""

    def limit_bristles(self) -> Array:
        """Bring bristles of the state back to their levels, which steady sliding does not pass.

        Returns:
            These levels, shape (n,), N or N m, overwritten at the next call; infinite for all else in the state.
        """
        limit_bristles(self.address)
        return self._args.levels

    def watch(self, names: Sequence[str]) -> None:
        """Prepare `watched` for signals that are sums of forces and inputs of rows with fixed weights, as tensions are.

        Args:
            names: Of `FingerSignals`.
        """
        count = self._args.weights_of_rows.shape[1]
        # A row's force or input of 1 alone gives its weight.
        buffer = self._evaluator.allocate(2 * count, "no_acceleration")
        rows = np.zeros((len(buffer.rows), 2 * count, count))
        rows[ROW.force, :count] = rows[ROW.command, count:] = np.eye(count)
        x, inputs = np.tile(self.x, (2 * count, 1)), np.tile(self.inputs, (2 * count, 1))
        evaluation = self._evaluator.to_evaluation(buffer._replace(rows=rows, packed=x))
        signals = self.finger.signals(x, inputs, None, evaluation)
        weights = np.concatenate([signals[name] for name in names], axis=-1).reshape(2, count, -1)
        number = weights.shape[-1]
        slopes = np.zeros((number, len(self._args.steps)))
        self._args = self._args._replace(weights_of_rows=weights, watched=np.zeros(number), slopes=slopes)
        self._bind()

    def _bind(self) -> None:
        """Bind the arguments of compiled code."""
        self._block = pack(self._args, PERIOD_ARGS)
        self.address = self._block.address

    def watched(self) -> tuple[Array, Array]:
        """Return the signals that are watched, shape (k,), and their derivatives, shape (k, n + m).

        They are overwritten at the next call.
        """
        fill_watched(self.address)
        return self._args.watched, self._args.slopes


def _same(first: Any, second: Any) -> bool:
    """Return whether all numbers of two tables are the same."""
    if isinstance(first, tuple):
        return all(_same(*pair) for pair in zip(first, second, strict=True))
    return np.array_equal(first, second)


def _changed_rows(structure: Structure, first: Parameters, second: Parameters) -> NDArray[np.bool_]:
    """Return which rows have other numbers, shape (K,); none where bodies, tips or paths have."""
    fields = ("laws", "arm", "measure", "weights")
    if not _same(first, second._replace(**{name: getattr(first, name) for name in fields})):
        return np.zeros(len(structure.state), dtype=bool)
    rows = np.any(first.laws != second.laws, axis=0)
    rows[structure.arm_row[(first.arm != second.arm) | (first.measure != second.measure)]] = True
    for starts in (structure.input_start, structure.load_start):
        for k in range(len(rows)):
            rows[k] |= np.any((first.weights != second.weights)[starts[k] : starts[k + 1]])
    return rows


def _dependent_ranges(structure: Structure, rows: NDArray[np.bool_]) -> Iterator[tuple[int, int, int]]:
    """Yield group, first row and last + 1 of rows that are marked, shape (K,), and of all that they feed or load."""
    rows = rows.copy()
    for k in range(len(rows)):
        for starts in (structure.input_start, structure.load_start):
            rows[k] |= rows[structure.terms[starts[k] : starts[k + 1]]].any()
    for g, (first, end) in enumerate(zip(structure.groups.first, structure.groups.end, strict=True)):
        edges = np.flatnonzero(np.diff(rows[first:end].astype(int), prepend=0, append=0))
        for begin, stop in edges.reshape(-1, 2):
            yield g, first + begin, first + stop
