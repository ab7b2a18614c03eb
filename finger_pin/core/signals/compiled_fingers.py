"""Fingers of one structure with different parameters, each evaluated at its own state."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from finger_pin.core.jit import Block, pack
from finger_pin.core.signals.compiled_finger import CompiledFinger
from finger_pin.core.signals.state_batches import STATES, evaluate_many
from finger_pin.mechanism.evaluation import Outputs
from finger_pin.mechanism.mechanism import PRESCRIBED_ACCELERATIONS
from finger_pin.mechanism.signals import FingerSignals
from finger_pin.mechanism.state import Motion
from finger_pin.typing import Array

_MOTION = ("tip", "kinetic_energy", "potential_energy")


class CompiledFingers:
    """Compiled evaluation of m fingers, each at a state; not to be shared between threads.

    What it returns is overwritten by the next evaluation.
    """

    def __init__(self, fingers: Sequence[CompiledFinger], *, accelerated: bool) -> None:
        """Bind fingers.

        Args:
            fingers: Of the same rows and states.
            accelerated: Whether accelerations are wanted, which take most of the time; they are NaN else.
        """
        self._fingers, self._first, self._accelerated = list(fingers), fingers[0], accelerated
        # Says where tips are as long as bodies are the same, whoever is the first: that it binds once.
        self._mover = fingers[0]
        mechanism, count = self._first.mechanism, len(fingers)
        structure = mechanism.structure
        self._buffer = mechanism.allocate(count, "all" if accelerated else "no_acceleration")
        self._states = np.zeros((count, mechanism.charts.size))
        self._attitudes = np.zeros((count, len(mechanism.charts.quaternions), 4))
        self._commands = np.zeros((count, mechanism.mechanism.channels))
        self._forces = np.zeros((count, len(structure.tip_body), 3))
        self._prescribed = int(structure.prescribed.max(initial=-1)) + 1
        self._bases = np.zeros((count, 15 + self._prescribed))
        # By whether there are forces at the tips, and whether the base moves.
        self._blocks: dict[tuple[bool, bool], list[Block]] = {}
        self._at_home = np.array([self._is_at_home(each) for each in fingers])

    def __reduce__(self) -> tuple[Any, ...]:
        """Return constructor and arguments for `copy.deepcopy` and pickles: a copy binds copies of the fingers."""
        return partial(CompiledFingers, accelerated=self._accelerated), (self._fingers,)

    def replace(self, index: int, finger: CompiledFinger) -> None:
        """Replace a finger by another one, or by itself with other parameters."""
        if finger is not self._fingers[index]:
            self._fingers[index], self._first = finger, self._fingers[0]
            for kind, blocks in self._blocks.items():
                blocks[index] = self._bound(index, *kind)
        compared = range(len(self._fingers)) if finger is self._mover else (index,)
        self._at_home[[*compared]] = [self._is_at_home(self._fingers[each]) for each in compared]

    def _is_at_home(self, finger: CompiledFinger) -> bool:
        """Return whether the tips of a finger are where the mover's are."""
        if finger is self._mover:
            return True
        joints, numbers = (
            len(finger.finger.routing.joints),
            (finger.mechanism.parameters, self._mover.mechanism.parameters),
        )
        bodies = [(each.bodies[:joints], each.tip_offset, each.gravity) for each in numbers]
        return all(map(np.array_equal, *bodies))

    def _bound(self, index: int, loaded: bool, moved: bool) -> Block:
        """Return a block with a finger, its state, and the arrays of its signals."""
        model = self._fingers[index].mechanism.models.model(loaded)
        bases = self._bases if moved else self._bases[:0]
        inputs = (self._states, self._commands, self._forces, bases, self._attitudes)
        return pack(self._buffer.states(slice(index, index + 1), model.address, *inputs), STATES)

    def evaluate(
        self,
        x: Array,
        command: Array,
        fingertip_force: Array | None = None,
        base: Array | None = None,
        outputs: Outputs = "all",
    ) -> FingerSignals:
        """Return the signals of (18) at packed states, shape (m, size); its buffers decide which outputs there are."""
        force = np.zeros(3) if fingertip_force is None else fingertip_force
        mechanism, loaded = self._first.mechanism, bool(np.any(force))
        self._buffer.packed[:], self._commands[:] = x, command
        # Of what touches, forces are added up.
        self._buffer.touches[:] = 0.0
        self._states[:], self._attitudes[:] = mechanism.charts.to_core(self._buffer.packed)
        # Of one tip, forces have no axis of their own for it.
        self._forces[:] = force if force.ndim == 1 or self._forces.shape[1] > 1 else force[:, None]
        if base is not None:
            self._bases[:, :15], self._bases[:, 15:] = (
                base[:, :15],
                base[:, PRESCRIBED_ACCELERATIONS : PRESCRIBED_ACCELERATIONS + self._prescribed],
            )
        kind = loaded, base is not None
        if kind not in self._blocks:
            self._blocks[kind] = [self._bound(index, *kind) for index in range(len(self._fingers))]
        for block in self._blocks[kind]:
            evaluate_many(block.address)
        evaluation = mechanism.to_evaluation(self._buffer)
        return self._first.finger.signals(x, command, fingertip_force, evaluation)

    def powers(
        self, x: Array, command: Array, fingertip_force: Array | None = None, base: Array | None = None
    ) -> tuple[Array, Array]:
        """Return powers of the rows, shape (m, powers), W, in the order of `Energies`, and J^T F, shape (m, N)."""
        self.evaluate(x, command, fingertip_force, base)
        stored = len(self._first.finger.mechanism.energies.stored)
        return self._buffer.energy_terms[:, stored:], self._buffer.externals

    def motion(self, position: Array, velocity: Array, base: Array | None = None) -> Motion:
        """Return fingertips and energies of the rigid bodies at positions and velocities, shape (m, n)."""
        if self._at_home.all() and base is None:
            return self._mover.motion(position, velocity)
        bases = [None] * len(position) if base is None else base
        motions = [
            each.motion(*arguments) for each, *arguments in zip(self._fingers, position, velocity, bases, strict=True)
        ]
        tips, kinetic, potential = (np.array([getattr(each, name) for each in motions]) for name in _MOTION)
        return Motion(tips, kinetic, potential)
