"""Recordings: tables of numbers as they were written down, in SI, by the names that a result has."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from finger_pin.description.recordings.bench import Column, RecordingSettings
from finger_pin.description.recordings.columns import Table
from finger_pin.description.recordings.csv_files import chosen_rows, read_columns, row_mask
from finger_pin.description.scenario import Scenario
from finger_pin.description.validation import IN_RADIANS, MOST_ANGLE
from finger_pin.exceptions import InputError
from finger_pin.identification.parameters.parameters import NuisanceParameter, ScenarioMap
from finger_pin.typing import Array

# SI units of the common variables; a column of any other is in SI.
_TENSIONS = ("tendon_command", "tendon_tension", "tendon_friction", "spool_tension", "passive_tension_proximal")
_ANGLES = ("joint_position", "joint_reference", "tracking_error", "motor_position", "spool_angle")
_SI_UNITS = {
    **dict.fromkeys((*_TENSIONS, "contact_force", "contact_normal_force", "fingertip_force"), "N"),
    **dict.fromkeys(("fingertip_position", "tendon_winding"), "m"),
    **dict.fromkeys(_ANGLES, "rad"),
    **dict.fromkeys(("joint_velocity", "motor_velocity"), "rad/s"),
    **dict.fromkeys(("joint_torque", "joint_effort", "motor_torque"), "N m"),
    **dict.fromkeys(("motor_voltage", "supply_voltage"), "V"),
    **{"tendon_velocity": "m/s", "motor_current": "A"},
}
#: Greatest excess of a recorded angle over a joint's range, rad.
RANGE_MARGIN = 0.2
# Greatest error of a load cell's zero, part of its greatest reading.
_ZERO_ERROR_SHARE = 0.1
# Tolerance of a jump by one turn that shows a wrapped angle, in turns.
_TURN_TOLERANCE = 0.1


@dataclass(frozen=True, eq=False)
class RecordedSignal:
    """An output of a recording.

    Attributes:
        recording: Name of the recording.
        name: variable.label.
        unit: SI unit.
        measured: Shape (m,), those that are numbers.
        rows: Which rows of the recording they are, shape (m,).
        instant: Time of each, s; of steady readings its number.
        load: Input of the model there; not a number where there are several.
        replicate: The number of the group of equal readings that each is of, shape (m,).
        ordered: Whether its samples follow each other in time, so that neighbours may err alike.
        least_noise: Standard deviation that its noise has at least, in its unit.
        noise_share: Part of a reading by which its noise grows.
        shared_noise: Name of the noise that it shares with others; empty for its own.
    """

    recording: str
    name: str
    unit: str
    measured: Array
    rows: NDArray[np.intp]
    instant: Array
    load: Array
    replicate: NDArray[np.intp]
    ordered: bool
    least_noise: float = 0.0
    noise_share: float = 0.0
    shared_noise: str = ""


@dataclass(frozen=True, eq=False)
class Recording:
    """A recording in SI; m rows.

    Attributes:
        name: Its name.
        settings: As described.
        inputs: By variable.label, shape (m,).
        outputs: By variable.label, shape (m,); not a number where nothing was measured.
        time: Of a motion, shape (m,), s, from zero; zero of steady readings.
        speed: Of steady readings, shape (m,), m/s.
        unitless: Names of inputs and outputs that are read as SI because nothing names their unit.
        held_out: Rows that are held out by a column, shape (m,); empty where none are.
        turns: Of angles, by how much the numbers of the column differ after a turn.
    """

    name: str
    settings: RecordingSettings
    inputs: dict[str, Array]
    outputs: dict[str, Array]
    time: Array
    speed: Array
    unitless: frozenset[str] = frozenset()
    held_out: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=bool))
    turns: Mapping[str, float] = field(default_factory=dict)

    def repeats(self, other: Recording) -> bool:
        """Return whether this is a motion like another one, with equal times, inputs, values and start."""
        a, b = self.settings, other.settings
        if (a.values, a.start, self.inputs.keys()) != (b.values, b.start, other.inputs.keys()):
            return False
        pairs = [(self.time, other.time), *((self.inputs[name], other.inputs[name]) for name in self.inputs)]
        return all(np.array_equal(one, another) for one, another in pairs)


class RecordingModel(ABC):
    """Recording, or a part of one, compared with a scenario.

    Attributes:
        recording: The recording.
        scenario: The scenario with the recording's inputs.
        nuisance_parameters: The parameters of this recording alone.
    """

    recording: Recording
    scenario: Scenario
    nuisance_parameters: Sequence[NuisanceParameter] = ()

    def warnings(self, searched_keys: Collection[str]) -> list[str]:
        """Return warnings about a recording for the parameters to be found."""
        return []

    @abstractmethod
    def check(self, nuisance: Mapping[str, float]) -> None:
        """Raise the error of offsets and scales of inputs with which the recording cannot be computed."""

    @abstractmethod
    def compute(self, scenario: Scenario, nuisance: Mapping[str, float]) -> list[Array]:
        """Return the computed values of every output, shape (m,) each; not a number if a run fails."""

    @abstractmethod
    def slopes(self, scenario_map: ScenarioMap, values: Array, sizes: Array) -> list[Array]:
        """Return the derivatives of the outputs by the values, shape (m, p) each.

        Args:
            scenario_map: Maps values to a scenario and the numbers of this recording.
            values: Values of the parameters, shape (p,).
            sizes: Sizes of changes of the values, shape (p,).
        """

    def ringing(self, scenario: Scenario, nuisance: Mapping[str, float]) -> str:
        """Return a warning about what rings almost undamped and makes the run slow; empty without any."""
        return ""

    def with_tolerances(self, factor: float) -> Self:
        """Return the model with the scenario's tolerances multiplied by a factor; a closed form has no errors."""
        return self


