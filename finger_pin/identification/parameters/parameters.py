"""Numbers to be found: their bounds, the scale on which they are searched for, and scenarios at their values."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from finger_pin.description.scenario import Scenario
from finger_pin.identification.parameters.keys import (
    acts_on,
    check_duplicates,
    check_shadowing,
    is_scenario_key,
    key_in,
    recording_pattern,
)
from finger_pin.identification.parameters.scenarios import Limits, ScenarioPart, with_parameters
from finger_pin.typing import Array

#: Maps values to a scenario, and to the numbers that belong to a recording, by key.
ScenarioMap = Callable[[Array], tuple[Scenario, dict[str, float]]]
#: Least and greatest values, by key.
Bounds = Mapping[str, tuple[float, float]]


class NuisanceParameter(NamedTuple):
    """Nuisance parameter of one recording, such as its initial angle."""

    key: str
    low: float
    high: float
    start: float


class Recorded(Protocol):
    """Recording, or a window of one, with its scenario and the parameters of it alone."""

    recording: Any
    scenario: Scenario
    nuisance_parameters: Sequence[NuisanceParameter]


class Parameters:
    """Parameters within bounds; positive ones are searched for as logarithms, z, shape (p,).

    Attributes:
        bounds: Of the parameters that were asked for, by dotted key.
        keys: Theirs, and then the keys of nuisance parameters of the recordings.
        low: Least values, shape (p,).
        high: Greatest values, shape (p,).
        logarithmic: Which ones are positive, shape (p,).
        box: Least and greatest z.
        columns: Names of all inputs and outputs, with their recordings.
        start: z from which to search: the scenario's own numbers.
    """

    def __init__(self, bounds: Bounds, recorded: Sequence[Recorded], fixed: Mapping[str, float] | None = None) -> None:
        """Check that every key allows its bounds.

        Args:
            bounds: Of the parameters that are asked for.
            recorded: On what they act.
            fixed: Values that every scenario is given first, by key.

        Raises:
            InputError: If a key or its bounds are wrong, or two keys are of the same entry.
        """
        fixed = fixed or {}
        recordings = [one.recording for one in recorded]
        nuisances = [each for one in recorded for each in one.nuisance_parameters if each.key not in bounds]
        self.bounds = dict(bounds)
        self.keys = (*bounds, *(each.key for each in nuisances))
        ends = [*bounds.values(), *((each.low, each.high) for each in nuisances)]
        self.low, self.high = np.array(ends, dtype=float).reshape(-1, 2).T
        self.logarithmic: NDArray[np.bool_] = self.low > 0.0
        self.box = self.to_search(self.low), self.to_search(self.high)
        columns = (f"{each.name}.{name}" for each in recordings for name in (*each.inputs, *each.outputs))
        self.columns, self._names = tuple(dict.fromkeys(columns)), [each.name for each in recordings]
        check_duplicates(self.keys, dict.fromkeys(self._names))
        self._of_scenario = np.flatnonzero([is_scenario_key(key, self.columns) for key in bounds])
        keys = [self.keys[k] for k in self._of_scenario]
        for each in recordings:
            check_shadowing(each.name, each.settings, [*keys, *fixed])
        self._parts = _scenario_parts(recorded, keys, fixed)
        # One recording stands for all that limit parameters alike.
        first = {name: self._names.index(name) for name in self._names}
        limiting = {
            first[each.name]
            for each in recordings
            if each.settings.values or any(recording_pattern(key) and acts_on(key, each.name) for key in keys)
        }
        parts = [self._parts[k] for k in sorted({0, *limiting})]
        self._limits = Limits(parts, keys, self.low[self._of_scenario], self.high[self._of_scenario])
        known: dict[str, Any] = {each.key: each.start for each in nuisances}
        for part in reversed(parts):
            known |= zip([keys[k] for k in part.indices], part.family.values, strict=True)
        neutral = {"offset": 0.0, "scale": 1.0, "delay": 0.0}
        given = [known.get(key, neutral.get(key.rpartition(".")[2])) for key in self.keys]
        middle = self.values(0.5 * (self.box[0] + self.box[1]))
        start = [float(v) if isinstance(v, int | float) else m for v, m in zip(given, middle, strict=True)]
        self.start: Array = self.feasible(self.to_search(np.clip(start, self.low, self.high)))

    def to_search(self, values: Array) -> Array:
        """Return z at values: logarithms of positive ones."""
        return np.where(self.logarithmic, np.log(np.where(self.logarithmic, values, 1.0)), values)

    def values(self, z: Array) -> Array:
        """Return the values at z."""
        return np.where(self.logarithmic, np.exp(np.where(self.logarithmic, z, 0.0)), z)

    def at_values(self, values: Array) -> Array:
        """Return z at values of the parameters that were asked for, shape (n,), and at the start of all others."""
        n = len(values)
        return np.append(self.to_search(np.append(values, self.values(self.start)[n:]))[:n], self.start[n:])

    def feasible(self, z: Array, free: NDArray[np.bool_] | None = None) -> Array:
        """Return z, shape (p,), or the nearest allowed point, by changing only the free parameters (all by default)."""
        values, indices = self.values(z), self._of_scenario
        allowed = self._limits.nearest_allowed(values[indices], None if free is None else free[indices])
        changed = allowed != values[indices]
        values[indices] = allowed
        return self.to_search(values) if changed.any() else z

    def scenario_maps(self) -> list[ScenarioMap]:
        """Return, for every scenario, the map from values to it and to the nuisance parameters of its recording."""
        others = sorted({*range(len(self.keys))} - {*self._of_scenario.tolist()})

        def scenario_map(part: ScenarioPart, recording: str) -> ScenarioMap:
            keys = [(k, key_in(self.keys[k], recording)) for k in others]
            return lambda values: (
                part.scenario_at(values[self._of_scenario]),
                {key: float(values[k]) for k, key in keys},
            )

        return list(map(scenario_map, self._parts, self._names))


def _scenario_parts(
    recorded: Sequence[Recorded], keys: Sequence[str], fixed: Mapping[str, float]
) -> list[ScenarioPart]:
    """Return the scenarios of every recording; those of one scenario on which the same keys act share them."""
    shared = dict[tuple[int, tuple[str, ...]], ScenarioPart]()
    parts = []
    for one in recorded:
        place = id(one.scenario), tuple(key for key in keys if acts_on(key, one.recording.name))
        if place not in shared:
            scenario = with_parameters(one.scenario, fixed) if fixed else one.scenario
            shared[place] = ScenarioPart.from_keys(scenario, one.recording.name, keys)
        parts.append(shared[place])
    return parts
