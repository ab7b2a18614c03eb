"""A mechanism whose evaluation is compiled: the same interface as `Mechanism` for signals."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from finger_pin.core.control import held_control
from finger_pin.core.evaluation.charts import Charts
from finger_pin.core.evaluation.law_code import COMMAND, CURVATURE, FORCE, LENGTH, LOAD, RATE, SIGNALS, SPEED, STATE
from finger_pin.core.evaluation.signals import MOTIONS, STATES, Motions, States, evaluate_many, motion_many
from finger_pin.core.jit import bound, call
from finger_pin.core.model import BoundModel
from finger_pin.core.stepping.stepper import in_threads
from finger_pin.core.tables import Tables, build_tables
from finger_pin.core.work import build_work
from finger_pin.description.routing import Array
from finger_pin.laws.contact import CONTACT
from finger_pin.laws.law import ContactLaw, Law
from finger_pin.mechanism.evaluation import Evaluation, Touching
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.finger_signals import FingerSignals
from finger_pin.mechanism.kinematics import Motion
from finger_pin.mechanism.mechanism import GUIDES, Mechanism
from finger_pin.mechanism.rows import RowSignals

# Fewer states than this are not worth a second thread.
_FEW = 1000


class Room(NamedTuple):
    """What `evaluate_many` fills for m states, beside the packed states, shape (m, size).

    The rows are those of more states, these from the ``first`` on: compiled code takes them whole.
    """

    packed: Array
    rates: Array
    rows: Array
    first: int
    torques: Array
    externals: Array
    booked: Array
    touches: Array

    def part(self, at: slice) -> Room:
        """Return the room of some of the states, the same memory."""
        first = self.first + at.indices(len(self.packed))[0]
        own = (self.packed, self.rates, self.torques, self.externals, self.booked, self.touches)
        packed, rates, torques, externals, booked, touches = (values[at] for values in own)
        return Room(packed, rates, self.rows, first, torques, externals, booked, touches)


class Models:
    """Models of the same tables under inputs that are given: memory for threads, and with or without forces at tips."""

    def __init__(
        self, tables: Tables, laws: Sequence[Law | ContactLaw], channels: int, moved: bool, books: int
    ) -> None:
        """Keep what they are made of.

        Args:
            tables: Of a mechanism or an island.
            laws: Of their groups of rows.
            channels: Number of inputs.
            moved: Whether the base moves.
            books: Number of energies and powers that are booked.
        """
        self.tables, self.books = tables, books
        self._laws, self._channels, self._moved = laws, channels, moved
        self._known: dict[tuple[bool, int], BoundModel] = {}

    def model(self, loaded: bool = False, thread: int = 0) -> BoundModel:
        """Return a thread's model that minds forces at the tips or not.

        Each has memory of its own: without loads, nothing writes where loads have left their torques.
        """
        if (loaded, thread) not in self._known:
            tables = self.tables
            own = tables._replace(loaded=loaded, tip_force=tables.tip_force.copy(), bodies=tables.bodies.copy())
            work = build_work(own, self._laws, self._channels)
            control = held_control(self._channels, len(work.torque))
            self._known[loaded, thread] = BoundModel(own, control, work, self._moved)
        return self._known[loaded, thread]


def book_many(
    models: Models, states: Array, attitudes: Array, commands: Array, forces: Array, base: Array | None
) -> tuple[Array, Array]:
    """Return energies and powers at states of the core, shape (m, books), and J^T F, shape (m, N).

    Args:
        models: Of the mechanism or island.
        states: Shape (m, size), of the core.
        attitudes: Of free bodies, shape (m, f, 4).
        commands: Inputs, shape (m, u).
        forces: At the tips, shape (m, t, 3), N.
        base: How the base moves, as for `Mechanism.evaluate`, shape (m, 12 or more); None at rest.
    """
    count, work = len(states), models.model().model.work
    room = Room(
        packed=states,
        rates=np.zeros((0, states.shape[1])),
        rows=np.zeros((len(work.rows), 0, work.rows.shape[1])),
        first=0,
        torques=np.zeros((count, len(work.torque))),
        externals=np.zeros((count, len(work.torque))),
        booked=np.zeros((count, models.books)),
        touches=np.zeros((0, models.tables.touching // CONTACT.arms, 9)),
    )
    _fill(models, room, states, attitudes, commands, np.ascontiguousarray(forces), base)
    return room.booked, room.externals


def _fill(
    models: Models, room: Room, states: Array, attitudes: Array, commands: Array, forces: Array, base: Array | None
) -> None:
    bases = _bases(base, len(states), int(models.tables.guided.max(initial=-1)) + 1)
    loaded, count = bool(np.any(forces)), len(states)

    def fill(model: BoundModel, part: slice) -> None:
        own = room.part(part)
        filled = (own.rates, own.rows, own.first, own.torques, own.externals, own.booked)
        given = (states[part], commands[part], forces[part], *filled, bases[part], attitudes[part], own.touches)
        call(evaluate_many, States(model.address, *given), STATES)

    if count < _FEW:
        fill(models.model(loaded), slice(None))
    else:
        half = count // 2
        pair = (models.model(loaded), models.model(loaded, 1))
        in_threads(lambda each: fill(*each), list(zip(pair, (slice(half), slice(half, None)), strict=True)))


class CompiledMechanism:
    """Evaluates a mechanism without Python inside; not to be shared between threads.

    Attributes:
        mechanism: The mechanism.
        charts: Where its packed states have quaternions.
        tables: Its arrays.
        models: Bound models of them.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        """Read a mechanism."""
        self.mechanism = mechanism
        self.charts = Charts.of(mechanism)
        self.tables = build_tables(mechanism)
        laws, books = [table.law for table in mechanism.rows], mechanism.books
        count = len(books.stored) + len(books.powers)
        self.models = Models(self.tables, laws, mechanism.channels, mechanism.moved, count)
        self._motions: dict[int, tuple[Motions, NDArray[np.uint8]]] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        """Return constructor and arguments for `copy.deepcopy` and pickles: a copy binds models of its own."""
        return CompiledMechanism, (self.mechanism,)

    def evaluate(
        self,
        x: Array,
        command: Array,
        force: Array | None = None,
        base: Array | None = None,
        *,
        accelerated: bool = True,
    ) -> Evaluation:
        """Return everything at packed states, shape (size,) or (m, size); see `Mechanism.evaluate`.

        Without accelerations, which take most of the time, they and the rate are NaN.
        """
        room = self.room(len(np.atleast_2d(x)), accelerated=accelerated)
        self.fill(room, x, command, force, base)
        return self.found(room, slice(None) if np.ndim(x) > 1 else 0)

    def room(self, count: int, *, booked_only: bool = False, accelerated: bool = True) -> Room:
        """Return room for what is computed of so many states: all, or energies, powers and J^T F only."""
        mechanism, work = self.mechanism, self.models.model().model.work
        width, kept = mechanism.coordinates, 0 if booked_only else count
        return Room(
            packed=np.zeros((count, mechanism.size)),
            rates=np.zeros((kept if accelerated else 0, self.charts.size)),
            rows=np.zeros((len(work.rows), kept, work.rows.shape[1])),
            first=0,
            torques=np.zeros((count, width)),
            externals=np.zeros((count, width)),
            booked=np.zeros((count, len(mechanism.books.stored) + len(mechanism.books.powers))),
            touches=np.zeros((kept, self.tables.touching // CONTACT.arms, 9)),
        )

    def found(self, room: Room, at: slice | int = slice(None)) -> Evaluation:
        """Return what fills a room, or what does so at one place."""
        mechanism, rates, rows = self.mechanism, room.rates, room.rows[:, room.first :][:, : len(room.packed)]
        width, joints = mechanism.coordinates, mechanism.body.model.nv
        if not len(rates):
            rates = np.full((len(room.packed), mechanism.size), np.nan)
        acceleration, rate = rates[:, width : 2 * width], rates
        if mechanism.positions != width and len(room.rates):
            acceleration, (q, v, _) = acceleration.copy(), mechanism.split(room.packed)
            for i in self.charts.angles:
                # From the second derivatives of the angles to the angular acceleration.
                a, b, c = v[:, i], v[:, i + 1], v[:, i + 2]
                acceleration[:, i : i + 3] += np.stack([b * c, -a * c, a * b], axis=1)
            moving = mechanism.body.position_rate(q[:, : mechanism.body.model.nq], v[:, :joints])
            rate = np.concatenate([moving, v[:, joints:], acceleration, rates[:, 2 * width :]], axis=1)
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
            room.torques[at],
            room.externals[at],
            acceleration[at],
            rate[at],
            base_power=room.booked[at][..., -1:] if mechanism.moved else None,
            booked=room.booked[at],
            touching=Touching(*np.split(room.touches[at], 3, axis=-1)) if room.touches.size else None,
        )

    def powers(
        self, x: Array, command: Array, force: Array | None = None, base: Array | None = None
    ) -> tuple[Array, Array]:
        """Return the powers of the rows, shape (m, powers), W, in the order of the books, and J^T F, (m, N)."""
        room = self.room(len(x), booked_only=True)
        self.fill(room, x, command, force, base)
        return room.booked[:, len(self.mechanism.books.stored) :], room.externals

    def fill(self, room: Room, x: Array, command: Array, force: Array | None = None, base: Array | None = None) -> None:
        """Fill a room with what is computed of packed states, shape (size,) or (m, size)."""
        mechanism, tables = self.mechanism, self.tables
        # Compiled code checks no sizes.
        mechanism.split(np.asarray(x))
        room.packed[:] = x
        count, tips = len(room.packed), len(tables.tip_body)
        commands = _rows(command, (count, mechanism.channels))
        loaded = force is not None and bool(np.any(force))
        forces = np.zeros((count, tips, 3))
        if loaded:
            given = np.asarray(force, dtype=float)
            forces[...] = given[..., None, :] if tips == 1 else given
        states, attitudes = self.charts.to_core(room.packed)
        _fill(self.models, room, states, attitudes, commands, forces, base)

    def motion(self, position: Array, velocity: Array, base: Array | None = None) -> Motion:
        """Return tips and energies of the bodies at positions and velocities of the joints, shape (n,) or (m, n).

        With a base that moves, energies are those of the motion in the world, where the base has no height.
        """
        count, alone = len(np.atleast_2d(position)), np.ndim(position) == 1
        # A few postures after the other are asked for in loops: what is bound once serves them all.
        kept = count < _FEW and base is None
        found = self._motions.get(count) if kept else None
        motions, block = found or self._bound_motions(count, base)
        if kept:
            self._motions[count] = motions, block
        motions.positions[:], motions.velocities[:] = position, velocity
        motion_many(block.ctypes.data)
        at = 0 if alone else slice(None)
        tips = motions.tips[at] if motions.tips.shape[1] != 1 else motions.tips[at][..., 0, :]
        return Motion(tips.copy(), motions.kinetic[at].copy(), motions.potential[at].copy())

    def _bound_motions(self, count: int, base: Array | None) -> tuple[Motions, NDArray[np.uint8]]:
        """Return room for postures, and the block that compiled code finds it by."""
        tables = self.tables
        shape = (count, len(tables.parents))
        filled = np.zeros((count, len(tables.tip_body), 3)), np.zeros(count), np.zeros(count)
        motions = Motions(
            self.models.model().address, np.zeros(shape), np.zeros(shape), *filled, _bases(base, count, 0)
        )
        return motions, bound(motions, MOTIONS)


class CompiledFinger:
    """Evaluates a finger without Python inside; not to be shared between threads.

    Attributes:
        finger: The finger.
        mechanism: What evaluates its mechanism.
    """

    def __init__(self, finger: Finger) -> None:
        """Read a finger."""
        self.finger = finger
        self.mechanism = CompiledMechanism(finger.mechanism)

    def evaluate(
        self, x: Array, command: Array, fingertip_force: Array | None = None, base: Array | None = None
    ) -> FingerSignals:
        """Return all signals of (18) at packed states, shape (size,) or (m, size); see `Finger.evaluate`."""
        found = self.mechanism.evaluate(x, command, fingertip_force, base)
        return self.finger.signals(np.asarray(x), np.asarray(command), fingertip_force, found)

    def exerted(
        self, x: Array, command: Array, fingertip_force: Array | None = None, base: Array | None = None
    ) -> FingerSignals:
        """Return the same with no accelerations, which are NaN."""
        found = self.mechanism.evaluate(x, command, fingertip_force, base, accelerated=False)
        return self.finger.signals(np.asarray(x), np.asarray(command), fingertip_force, found)

    def powers(
        self, x: Array, command: Array, fingertip_force: Array | None = None, base: Array | None = None
    ) -> tuple[Array, Array]:
        """Return powers of the rows, shape (m, powers), W, in the order of the books, and J^T F, shape (m, N)."""
        return self.mechanism.powers(x, command, fingertip_force, base)

    def motion(self, position: Array, velocity: Array, base: Array | None = None) -> Motion:
        """Return fingertip and energies of the rigid body at positions and velocities, shape (n,) or (m, n)."""
        return self._alone.motion(position, velocity, base)

    @cached_property
    def _alone(self) -> CompiledMechanism:
        """What fingertip and energies are of: the finger without what surrounds it."""
        if self.finger.surroundings is None:
            return self.mechanism
        return CompiledMechanism(Mechanism(self.finger.rigid_body, [], moved=self.finger.mechanism.moved))


def _bases(base: Array | None, count: int, guided: int) -> Array:
    """Return the motions of the base and of what is moved along paths, shape (count, 15 + g), or no rows at rest."""
    if base is None:
        return np.zeros((0, 15 + guided))
    given = np.concatenate([base[..., :15], base[..., GUIDES : GUIDES + guided]], axis=-1)
    return _rows(given, (count, 15 + guided))


def _rows(values: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Return a copy of one kind alone, of which the core has one compilation: writable, contiguous, of floats."""
    return np.array(np.broadcast_to(values, shape), dtype=float, order="C")
