"""Many simulators together: stepped in threads, and their variables at the present instant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from finger_pin.control.closed_loop import ClosedLoop, LoopSignals
from finger_pin.control.inputs import Inputs
from finger_pin.control.interface import ControlSignals
from finger_pin.core.signals.compiled_finger import CompiledFinger
from finger_pin.core.signals.compiled_fingers import CompiledFingers
from finger_pin.core.stepping.batch_stepper import advance_many
from finger_pin.core.steps.trajectory import Statistics, Trajectory
from finger_pin.description.caching import cached_property
from finger_pin.exceptions import InputError
from finger_pin.mechanism.signals import Quantity
from finger_pin.mechanism.state import Motion, State
from finger_pin.references.reference import ReferenceSignals
from finger_pin.references.signal import Signal
from finger_pin.simulation.recording import check_variables, record
from finger_pin.simulation.sampled_trajectory import SampledTrajectory
from finger_pin.simulation.simulator import Simulator
from finger_pin.simulation.variables import LOOP_VARIABLES, RESIDUAL, variables
from finger_pin.typing import Array

# Of a reference and a controller, which do not act.
_CONTROLLER_VARIABLES = ("joint_reference", "tracking_error", "joint_torque_command", "torque_shortfall")
# What follows from the states, computed on first use.
_SIGNALS = {"reference", "control", "signals", "touching", "motion", "stored", "powers", "account"}


def step_many(
    simulators: Sequence[Simulator],
    tensions: Sequence[Inputs],
    dt: float | Sequence[float],
    fingertip_forces: Sequence[ArrayLike] | None = None,
) -> list[State]:
    """Advance many simulators by a time, side by side in threads; return their states then.

    Each does bit by bit what `Simulator.step` does. There is no Python between the steps.

    Args:
        simulators: The simulators, none of them twice.
        tensions: The inputs of `Simulator.step` for each.
        dt: s, one for all or one for each.
        fingertip_forces: The force of `Simulator.step` for each; none by default.

    Raises:
        InputError: If numbers of them differ, a simulator stands there twice, or an argument is wrong; nothing moved.
        IntegrationError: If the integrator of one cannot go on, whose ``failure`` says why; the others have stepped.
    """
    advance(simulators, tensions, dt, fingertip_forces)
    return [simulator._state_after_step() for simulator in simulators]


def advance(
    simulators: Sequence[Simulator],
    inputs: Sequence[Inputs],
    dt: float | Sequence[float],
    fingertip_forces: Sequence[ArrayLike] | None = None,
) -> None:
    """Advance many simulators as `step_many` does; of those that cannot go on the ``failure`` says why.

    Args:
        simulators: As for `step_many`.
        inputs: As its ``tensions``.
        dt: As for `step_many`, s.
        fingertip_forces: As for `step_many`.

    Raises:
        InputError: If numbers of them differ, a simulator stands there twice, or an argument is wrong; nothing moved.
    """
    count = len(simulators)
    forces: Sequence[ArrayLike | None] = [None] * count if fingertip_forces is None else fingertip_forces
    times = cast("Sequence[float]", dt if hasattr(dt, "__len__") else [dt] * count)
    for name, values in (("tensions", inputs), ("fingertip_forces", forces), ("dt", times)):
        if len(values) != count:
            raise InputError(name, f"must be {count}, one per simulator", len(values))
    if len({id(simulator) for simulator in simulators}) < count:
        raise InputError("simulators", "must differ: one stands there twice; use clone")
    steps = zip(simulators, inputs, times, forces, strict=True)
    checked = [simulator._held.check(command, time, force) for simulator, command, time, force in steps]
    active = [
        (simulator, force, simulator._command(command, time))
        for simulator, (command, force), time in zip(simulators, checked, times, strict=True)
    ]
    while active:
        pieces = [
            simulator._held.apply(simulator._stepper, force, simulator.time, end) for simulator, force, end in active
        ]
        steppers = [simulator._stepper for simulator, _, _ in active]
        # One alone needs no threads.
        statuses = advance_many(steppers, pieces) if len(steppers) > 1 else [steppers[0].advance(pieces[0])]
        for (simulator, _, _), status in zip(active, statuses, strict=True):
            simulator._end_piece(status)
        active = [each for each, end in zip(active, pieces, strict=True) if end < each[2] and not each[0].failure]


def instant_variables(loop: ClosedLoop) -> dict[str, Quantity]:
    """Return the variables of a result that are defined at an instant, by name."""
    return {
        name: each
        for name, each in variables(loop).items()
        # The account is of a whole run.
        if each.energy_term is None and name not in (*_CONTROLLER_VARIABLES, *LOOP_VARIABLES, RESIDUAL)
    }


class Instants(SampledTrajectory):
    """Variables of a result at the present states of simulators, each at its own time.

        instants = Instants(simulators, ["joint_position", "tendon_tension"])
        step_many(simulators, tensions, 0.02)
        print(instants.read()["tendon_tension"])  # N, shape (simulators, tendons)

    Not to be shared between threads.

    Attributes:
        simulators: Of the same rows and states; none to be put in the place of another.
    """

    def __init__(self, simulators: Sequence[Simulator], names: Sequence[str] | None = None) -> None:
        """Bind simulators.

        Args:
            simulators: The simulators; their parameters may change.
            names: Names of the variables that will be read; by default all that are defined at an instant.

        Raises:
            InputError: If there is no such variable.
        """
        self.simulators, first = list(simulators), simulators[0].loop
        palm = first.palm and replace(first.palm, signal=cast(Signal, _PalmSignals(self.simulators)))
        self.loop = replace(first, palm=palm)
        self._find_variables(names)
        self._outputs = "all" if "joint_acceleration" in self._quantities else "no_acceleration"
        self._loops, self.times = [simulator.loop for simulator in simulators], np.zeros(len(simulators))
        fingers = [cast(CompiledFinger, loop.dynamics) for loop in self._loops]
        self._fingers = CompiledFingers(fingers, accelerated=self._outputs == "all")
        self.packed = np.zeros((len(simulators), first.finger.layout.size))
        self.trajectory = Trajectory(self.times[-1:], lambda times: self.packed, Statistics(0, 0, 0, 0, 0.0))

    def _find_variables(self, names: Sequence[str] | None) -> None:
        available = instant_variables(self.loop)
        check_variables("names", names or (), available)
        self._quantities = available if names is None else {name: available[name] for name in names}

    def read(self, names: Sequence[str] | None = None) -> dict[str, Array]:
        """Return variables now by name, shape (simulators, ...); by default all of this object's."""
        self.update()
        return {name: np.array(self.values_of(self._quantities[name])) for name in names or self._quantities}

    def dataset(self) -> xr.Dataset:
        """Return the variables as a Dataset with the simulators along time: of one simulator its present instant."""
        self.update()
        scenario = self.simulators[0].scenario
        return record(scenario, self, scenario.simulation.method, list(self._quantities))

    def update(self) -> None:
        """Read the present states, and forget all signals of earlier ones."""
        for name in _SIGNALS & vars(self).keys():
            delattr(self, name)
        for index, simulator in enumerate(self.simulators):
            self.times[index], self.packed[index] = simulator.time, simulator._stepper.x
            if simulator.loop is not self._loops[index]:
                self._loops[index] = simulator.loop
                self._fingers.replace(index, cast(CompiledFinger, simulator.loop.dynamics))

    @property
    def force(self) -> Array:
        """F, shape (m, 3), of several fingers (m, f, 3), N, base frame."""
        held = zip(self.simulators, self.times, strict=True)
        return np.array([simulator._held.force_at(time) for simulator, time in held])

    @property
    def spool_goals(self) -> Array | None:
        """theta_m^d of the motors in position drive, shape (m, k), rad; None without loops."""
        held = zip([simulator._held.goals for simulator in self.simulators], self.times, strict=True)
        drives = [(goals.compiled, time) for goals, time in held if goals is not None]
        return np.array([each.zero_order_hold(each.goals, time) for each, time in drives]) if drives else None

    def wound_lengths(self, angle: Array) -> Array:
        """Return the lengths that spools at angles (m, k), rad, wind in of their k' cords, shape (m, k'), m."""
        spools = [loop.finger.actuators.spools for loop in self._loops]
        return np.array([angles @ each.T for angles, each in zip(angle, spools, strict=True)])

    @cached_property
    def signals(self) -> LoopSignals:
        """All signals; the base's motion counts for accelerations alone."""
        routing, count = self.loop.finger.routing, len(self.times)
        inputs = np.array([each._held.at(time) for each, time in zip(self.simulators, self.times, strict=True)])
        tension, zeros = np.zeros((count, len(routing.tendons))), np.zeros((count, len(routing.joints)))
        tension[:, : routing.actuated] = inputs[:, : routing.actuated]
        tension[:, self.loop.finger.actuators.voltages] = 0.0
        control = ControlSignals(zeros, tension, inputs=inputs[:, routing.actuated :])
        base = None
        if self._outputs == "all" and (self.loop.palm or self.loop.prescribed_motion):
            base = np.array([loop.base(time) for loop, time in zip(self._loops, self.times, strict=True)])
        finger = self._fingers.evaluate(self.packed, inputs, self.force, base, self._outputs)
        return LoopSignals(ReferenceSignals(zeros, zeros), control, finger)

    @cached_property
    def motion(self) -> Motion:
        """Fingertips, base frame; energies are those of a palm at rest."""
        return self._fingers.motion(self.state.position, self.state.velocity)

    def __getstate__(self) -> dict[str, Any]:
        """Return the state without signals, and without the functions of variables, which cannot be pickled."""
        dropped = {*_SIGNALS, "state", "trajectory", "_quantities"}
        state = {name: value for name, value in vars(self).items() if name not in dropped}
        return state | {"names": [*self._quantities]}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore the state, and find the functions of the variables again."""
        names = state.pop("names")
        vars(self).update(state)
        self._find_variables(names)
        self.trajectory = Trajectory(self.times[-1:], lambda times: self.packed, Statistics(0, 0, 0, 0, 0.0))


class _PalmSignals:
    """Paths of the palms of simulators, each at its own time."""

    def __init__(self, simulators: Sequence[Simulator]) -> None:
        self._simulators = simulators

    def at(self, time: Array) -> tuple[Array, Array]:
        """Return values and rates at times (w,), shape (w, 6) each."""
        palms = zip([simulator.loop.palm for simulator in self._simulators], time, strict=True)
        samples = [palm.signal.at(instant) for palm, instant in palms if palm is not None]
        return np.array([value for value, _ in samples]), np.array([rate for _, rate in samples])