def unit_of(name: str) -> str:
    """Return the SI unit of ``variable.label``; empty for an unknown one."""
    return _SI_UNITS.get(name.partition(".")[0], "")


def check_tension_sign(entry: str, tension: Array) -> None:
    """Refuse recorded tensions that are negative by more than a wrong zero makes them; below 0 N a cord is slack."""
    least, greatest = float(tension.min()), float(tension.max())
    if least < -_ZERO_ERROR_SHARE * max(greatest, 0.0):
        hint = "" if greatest > 0.0 else "; scale = -1 turns the sign of a column"
        allowed = f"is {least:.4g} N in row {int(np.argmin(tension)) + 1}, and a tendon only pulls{hint}"
        raise InputError(entry, allowed)


def read_recording(
    name: str, settings: RecordingSettings, data: Mapping[str, Sequence[float] | Array] | None = None
) -> Recording:
    """Read a recording from its file, or from arrays by the names of columns."""
    entry = f"identify.recordings.{name}"
    if data is None and settings.file is None:
        raise InputError(f"{entry}.file", "is missing: the path of a CSV file")
    path = Path(str(settings.file))
    cells = read_columns(f"{entry}.file {path.name}", path, settings) if data is None else data
    cells = chosen_rows(entry, cells, settings.rows)
    table, held_out = Table(entry, cells), np.zeros(0, dtype=bool)
    if isinstance(settings.held_out, dict):
        held_out = row_mask(f"{entry}.held_out", cells, settings.held_out)
        if held_out.all():
            raise InputError(f"{entry}.held_out", "leaves no row to be fitted; write true", settings.held_out)
    time = table.row_times(settings)
    if settings.time is not None:
        time = time - time[0]
        held_out = table.at_instants(held_out) > 0.0 if len(held_out) else held_out
    speed = np.zeros(table.rows)
    if isinstance(settings.speed, Column):
        speed = table.column("speed", settings.speed, "m/s")
        if np.any(speed == 0.0):
            raise InputError(f"{entry}.speed", "must not be zero: friction has the sign of sliding")
    elif settings.speed is not None:
        speed = np.full(table.rows, settings.speed)
    groups = {"inputs": settings.inputs, "outputs": settings.outputs}
    columns = {(group, key): column for group, each in groups.items() for key, column in each.items()}
    signals = {place: _signal(table, *place, column) for place, column in columns.items()}
    for (group, key), column in columns.items():
        if column.integrate:
            label, turned = key.partition(".")[2], np.cumsum(signals[group, key][:-1] * np.diff(time))
            measured = signals.get(("outputs", f"motor_position.{label}"), np.zeros(1))
            start = float(measured[np.isfinite(measured)][0]) if np.isfinite(measured).any() else 0.0
            signals[group, key] = start + np.append(0.0, turned)
    return Recording(
        name,
        settings,
        {key: values for (group, key), values in signals.items() if group == "inputs"},
        {key: values for (group, key), values in signals.items() if group == "outputs"},
        time,
        speed,
        frozenset(key for (_, key), column in columns.items() if not table.names_unit(column)),
        held_out,
        {
            key: table.turn(f"{group}.{key}", each)
            for (group, key), each in columns.items()
            if unit_of(key) == "rad" and not each.integrate
        },
    )


def wraparound_warning(recording: Recording) -> str:
    """Return a warning about an angle that jumps by a turn between two samples; empty without any."""
    for name, values in {**recording.inputs, **recording.outputs}.items():
        finite_rows = np.flatnonzero(np.isfinite(values))
        turns = np.abs(np.diff(values[finite_rows])) / (2.0 * np.pi)
        jumps = np.flatnonzero(np.abs(turns - 1.0) < _TURN_TOLERANCE)
        if unit_of(name) == "rad" and len(jumps):
            where = f"{recording.name}.{name} jumps by a turn after row {finite_rows[jumps[0]] + 1}"
            return f"{where}: if its numbers come round there, write period = {recording.turns[name]:.6g}"
    return ""


def check_angles(recording: Recording, scenario: Scenario) -> None:
    """Ask about angles of joints without a unit that are beyond the joint's range as radians, and not as degrees."""
    for group, columns in (("inputs", recording.inputs), ("outputs", recording.outputs)):
        for name in recording.unitless.intersection(columns):
            variable, _, joint = name.partition(".")
            if variable not in ("joint_position", "joint_reference") or joint not in scenario.finger.joints:
                continue
            low, high = scenario.finger.joints[joint].range
            beyond = np.maximum(low - columns[name], columns[name] - high)
            if np.nanmax(beyond, initial=0.0) > RANGE_MARGIN and scenario.finger.joints[joint].limited:
                farthest = float(columns[name][np.nanargmax(beyond)])
                allowed = f"is beyond the range of {joint}, {low:.3g} to {high:.3g} rad (is it in degrees?); write"
                hint = 'unit = "deg", or unit = "rad" if it is not'
                raise InputError(f"identify.recordings.{recording.name}.{group}.{name}", f"{allowed} {hint}", farthest)


def _signal(table: Table, group: str, name: str, column: Column) -> Array:
    """Return a column in SI; cells of outputs may be empty, and angles of joints are asked about."""
    unit = f"{unit_of(name)}/s" if column.integrate else unit_of(name)
    values = table.column(f"{group}.{name}", column, unit, missing=group == "outputs")
    if name.startswith("joint_position.") and np.nanmax(np.abs(values), initial=0.0) > MOST_ANGLE:
        allowed = f"angles must be at most {MOST_ANGLE:g}{IN_RADIANS}"
        raise InputError(f"{table.entry}.{group}.{name}", allowed, float(np.nanmax(np.abs(values))))
    return values
