"""A mechanism whose evaluation is compiled: the same interface as `Mechanism` for signals."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from finger_pin.core.charts import Charts, place_all
from finger_pin.core.inputs import held_control
from finger_pin.core.law_code import COMMAND, CURVATURE, FORCE, LENGTH, LOAD, RATE, SIGNALS, SPEED, STATE
from finger_pin.core.model import BoundModel
from finger_pin.core.signals import evaluate_many, motion_many
from finger_pin.core.tables import build_tables, build_work
from finger_pin.description.routing import Array
from finger_pin.laws.law import Row
from finger_pin.mechanism.finger import Finger, FingerSignals
from finger_pin.mechanism.mechanism import Evaluation, Mechanism
from finger_pin.mechanism.rigid_body import Motion
from finger_pin.mechanism.rows import RowSignals


class CompiledMechanism:
    """Evaluates a mechanism without Python inside; not to be shared between threads."""

    def __init__(self, mechanism: Mechanism) -> None:
        """Read a mechanism."""
        self.mechanism = mechanism
        self._charts = Charts.of(mechanism)
        tables = build_tables(mechanism)
        laws = [table.law for table in mechanism.rows]
        control = held_control(mechanism.channels, mechanism.coordinates)
        # Each has work of its own: without loads, nothing writes where loads have left their torques.
        self._models = [
            BoundModel(tables._replace(loaded=loaded), control, build_work(tables, laws, mechanism.channels))
            for loaded in (False, True)
        ]

    def evaluate(self, x: Array, command: Array, force: Array | None = None) -> Evaluation:
        """Return everything at packed states, shape (size,) or (m, size); see `Mechanism.evaluate`."""
        mechanism, tables = self.mechanism, self._models[0].model.tables
        # Compiled code checks no sizes.
        mechanism.split(np.asarray(x))
        packed = _rows(x, np.atleast_2d(x).shape)
        count, width = len(packed), mechanism.coordinates
        commands = _rows(command, (count, mechanism.channels))
        tips = len(tables.tip_body)
        loaded = force is not None and bool(np.any(force))
        forces = np.zeros((count, tips, 3))
        if loaded:
            given = np.asarray(force, dtype=float)
            forces[...] = given[..., None, :] if tips == 1 else given
        states, attitudes = self._charts.to_core(packed)
        rates, rows = np.zeros_like(states), np.zeros((len(self._models[0].model.work.rows), count, len(tables.state)))
        torques, externals = np.zeros((2, count, width))
        address = self._models[loaded].address
        parts = [slice(None)] if not len(tables.charts) else [slice(m, m + 1) for m in range(count)]
        for part in parts:
            if len(tables.charts):
                place_all(tables, attitudes[part][0])
            filled = np.ascontiguousarray(rows[:, part])
            evaluate_many(
                address,
                states[part],
                commands[part],
                forces[part],
                rates[part],
                filled,
                torques[part],
                externals[part],
            )
            rows[:, part] = filled
        return self._evaluation(np.ndim(x) == 1, packed, rates, rows, torques, externals)

    def _evaluation(
        self, single: bool, packed: Array, rates: Array, rows: Array, torques: Array, externals: Array
    ) -> Evaluation:
        mechanism, width = self.mechanism, self.mechanism.coordinates
        acceleration, joints = rates[:, width : 2 * width], mechanism.body.model.nv
        rate = rates
        if mechanism.positions != width:
            q, v, _ = mechanism.split(packed)
            for i in self._charts.angles:
                # From the second derivatives of the angles to the angular acceleration.
                x, y, z = v[:, i], v[:, i + 1], v[:, i + 2]
                acceleration[:, i : i + 3] += np.stack([y * z, -x * z, x * y], axis=1)
            moving = mechanism.body.position_rate(q[:, : mechanism.body.model.nq], v[:, :joints])
            rate = np.concatenate([moving, v[:, joints:], rates[:, width:]], axis=1)
        at = 0 if single else slice(None)
        found, begin = {}, 0
        for table in mechanism.rows:
            end = begin + len(table.names)
            own = rows[:, at, begin:end]
            seen = Row(*(own[c] for c in (LENGTH, SPEED, STATE, LOAD, COMMAND, CURVATURE)))
            shown = tuple(own[SIGNALS + i] for i in range(len(table.law.signals)))
            found[table.group] = RowSignals(table, seen, own[FORCE], own[RATE], shown)
            begin = end
        return Evaluation(found, torques[at], externals[at], acceleration[at], rate[at])

    def motion(self, position: Array, velocity: Array) -> Motion:
        """Return tips and energies of the bodies at positions and velocities of the joints, shape (n,) or (m, n)."""
        tables = self._models[0].model.tables
        shape = (np.atleast_2d(position).shape[0], len(tables.parents))
        tips, kinetic, potential = np.zeros((shape[0], len(tables.tip_body), 3)), np.zeros(shape[0]), np.zeros(shape[0])
        motion_many(self._models[0].address, _rows(position, shape), _rows(velocity, shape), tips, kinetic, potential)
        at = 0 if np.ndim(position) == 1 else slice(None)
        return Motion(tips[at, 0] if np.ndim(position) == 1 else tips[:, 0], kinetic[at], potential[at])


class CompiledFinger:
    """Evaluates a finger without Python inside; not to be shared between threads.

    Attributes:
        finger: The finger.
    """

    def __init__(self, finger: Finger) -> None:
        """Read a finger."""
        self.finger = finger
        self._mechanism = CompiledMechanism(finger.mechanism)

    def evaluate(self, x: Array, command: Array, fingertip_force: Array | None = None) -> FingerSignals:
        """Return all signals of (18) at packed states, shape (size,) or (m, size); see `Finger.evaluate`."""
        found = self._mechanism.evaluate(x, command, fingertip_force)
        return self.finger.signals(np.asarray(x), np.asarray(command), fingertip_force, found)

    def motion(self, position: Array, velocity: Array) -> Motion:
        """Return fingertip and energies of the rigid body at positions and velocities, shape (n,) or (m, n)."""
        return self._mechanism.motion(position, velocity)


def _rows(values: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Return a copy of one kind alone, of which the core has one compilation: writable, contiguous, of floats."""
    return np.array(np.broadcast_to(values, shape), dtype=float, order="C")
