"""A finger under control: reference, controller, fingertip force and finger as one system x' = f(t, x)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from finger_pin.control.interface import Controller, ControlSignals, Dynamics, LoopController
from finger_pin.control.palm import (
    PalmPath,
    PrescribedJoints,
    PrescribedMotion,
    PrescribedPaths,
    start_state,
    with_paths,
)
from finger_pin.control.position_drive import DriveSignals, LoopMemory
from finger_pin.control.user_controllers import Samples, choose_controller, choose_reference
from finger_pin.core.signals.compiled_finger import CompiledFinger
from finger_pin.core.tables.inputs import InputTable, core_signal, held_control
from finger_pin.description.scenario import Scenario
from finger_pin.description.signals import AXES, ForceSignal
from finger_pin.exceptions import InputError
from finger_pin.mechanism.evaluation import Outputs
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.signals import FingerSignals
from finger_pin.mechanism.state import Motion, State, as_floats
from finger_pin.references.reference import LoopReference, Reference, ReferenceSignals
from finger_pin.references.signal import HARMONIC, Signal
from finger_pin.typing import Array

_NO_FORCE = ForceSignal()
# Least step between knots of signals, s, however close they are.
_SHORTEST_STEP = 1e-4


_Inputs = tuple[Array, Array, Array | None]


@dataclass(frozen=True, eq=False)
class LoopSignals:
    """The signals of a loop at one instant or at many: desired motion, commands, and the finger's own."""

    reference: ReferenceSignals
    control: ControlSignals
    finger: FingerSignals


