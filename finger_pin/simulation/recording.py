"""Records of a motion: variables of it, as arrays or as a Dataset."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import cache
from importlib import metadata
from typing import TYPE_CHECKING, Any

import numpy as np

from finger_pin.core.stepping.textbook import Trajectory
from finger_pin.description.embedded import embedded
from finger_pin.description.loading import to_toml
from finger_pin.description.routing import Array
from finger_pin.description.scenario import Scenario
from finger_pin.simulation.motions import SampledMotion
from finger_pin.simulation.quantity import BASE_FRAME
from finger_pin.simulation.variables import SHORTFALL, coordinates, variables

if TYPE_CHECKING:
    import xarray as xr

_PACKAGES = ("finger-pin", "pin", "numpy", "scipy", "xarray")

#: Variables by name: dimensions, of which time is the first, values and attributes.
Recorded = dict[str, tuple[tuple[str, ...], Array, dict[str, str]]]


def recorded(motions: SampledMotion, names: Sequence[str] | None = None) -> Recorded:
    """Return variables of a motion, by default all; only what they need is computed.

    Args:
        motions: The motion at the times that are recorded.
        names: Of the variables.
    """
    table = variables(motions.loop)
    if names is None and motions.control.shortfall is None:
        del table[SHORTFALL]
    chosen = table if names is None else {name: table[name] for name in names}
    # A motion at the edge of what numbers hold has energies beyond it: that is told apart from this.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        return {name: (each.dims, np.asarray(each.value(motions)), each.attributes) for name, each in chosen.items()}


def record(
    scenario: Scenario,
    motions: SampledMotion,
    method: str,
    names: Sequence[str] | None = None,
    text: str | None = None,
) -> xr.Dataset:
    """Return a motion as a Dataset.

    Args:
        scenario: What was simulated.
        motions: The motion at the times that are recorded.
        method: Its integrator.
        names: Of the variables; by default all.
        text: The scenario's TOML; written anew unless it is given.
    """
    import xarray as xr

    found = recorded(motions, names)
    texts = {"scenario": to_toml(scenario) if text is None else text, **embedded(scenario)}
    attributes = {**attributes_of(scenario, motions.trajectory, method), **texts}
    return xr.Dataset(found, coordinates(scenario, motions.loop, motions.times), attributes)


def attributes_of(scenario: Scenario, trajectory: Trajectory, method: str) -> dict[str, Any]:
    """Return the attributes of a result about its run: how far it went, by which method, at which cost."""
    statistics = {f"solver_{key}": value for key, value in asdict(trajectory.statistics).items()}
    return {
        "title": scenario.title or scenario.name,
        "frame": BASE_FRAME,
        "method": method,
        "rtol": scenario.simulation.rtol,
        "atol_scale": scenario.simulation.atol_scale,
        "end_time": float(trajectory.breakpoints[-1]),
        **statistics,
        **_versions(),
    }


@cache
def _versions() -> Mapping[str, str]:
    return {f"version_{name.replace('-', '_')}": metadata.version(name) for name in _PACKAGES}
