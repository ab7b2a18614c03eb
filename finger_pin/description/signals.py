"""Signals over time as data: a sinusoid about an offset, and on top of it a step, a ramp, points or samples.

Angles of joints, tensions of tendons and the force at the fingertip are all described in this way.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, field_serializer, field_validator, model_validator

from finger_pin.description.fields import flatten, unflatten
from finger_pin.description.tables import Series, series
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

#: The most points or samples of a signal in a file. Arrays in Python may be longer.
MOST_POINTS = 1_000_000
_LATEST_TIME, _MOST_FORCE = 1e6, 1e6
AXES = ("x", "y", "z")
_ENTRIES_OF_KIND: dict[str, tuple[str, ...]] = {
    "sine": (),
    "step": ("time", "height"),
    "ramp": ("time", "duration", "height"),
    "points": ("times", "values"),
    "cosine": ("times", "values"),
    "samples": ("times", "values"),
    "hold": ("times", "values"),
}
_ANGLE = real(-MOST_ANGLE, MOST_ANGLE, hint=IN_RADIANS)
_FORCE, _FORCES = real(-_MOST_FORCE, _MOST_FORCE), series(-_MOST_FORCE, _MOST_FORCE)
_MOST_TURN, _MOST_WOUND, _MILLIMETRES = 1e6, 1.0, " m (is it in millimetres?)"
_TURN, _WOUND = real(-_MOST_TURN, _MOST_TURN), real(-_MOST_WOUND, _MOST_WOUND, hint=_MILLIMETRES)
_MOST_VOLTAGE = 1e4
_VOLTAGE = real(-_MOST_VOLTAGE, _MOST_VOLTAGE)
Samples = tuple[float, ...] | Series


class SignalSettings(Description):
    """offset + amplitude sin(2 pi frequency t + phase) + the function of ``kind``.

    A step adds ``height`` from ``time`` on; a ramp reaches it after ``duration``. Points are joined by motions of least
    jerk that rest at every point (Flash and Hogan, J. Neuroscience 5(7), 1985), of kind "cosine" by half periods of a
    cosine; samples by monotone cubics (Fritsch and Butland, SIAM J. Scientific Computing 5(2), 1984); of kind "hold" a
    value stays until the next (zero-order hold). None overshoots, and all are constant before and after.
    """

    kind: Annotated[
        Literal["sine", "step", "ramp", "points", "cosine", "samples", "hold"], choice(*_ENTRIES_OF_KIND)
    ] = quantity(
        "sine", unit="1", source="chosen", doc="Function that is added to the sinusoid: none, or one of these."
    )
    frequency: Annotated[float, real(0.0, 1e4)] = quantity(
        0.0, unit="Hz", source="chosen", doc="Frequency of the sinusoid."
    )
    phase: Annotated[float, real(-1e3, 1e3)] = quantity(
        0.0, unit="rad", source="chosen", doc="Phase of the sinusoid at t = 0."
    )
    time: Annotated[float, real(-_LATEST_TIME, _LATEST_TIME)] | None = quantity(
        None, unit="s", source="chosen", doc="Instant of the step, or start of the ramp."
    )
    duration: Annotated[float, real(1e-6, _LATEST_TIME)] | None = quantity(
        None, unit="s", source="chosen", doc="Time that the ramp takes."
    )
    times: Annotated[Samples, series(-_LATEST_TIME, _LATEST_TIME)] | None = quantity(
        None, unit="s", source="chosen", doc="Of the points or samples, increasing."
    )
    offset: float
    amplitude: float
    height: float | None
    values: Samples | None

    @model_validator(mode="after")
    def _complete(self) -> Self:
        needed = _ENTRIES_OF_KIND[self.kind]
        for entry in ("time", "duration", "height", "times", "values"):
            value = getattr(self, entry)
            if value is None and entry in needed:
                raise problem(entry, f'is missing: kind = "{self.kind}" needs {", ".join(needed)}')
            if value is not None and entry not in needed:
                kinds = " or ".join(f'"{kind}"' for kind, entries in _ENTRIES_OF_KIND.items() if entry in entries)
                raise problem(entry, f'is for kind = {kinds}, not "{self.kind}"', value)
        if self.times is not None and self.values is not None:
            if len(self.values) != len(self.times):
                raise problem("values", f"must be {len(self.times)} numbers, one for each of times", self.values)
            if not 2 <= len(self.times) <= MOST_POINTS:
                raise problem("times", f"must be 2 to {MOST_POINTS} numbers, not {len(self.times)}")
            falls = np.flatnonzero(np.diff(np.asarray(self.times)) <= 0.0)
            if len(falls):
                before, after = self.times[falls[0] : falls[0] + 2]
                raise problem(f"times[{falls[0] + 1}]", f"times must increase: it comes after {before:g}", after)
        return self

    def faster(self, factor: float) -> Self:
        """Return the same signal in its time over a factor."""
        update: dict[str, float | Series] = {"frequency": self.frequency * factor}
        for entry in ("time", "duration"):
            if getattr(self, entry) is not None:
                update[entry] = getattr(self, entry) / factor
        if self.times is not None:
            update["times"] = Series(np.asarray(self.times) / factor)
        return self.updated(**update)

    @property
    def greatest(self) -> float:
        """A magnitude that the signal never exceeds."""
        added = np.max(np.abs(self.values or (self.height or 0.0,)))
        return abs(self.offset) + abs(self.amplitude) + float(added)

    @property
    def highest(self) -> float:
        """A value that the signal never exceeds: the greatest of the sinusoid and of the rest together."""
        return self.offset + abs(self.amplitude) + float(np.max(self.values or (0.0, self.height or 0.0)))

    @property
    def lowest(self) -> float:
        """A value that the signal is never below: the least of the sinusoid and of the rest together."""
        return self.offset - abs(self.amplitude) + float(np.min(self.values or (0.0, self.height or 0.0)))


_DOCUMENTS = {
    "offset": "Added to all of it; the mean of a sinusoid.",
    "amplitude": "Amplitude of the sinusoid, half its swing.",
    "height": "Of the step or ramp.",
    "values": "At the points or samples.",
}


def signal_field(entry: str, unit: str, doc: str = "") -> Any:
    """Return the field of a signal that has its unit: offset, amplitude, height or values."""
    default = 0.0 if entry in ("offset", "amplitude") else None
    return quantity(default, unit=unit, source="chosen", doc=doc or _DOCUMENTS[entry])


class JointReference(SignalSettings):
    """theta^d of a joint."""

    offset: Annotated[float, _ANGLE] = signal_field("offset", "rad")
    amplitude: Annotated[float, _ANGLE] = signal_field("amplitude", "rad")
    height: Annotated[float, _ANGLE] | None = signal_field("height", "rad")
    values: Annotated[Samples, series(-MOST_ANGLE, MOST_ANGLE, IN_RADIANS)] | None = signal_field("values", "rad")


class InputSignal(SignalSettings):
    """Input of an actuator of a tree, in the unit that its gain takes."""

    offset: Annotated[float, _FORCE] = signal_field("offset", "1")
    amplitude: Annotated[float, _FORCE] = signal_field("amplitude", "1")
    height: Annotated[float, _FORCE] | None = signal_field("height", "1")
    values: Annotated[Samples, _FORCES] | None = signal_field("values", "1")


class SpoolAngle(SignalSettings):
    """Angle of the spool of a motor in position drive."""

    offset: Annotated[float, _TURN] = signal_field("offset", "rad")
    amplitude: Annotated[float, _TURN] = signal_field("amplitude", "rad")
    height: Annotated[float, _TURN] | None = signal_field("height", "rad")
    values: Annotated[Samples, series(-_MOST_TURN, _MOST_TURN)] | None = signal_field("values", "rad")


class WoundLength(SignalSettings):
    """Length of a tendon that is wound in, from where it is just taut with all joints at zero."""

    offset: Annotated[float, _WOUND] = signal_field("offset", "m")
    amplitude: Annotated[float, _WOUND] = signal_field("amplitude", "m")
    height: Annotated[float, _WOUND] | None = signal_field("height", "m")
    values: Annotated[Samples, series(-_MOST_WOUND, _MOST_WOUND, _MILLIMETRES)] | None = signal_field("values", "m")


class VoltageSignal(SignalSettings):
    """Voltage of a motor in place of its loop; of pulse widths the mean, their part of the supply."""

    offset: Annotated[float, _VOLTAGE] = signal_field("offset", "V")
    amplitude: Annotated[float, _VOLTAGE] = signal_field("amplitude", "V")
    height: Annotated[float, _VOLTAGE] | None = signal_field("height", "V")
    values: Annotated[Samples, series(-_MOST_VOLTAGE, _MOST_VOLTAGE)] | None = signal_field("values", "V")


class ForceSignal(SignalSettings):
    """Tension of a tendon, or a component of a force."""

    offset: Annotated[float, _FORCE] = signal_field("offset", "N")
    amplitude: Annotated[float, _FORCE] = signal_field("amplitude", "N")
    height: Annotated[float, _FORCE] | None = signal_field("height", "N")
    values: Annotated[Samples, _FORCES] | None = signal_field("values", "N")


def check_axes(signals: dict[str, ForceSignal] | None) -> dict[str, ForceSignal] | None:
    """Return signals by axis as they are; raise the error of a name that is no axis."""
    for name in signals or {}:
        if name not in AXES:
            raise problem(name, f"no such axis; the axes are {', '.join(AXES)}")
    return signals


class ReferenceSettings(Description):
    """References by joint; a joint without one is held at zero, a joint driven by a passive tendon follows (20).

    In a hand the tables of a finger's joints stand in one of its own, such as ``joints.index.medial``.

    In a file, ``file`` names a CSV file: its columns are ``time`` and joints, and become their samples.
    """

    file_keys = ("file",)

    joints: dict[FullName, JointReference] = Field({}, description="By joint.")

    _flat = field_validator("joints", mode="before")(flatten)
    _nested = field_serializer("joints", mode="wrap")(unflatten)
