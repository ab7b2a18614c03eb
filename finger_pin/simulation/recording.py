"""Recording of a motion's variables, as plain arrays or as a Dataset."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cache
from importlib import metadata
from typing import Any

import numpy as np
import xarray as xr

from finger_pin.core.steps.trajectory import Trajectory
from finger_pin.description.loading import to_toml
from finger_pin.description.scenario import Scenario
from finger_pin.description.simulation_settings import SimulationSettings
from finger_pin.description.validation import choices
from finger_pin.exceptions import InputError
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.signals import BASE_FRAME
from finger_pin.simulation.frames import scene_metadata
from finger_pin.simulation.sampled_trajectory import SampledTrajectory
from finger_pin.simulation.variables import SHORTFALL, coordinates, variables
from finger_pin.threads import physical_memory
from finger_pin.typing import Array

_PACKAGES = ("finger-pin", "pin", "numba", "numpy", "scipy", "xarray")

#: Variables by name: dimensions, of which time is the first, values and attributes.
Variables = dict[str, tuple[tuple[str, ...], Array, dict[str, str]]]


def record_arrays(samples: SampledTrajectory, names: Sequence[str] | None = None, entry: str = "record") -> Variables:
    """Return variables of a motion, by default all, from only the signals that they need.

    Args:
        samples: The motion at the times that are recorded.
        names: Of the variables.
        entry: Argument that named them, for messages.
    """
    table = variables(samples.loop)
    check_variables(entry, names or (), table)
    if names is None and samples.control.torque_deficit is None:
        del table[SHORTFALL]
    recorded = table if names is None else {name: table[name] for name in names}
    # Energies of a diverging motion may overflow; the motion itself is checked elsewhere.
    # Copies, so that the arrays that they are views of are freed; `without_far_pairs` copies those of contacts.
    views = {name for name, each in recorded.items() if names is None and "contact" in each.dims}
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        return {
            name: (
                ("time", *each.dims),
                (np.asarray if name in views else np.array)(samples.values_of(each)),
                each.attributes,
            )
            for name, each in recorded.items()
        }


def select(result: xr.Dataset, names: Iterable[str]) -> xr.Dataset:
    """Return a result with variables of some names, and all coordinates."""
    selected = {*names}
    return result.drop_vars([name for name in result.data_vars if name not in selected])


def check_variables(entry: str, names: Iterable[str], allowed_names: Iterable[str]) -> None:
    """Raise unless a result has all variables of some names."""
    if isinstance(names, str):
        raise InputError(entry, "must be a list of names", names)
    allowed_names = list(allowed_names)
    for name in names:
        if name not in allowed_names:
            raise InputError(entry, f"the result has no such variable; it has {choices(name, allowed_names)}", name)


def record(
    scenario: Scenario,
    samples: SampledTrajectory,
    method: str,
    names: Sequence[str] | None = None,
    text: str | None = None,
) -> xr.Dataset:
    """Return a motion as a Dataset.

    Args:
        scenario: The scenario of the run.
        samples: The motion at the times that are recorded.
        method: Its integrator.
        names: Of the variables; by default all.
        text: The scenario's TOML; written anew unless it is given.
    """
    data_variables = record_arrays(samples, names)
    texts = {"scenario": to_toml(scenario) if text is None else text, **scene_metadata(scenario)}
    attributes = {**run_attributes(scenario, samples.trajectory, method), **texts}
    return xr.Dataset(data_variables, coordinates(scenario, samples.loop, samples.times), attributes)


def run_attributes(scenario: Scenario, trajectory: Trajectory, method: str) -> dict[str, Any]:
    """Return the attributes of a result about its run: its end, method and cost."""
    statistics = {f"solver_{key}": value for key, value in asdict(trajectory.statistics).items()}
    return {
        "title": scenario.title or scenario.name,
        "controller": scenario.controller.kind,
        "frame": BASE_FRAME,
        "method": method,
        "rtol": scenario.simulation.rtol,
        "atol_scale": scenario.simulation.atol_scale,
        "end_time": float(trajectory.breakpoints[-1]),
        **statistics,
        **versions(),
    }


def recorded_custom_parts(result: xr.Dataset) -> str:
    """Return the names of a result's custom parts, empty for none; results before 0.6 call them ``own``."""
    return str(result.attrs.get("custom", result.attrs.get("own", "")))


