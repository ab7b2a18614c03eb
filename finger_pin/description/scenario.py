"""A scenario: a finger, its controller and reference, what acts on it, and how it is simulated."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Annotated, Self

import numpy as np
from pydantic import Field, field_validator, model_validator

from finger_pin.description.controller import ControllerSettings, check_controller
from finger_pin.description.coupling import PassiveCoupling
from finger_pin.description.objects import Object
from finger_pin.description.parameters import FingerDescription
from finger_pin.description.routing import Array, Routing
from finger_pin.description.signals import ForceSignal, JointReference
from finger_pin.description.tautness import Tautness
from finger_pin.description.validation import (
    IN_RADIANS,
    MOST_ANGLE,
    Description,
    Name,
    choice,
    expand,
    nearest,
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
AXES = ("x", "y", "z")
LEAST_RTOL, LEAST_ATOL_SCALE = 1e-12, 1e-15


class ReferenceSettings(Description):
    """References by joint; a joint without one is held at zero, a joint driven by a passive tendon follows (20).

    In a file, ``file`` names a CSV file: its columns are ``time`` and joints, and become their samples.
    """

    file_keys = ("file",)

    joints: dict[Name, JointReference] = Field({}, description="By joint.")


class EnvironmentSettings(Description):
    """What acts on the finger from outside.

    In a file, ``fingertip_force_file`` names a CSV file: its columns are ``time`` and some of ``x``, ``y``, ``z``, and
    become samples of ``fingertip_force_signal``.
    """

    file_keys = ("fingertip_force_file",)

    fingertip_force: Annotated[tuple[float, float, float], vector(3, -1e6, 1e6)] = quantity(
        (0.0, 0.0, 0.0), unit="N", source="(6)", doc="F, constant, base frame."
    )
    fingertip_force_signal: dict[Name, ForceSignal] | None = Field(
        None, description="What varies of F, added to the constant, by axis x, y, z of the base frame."
    )

    objects: dict[Name, Object] = Field({}, description="What the finger may touch, by name.")

    @field_validator("fingertip_force_signal")
    @classmethod
    def _axes(cls, value: dict[str, ForceSignal] | None) -> dict[str, ForceSignal] | None:
        for name in value or {}:
            if name not in AXES:
                raise problem(name, f"no such axis; the axes are {', '.join(AXES)}")
        return value


class InitialSettings(Description):
    """Where the joints start; the rest of the state follows: bristles relaxed, passive tendons taut in between."""

    position: dict[Name, Annotated[float, real(-MOST_ANGLE, MOST_ANGLE, hint=IN_RADIANS)]] = quantity(
        {}, unit="rad", source="chosen", doc="theta(0) by joint; a joint left out starts on its reference."
    )
    velocity: dict[Name, Annotated[float, real(-1e4, 1e4)]] = quantity(
        {}, unit="rad/s", source="chosen", doc="theta'(0) by joint; a joint left out starts at rest."
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

    start_time: Annotated[float, real(-1e6, 1e6)] = quantity(
        0.0, unit="s", source="chosen", doc="What the clock of references, tensions and forces shows at t = 0."
    )
    initial: InitialSettings | None = Field(None, description="Where the joints start: at rest on their references.")

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
        # Tensions in open loop are what they are; (22) needs some that can be raised without turning a joint.
        closure = routing.force_closure()
        try:
            followers = self.coupling(routing).followers
        except InputError as error:
            raise problem(error.entry, error.allowed) from None
        routed = any(tendon.along for tendon in finger.tendons.values())
        if self.controller.kind == "proportional" and not closure.holds and not routed:
            self._check_taut(routing, str(closure))
        initial = self.simulation.initial or InitialSettings()
        tables: dict[str, Iterable[str]] = {
            "reference.joints": self.reference.joints,
            "simulation.initial.position": initial.position,
            "simulation.initial.velocity": initial.velocity,
        }
        for table, names in tables.items():
            for name in names:
                if name not in finger.joints:
                    near = nearest(name, finger.joints)
                    hint = f"; did you mean {near}?" if near else ""
                    raise problem(f"{table}.{name}", f"no such joint; the joints are {', '.join(finger.joints)}{hint}")
        for name in self.reference.joints:
            if routing.joints.index(name) in followers:
                raise problem(f"reference.joints.{name}", "follows from the passive tendon (20); leave it out")
        return self

    def _check_taut(self, routing: Routing, missing: str) -> None:
        """Raise unless springs keep the tendons taut that (22) cannot without force closure."""
        if not any(joint.spring for joint in self.finger.joints.values()):
            raise problem("finger.tendons", f"{missing}; the controller needs force closure")
        minimum = expand(self.controller.minimum_tension, len(routing.tendons))
        tautness = Tautness.of(self.finger, routing, self.coupling(routing), minimum)
        if not tautness.holds:
            raise problem("finger.tendons", f"{missing}, and {tautness}")

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
