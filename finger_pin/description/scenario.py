"""A scenario: a finger, its controller and reference, what acts on it, and how it is simulated."""

from __future__ import annotations

import math
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from finger_pin.description.controller import ControllerSettings, check_controller
from finger_pin.description.coupling import PassiveCoupling
from finger_pin.description.parameters import FingerDescription
from finger_pin.description.routing import Array, Routing
from finger_pin.description.validation import (
    IN_RADIANS,
    MOST_ANGLE,
    Description,
    Name,
    choice,
    expand,
    problem,
    quantity,
    real,
    vector,
)
from finger_pin.exceptions import InputError

# The textbook path keeps to NumPy and Pinocchio; the others evaluate the compiled model.
METHODS_IN_NUMPY = ("Radau", "BDF", "LSODA")
METHODS = ("Rodas5P", "Rodas4", *METHODS_IN_NUMPY, "CVODE")
MOST_SAMPLES = 5_000_000
LEAST_RTOL, LEAST_ATOL_SCALE = 1e-12, 1e-15


_ANGLE = real(-MOST_ANGLE, MOST_ANGLE, hint=IN_RADIANS)


class JointReference(Description):
    """theta^d = offset + amplitude sin(2 pi frequency t + phase)."""

    offset: Annotated[float, _ANGLE] = quantity(0.0, unit="rad", source="chosen", doc="Mean.")
    amplitude: Annotated[float, _ANGLE] = quantity(0.0, unit="rad", source="chosen", doc="Half the swing.")
    frequency: Annotated[float, real(0.0, 1e4)] = quantity(0.0, unit="Hz", source="chosen", doc="Of the sinusoid.")
    phase: Annotated[float, real(-1e3, 1e3)] = quantity(0.0, unit="rad", source="chosen", doc="At t = 0.")


class ReferenceSettings(Description):
    """References by joint; a joint without one is held at zero, a joint driven by a passive tendon follows (20)."""

    joints: dict[Name, JointReference] = Field({}, description="By joint.")


class EnvironmentSettings(Description):
    """What acts on the finger from outside."""

    fingertip_force: Annotated[tuple[float, float, float], vector(3, -1e6, 1e6)] = quantity(
        (0.0, 0.0, 0.0), unit="N", source="(6)", doc="F, constant, base frame."
    )


class SimulationSettings(Description):
    """How long, how finely sampled and how accurately to integrate."""

    duration: Annotated[float, real(0.0, 1e6, above=True)] = quantity(8.0, unit="s", source="chosen", doc="Length.")
    sample_rate: Annotated[float, real(0.0, 1e7, above=True)] = quantity(
        1000.0, unit="Hz", source="chosen", doc="Of the saved signals."
    )
    method: Annotated[str, choice(*METHODS)] = quantity("Rodas5P", unit="1", source="benchmark", doc="Integrator.")
    rtol: Annotated[float, real(LEAST_RTOL, 0.1)] = quantity(
        1e-6, unit="1", source="energy account", doc="Relative tolerance."
    )
    atol_scale: Annotated[float, real(LEAST_ATOL_SCALE, 0.1)] = quantity(
        1e-6, unit="1", source="energy account", doc="Absolute tolerance over the scale of each kind of state."
    )

    @model_validator(mode="after")
    def _affordable(self) -> Self:
        if self.duration * self.sample_rate > MOST_SAMPLES:
            allowed = f"duration times sample_rate must be at most {MOST_SAMPLES} samples"
            raise problem("sample_rate", allowed, self.sample_rate)
        return self


class Scenario(Description):
    """Everything that determines a simulation."""

    file_keys = ("extends",)

    name: Name = Field(description="Names the folder of results.")
    title: str = Field("", strict=True, max_length=200, description="One line for listings.")
    finger: FingerDescription
    controller: ControllerSettings = ControllerSettings()
    reference: ReferenceSettings = ReferenceSettings()
    environment: EnvironmentSettings = EnvironmentSettings()
    simulation: SimulationSettings = SimulationSettings()

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        finger = self.finger
        check_controller(self.controller, finger)
        routing = Routing.from_description(finger)
        closure = routing.force_closure()
        if not closure.holds:
            raise problem("finger.tendons", f"{closure}; the controller needs force closure")
        try:
            followers = self.coupling(routing).followers
        except InputError as error:
            raise problem(error.entry, error.allowed) from None
        for name in self.reference.joints:
            if name not in finger.joints:
                allowed = f"no such joint; the joints are {', '.join(finger.joints)}"
                raise problem(f"reference.joints.{name}", allowed)
            if routing.joints.index(name) in followers:
                raise problem(f"reference.joints.{name}", "follows from the passive tendon (20); leave it out")
        return self

    def coupling(self, routing: Routing) -> PassiveCoupling:
        """Return what the passive tendons impose on the references (20)."""
        return PassiveCoupling.from_routing(
            routing,
            expand(self.controller.passive_tension, routing.passive),
            expand(self.finger.passive_tendon.stiffness, routing.passive),
        )

    def sample_times(self) -> Array:
        """Return the times of the saved signals, s: multiples of the sampling period, and the end."""
        duration, rate = self.simulation.duration, self.simulation.sample_rate
        times = np.arange(math.floor(duration * rate * (1.0 + 1e-12)) + 1) / rate
        if math.isclose(times[-1], duration, rel_tol=1e-9):
            times[-1] = duration
            return times
        return np.append(times, duration)
