"""A mechanism whose evaluation is compiled: the same interface as `Mechanism` for signals."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from finger_pin.core.addresses.law_code import ROW
from finger_pin.core.evaluation.attitude_charts import Charts
from finger_pin.core.jit import Block, pack
from finger_pin.core.signals.bound_models import (
    MIN_STATES_PER_THREAD,
    Models,
    SignalBuffer,
    as_core_array,
    fill,
    path_motions,
)
from finger_pin.core.signals.state_batches import MOTIONS, Motions, motion_many
from finger_pin.core.tables.mechanism_parameters import compile_mechanism
from finger_pin.description.caching import cached_property
from finger_pin.laws.law import Row
from finger_pin.mechanism.evaluation import ContactPoints, Evaluation, Outputs
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.mechanism import Mechanism
from finger_pin.mechanism.rows import RowSignals
from finger_pin.mechanism.signals import FingerSignals
from finger_pin.mechanism.state import Motion
from finger_pin.typing import Array

_Asked = tuple[Motions, Array, Block]


class CompiledMechanism:
    """Compiled evaluation of a mechanism; not to be shared between threads.

    Attributes:
        mechanism: The mechanism.
        charts: Places of quaternions in its packed states.
        structure: Its structure.
        parameters: Its parameters.
        models: Bound models of them.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        """Read a mechanism."""
        self.mechanism = mechanism
        self.charts = Charts.from_mechanism(mechanism)
        self.structure, self.parameters = compile_mechanism(mechanism)
        size = 2 * len(self.structure.prescribed) + len(self.structure.state_row)
        if self.charts.size != size:
            raise RuntimeError(f"the structure has {size} numbers of the state, the mechanism {self.charts.size}")
        laws = [table.law for table in mechanism.rows]
        self.models = Models(self.structure, self.parameters, laws, mechanism.channels, mechanism.moved)
        self._motions: dict[int, _Asked] = {}

    def rebind(self, mechanism: Mechanism) -> bool:
        """Take another mechanism of the same structure; return False if it is none, and this is of no use."""
        if mechanism is self.mechanism:
            return True
        before, self.mechanism, structure = self.mechanism, mechanism, self.structure
        if mechanism.wiring is before.wiring:
            self.parameters = self.parameters.changed(mechanism, before)
        else:
            self.structure, self.parameters = compile_mechanism(mechanism)
        return structure is self.structure and self.models.rebind(self.parameters)

    def __reduce__(self) -> tuple[Any, ...]:
        """Return constructor and arguments for `copy.deepcopy` and pickles."""
        return CompiledMechanism, (self.mechanism,)

    def evaluate(
        self, x: Array, command: Array, force: Array | None = None, base: Array | None = None, outputs: Outputs = "all"
    ) -> Evaluation:
        """Return the signals at packed states, shape (size,) or (m, size); see `Mechanism.evaluate`.

        Without accelerations, which take most of the time, they and the rate are NaN. Of many states the rows' forces
        alone take less again; all but them and their sums is then missing.
        """
        buffer = self.allocate(len(np.atleast_2d(x)), outputs)
        self.fill(buffer, x, command, force, base)
        return self.to_evaluation(buffer, slice(None) if np.ndim(x) > 1 else 0)

    def allocate(self, count: int, outputs: Outputs | Literal["powers"] = "all") -> SignalBuffer:
        """Return buffers for the signals of m states; "powers" come with J^T F."""
        mechanism, (columns, rows) = self.mechanism, self.models.model().model.work.rows.shape
        forces_only, width = outputs == "row_forces", mechanism.coordinates
        # Of states whose rows are kept, and of those whose sums are.
        row_states, summed_states = 0 if outputs == "powers" else count, 0 if forces_only else count
        return SignalBuffer(
            packed=np.empty((count, mechanism.size)),
            rates=np.empty((count if outputs == "all" else 0, self.charts.size)),
            rows=np.empty((1 if forces_only else columns, row_states, rows)),
            first=0,
            column=ROW.force if forces_only else 0,
            torques=np.empty((summed_states, width)),
            tendons=np.concatenate(
                [np.zeros(0), *(np.full(each.count, float(each.group in mechanism.tendons)) for each in mechanism.rows)]
            ),
            tendon_torques=np.empty((row_states, width)),
            externals=np.empty((summed_states, width)),
            energy_terms=np.empty((summed_states, len(mechanism.energies.stored) + len(mechanism.energies.powers))),
            # Of what touches, forces are added up.
            touches=np.zeros(
                (min(row_states, summed_states), self.structure.contact_rows // self.structure.contact_arms, 9)
            ),
        )

    def to_evaluation(self, buffer: SignalBuffer, at: slice | int = slice(None)) -> Evaluation:
        """Return the evaluation in a buffer, or at one place of it."""
        mechanism, rates, rows = self.mechanism, buffer.rates, buffer.rows[:, buffer.first :][:, : len(buffer.packed)]
        width, joints = mechanism.coordinates, mechanism.body.model.nv
        if not len(rates):
            rates = np.broadcast_to(np.nan, buffer.packed.shape)
        acceleration, rate = rates[:, width : 2 * width], rates
        if mechanism.positions != width and len(buffer.rates):
            acceleration, (q, v, _) = acceleration.copy(), mechanism.split(buffer.packed)
            for i in self.charts.angles:
                # From the second derivatives of the angles to the angular acceleration.
                a, b, c = v[:, i], v[:, i + 1], v[:, i + 2]
                acceleration[:, i : i + 3] += np.stack([b * c, -a * c, a * b], axis=1)
            moving = mechanism.body.position_rate(q[:, : mechanism.body.model.nq], v[:, :joints])
            rate = np.concatenate([moving, v[:, joints:], acceleration, rates[:, 2 * width :]], axis=1)
        signals, begin = {}, 0
        for table in mechanism.rows:
            end = begin + table.count
            columns, arms, begin = rows[:, at, begin:end], table.law.arms, end
            if buffer.column == ROW.force:
                signals[table.group] = RowSignals(table, None, columns[0], columns[0, ..., :0], ())
                continue
            stateful = np.arange(table.count) % arms > 0 if arms > 1 else slice(None)
            row = Row(*columns[: len(Row._fields)])._replace(state=columns[ROW.state][..., stateful], side=0.0)
            shown = tuple(columns[ROW.signals + i, ..., ::arms] for i in range(len(table.law.signals)))
            of_states = columns[ROW.rate][..., stateful]
            signals[table.group] = RowSignals(table, table.law.arguments(row), columns[ROW.force], of_states, shown)
        return Evaluation(
            mechanism.energies,
            signals,
            buffer.torques[at],
            buffer.tendon_torques[at],
            buffer.externals[at],
            acceleration[at],
            rate[at],
            base_power=buffer.energy_terms[at][..., -1:] if mechanism.moved else None,
            energy_terms=buffer.energy_terms[at],
            touching=ContactPoints(*np.split(buffer.touches[at], 3, axis=-1)) if buffer.touches.size else None,
        )

    def powers(
        self, x: Array, command: Array, force: Array | None = None, base: Array | None = None
    ) -> tuple[Array, Array]:
        """Return the powers of the rows, shape (m, powers), W, in the order of `Energies`, and J^T F, (m, N)."""
        buffer = self.allocate(len(x), "powers")
        self.fill(buffer, x, command, force, base)
        return buffer.energy_terms[:, len(self.mechanism.energies.stored) :], buffer.externals

    def fill(
        self, buffer: SignalBuffer, x: Array, command: Array, force: Array | None = None, base: Array | None = None
    ) -> None:
        """Fill a buffer with the signals of packed states, shape (size,) or (m, size)."""
        mechanism = self.mechanism
        # Compiled code checks no sizes.
        mechanism.split(np.asarray(x))
        buffer.packed[:] = x
        count, tips = len(buffer.packed), len(self.structure.tip_body)
        commands = as_core_array(command, (count, mechanism.channels))
        loaded = force is not None and bool(np.any(force))
        forces = np.zeros((count, tips, 3))
        if loaded:
            tip_force = np.asarray(force, dtype=float)
            forces[...] = tip_force[..., None, :] if tips == 1 else tip_force
        states, attitudes = buffer.packed, np.zeros((count, 0, 4))
        if self.charts.quaternions:
            states, attitudes = self.charts.to_core(states)
        fill(self.models, buffer, states, attitudes, commands, forces, base)

    def motion(self, position: Array, velocity: Array, base: Array | None = None) -> Motion:
        """Return tips and energies of the bodies at positions and velocities of the joints, shape (n,) or (m, n).

        With a base that moves, energies are those of the motion in the world, where the base has no height.
        """
        alone = position.ndim == 1
        count = 1 if alone else len(position)
        # A few postures after the other are asked for in loops: what is bound once serves them all.
        reusable = count < MIN_STATES_PER_THREAD and base is None
        buffers = self._motions.get(count) if reusable else None
        motions, tips, block = buffers or self._bound_motions(count, base)
        if reusable:
            self._motions[count] = motions, tips, block
        motions.positions[:], motions.velocities[:] = position, velocity
        motion_many(block.address)
        if alone:
            return Motion(tips[0].copy(), motions.kinetic[0].copy(), motions.potential[0].copy())
        return Motion(tips.copy(), motions.kinetic.copy(), motions.potential.copy())

    def _bound_motions(self, count: int, base: Array | None) -> _Asked:
        """Return buffers for postures, its tips, and the block by which compiled code finds it."""
        shape = (count, len(self.structure.parents))
        filled = np.zeros((count, len(self.structure.tip_body), 3)), np.zeros(count), np.zeros(count)
        motions = Motions(
            self.models.model().address, np.zeros(shape), np.zeros(shape), *filled, path_motions(base, count, 0)
        )
        block, tips = pack(motions, MOTIONS), motions.tips
        # Of one tip there is no axis.
        return motions, tips if tips.shape[1] != 1 else tips[:, 0], block


class CompiledFinger:
    """Compiled evaluation of a finger; not to be shared between threads.

    Attributes:
        finger: The finger.
        mechanism: Evaluator of its mechanism.
    """

    def __init__(self, finger: Finger) -> None:
        """Read a finger."""
        self.finger = finger
        self.mechanism = CompiledMechanism(finger.mechanism)

    def rebind(self, finger: Finger) -> bool:
        """Take another finger of the same structure; return False if it is none, and this is of no use."""
        kept = finger.mechanism.wiring is self.finger.mechanism.wiring and finger.rigid_body is self.finger.rigid_body
        self.finger = finger
        if not kept:
            vars(self).pop("_without_surroundings", None)
        return self.mechanism.rebind(finger.mechanism)

    def evaluate(
        self,
        x: Array,
        command: Array,
        fingertip_force: Array | None = None,
        base: Array | None = None,
        outputs: Outputs = "all",
    ) -> FingerSignals:
        """Return the signals of (18) at packed states, shape (size,) or (m, size); see `Finger.evaluate`."""
        evaluation = self.mechanism.evaluate(x, command, fingertip_force, base, outputs)
        return self.finger.signals(np.asarray(x), np.asarray(command), fingertip_force, evaluation)

    def powers(
        self, x: Array, command: Array, fingertip_force: Array | None = None, base: Array | None = None
    ) -> tuple[Array, Array]:
        """Return powers of the rows, shape (m, powers), W, in the order of `Energies`, and J^T F, shape (m, N)."""
        return self.mechanism.powers(x, command, fingertip_force, base)

    def motion(self, position: Array, velocity: Array, base: Array | None = None) -> Motion:
        """Return fingertip and energies of the rigid body at positions and velocities, shape (n,) or (m, n)."""
        return self._without_surroundings.motion(position, velocity, base)

    @cached_property
    def _without_surroundings(self) -> CompiledMechanism:
        """The mechanism of the finger without its surroundings, for fingertip and energies."""
        if self.finger.scene is None:
            return self.mechanism
        return CompiledMechanism(Mechanism(self.finger.rigid_body, [], moved=self.finger.mechanism.moved))