@dataclass(frozen=True, eq=False)
class ClosedLoop:
    """A finger with its controller and reference. `rhs` is a pure function of time and state.

    Attributes:
        finger: The finger.
        controller: Turns reference and motion into tensions.
        reference: The desired motion.
        fingertip_force: F, or its constant part, shape (3,), of several fingers (f, 3), N, base frame.
        dynamics: Evaluator of the finger.
        varying_force: The varying part of F, three signals for each finger, N; None for nothing.
        start: The packed state at the start, shape (size,); None for rest on the reference.
        drives: Loops of motors in position drive; None without any.
        last_samples: Of these loops, from the run that this one goes on from; None for loops that start.
        palm: Path of the palm of a hand; None at rest.
        prescribed_motion: Paths of moved objects and joints, or the motion of all joints; None without any.
    """

    finger: Finger
    controller: LoopController
    reference: LoopReference
    fingertip_force: Array
    dynamics: Dynamics
    varying_force: Signal | None = None
    start: Array | None = None
    drives: DriveSignals | None = None
    last_samples: LoopMemory | None = None
    palm: PalmPath | None = None
    prescribed_motion: PrescribedMotion | None = None

    @classmethod
    def from_scenario(
        cls,
        scenario: Scenario,
        controller: Controller | Samples | None = None,
        reference: Reference | Samples | None = None,
        fingertip_force: Samples | None = None,
        finger: Finger | None = None,
    ) -> ClosedLoop:
        """Build the loop of a scenario, with a custom controller or reference if given.

        Args:
            scenario: The scenario.
            controller: Replaces its controller: an object, or times (m,), s, and tensions (m, a), N.
            reference: Replaces its reference: an object, or times (m,), s, and angles (m, k), rad, one column for each
                of the k joints that no passive tendon drives.
            fingertip_force: Replaces F: times (m,), s, and forces (m, 3), N, base frame; (m, 3 f) of several fingers.
            finger: Replaces the finger that its description makes, such as one with rows of its own.
        """
        start, environments = scenario.simulation.start_time, scenario.environments()
        finger = finger or Finger(scenario.finger, objects=scenario.environment.objects)
        _check_matches(finger, scenario)
        single, forces = len(environments) == 1, np.array([each.fingertip_force for each in environments.values()])
        loop = cls(
            finger=finger,
            controller=choose_controller(controller, scenario, finger),
            reference=choose_reference(reference, scenario, finger.routing),
            fingertip_force=forces[0] if single else forces,
            dynamics=finger,
            palm=PalmPath.from_hand(scenario.hand, start, finger, scenario.simulation.rtol),
            prescribed_motion=PrescribedPaths.from_finger(finger, start, scenario.simulation.rtol),
        )
        signals = [each.fingertip_force_signal or {} for each in environments.values()]
        if fingertip_force is not None:
            columns = AXES if single else [f"{name}.{axis}" for name in environments for axis in AXES]
            force = Signal.from_samples("fingertip_force", fingertip_force, columns, scenario.simulation.rtol)
            loop = replace(
                loop, fingertip_force=np.zeros_like(loop.fingertip_force), varying_force=force.starting_at(start)
            )
        elif any(signals):
            settings = [each.get(axis, _NO_FORCE) for each in signals for axis in AXES]
            force = Signal.from_settings(settings, scenario.simulation.rtol)
            loop = replace(loop, varying_force=force.starting_at(start))
        initial, keyframe = scenario.simulation.initial, scenario.keyframe
        if initial is not None or keyframe is not None:
            angles = (keyframe.position if keyframe else {}) | (initial.position if initial else {})
            speeds = (keyframe.velocity if keyframe else {}) | (initial.velocity if initial else {})
            joints = finger.routing.joints
            position = loop.reference.at(0.0).position
            start_position = [angles.get(name, angle) for name, angle in zip(joints, position, strict=True)]
            velocity = [speeds.get(name, 0.0) for name in joints]
            loop = replace(loop, start=loop.rest_state(np.array(start_position), np.array(velocity)))
        return loop

    def rest_state(self, position: Array, velocity: Array) -> Array:
        """Return the packed state at a posture, with tendons on spools stretched by the tensions commanded there."""
        controller, tension = self.controller.stateless(), None
        if self.finger.actuators.names and controller is not None:
            planned = controller.command(0.0, self.reference.at(0.0), position, velocity)
            tension = planned.tension[: self.finger.routing.actuated]
        x = self.finger.rest_state(position, velocity, tension)
        return start_state(self.finger, x, self.palm, self.prescribed_motion)

    def with_start(self, x: Array, last_samples: LoopMemory | None = None) -> ClosedLoop:
        """Return the same loop that starts at a packed state; a palm on a path has the world where it is then."""
        start = x if self.palm is None else self.palm.place_world(self.finger, x)
        return replace(self, start=start, last_samples=last_samples)

    def with_prescribed_motion(self, motion: Signal) -> ClosedLoop:
        """Return the same loop with its joints held to a motion, n functions of time, rad; bristles start relaxed."""
        finger = self.finger.with_prescribed_joints()
        prescribed = PrescribedJoints(motion, np.array(finger.rigid_body.model.gravity.linear))
        loop = replace(self, finger=finger, dynamics=finger, prescribed_motion=prescribed)
        return replace(loop, start=loop.rest_state(*motion.at(0.0)))

    def compiled(self, reused: CompiledFinger | None = None) -> ClosedLoop:
        """Return the same loop on the compiled core, with one that is not needed any more if that fits."""
        fitting = reused if reused is not None and reused.rebind(self.finger) else CompiledFinger(self.finger)
        return replace(self, dynamics=fitting)

    def initial_state(self) -> Array:
        """Return the packed state at the start, shape (size,)."""
        if self.start is not None:
            return self.start.copy()
        position = self.reference.at(0.0).position
        return self.rest_state(position, np.zeros_like(position))

    def force(self, time: Array | float) -> Array:
        """Return F at one time, shape (3,), or at times of shape (m,), (m, 3) if it varies; N, base frame.

        Of several fingers shapes are (f, 3) and (m, f, 3).
        """
        if self.varying_force is None:
            return self.fingertip_force
        varying = self.varying_force.at(time)[0]
        return np.asarray(self.fingertip_force + varying.reshape(*np.shape(time), *self.fingertip_force.shape))

    def knots(self, tolerance: float) -> Array:
        """Return the times at which a signal bends or jumps by more than a relative tolerance, s, in order."""
        path_signals = [each and each.signal for each in (self.palm, self.prescribed_motion)]
        signals_beside = [each for each in (self.varying_force, *path_signals) if each]
        signals = (*self.reference.signals(), *self.controller.signals(), *signals_beside)
        return np.unique(np.concatenate([np.zeros(0), *(each.step_ends(tolerance) for each in signals)]))

    def longest_step(self, tolerance: float) -> float:
        """Return the longest step, s, in which no signal has more than one knot; infinite without knots."""
        return max(float(np.diff(self.knots(tolerance)).min(initial=np.inf)), _SHORTEST_STEP)

    def evaluate(self, time: Array | float, x: Array, outputs: Outputs = "all") -> LoopSignals:
        """Return the signals at one time and state, or at times (m,) and states (m, size); see `Finger.evaluate`."""
        reference, control, inputs = self._mechanism_inputs(time, x)
        if self.drives is not None:
            control = self.drives.planned(time, reference, control)
        return LoopSignals(reference, control, self.dynamics.evaluate(x, *inputs, outputs))

    def _mechanism_inputs(self, time: Array | float, x: Array) -> tuple[ReferenceSignals, ControlSignals, _Inputs]:
        """Return reference, plan, inputs of the mechanism, F, and the motion of palm or objects.

        Inputs are tensions, voltages of motors in position drive, inputs of a tree.
        """
        state, reference = self.finger.layout.unpack(x), self.reference.at(time)
        control = self.controller.command(time, reference, state.position, state.velocity)
        command = control.tension[..., : self.finger.routing.actuated]
        if self.drives is not None:
            command = command.copy()
            command[..., self.drives.channels] = self.drives.voltages(time)
        if control.inputs is not None:
            command = np.concatenate([command, control.inputs], axis=-1)
        return reference, control, (command, self.force(time), self.base(time))

    def base(self, time: Array | float) -> Array | None:
        """Return the motion of palm and objects at one time, shape (27 + g,), or at times (m,); None at rest."""
        path = self.palm or self.prescribed_motion
        return None if path is None else path.base(time)

    def motion(self, time: Array, state: State) -> Motion:
        """Return fingertips, base frame, and energies in the world at times (m,) and states."""
        base, scene, objects = self.base(time), self.finger.scene, None
        motion = self.dynamics.motion(state.position, state.velocity, base)
        if scene is not None:
            objects = scene.energies(state.object_pose, state.object_velocity, base)
        if self.palm is not None:
            potential_energy = motion.potential_energy + self.palm.gravity_energy(time, self.finger.rigid_body.mass)
            motion = motion._replace(potential_energy=potential_energy)
            if scene is not None and objects is not None:
                objects = objects[0], objects[1] + self.palm.gravity_energy(time, float(np.sum(scene.mass)))
        return motion._replace(objects=objects)

    def powers(self, time: Array, x: Array) -> Array:
        """Return powers of the rows and of the fingertip force, shape (m, powers + 1), W, at times (m,) and states."""
        rows, external = self.dynamics.powers(x, *self._mechanism_inputs(time, x)[2])
        velocity = self.finger.layout.unpack(x).velocity
        fingertip = np.sum(external[:, : velocity.shape[-1]] * velocity, axis=-1)
        return np.concatenate([rows, fingertip[:, None]], axis=1)

    def rhs(self, time: float, x: Array) -> Array:
        """Return x', shape (size,)."""
        return self.evaluate(time, as_floats("x", x, self.finger.layout.size)).finger.rate


