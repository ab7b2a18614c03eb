"""Models of a mechanism under given inputs, and batched evaluation of states."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from finger_pin.core.evaluation.condensation import condense
from finger_pin.core.evaluation.contacts import add_pushes, fill_contact_gains, measure
from finger_pin.core.evaluation.dynamics import evaluate, exert
from finger_pin.core.evaluation.linearisation import linearise
from finger_pin.core.evaluation.moving_base import base_power, bias_rate, move_base
from finger_pin.core.evaluation.path_derivatives import linearise_paths
from finger_pin.core.evaluation.paths import look
from finger_pin.core.jit import call, copied, empty_table, overwrite, pack
from finger_pin.core.signals.state_batches import STATES, States, evaluate_many
from finger_pin.core.tables.buffers import build_work
from finger_pin.core.tables.inputs import InputTable, held_control
from finger_pin.core.tables.linear_systems import Linear, build_linear
from finger_pin.core.tables.mechanism_parameters import Parameters
from finger_pin.core.tables.model import MODEL, Model
from finger_pin.core.tables.structure import Structure
from finger_pin.laws.law import ContactLaw, Law
from finger_pin.mechanism.mechanism import PRESCRIBED_ACCELERATIONS
from finger_pin.threads import in_threads, threads
from finger_pin.typing import Array

#: Fewer states than this are not worth a second thread.
MIN_STATES_PER_THREAD = 1000


class SignalBuffer(NamedTuple):
    """Output buffers of `evaluate_many` for m states.

    The rows are those of more states, these from the ``first`` on: compiled code takes them whole; ``column`` is the
    first of the table that they have.
    """

    packed: Array
    rates: Array
    rows: Array
    first: int
    column: int
    torques: Array
    tendons: Array
    tendon_torques: Array
    externals: Array
    energy_terms: Array
    touches: Array

    def part(self, at: slice) -> SignalBuffer:
        """Return the buffer of some of the states, the same memory."""
        first = self.first + at.indices(len(self.packed))[0]
        names = ("packed", "rates", "torques", "tendon_torques", "externals", "energy_terms", "touches")
        return self._replace(first=first, **{name: getattr(self, name)[at] for name in names})

    def states(
        self, at: slice, model: int, states: Array, commands: Array, forces: Array, bases: Array, attitudes: Array
    ) -> States:
        """Return some states with the arrays of their signals, for the model at an address."""
        buffer = self.part(at)
        return States(
            model=model,
            states=states[at],
            commands=commands[at],
            forces=forces[at],
            rates=buffer.rates,
            rows=buffer.rows,
            first=buffer.first,
            column=buffer.column,
            torques=buffer.torques,
            tendons=buffer.tendons,
            tendon_torques=buffer.tendon_torques,
            externals=buffer.externals,
            energy_terms=buffer.energy_terms,
            bases=bases[at],
            attitudes=attitudes[at],
            touches=buffer.touches,
        )


# Of models that only evaluate.
_NO_LINEARISATION = empty_table(Linear)
# In the order of the addresses of a `Model`.
_PATH_UNITS = (measure, linearise_paths, fill_contact_gains, add_pushes, look)
_MOVING_BASE_UNITS = (move_base, bias_rate, base_power)


class BoundModel:
    """A model and its address.

    Attributes:
        model: Its arrays, which live as long as this.
        address: Of what `unpack` reads.
    """

    def __init__(
        self,
        structure: Structure,
        parameters: Parameters,
        laws: Sequence[Law | ContactLaw],
        control: InputTable,
        moved: bool = False,
        linearised: bool = True,
    ) -> None:
        """Bind; arrays are taken as they are, not copied, and belong to it if it is to `rebind`.

        Args:
            structure: Of a mechanism.
            parameters: Its parameters.
            laws: Of its groups of rows.
            control: Its inputs.
            moved: Whether the base is moved by others than its control.
            linearised: Whether it has memory for `linearise` and `condense`.
        """
        size = 2 * len(structure.prescribed) + len(structure.state_row)
        moved = moved or len(control.palm.harmonics) > 0
        through_space = len(structure.paths.columns) > 0
        units = [unit.address for unit in (evaluate, exert, linearise, condense)]
        # Compiled only for mechanisms that need them: paths through space or contacts, and a base that moves.
        units += [unit.address if through_space else 0 for unit in _PATH_UNITS]
        units += [unit.address if moved else 0 for unit in _MOVING_BASE_UNITS]
        work = build_work(structure, laws, len(control.tension))
        linear = build_linear(structure, control) if linearised else _NO_LINEARISATION
        self.model = Model(structure, parameters, control, work, linear, np.zeros(size), np.zeros(size), *units)
        self._fill_constants()
        self._block = pack(self.model, MODEL)
        self.address = self._block.address

    def rebind(self, parameters: Parameters) -> bool:
        """Take other parameters of the same structure, by value; return False, unchanged, if they do not fit."""
        if not overwrite(self.model.parameters, parameters):
            return False
        self._fill_constants()
        return True

    def _fill_constants(self) -> None:
        """Fill in what no evaluation changes but those of paths and of moving bodies."""
        structure, parameters, work, linear = (
            self.model.structure,
            self.model.parameters,
            self.model.work,
            self.model.linear,
        )
        work.base_acceleration[3:] = -parameters.gravity
        work.arm[:], work.gradient[:] = parameters.arm, parameters.measure
        work.paths.frame[:], work.paths.origin[:] = parameters.paths.rotation, parameters.paths.origin
        if linear is not _NO_LINEARISATION:
            lumped = np.arange(len(structure.parents), len(structure.prescribed))
            linear.mass[lumped, lumped] = parameters.lumps
            linear.arm[:], linear.measure[:], linear.bend[:] = parameters.arm, parameters.measure, parameters.bend


class Models:
    """Models of the same mechanism under given inputs: memory for threads, with or without forces at tips."""

    def __init__(
        self, structure: Structure, parameters: Parameters, laws: Sequence[Law | ContactLaw], channels: int, moved: bool
    ) -> None:
        """Keep a mechanism.

        Args:
            structure: Of a mechanism.
            parameters: Its parameters.
            laws: Of its groups of rows.
            channels: Number of inputs.
            moved: Whether the base moves.
        """
        self.structure, self.parameters = structure, parameters
        self._laws, self._channels, self._moved = laws, channels, moved
        self._known: dict[tuple[bool, int], BoundModel] = {}

    def model(self, loaded: bool = False, thread: int = 0) -> BoundModel:
        """Return a thread's model, with or without forces at the tips.

        Each has memory of its own: without loads, nothing writes where loads have left their torques.
        """
        if (loaded, thread) not in self._known:
            parameters = copied(self.parameters)._replace(has_tip_force=loaded)
            control = held_control(self._channels, len(self.structure.prescribed))
            bound = BoundModel(self.structure, parameters, self._laws, control, self._moved, linearised=False)
            self._known[loaded, thread] = bound
        return self._known[loaded, thread]

    def rebind(self, parameters: Parameters) -> bool:
        """Take other parameters of the same structure; return False if they do not fit, and these are of no use."""
        self.parameters = parameters
        return all(bound.rebind(parameters._replace(has_tip_force=key[0])) for key, bound in self._known.items())


def fill(
    models: Models,
    buffer: SignalBuffer,
    states: Array,
    attitudes: Array,
    commands: Array,
    forces: Array,
    base: Array | None,
) -> None:
    """Fill a buffer with the signals of states of the core.

    Args:
        models: Of the mechanism.
        buffer: What is filled.
        states: Shape (m, size), of the core.
        attitudes: Of free bodies, shape (m, f, 4).
        commands: Inputs, shape (m, u).
        forces: At the tips, shape (m, t, 3), N.
        base: Motion of the base, as for `Mechanism.evaluate`, shape (m, 12 or more); None at rest.
    """
    bases = path_motions(base, len(states), int(models.structure.prescribed.max(initial=-1)) + 1)
    loaded, count = bool(np.any(forces)), len(states)

    def fill_part(model: BoundModel, part: slice) -> None:
        batch = buffer.states(part, model.address, states, commands, forces, bases, attitudes)
        call(evaluate_many, batch, STATES)

    if count < MIN_STATES_PER_THREAD or threads() < 2:
        fill_part(models.model(loaded), slice(None))
    else:
        half = count // 2
        pair = (models.model(loaded), models.model(loaded, 1))
        in_threads(lambda share: fill_part(*share), list(zip(pair, (slice(half), slice(half, None)), strict=True)))


def path_motions(base: Array | None, count: int, prescribed: int) -> Array:
    """Return the motions of the base and of the prescribed coordinates, shape (count, 15 + g), or no rows at rest."""
    if base is None:
        return np.zeros((0, 15 + prescribed))
    motions = np.concatenate(
        [base[..., :15], base[..., PRESCRIBED_ACCELERATIONS : PRESCRIBED_ACCELERATIONS + prescribed]], axis=-1
    )
    return as_core_array(motions, (count, 15 + prescribed))


def as_core_array(values: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Return a writable, contiguous copy of floats, the one array type that the core is compiled for."""
    return np.array(np.broadcast_to(values, shape), dtype=float, order="C")
