"""The motion of one island: its steps, its states between their ends, and the powers there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from finger_pin.core.addresses.law_code import ROW
from finger_pin.core.jit import call, copied
from finger_pin.core.signals.bound_models import MIN_STATES_PER_THREAD, BoundModel
from finger_pin.core.signals.powers import POWERS, Powers, power_many
from finger_pin.core.stepping.island_stepper import IslandIntegrator, Record
from finger_pin.core.steps.interpolation import INTERPOLATION, Interpolation, interpolate_many
from finger_pin.description.caching import cached_property
from finger_pin.mechanism.mechanism import Mechanism
from finger_pin.threads import in_threads, threads
from finger_pin.typing import Array, Indices


@dataclass(frozen=True, eq=False)
class IslandMotion:
    """The steps of one island, from a start; angles of free bodies are reset at each.

    Attributes:
        mechanism: The whole.
        part: The island, where its motion has ended.
        begin: Time of the start, s.
        start: State then.
        attitude: Quaternions of its free bodies then.
        record: The steps.
        columns: Of the state's numbers those that the record has, in order, shape (k,); all others are zero throughout.
    """

    mechanism: Mechanism
    part: IslandIntegrator
    begin: float
    start: Array
    attitude: Array
    record: Record
    columns: Indices

    @property
    def times(self) -> Array:
        """Ends of the steps with the start first."""
        return np.concatenate([[self.begin], self.record.times])

    def interpolate(self, at: Array) -> tuple[Array, Array]:
        """Return states at times, shape (m, size), and the quaternions from which angles count, shape (m, f, 4)."""
        at = np.array(at, dtype=float)
        steps = self._steps_at(at, len(at))
        if len(self.record.times):
            call(interpolate_many, steps, INTERPOLATION)
        else:
            steps.interpolated[:], steps.turned[:] = steps.start, self.attitude
        if len(steps.start) == len(self.start):
            return steps.interpolated, steps.turned
        states = np.zeros((len(at), len(self.start)))
        states[:, self.columns] = steps.interpolated
        return states, steps.turned

    def _steps_at(self, times: Array, count: int = 0) -> Interpolation:
        """Return the steps and times with a buffer for m states."""
        record, structure = self.record, self.part.structure
        start = self.start[self.columns]
        return Interpolation(
            begin=self.begin,
            start=start,
            attitude=self.attitude,
            ends=record.times,
            states=record.states,
            attitudes=record.attitudes,
            dense=record.dense,
            charts=structure.charts,
            width=len(structure.prescribed),
            before=np.zeros_like(start),
            times=times,
            interpolated=np.empty((count, len(start))),
            turned=np.empty((count, *self.attitude.shape)),
        )

    def powers(self, times: Array) -> Array:
        """Return powers of its rows and of its tip forces, shape (m, powers + 1), W, in the order of `Energies`.

        Inputs, forces and the motion of the base are those that the core computes itself.

        Args:
            times: Shape (m,), s; there must be a step.
        """
        energies, count = self.mechanism.energies, len(times)
        powers = np.empty((count, len(energies.powers) + 1))
        parts = 1 if count < MIN_STATES_PER_THREAD else min(2, threads())
        while len(self._models) < parts:
            self._models.append(self._bound())

        def fill(thread: int) -> None:
            part = slice(thread * count // parts, (thread + 1) * count // parts)
            steps, columns = self._steps_at(np.array(times[part]), 1), self.columns
            energy_terms = np.zeros(len(energies.stored) + len(energies.powers))
            call(power_many, Powers(self._models[thread].address, steps, columns, energy_terms, powers[part]), POWERS)

        in_threads(fill, range(parts))
        return powers

    def _bound(self) -> BoundModel:
        """Return a further model of the island with its inputs."""
        part = self.part
        return BoundModel(part.structure, part.parameters.separate(), part.laws, copied(part.control), linearised=False)

    @cached_property
    def _models(self) -> list[BoundModel]:
        """Models, one for each thread; the first is the island's."""
        self.part.work.rows[ROW.side] = 0.0
        return [self.part.model]
