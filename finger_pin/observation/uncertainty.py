"""What an observer does not know of its model: numbers of a scenario, and the standard deviation of each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from finger_pin.description.loading import ParametrisedScenario
from finger_pin.description.scenario import Scenario
from finger_pin.description.tables import match_paths, split
from finger_pin.exceptions import InputError
from finger_pin.mechanism.finger import Finger
from finger_pin.simulation.sensitivity import make_variations
from finger_pin.typing import Array

# Default spreads by the last names of keys: frictions, springs and stiffnesses; radii.
_FRICTIONS = ("coulomb", "stiction", "drag", "viscous", "by_load", "stribeck", "stribeck_by_load", "driving", "driven")
_ELASTIC = ("spring.stiffness", "passive_tendon.stiffness", "tendon_rigidity", "winch.stiffness")
_DEFAULTS = {**dict.fromkeys((*_FRICTIONS, *_ELASTIC), 0.1), **dict.fromkeys(("radius", "spool_radius"), 0.02)}
# Parts of a finger whose numbers of these names are no part of its transmission.
_APART = ("finger.stroke_limiter", "finger.contact", "finger.tree.bodies")
# Half widths of 95 % intervals, in standard deviations.
_HALF_WIDTH = 1.96


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Numbers that are not known exactly, and the finger with each of them changed.

    Attributes:
        keys: Dotted keys of the scenario, shape (p,).
        values: Nominal values, shape (p,).
        deviations: Standard deviations, shape (p,).
        varied: The finger with one number changed, and by how much, for each.
    """

    keys: tuple[str, ...]
    values: Array
    deviations: Array
    varied: list[tuple[Finger, float]]

    @classmethod
    def from_scenario(
        cls, scenario: Scenario, finger: Finger, uncertain: Mapping[str, float] | xr.Dataset | None
    ) -> Uncertainty:
        """Read the numbers that are uncertain.

        Args:
            scenario: The scenario.
            finger: Its finger.
            uncertain: By key the standard deviation as a part of the value, the result of an identification, or None
                for 10 % of frictions, springs and stiffnesses, and 2 % of radii.

        Raises:
            InputError: Naming a key that is none, or has no single number.
        """
        spreads = _spreads(scenario, uncertain)
        keys, values, deviations, varied = [], [], [], []
        for key, spread in spreads.items():
            family = ParametrisedScenario(scenario, (key,))
            value = _number(key, family.values[0])
            deviation = spread if isinstance(uncertain, xr.Dataset) else spread * abs(value)
            try:
                # Where a number is nothing, its deviation tells its size.
                scenarios, changes = make_variations([value], [abs(value) or deviation], family.with_values)
            except InputError:
                if uncertain is not None:
                    raise
                # A number without effect, of a part that the finger lacks.
                continue
            keys.append(key)
            values.append(value)
            deviations.append(deviation)
            varied.append((Finger(scenarios[0].finger), float(changes[0])))
        return cls(tuple(keys), np.array(values), np.array(deviations), varied)


def _spreads(scenario: Scenario, uncertain: Mapping[str, float] | xr.Dataset | None) -> dict[str, float]:
    """Return standard deviations by key: parts of the value, or of an identification in the value's unit."""
    if isinstance(uncertain, xr.Dataset):
        missing = {"parameter", "lower", "upper"} - {*uncertain.variables}
        if missing:
            raise InputError(
                "uncertain", f"has no {', '.join(sorted(missing))}: must be the result of an identification"
            )
        width = (uncertain["upper"] - uncertain["lower"]).values / (2.0 * _HALF_WIDTH)
        names = [str(name) for name in uncertain["parameter"].values]
        if tied := [name for name in names if "&" in name]:
            raise InputError("uncertain", "has a parameter that ties several numbers; give a spread for each", tied[0])
        if open_ends := [name for name, each in zip(names, width, strict=True) if not np.isfinite(each)]:
            raise InputError("uncertain", "has an interval with an open end; give a spread in its place", open_ends[0])
        return dict(zip(names, width.tolist(), strict=True))
    if uncertain is None:
        if scenario.hand is not None:
            raise InputError("uncertain", "must be given for a hand, by keys that begin with hand.fingers.NAME.finger")
        return dict(_defaults("finger", scenario.finger.model_dump(mode="python")))
    spreads = {}
    for key, part in uncertain.items():
        if isinstance(part, bool) or not isinstance(part, int | float) or not 0.0 <= part < np.inf:
            raise InputError(f"uncertain.{key}", "must be a part of the value, at least 0", part)
        name, index = split(key)
        for path in match_paths(name.split("."), scenario):
            suffix = "" if index is None else str([*index]).replace(" ", "")
            spreads[".".join(path) + suffix] = float(part)
    return spreads


def _defaults(key: str, entry: Any) -> Iterator[tuple[str, float]]:
    """Yield default spreads of the numbers below a key, those that are zero left out."""
    if key in _APART:
        return
    if isinstance(entry, Mapping):
        for name, child in entry.items():
            yield from _defaults(f"{key}.{name}", child)
        return
    spread = next((part for name, part in _DEFAULTS.items() if f".{key}".endswith(f".{name}")), None)
    if spread is None:
        return
    if isinstance(entry, list | tuple):
        yield from ((f"{key}[{k}]", spread) for k, value in enumerate(entry) if isinstance(value, float) and value)
    elif isinstance(entry, float) and entry:
        yield key, spread


def _number(key: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"uncertain.{key}", "must be a single number of the scenario", value)
    return float(value)
