"""The settings of a run as data: duration, start, integrator, tolerances."""

from __future__ import annotations

import math
from typing import Annotated, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_serializer, field_validator, model_validator

from finger_pin.description.fields import flatten, unflatten
from finger_pin.description.validation import (
    IN_RADIANS,
    MOST_ANGLE,
    Description,
    FullName,
    choice,
    problem,
    quantity,
    real,
)

# The textbook path keeps to NumPy and Pinocchio; the others evaluate the compiled model.
METHODS_IN_NUMPY = ("Radau", "BDF", "LSODA")
METHODS = ("Rodas5P", "Rodas4", *METHODS_IN_NUMPY)
MOST_SAMPLES = 5_000_000
LEAST_RTOL, LEAST_ATOL_SCALE = 1e-12, 1e-15


class InitialSettings(Description):
    """The start of the joints; the rest of the state follows: bristles relaxed, passive tendons taut in between."""

    position: dict[FullName, Annotated[float, real(-MOST_ANGLE, MOST_ANGLE, hint=IN_RADIANS)]] = quantity(
        {}, unit="rad", source="chosen", doc="theta(0) by joint; one left out starts on its reference, or keyframe."
    )
    velocity: dict[FullName, Annotated[float, real(-1e4, 1e4)]] = quantity(
        {}, unit="rad/s", source="chosen", doc="theta'(0) by joint; a joint left out starts at rest."
    )
    keyframe: FullName | None = Field(
        None, description="Of a tree, the posture that it starts from, below position; by default its first, if any."
    )

    _flat = field_validator("position", "velocity", mode="before")(lambda table: flatten(table, numbers=True))
    _nested = field_serializer("position", "velocity", mode="wrap")(unflatten)


class SimulationSettings(Description):
    """Duration, sample rate, integrator and tolerances of a run."""

    duration: Annotated[float, real(0.0, 1e6, above=True)] = quantity(
        8.0, unit="s", source="chosen", doc="Simulated time of the run."
    )
    sample_rate: Annotated[float, real(0.0, 1e7, above=True)] = quantity(
        1000.0, unit="Hz", source="chosen", doc="Of the saved signals."
    )
    method: Annotated[str, choice(*METHODS)] = quantity(
        "Rodas5P", unit="1", source="benchmark", doc="Integrator: a Rosenbrock method compiled here, or one of scipy's."
    )
    rtol: Annotated[float, real(LEAST_RTOL, 0.1)] = quantity(
        1e-6, unit="1", source="energy account", doc="Relative tolerance of the error of a step."
    )
    atol_scale: Annotated[float, real(LEAST_ATOL_SCALE, 0.1)] = quantity(
        1e-6, unit="1", source="energy account", doc="Absolute tolerance over the scale of each kind of state."
    )
    max_step: Annotated[float, real(0.0, 1e3, above=True)] | None = quantity(
        None,
        unit="s",
        source="chosen",
        doc="Methods of scipy: maximum step size, as touches within a step are not seen.",
    )
    start_time: Annotated[float, real(-1e6, 1e6)] = quantity(
        0.0, unit="s", source="chosen", doc="Time of references, tensions and forces at t = 0."
    )
    initial: InitialSettings | None = Field(None, description="Where the joints start: at rest on their references.")

    @model_validator(mode="after")
    def _affordable(self) -> Self:
        if self.duration * self.sample_rate > MOST_SAMPLES:
            allowed = f"duration times sample_rate must be at most {MOST_SAMPLES} samples"
            raise problem("sample_rate", allowed, self.sample_rate)
        return self

    def sample_times(self) -> NDArray[np.float64]:
        """Return the times of the saved signals, s: multiples of the sampling period, and the end."""
        times = np.arange(math.floor(self.duration * self.sample_rate * (1.0 + 1e-12)) + 1) / self.sample_rate
        if math.isclose(times[-1], self.duration, rel_tol=1e-9):
            times[-1] = self.duration
            return times
        return np.append(times, self.duration)
