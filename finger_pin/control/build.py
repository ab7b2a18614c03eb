"""Construction of a controller from the entries of a scenario."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from finger_pin.analysis import closure_over_range, critical_friction
from finger_pin.control.compensated import CompensatedController, PassiveTensionLoop
from finger_pin.control.distribution import PseudoInverse, TensionDistribution
from finger_pin.control.interface import ControlSignals, LoopController
from finger_pin.control.open_loop import OpenLoopTensions
from finger_pin.control.proportional import FingertipForce, ProportionalController, RoutedController, TorqueLaw
from finger_pin.control.tendon_feedforward import JointCompensation, TendonFeedforward
from finger_pin.description.caching import memoised
from finger_pin.description.loading import ScenarioLike, load_scenario
from finger_pin.description.routing import Routing, routing_parts
from finger_pin.description.scenario import Scenario
from finger_pin.description.signals import AXES, ForceSignal
from finger_pin.description.tables import settings_of_finger
from finger_pin.description.validation import Numbers, expand
from finger_pin.exceptions import InputError
from finger_pin.mechanism.finger import Finger
from finger_pin.references.reference import ReferenceSignals
from finger_pin.references.signal import Signal
from finger_pin.typing import Array


def build_controller(scenario: ScenarioLike, finger: Finger | None = None) -> LoopController:
    """Return the controller that a scenario describes.

    Tensions in open loop, or the paper's, unless an entry asks for more; then a `CompensatedController`, inside a
    `PassiveTensionLoop` if asked. A finger without force closure has no internal tension (22) to raise: its tensions
    are the least of at least f0 that exert tau^d and hold the springs, or come nearest (`LimitedDistribution`). In a
    hand every finger has its own.

    Args:
        scenario: The scenario, its name, or the path of a file.
        finger: Its finger, if it is built already.
    """
    scenario = load_scenario(scenario)
    routing = finger.routing if finger is not None else Routing.from_description(scenario.finger)
    parts = scenario.parts()
    if len(parts) > 1:
        return hand_controller([build_controller(part) for part in parts.values()], routing)
    scenario = next(iter(parts.values()))
    settings, numbers = scenario.controller, scenario.numbers
    if settings.kind == "tensions":
        return OpenLoopTensions.from_scenario(scenario, routing)
    if scenario.finger.through_space:
        return _routed(scenario, finger or Finger(scenario.finger))
    has_closure = routing.force_closure().holds
    if settings.is_paper and has_closure:
        return ProportionalController.from_scenario(scenario, routing)
    finger = finger or Finger(scenario.finger)
    springs = settings.spring_compensation or not has_closure
    controller = CompensatedController(
        routing=finger.routing,
        law=TorqueLaw(
            gain=numbers["gain"],
            damping=numbers["damping"],
            static=_static_torque(finger, settings.gravity_compensation, springs),
        ),
        distribution=_distribution(scenario, finger),
        minimum=numbers["minimum_tension"],
        tendons=_feedforward(scenario, finger),
        joints=_joint_compensation(scenario, finger),
        fingertip=_fingertip(scenario, finger),
    )
    loop = settings.passive_tension_loop
    if loop is None:
        return controller
    return PassiveTensionLoop(controller, numbers["passive_tension"], loop.proportional, loop.integral, loop.limit)


def _routed(scenario: Scenario, finger: Finger) -> RoutedController:
    """Return the controller of a finger whose arms depend on the posture."""
    settings, numbers = scenario.controller, scenario.numbers
    law = TorqueLaw(
        gain=numbers["gain"],
        damping=numbers["damping"],
        static=_static_torque(finger, settings.gravity_compensation, settings.spring_compensation),
    )
    return RoutedController(finger, law, numbers["minimum_tension"], _fingertip(scenario, finger))


def closure_advice(controller: LoopController) -> str:
    """Return the warning about force closure that a controller's fingers lose, in one line; empty if it holds."""
    parts = controller.controllers if isinstance(controller, HandController) else (controller,)
    return "; ".join(filter(None, (_lost_closure(part.finger) for part in parts if isinstance(part, RoutedController))))


def _arm_parts(finger: Finger) -> tuple[object, ...]:
    description = finger.description
    return (finger.constructor_args.rigid_body, *routing_parts(description), *description.joints.values())


# Runs of a study share what the arms depend on.
@memoised(_arm_parts)
def _lost_closure(finger: Finger) -> str:
    closure = closure_over_range(finger)
    return "" if closure.holds else f"{closure}: tendons go slack or turn joints there"


def _distribution(scenario: Scenario, finger: Finger) -> TensionDistribution:
    limits = scenario.controller.distribution
    if limits is None and finger.routing.force_closure().holds:
        return PseudoInverse.from_routing(finger.routing)
    # Importing the solver takes a while: only where there are limits.
    from finger_pin.control.distribution import LimitedDistribution

    maximum = math.inf if limits is None else limits.maximum_tension
    return LimitedDistribution(finger.routing, expand(maximum, len(finger.routing.tendons)))


