"""Recording of a motion's variables, as plain arrays or as a Dataset."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cache
from importlib import metadata
from typing import Any

import numpy as np
import xarray as xr

from finger_pin.core.stepping.trajectory import Trajectory
from finger_pin.core.threads import physical_memory
from finger_pin.description.loading import to_toml
from finger_pin.description.scenario import Scenario
from finger_pin.description.simulation_settings import SimulationSettings
from finger_pin.description.validation import choices
from finger_pin.exceptions import InputError
from finger_pin.mechanism.finger import Finger
from finger_pin.simulation.frames import scene_metadata
from finger_pin.simulation.sampled_trajectory import BASE_FRAME, SampledTrajectory
from finger_pin.simulation.variables import SHORTFALL, coordinates, variables
from finger_pin.typing import Array

_PACKAGES = ("finger-pin", "pin", "numba", "numpy", "scipy", "xarray")

#: Variables by name: dimensions, of which time is the first, values and attributes.
Recorded = dict[str, tuple[tuple[str, ...], Array, dict[str, str]]]


def recorded(motions: SampledTrajectory, names: Sequence[str] | None = None, entry: str = "record") -> Recorded:
    """Return variables of a motion, by default all, from only the signals that they need.

    Args:
        motions: The motion at the times that are recorded.
        names: Of the variables.
        entry: What named them.

    Raises:
        InputError: If the result has no such variable.
    """
    table = variables(motions.loop)
    refuse_unknown(entry, names or (), table)
    if names is None and motions.control.torque_deficit is None:
        del table[SHORTFALL]
    chosen = table if names is None else {name: table[name] for name in names}
    # A motion at the edge of what numbers hold has energies beyond it: that is told apart from this.
    # And a few variables are no reason to keep what they are views of.
    kept = np.asarray if names is None else np.array
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        return {name: (each.dims, kept(each.value(motions)), each.attributes) for name, each in chosen.items()}


def only(result: xr.Dataset, names: Iterable[str]) -> xr.Dataset:
    """Return a result with variables of some names, and all coordinates."""
    kept = {*names}
    return result.drop_vars([name for name in result.data_vars if name not in kept])


def refuse_unknown(entry: str, names: Iterable[str], known: Iterable[str]) -> None:
    """Raise unless a result has all variables of some names."""
    if isinstance(names, str):
        raise InputError(entry, "must be a list of names", names)
    known = list(known)
    for name in names:
        if name not in known:
            raise InputError(entry, f"the result has no such variable; it has {choices(name, known)}", name)


def record(
    scenario: Scenario,
    motions: SampledTrajectory,
    method: str,
    names: Sequence[str] | None = None,
    text: str | None = None,
) -> xr.Dataset:
    """Return a motion as a Dataset.

    Args:
        scenario: The scenario of the run.
        motions: The motion at the times that are recorded.
        method: Its integrator.
        names: Of the variables; by default all.
        text: The scenario's TOML; written anew unless it is given.
    """
    data_variables = recorded(motions, names)
    texts = {"scenario": to_toml(scenario) if text is None else text, **scene_metadata(scenario)}
    attributes = {**attributes_of(scenario, motions.trajectory, method), **texts}
    return xr.Dataset(data_variables, coordinates(scenario, motions.loop, motions.times), attributes)


def attributes_of(scenario: Scenario, trajectory: Trajectory, method: str) -> dict[str, Any]:
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


def custom_of(result: xr.Dataset) -> str:
    """Return the names of a result's custom parts, empty for none; results before 0.6 call them ``own``."""
    return str(result.attrs.get("custom", result.attrs.get("own", "")))


def is_tracking(result: xr.Dataset) -> bool:
    """Return whether joints were to follow a reference; under given tensions only one that moves counts."""
    open_loop = result.attrs.get("controller") == "tensions" and not custom_of(result)
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
        # The sums alone tell in most cases, and BLAS has them soonest.
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
    """Refuse a result that cannot fit into the machine's memory.

    Raises:
        InputError: Naming the sample rate.
    """
    samples = settings.duration * settings.sample_rate
    # Every signal of a result, and what it is computed from: measured, 3.5 kB a sample of fig6 and 19 kB of pinch.
    rows = sum(table.count for table in finger.mechanism.rows)
    needed = samples * 8.0 * (25 * rows + 3 * finger.layout.size)
    present = physical_memory()
    if needed > present:
        allowed = (
            f"{samples:.3g} samples need about {needed / 2**30:.3g} GiB of memory, of which there are "
            f"{present / 2**30:.3g}; must be at most {settings.sample_rate * present / needed:.3g}"
        )
        raise InputError("simulation.sample_rate", allowed, settings.sample_rate)


@dataclass(eq=False)
class RunArrays:
    """Variables of a run as plain arrays.

    Attributes:
        variables: Dimensions, of which time is the first, values and attributes, by name.
        coordinates: Likewise, or the values alone.
        attrs: End, cost and settings of the run.
        slopes: Derivatives of the variables by the values that the run was given, shape (p, ...), if they were asked
            for.
    """

    variables: Recorded
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