def _check_matches(finger: Finger, scenario: Scenario) -> None:
    """Refuse a finger that has other joints, tendons or winches than a scenario's."""
    for kind, names, described in (
        ("joints", finger.routing.joints, scenario.finger.joints),
        ("tendons", finger.routing.tendons, scenario.finger.tendons),
    ):
        if names != tuple(described):
            raise InputError(f"finger.{kind}", f"must be the scenario's: {', '.join(described)}", ", ".join(names))
    for name, has_winch in zip(finger.routing.tendons, finger.routing.winched, strict=False):
        if has_winch != (scenario.finger.tendons[name].winch is not None):
            raise InputError(f"finger.tendons.{name}.winch", "must be that of the scenario's finger")


def compiled_control(loop: ClosedLoop) -> InputTable | None:
    """Return a loop's controller, reference and varying force as arrays, or None if the first two are Python."""
    if len(loop.finger.actuators.positioned) == loop.finger.mechanism.channels:
        # All inputs come from sampled drives: none directly from the controller.
        return sampled_control(loop)
    control = loop.controller.as_control(loop.reference, loop.finger)
    return None if control is None else with_force(control, loop)


def sampled_control(loop: ClosedLoop) -> InputTable:
    """Return inputs that hold the commands of a sampled controller, with the loop's varying force."""
    mechanism = loop.finger.mechanism
    return with_force(held_control(mechanism.channels, mechanism.coordinates), loop)


def with_force(control: InputTable, loop: ClosedLoop) -> InputTable:
    """Return inputs with the path of the palm and the force at the fingertip, its varying and its constant part."""
    control = with_paths(control, loop.palm, loop.prescribed_motion)
    if loop.varying_force is None:
        return control
    force = core_signal(loop.varying_force)
    force.harmonics[:, HARMONIC.offset] += loop.fingertip_force.ravel()
    return control._replace(force=force)
