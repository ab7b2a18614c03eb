"""A mechanism whose evaluation is compiled: the same interface as `Mechanism` for signals."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from finger_pin.core.charts import Charts
from finger_pin.core.control import held_control
from finger_pin.core.law_code import COMMAND, CURVATURE, FORCE, LENGTH, LOAD, RATE, SIGNALS, SPEED, STATE
from finger_pin.core.model import BoundModel
from finger_pin.core.signals import evaluate_many, motion_many
from finger_pin.core.stepper import in_threads
from finger_pin.core.tables import build_tables
from finger_pin.core.work import build_work
from finger_pin.description.routing import Array
from finger_pin.mechanism.evaluation import Evaluation
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.finger_signals import FingerSignals
from finger_pin.mechanism.kinematics import Motion
from finger_pin.mechanism.mechanism import GUIDES, Mechanism
from finger_pin.mechanism.rows import RowSignals

# Fewer states than this are not worth a second thread.
_FEW = 1000


class CompiledMechanism:
    """Evaluates a mechanism without Python inside; not to be shared between threads."""

    def __init__(self, mechanism: Mechanism) -> None:
        """Read a mechanism."""
        self.mechanism = mechanism
        self._charts = Charts.of(mechanism)
        self._tables = build_tables(mechanism)
        self._models: dict[tuple[bool, int], BoundModel] = {}

    def _model(self, loaded: bool = False, thread: int = 0) -> BoundModel:
        """Return a thread's model that minds forces at the tips or not.

        Each has memory of its own: without loads, nothing writes where loads have left their torques.
        """
        if (loaded, thread) not in self._models:
            mechanism, tables = self.mechanism, self._tables
            own = tables._replace(loaded=loaded, tip_force=tables.tip_force.copy(), bodies=tables.bodies.copy())
            work = build_work(own, [table.law for table in mechanism.rows], mechanism.channels)
            control = held_control(mechanism.channels, mechanism.coordinates)
            self._models[loaded, thread] = BoundModel(own, control, work, mechanism.moved)
        return self._models[loaded, thread]

    def evaluate(self, x: Array, command: Array, force: Array | None = None, base: Array | None = None) -> Evaluation:
        """Return everything at packed states, shape (size,) or (m, size); see `Mechanism.evaluate`."""
        mechanism, several = self.mechanism, np.ndim(x) > 1
        packed, filled = self._filled(x, command, force, base)
        rates, rows, torques, externals, booked = filled
        width, joints = mechanism.coordinates, mechanism.body.model.nv
        acceleration, rate = rates[:, width : 2 * width], rates
        if mechanism.positions != width:
            q, v, _ = mechanism.split(packed)
            for i in self._charts.angles:
                # From the second derivatives of the angles to the angular acceleration.
                a, b, c = v[:, i], v[:, i + 1], v[:, i + 2]
                acceleration[:, i : i + 3] += np.stack([b * c, -a * c, a * b], axis=1)
            moving = mechanism.body.position_rate(q[:, : mechanism.body.model.nq], v[:, :joints])
            rate = np.concatenate([moving, v[:, joints:], rates[:, width:]], axis=1)
        at = slice(None) if several else 0
        found, begin = {}, 0
        for table in mechanism.rows:
            end = begin + table.count
            own, arms = rows[:, at, begin:end], table.law.arms
            stateful = np.arange(table.count) % arms > 0 if arms > 1 else slice(None)
            seen = table.law.sees(
                own[LENGTH], own[SPEED], own[STATE][..., stateful], *(own[c] for c in (LOAD, COMMAND, CURVATURE))
            )
            shown = tuple(own[SIGNALS + i, ..., ::arms] for i in range(len(table.law.signals)))
            found[table.group] = RowSignals(table, seen, own[FORCE], own[RATE][..., stateful], shown)
            begin = end
        return Evaluation(
            mechanism.books,
            found,
            torques[at],
            externals[at],
            acceleration[at],
            rate[at],
            base_power=booked[at][..., -1:] if mechanism.moved else None,
            booked=booked[at],
        )

    def powers(
        self, x: Array, command: Array, force: Array | None = None, base: Array | None = None
    ) -> tuple[Array, Array]:
        """Return what the rows supply and lose, shape (m, powers), W, in the order of the books, and J^T F, (m, N)."""
        _, (_, _, _, externals, booked) = self._filled(x, command, force, base, booked_only=True)
        return booked[:, len(self.mechanism.books.stored) :], externals

    def _filled(
        self, x: Array, command: Array, force: Array | None, base: Array | None, *, booked_only: bool = False
    ) -> tuple[Array, tuple[Array, ...]]:
        """Return packed states, and what `evaluate_many` fills for them: all, or energies, powers and J^T F only."""
        mechanism, tables = self.mechanism, self._tables
        # Compiled code checks no sizes.
        mechanism.split(np.asarray(x))
        packed = _rows(x, np.atleast_2d(x).shape)
        count, width, tips = len(packed), mechanism.coordinates, len(tables.tip_body)
        commands = _rows(command, (count, mechanism.channels))
        loaded = force is not None and bool(np.any(force))
        forces = np.zeros((count, tips, 3))
        if loaded:
            given = np.asarray(force, dtype=float)
            forces[...] = given[..., None, :] if tips == 1 else given
        bases = _bases(base, count, int(tables.guided.max(initial=-1)) + 1)
        states, attitudes = self._charts.to_core(packed)
        books = len(mechanism.books.stored) + len(mechanism.books.powers)
        kept = 0 if booked_only else count
        rates, rows = np.zeros((kept, states.shape[1])), np.zeros((kept, *self._model().model.work.rows.shape))
        torques, externals, booked = np.zeros((count, width)), np.zeros((count, width)), np.zeros((count, books))

        def fill(model: BoundModel, part: slice) -> None:
            evaluate_many(
                model.address,
                states[part],
                commands[part],
                forces[part],
                rates[part],
                rows[part],
                torques[part],
                externals[part],
                booked[part],
                bases[part],
                attitudes[part],
            )

        if count < _FEW:
            fill(self._model(loaded), slice(None))
        else:
            half = count // 2
            models = (self._model(loaded), self._model(loaded, 1))
            in_threads(lambda each: fill(*each), list(zip(models, (slice(half), slice(half, None)), strict=True)))
        return packed, (rates, np.moveaxis(rows, 1, 0), torques, externals, booked)

    def motion(self, position: Array, velocity: Array, base: Array | None = None) -> Motion:
        """Return tips and energies of the bodies at positions and velocities of the joints, shape (n,) or (m, n).

        With a base that moves, energies are those of the motion in the world, where the base has no height.
        """
        tables = self._tables
        shape = (np.atleast_2d(position).shape[0], len(tables.parents))
        tips, kinetic, potential = np.zeros((shape[0], len(tables.tip_body), 3)), np.zeros(shape[0]), np.zeros(shape[0])
        given = _rows(position, shape), _rows(velocity, shape)
        motion_many(self._model().address, *given, tips, kinetic, potential, _bases(base, shape[0], 0))
        at = 0 if np.ndim(position) == 1 else slice(None)
        return Motion(tips[at] if tips.shape[1] != 1 else tips[at][..., 0, :], kinetic[at], potential[at])


class CompiledFinger:
    """Evaluates a finger without Python inside; not to be shared between threads.

    Attributes:
        finger: The finger.
    """

    def __init__(self, finger: Finger) -> None:
        """Read a finger."""
        self.finger = finger
        self._mechanism = CompiledMechanism(finger.mechanism)
        # Fingertip and energies are those of the finger alone.
        self._alone = self._mechanism
        if finger.surroundings is not None:
            self._alone = CompiledMechanism(Mechanism(finger.rigid_body, [], moved=finger.mechanism.moved))

    def evaluate(
        self, x: Array, command: Array, fingertip_force: Array | None = None, base: Array | None = None
    ) -> FingerSignals:
        """Return all signals of (18) at packed states, shape (size,) or (m, size); see `Finger.evaluate`."""
        found = self._mechanism.evaluate(x, command, fingertip_force, base)
        return self.finger.signals(np.asarray(x), np.asarray(command), fingertip_force, found)

    def powers(
        self, x: Array, command: Array, fingertip_force: Array | None = None, base: Array | None = None
    ) -> tuple[Array, Array]:
        """Return powers of the rows, shape (m, powers), W, in the order of the books, and J^T F, shape (m, N)."""
        return self._mechanism.powers(x, command, fingertip_force, base)

    def motion(self, position: Array, velocity: Array, base: Array | None = None) -> Motion:
        """Return fingertip and energies of the rigid body at positions and velocities, shape (n,) or (m, n)."""
        return self._alone.motion(position, velocity, base)


def _bases(base: Array | None, count: int, guided: int) -> Array:
    """Return how the base moves, and what is moved along paths, shape (count, 15 + g), or no rows at rest."""
    if base is None:
        return np.zeros((0, 15 + guided))
    given = np.concatenate([base[..., :15], base[..., GUIDES : GUIDES + guided]], axis=-1)
    return _rows(given, (count, 15 + guided))


def _rows(values: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Return a copy of one kind alone, of which the core has one compilation: writable, contiguous, of floats."""
    return np.array(np.broadcast_to(values, shape), dtype=float, order="C")
