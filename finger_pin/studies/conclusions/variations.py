"""The same scenario with more or less friction, tension or speed."""

from __future__ import annotations

import numpy as np

from finger_pin.analysis import self_locking_margin
from finger_pin.description.routing import Routing
from finger_pin.description.scenario import Scenario
from finger_pin.description.signals import JointReference
from finger_pin.description.validation import Numbers, expand

#: Half a period of the swing in which a finger is led to self-locking, s.
SWING = 2.0


def scaled(value: Numbers, factor: float) -> Numbers:
    """Return one number, or one for each, times a factor."""
    return tuple(factor * each for each in value) if isinstance(value, tuple) else factor * value


def with_joint_friction(scenario: Scenario, factor: float) -> Scenario:
    """Return a scenario with M^d and M^c of the joints times a factor."""
    law = scenario.finger.joint_friction
    update = {"coulomb": scaled(law.coulomb, factor), "stiction": scaled(law.stiction, factor)}
    finger = scenario.finger.model_copy(update={"joint_friction": law.model_copy(update=update)})
    return scenario.model_copy(update={"finger": finger})


def with_tendon_friction(scenario: Scenario, factor: float) -> Scenario:
    """Return a scenario with mu_e of the tendons times a factor."""
    law = scenario.finger.tendon_friction
    update = {"tendon_friction": law.model_copy(update={"coulomb": scaled(law.coulomb, factor)})}
    return scenario.model_copy(update={"finger": scenario.finger.model_copy(update=update)})


def with_minimum_tension(scenario: Scenario, tension: float) -> Scenario:
    """Return a scenario with f0 in N for all tendons."""
    return scenario.model_copy(
        update={"controller": scenario.controller.model_copy(update={"minimum_tension": tension})}
    )


def with_passive_tension(scenario: Scenario, tension: tuple[float, ...]) -> Scenario:
    """Return a scenario whose references (20) let passive tendons carry f5^d, N."""
    update = {"passive_tension": tension}
    return scenario.model_copy(update={"controller": scenario.controller.model_copy(update=update)})


def weightless(scenario: Scenario) -> Scenario:
    """Return a scenario without gravity."""
    finger = scenario.finger.model_copy(update={"gravity": (0.0, 0.0, 0.0)})
    return scenario.model_copy(update={"finger": finger})


def lasting(scenario: Scenario, duration: float, samples: int) -> Scenario:
    """Return a scenario of another duration, s, with about so many samples."""
    update = {"duration": duration, "sample_rate": samples / duration}
    return scenario.model_copy(update={"simulation": scenario.simulation.model_copy(update=update)})


def at_speed(scenario: Scenario, factor: float) -> Scenario:
    """Return a scenario whose reference runs through the same motion in its time over a factor."""
    joints = {name: joint.faster(factor) for name, joint in scenario.reference.joints.items()}
    settings = scenario.simulation
    update = {"duration": settings.duration / factor, "sample_rate": settings.sample_rate * factor}
    return scenario.model_copy(
        update={
            "reference": scenario.reference.model_copy(update={"joints": joints}),
            "simulation": settings.model_copy(update=update),
        }
    )


def swinging_to_lock(scenario: Scenario) -> Scenario:
    """Return a scenario whose joints swing once through their amplitudes, in the directions closest to self-locking."""
    margin = self_locking_margin(scenario)
    routing = Routing.from_description(scenario.finger)
    joints = {
        name: JointReference(
            offset=joint.offset,
            amplitude=-float(margin.directions[routing.joints.index(name)]) * abs(joint.amplitude),
            frequency=0.5 / SWING,
            phase=0.5 * np.pi,
        )
        for name, joint in scenario.reference.joints.items()
    }
    swung = scenario.model_copy(update={"reference": scenario.reference.model_copy(update={"joints": joints})})
    return lasting(swung, SWING, 200)


def internal_passive_tension(scenario: Scenario) -> tuple[float, ...]:
    """Return what (21), (22) plan for the passive tendons where no torque is asked for: lambda f^k, N."""
    routing = Routing.from_description(scenario.finger)
    internal = routing.force_closure().tension
    level = np.max(expand(scenario.controller.minimum_tension, len(internal)) / internal)
    return tuple(float(each) for each in level * internal[routing.actuated :])