def _static_torque(finger: Finger, gravity: bool, springs: bool) -> Callable[[Array], Array] | None:
    """Return the static torque added to tau^d: G, the torque of the springs, or both."""
    if not springs or not finger.springs.present:
        return finger.rigid_body.gravity_torque if gravity else None
    if gravity:
        return finger.static_torque
    return lambda position: finger.springs.torque(position, np.zeros_like(position))


def _feedforward(scenario: Scenario, finger: Finger) -> TendonFeedforward | None:
    settings = scenario.controller.tendon_friction_feedforward
    if settings is None:
        return None
    tendons = finger.tendons
    surface = _believed(settings.coulomb, tendons.surface)
    ratio = _believed(settings.stiction_ratio, tendons.stiction_ratio)
    return TendonFeedforward(tendons, surface, ratio, settings.share, settings.reversal_speed)


def _joint_compensation(scenario: Scenario, finger: Finger) -> JointCompensation | None:
    settings = scenario.controller.joint_friction_compensation
    if settings is None:
        return None
    friction = finger.joint_friction
    kinetic = _believed(settings.coulomb, friction.kinetic)
    static = np.maximum(_believed(settings.stiction, friction.static), kinetic)
    largest, critical = settings.share * float(np.max(static)), critical_friction(finger).coefficient
    if largest >= critical:
        raise InputError(
            "controller.joint_friction_compensation",
            f"compensates joint friction up to {largest:.3g} m; from {critical:.3g} m on, the tensions that overcome "
            "it raise it by as much (self-locking): lower share, coulomb or stiction",
        )
    believed = kinetic, static, _believed(settings.viscous, friction.viscous)
    return JointCompensation(friction, *believed, settings.share, settings.reversal_speed)


def _fingertip(scenario: Scenario, finger: Finger) -> FingertipForce | None:
    names = finger.description.tree.tip_names or ("",)
    tips = [settings_of_finger(scenario.controller, name).fingertip_force or {} for name in names]
    if not any(tips):
        return None
    settings = [signals.get(axis, ForceSignal()) for signals in tips for axis in AXES]
    force = Signal.from_settings(settings, scenario.simulation.rtol)
    return FingertipForce(force.starting_at(scenario.simulation.start_time), finger.rigid_body.jacobian)


def _believed(setting: Numbers | None, actual: Array) -> Array:
    return actual if setting is None else expand(setting, len(actual))


def hand_controller(controllers: Sequence[LoopController], routing: Routing) -> LoopController:
    """Return the controller of a hand from those of its fingers, in the order of the routing's.

    Controllers of one kind that has `from_fingers`, such as the paper's, become one of that kind, compiled like them.
    """
    kind, *other_kinds = {type(each) for each in controllers}
    combined = None if other_kinds else kind.from_fingers(controllers, routing)
    return combined or HandController(controllers, routing)


class HandController(LoopController):
    """Controllers of any kind, one for each finger.

    Attributes:
        controllers: In the order of the routing's fingers.
        routing: Of the hand.
    """

    def __init__(self, controllers: Sequence[LoopController], routing: Routing) -> None:
        """Put controllers side by side."""
        self.controllers, self.routing = tuple(controllers), routing
        self.needs_sensors = any(each.needs_sensors for each in controllers)

    def command(
        self, time: Array | float, reference: ReferenceSignals, position: Array, velocity: Array
    ) -> ControlSignals:
        """Return the commands of all for shapes (..., n)."""
        torque, batch_shape = np.zeros_like(position), position.shape[:-1]
        tension, torque_deficit = np.zeros((*batch_shape, len(self.routing.tendons))), np.zeros_like(position)
        limited, inputs = False, list[Array]()
        for controller, (joints, tendons) in zip(self.controllers, self.routing.fingers, strict=True):
            finger_reference = ReferenceSignals(reference.position[..., joints], reference.velocity[..., joints])
            signals = controller.command(time, finger_reference, position[..., joints], velocity[..., joints])
            torque[..., joints], tension[..., tendons] = signals.torque, signals.tension
            if signals.torque_deficit is not None:
                limited = True
                torque_deficit[..., joints] = signals.torque_deficit
            if signals.inputs is not None:
                inputs.append(signals.inputs)
        actuated = np.concatenate(inputs, axis=-1) if inputs else None
        return ControlSignals(torque, tension, torque_deficit if limited else None, actuated)

    def sense(self, readings: Mapping[str, Array], elapsed: float) -> None:
        """Pass on the readings of each finger's sensors, with the time since the last ones, s."""
        for controller, (joints, tendons) in zip(self.controllers, self.routing.fingers, strict=True):
            indices = {"tendon_tension": tendons, "joint_position": joints, "joint_velocity": joints}
            controller.sense({name: readings[name][selection] for name, selection in indices.items()}, elapsed)

    def signals(self) -> tuple[Signal, ...]:
        """Return the signals that any of them follows."""
        return tuple(signal for each in self.controllers for signal in each.signals())

    def stateless(self) -> HandController | None:
        """Return the stateless controllers of all fingers; None if one has a state."""
        controllers = [each.stateless() for each in self.controllers]
        stateless = [each for each in controllers if each is not None]
        return HandController(stateless, self.routing) if len(stateless) == len(controllers) else None