def is_tracking(result: xr.Dataset) -> bool:
    """Return whether joints were to follow a reference; under given tensions only one that moves counts."""
    open_loop = result.attrs.get("controller") == "tensions" and not recorded_custom_parts(result)
    return not open_loop or bool(np.ptp(result["joint_reference"].values, axis=0).any())


@cache
def versions() -> Mapping[str, str]:
    """Return the attributes of a result about the versions of the packages that it depends on."""
    return {f"version_{name.replace('-', '_')}": metadata.version(name) for name in _PACKAGES}


def finite_part(result: xr.Dataset) -> tuple[xr.Dataset, str]:
    """Return the finite part of a result, and the first variable that ceases to be finite, else an empty text."""
    length, excess = result.sizes["time"], ""
    ones = np.ones(length)
    for name in result.data_vars:
        values = result.variables[name].values.reshape(len(ones), -1)
        # The sums suffice in most cases, and BLAS computes them fastest.
        if np.isfinite(ones @ values).all():
            continue
        finite = np.isfinite(values).all(axis=1)
        if not finite.all():
            first = int(np.argmin(finite))
            if first < length:
                length, excess = first, str(name)
    if excess:
        result = result.isel(time=slice(max(length, 1)))
        result.attrs["end_time"] = float(result["time"][-1])
    return result, excess


def check_memory(settings: SimulationSettings, finger: Finger) -> None:
    """Refuse a result that cannot fit into the machine's memory."""
    samples = settings.duration * settings.sample_rate
    # Every signal of a result, and what it is computed from: measured, 3.5 kB a sample of fig6 and 19 kB of pinch.
    rows = sum(table.count for table in finger.mechanism.rows)
    needed = samples * 8.0 * (25 * rows + 3 * finger.layout.size)
    available = physical_memory()
    if needed > available:
        allowed = (
            f"{samples:.3g} samples need about {needed / 2**30:.3g} GiB of memory, of which there are "
            f"{available / 2**30:.3g}; must be at most {settings.sample_rate * available / needed:.3g}"
        )
        raise InputError("simulation.sample_rate", allowed, settings.sample_rate)


@dataclass(eq=False)
class RunArrays:
    """Variables of a run as plain arrays.

    Attributes:
        variables: Dimensions, of which time is the first, values and attributes, by name.
        coordinates: The same, or the values alone.
        attrs: End, cost and settings of the run.
        slopes: Derivatives of the variables by the values that the run was given, shape (p, ...), if they were asked
            for.
    """

    variables: Variables
    coordinates: dict[str, Any]
    attrs: dict[str, Any]
    slopes: dict[str, Array] = field(default_factory=dict)

    @property
    def time(self) -> Array:
        """The sample times, s, shape (m,)."""
        return self["time"]

    def __contains__(self, name: str) -> bool:
        """Return whether there is a variable or coordinate of a name."""
        return name in self.variables or name in self.coordinates

    def __getitem__(self, name: str) -> Array:
        """Return the values of a variable or coordinate."""
        entry = self.variables.get(name) or self.coordinates[name]
        return np.asarray(entry[1] if isinstance(entry, tuple) else entry)

    def units(self, name: str) -> str:
        """Return the unit of a variable."""
        return self.variables[name][2]["units"]

    def dataset(self) -> xr.Dataset:
        """Return the same as a Dataset."""
        return xr.Dataset(self.variables, self.coordinates, self.attrs)
