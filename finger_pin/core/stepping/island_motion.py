"""The motion of one island: its steps, its states between their ends, and the powers there."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from finger_pin.core.bound_models import Models, book_many
from finger_pin.core.jit import call
from finger_pin.core.stepping.interpolation import BETWEEN, COMMANDS, Between, Commands, command_many, interpolate_many
from finger_pin.core.stepping.island_stepper import Part, Record
from finger_pin.description.routing import Array
from finger_pin.mechanism.mechanism import Mechanism


@dataclass(frozen=True, eq=False)
class IslandMotion:
    """The steps of one island, from a start; angles of free bodies begin anew at each.

    Attributes:
        mechanism: The whole.
        part: The island, where its motion has ended.
        begin: Time of the start, s.
        start: State then.
        attitude: Quaternions of its free bodies then.
        record: The steps.
    """

    mechanism: Mechanism
    part: Part
    begin: float
    start: Array
    attitude: Array
    record: Record

    @property
    def times(self) -> Array:
        """Ends of the steps with the start first."""
        return np.concatenate([[self.begin], self.record.times])

    def interpolate(self, at: Array) -> tuple[Array, Array]:
        """Return states at times, shape (m, size), and the quaternions from which angles count, shape (m, f, 4)."""
        record, tables = self.record, self.part.tables
        at = np.array(at, dtype=float)
        found, turned = np.empty((len(at), len(self.start))), np.empty((len(at), *self.attitude.shape))
        if not len(record.times):
            found[:], turned[:] = self.start, self.attitude
            return found, turned
        width = len(tables.parents) + len(tables.lumps)
        between = Between(
            begin=self.begin,
            start=self.start,
            attitude=self.attitude,
            ends=record.times,
            states=record.states,
            attitudes=record.attitudes,
            dense=record.dense,
            charts=tables.charts,
            width=width,
            before=np.zeros_like(self.start),
            times=at,
            found=found,
            turned=turned,
        )
        call(interpolate_many, between, BETWEEN)
        return found, turned

    def powers(self, times: Array, force: Array, base: Array | None) -> Array:
        """Return powers of its rows and of the forces at its tips, shape (m, powers + 1), W, in the order of the books.

        Its inputs are those that the core computes itself.

        Args:
            times: Shape (m,), s.
            force: At all tips, shape (t, 3) or (m, t, 3), of one tip (3,) or (m, 3), N.
            base: As for `Mechanism.evaluate`, shape (m, 12 or more); None at rest.
        """
        part, (states, attitudes) = self.part, self.interpolate(times)
        commands = np.empty((len(times), len(part.control.tension)))
        call(command_many, Commands(part.model.address, np.array(times), states, commands), COMMANDS)
        tips = len(self.mechanism.body.tips)
        # Of one tip, forces over time have no axis of their own for it.
        given = force.reshape(-1, 1, 3) if tips == 1 else force
        forces = np.broadcast_to(given, (len(times), tips, 3))[:, part.island.tips]
        booked, external = book_many(self._models, states, attitudes, commands, forces, base)
        width, bodies = external.shape[1], len(part.tables.parents)
        fingertip = np.sum(external[:, :bodies] * states[:, width : width + bodies], axis=1)
        return np.column_stack([booked[:, len(self.mechanism.books.stored) :], fingertip])

    @cached_property
    def _models(self) -> Models:
        part = self.part
        count = len(self.mechanism.books.stored) + len(self.mechanism.books.powers)
        return Models(part.tables, part.laws, len(part.control.tension), self.mechanism.moved, count)
